"""Order conditions as arrays, and interpolation between the ends of a step."""

from __future__ import annotations

from fractions import Fraction
from itertools import islice

import numpy as np
import order_oracle as oracle
import pytest

from integrators import RungeKutta, catalogue, method
from integrators.methods.tableaux.weights import (
    continuous_extension,
    order_of_weights,
    weight_conditions,
)

EXPLICIT = [e for e in catalogue() if e.kind in ("explicit", "embedded pair") and not e.is_family and not e.parameters]


def exact_arrays(tableau: RungeKutta) -> tuple[np.ndarray, np.ndarray]:
    return np.array(tableau.A, dtype=object), np.array(tableau.b, dtype=object)


def with_last_stage(tableau: RungeKutta) -> tuple[np.ndarray, np.ndarray]:
    """The tableau in doubles with one more stage, the derivative at the end of the step."""
    rounded = tableau.to_float()
    A = np.pad(np.vstack([rounded.A, rounded.b]), ((0, 0), (0, 1)))
    return A, np.append(rounded.b, 0.0)


def test_conditions_are_those_of_all_trees():
    # 1/γ of all trees with k nodes; their numbers are OEIS A000081.
    counts = [1, 1, 2, 4, 9, 20, 48, 115, 286]
    for k, (vectors, values) in enumerate(islice(weight_conditions(np.full((1, 1), Fraction(1))), 9), 1):
        assert len(vectors) == len(values) == counts[k - 1]
        assert sorted(values) == sorted(Fraction(1, oracle.density(tree)) for tree in oracle.trees(k))


def test_residuals_are_those_of_the_oracle():
    tableau = method("rk4")
    A, b = exact_arrays(tableau)
    for k, (vectors, values) in enumerate(islice(weight_conditions(A), 6), 1):
        assert sorted(vectors @ b - values) == sorted(
            oracle.residuals(oracle.Tableau((tableau.A, tableau.b)), k).values()
        )


@pytest.mark.parametrize("entry", EXPLICIT, ids=lambda entry: entry.name)
def test_orders_in_doubles_are_those_claimed(entry):
    tableau = method(entry.name)
    rounded = tableau.to_float()
    assert order_of_weights(np.array(rounded.A), np.array(rounded.b)) == entry.order
    if tableau.domain == "QQ":
        assert order_of_weights(*exact_arrays(tableau)) == entry.order


def test_an_exact_order_is_lost_by_any_error():
    A, b = exact_arrays(method("dormand-prince54"))
    b[0] += Fraction(1, 10**30)
    assert order_of_weights(A, b) == 0
    assert order_of_weights(A.astype(float), b.astype(float)) == 5


def test_the_difference_of_weights_has_the_lower_of_their_orders():
    for name in ("fehlberg45", "dormand-prince54", "merson4"):
        tableau = method(name)
        A, b = exact_arrays(tableau)
        embedded = np.array(tableau.embedded[0])
        assert order_of_weights(A, b - embedded, 0) == min(order_of_weights(A, b), order_of_weights(A, embedded))


@pytest.mark.parametrize("entry", EXPLICIT, ids=lambda entry: entry.name)
def test_extensions_have_their_order_and_fit_together(entry):
    A, b = with_last_stage(method(entry.name))
    extension = continuous_extension(A, b, entry.order)
    assert extension.order >= max(entry.order - 1, min(entry.order, 3))
    # A step to any point θ is a method of its own, of that order: θ scales the tableau.
    longer = np.pad(A, ((0, len(extension.nodes)), (0, len(extension.nodes))))
    longer[len(A) :] = extension.rows
    powers = np.arange(1, extension.weights.shape[1] + 1)
    for part in (0.25, 0.6, 1.0, 1.4):
        assert order_of_weights(longer / part, extension.weights @ part**powers / part) >= extension.order
    # The whole is differentiable: its values and derivatives at the ends are those of the steps.
    units = np.eye(len(longer))
    np.testing.assert_allclose(extension.weights @ (powers > 0), np.append(b, 0 * extension.nodes), atol=1e-11)
    np.testing.assert_allclose(extension.weights @ (powers == 1), units[0], atol=1e-11)
    np.testing.assert_allclose(extension.weights @ powers, units[len(b) - 1], atol=1e-10)


def test_few_methods_need_further_stages():
    found = {
        entry.name: len(continuous_extension(*with_last_stage(method(entry.name)), entry.order).nodes)
        for entry in EXPLICIT
        if entry.kind == "embedded pair"
    }
    assert {name: number for name, number in found.items() if number} == {
        "verner65": 1,
        "dormand-prince87": 5,
        "dop853": 4,
    }


def test_at_order_three_it_is_hermite_interpolation():
    weights = continuous_extension(*with_last_stage(method("ssprk33")), 3).weights
    b, zero = np.array([1 / 6, 1 / 6, 2 / 3, 0]), np.zeros(2)
    first, last = np.array([1, *zero, 0]), np.array([0, *zero, 1])
    hermite = np.column_stack([first, 3 * b - 2 * first - last, first + last - 2 * b])
    np.testing.assert_allclose(weights, hermite, atol=1e-12)


def test_an_order_beyond_reach_fails():
    # Negative control: the weights of order 4 of a pair of order 5 do not pass for order 5 between the ends.
    A, b = with_last_stage(method("dormand-prince54"))
    extension = continuous_extension(A, b, 5)
    powers = np.arange(1, 5)
    assert order_of_weights(A / 0.5, extension.weights @ 0.5**powers / 0.5) == 4
