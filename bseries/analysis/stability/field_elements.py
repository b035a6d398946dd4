"""Tableau entries as elements of a field to compute in, and back.

Four kinds of elements, all of them false where zero: `Fraction`; `RealAlgebraic` for roots; `Inexact` for decimals and
floats; SymPy's field elements for formulas with symbols, and for roots of too high a degree. All but the last have
signs.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries.analysis.stability.inexact import SLACK, Inexact, nearest_float
from bseries.analysis.stability.number_fields import RealAlgebraic, to_number_field

if TYPE_CHECKING:
    from integrators.exact.entries import Entry
    from integrators.methods.tableaux.runge_kutta import RungeKutta


def to_elements(values: Sequence[Any], precision: Fraction | float = 0) -> list[Any]:
    """Numbers or formulas as elements of one field; `precision` is the relative error of inexact ones."""
    if precision:
        numbers = [Fraction(value) for value in values]
        return [Inexact(x, nearest_float(abs(x) * Fraction(precision)) * SLACK) if x else x for x in numbers]
    if all(isinstance(value, Fraction) for value in values):
        return list(values)
    symbolic = any(not isinstance(value, Fraction) and value.free_symbols for value in values)
    found = None if symbolic else to_number_field(values)
    return _formulas(values, symbolic=symbolic) if found is None else found


def _formulas(values: Sequence[Any], *, symbolic: bool) -> list[Any]:
    """Formulas as rational functions of their symbols, or as expressions that SymPy simplifies at each step."""
    import sympy

    formulas = [sympy.Rational(v.numerator, v.denominator) if isinstance(v, Fraction) else v for v in values]
    if symbolic:
        domain: Any
        domain, elements = sympy.construct_domain(formulas, field=True)
        # SymPy takes x and sqrt(x), or sqrt(2) and sqrt(3), for independent symbols.
        if domain.is_FractionField and all(x.is_Symbol for x in domain.symbols):
            return list(elements)
    return [sympy.EX(formula) for formula in formulas]


def has_sign(element: Any) -> bool:
    """Whether an element is a number whose sign is decided."""
    return isinstance(element, Fraction | RealAlgebraic | Inexact)


def tells_zero(element: Any) -> bool:
    """Whether an element is zero exactly if it is false: no error, and no roots that SymPy might not see through."""
    return isinstance(element, Fraction) or hasattr(element, "field")


def midpoint(element: Any) -> Any:
    """The number that an inexact one is taken for: zero where it may be; others are themselves."""
    if isinstance(element, Inexact):
        return element.value if element else Fraction(0)
    return element


def upper(element: Any) -> Any:
    """The largest number that an inexact one may be: what must not be negative may be so within its error."""
    return element.upper if isinstance(element, Inexact) else element


def from_element(element: Any, *, floating: bool = False) -> Entry:
    """The number or formula that an element stands for; an inexact one as `Fraction`, or as float if `floating`."""
    if isinstance(element, Fraction | Inexact):
        value: Any = midpoint(element)
        return nearest_float(value) if floating else value
    import sympy

    formula = element.to_sympy() if isinstance(element, RealAlgebraic) else element.as_expr()
    return Fraction(int(formula.p), int(formula.q)) if isinstance(formula, sympy.Rational) else formula


def stage_matrix(method: RungeKutta) -> tuple[list[list[Any]], list[Any], list[Any]]:
    """A matrix, a linear form and a vector with b (I − zA)⁻¹ 1 as in the tableau.

    For a method given by a stage algebra they are those of the polynomial basis 1, x, …: rational.
    """
    algebra = method.algebra
    if algebra is not None:
        ones = [Fraction(k == 0) for k in range(algebra.stages)]
        return [list(row) for row in algebra.A], list(algebra.b), ones
    size = method.stages
    elements = to_elements([v for row in (*method.A, method.b) for v in row], method.precision)
    rows = [elements[k : k + size] for k in range(0, len(elements), size)]
    return rows[:-1], rows[-1], [Fraction(1)] * size


def dot(first: Sequence[Any], second: Sequence[Any]) -> Any:
    """The sum of the products of entries."""
    return sum((a * b for a, b in zip(first, second, strict=True) if a and b), Fraction(0))
