"""What sources claim of methods beyond their order: additive pairs, energies, symmetry, weak stage order."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import bseries as bs

ADDITIVE = {
    "kennedy-carpenter32": 3,
    "kennedy-carpenter43": 4,
    "kennedy-carpenter43-7": 4,
    "kennedy-carpenter54": 5,
    "kennedy-carpenter54-2019": 5,
}


@pytest.mark.parametrize("name", ADDITIVE)
def test_additive_pairs_have_their_orders(name):
    """The pair and both parts; embedded weights one less; the implicit part is stiffly accurate and A-stable."""
    pair = bs.method(name)
    implicit, explicit = pair.partitions
    assert bs.order_of(pair) == bs.order_of(explicit) == bs.order_of(implicit) == ADDITIVE[name]
    for part in pair.partitions:
        assert bs.order_of(bs.RungeKutta(part.A, part.embedded[0], digits=25, warn=False)) == ADDITIVE[name] - 1
    assert implicit.A[-1] == implicit.b
    assert bs.stability.is_a_stable(implicit)
    assert all(abs(x - y) < 1e-24 for x, y in zip(explicit.c, implicit.c, strict=True))


@pytest.mark.parametrize(("name", "order"), [("kennedy-carpenter-esdirk32", 3), ("kennedy-carpenter-esdirk43", 4)])
def test_esdirk_methods_have_stage_order_two(name, order):
    """Stiffly accurate and L-stable, and A c = c²/2, but not A c² = c³/3."""
    method = bs.method(name)
    assert bs.order_of(method) == order
    assert method.A[-1] == method.b
    assert bs.check(method).stability["l_stable"] is True
    A = np.array(method.to_float().A, dtype=float)
    c = A.sum(axis=1)
    np.testing.assert_allclose(A @ c, c**2 / 2, atol=1e-15)
    assert abs(A @ c**2 - c**3 / 3).max() > 1e-3


def test_pseudo_energy_preserving_methods_preserve_energy_beyond_their_order():
    assert [bs.energy_preservation(name, 7).order for name in ("pep425", "pep526", "rk4")] == [5, 6, 4]


@pytest.mark.parametrize("x", ["1/10", "1/5", "-3"])
def test_effectively_symmetric_methods_are_symmetric_to_order_five(x):
    method = bs.method("ees25", x=x)
    assert (bs.order_of(method), bs.symmetry(method, 7).order) == (2, 5)
    if x == "1/10":
        assert method.A[2][:2] == (Fraction(-5, 48), Fraction(15, 16))


@pytest.mark.parametrize("x", ["1", "1/2", "-1/2"])
def test_effectively_symmetric_methods_need_nodes(x):
    with pytest.raises(bs.IntegratorError, match="parameter x of ees25 must not be 1, 1/2 or -1/2, but was "):
        bs.method("ees25", x=x)


def test_weak_stage_order_three():
    """b Aʲ (A cᵏ⁻¹ − cᵏ/k) vanishes for k up to 3 and every j; of crouzeix4 for k = 1 only."""

    def weak_residual(name, k):
        method = bs.method(name).to_float()
        A, b = np.array(method.A, dtype=float), np.array(method.b, dtype=float)
        c = A.sum(axis=1)
        defect = A @ c ** (k - 1) - c**k / k
        return max(abs(b @ np.linalg.matrix_power(A, j) @ defect) for j in range(len(b)))

    assert max(weak_residual("wso-dirk643", k) for k in (1, 2, 3)) < 1e-13
    assert weak_residual("wso-dirk643", 4) > 1e-3
    assert weak_residual("crouzeix4", 2) > 1e-3
