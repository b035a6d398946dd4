"""Splitting methods for second order equations q'' = g(q)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.methods.kinds.splitting import Splitting
from integrators.methods.program.program_method import read_parts

if TYPE_CHECKING:
    from integrators.methods.program.child_bounds import ChildBounds


class NystromSplitting(Splitting):
    """A splitting method that is accurate for q'' = g(q), as a system p' = g(q), q' = M⁻¹ p.

    Its flows are kicks, of the part p, and drifts, of the part q. With the drift D linear and the kick K a function of
    the positions, the bracket [K, [K, [K, D]]] and others vanish: fewer order conditions are left than for a
    `Splitting`, so that methods of the same order have fewer stages, or smaller errors. For other fields, such as that
    of a Hamiltonian T(p) + U(q) where T is not quadratic, the order may be lower.

    Args:
        flows: pairs (part, coefficient), in the order in which they are applied.
        parts: the names of the parts for momenta and positions.
        parameters: the symbols that formulas in text may use.
        name: what messages call the method.
        reference: where the method was published.
        digits: for coefficients published as decimals, how many significant digits are correct.

    Raises:
        IntegratorError: there are not two parts, or the flows are none for a `Splitting`.

    Example:
        >>> method = NystromSplitting([("q", "1/2"), ("p", 1), ("q", "1/2")])
        >>> print(method)
        k1 = z(1) - z(0), z' = 1/2 h f_q(z), z(0) = y
        k2 = z(1) - z(0), z' = h f_p(z), z(0) = y + k1
        k3 = z(1) - z(0), z' = 1/2 h f_q(z), z(0) = y + k1 + k2
        y1 = y + k1 + k2 + k3
        >>> method.max_children
        ((0, None), (1, 0))

    References:
        R. I. McLachlan, G. R. W. Quispel, Acta Numerica 11 (2002) 341–434, doi:10.1017/S0962492902000053; S. Blanes,
        P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7.
    """

    def __init__(
        self,
        flows: Iterable[tuple[str, Any]],
        *,
        parts: Sequence[str] = ("p", "q"),
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
    ) -> None:
        names = read_parts(parts, count=2)
        super().__init__(flows, parts=names, parameters=parameters, name=name, reference=reference, digits=digits)

    @cached_property
    def max_children(self) -> ChildBounds:
        """How often each part can be differentiated along p and along q: g depends on q, and q' is linear in p."""
        return (0, None), (1, 0)
