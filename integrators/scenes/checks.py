"""Checks of scenes: the domain of definition of the field, and declared first integrals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from random import Random
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import substituted
from integrators.exact.functions import Function, as_function
from integrators.scenes.model.blocks import ROLES, TIME, component_places
from integrators.scenes.model.formulas import as_float
from integrators.scenes.model.system import LocalTerm, System, output_formula
from integrators.scenes.model.terms import Sites
from integrators.scenes.particles.expansion import at_row, filled, is_local

if TYPE_CHECKING:
    import numpy as np
    import sympy

Number: TypeAlias = Any  # of mpmath, which declares no types

MAX_ROWS = 200_000
"""Above this number of pairs, only neighbours are checked, in an order that makes coinciding sites neighbours."""
MAX_SUSPECTS = 100
"""The number of rows of sites checked exactly: those with the smallest guards."""
SMALL = 1e-9
"""Guards above this value in double precision count as positive."""
DIGITS = 40
POINTS = 3
"""The precision and the number of points at which first integrals are checked."""
NOISE = 1e-25
"""The relative size below which cancelled terms count as zero; rounding errors are about 1e-40."""
MAX_TERMS = 50_000
"""Fields with more terms are not checked for first integrals."""


class Guard(NamedTuple):
    """A formula that must be positive (``">"``), not negative (``">="``) or not zero (``"!="``)."""

    formula: sympy.Expr
    relation: str

    def holds(self, value: sympy.Expr) -> bool:
        """Whether a value satisfies the guard; undecidable values pass."""
        if not value.is_number:
            return True
        number = value if value.is_Rational else value.evalf(30)
        if not number.is_real:
            return False
        zero = abs(number) < 1e-25
        return not zero if self.relation == "!=" else bool(number > 0 or (zero and self.relation == ">="))


def guards(formula: sympy.Expr, derivatives: int = 0) -> list[Guard]:
    """The conditions for a formula and its first `derivatives` derivatives to be defined, innermost first."""
    found = (guard for part in _parts(formula) for guard in _guards_of(part, derivatives))
    return list(dict.fromkeys(guard for guard in found if not guard.formula.is_positive))


def _parts(formula: sympy.Basic) -> Iterator[sympy.Basic]:
    """The parts of a formula, inner ones first, without the branches of ``where``, of which one is evaluated."""
    for argument in formula.args[:1] if type(formula).__name__ == "Where" else formula.args:
        yield from _parts(argument)
    yield formula


def _guards_of(part: Any, derivatives: int) -> Iterator[Guard]:
    """The guards of the outermost operation of a formula."""
    import sympy

    inner: Any = part.args[0] if part.args else None
    if part.is_Pow and not part.exp.is_Integer:
        smooth = part.exp.is_Rational and part.exp >= derivatives
        yield Guard(part.base, ">=" if smooth else ">")
    elif part.is_Pow and part.exp < 0:
        yield Guard(part.base, "!=")
    elif isinstance(part, sympy.log):
        yield Guard(inner, ">")
    elif isinstance(part, sympy.tan):
        yield Guard(sympy.cos(inner), "!=")
    elif isinstance(part, sympy.acosh):
        yield Guard(inner - 1, ">" if derivatives else ">=")
    elif isinstance(part, sympy.asin | sympy.acos):
        yield Guard(1 - inner**2, ">" if derivatives else ">=")
    elif isinstance(part, sympy.atanh):
        yield Guard(1 - inner**2, ">")


def check_domain(scene: System) -> None:
    """Refuse parameters or start values outside the domain of the field."""
    flat = [Guard(formula, ">") for formula in scene.positive]
    entries = (entry for row in scene.poisson or () for entry in row)
    for guard in (*flat, *(guard for entry in entries for guard in _guards_with_values(entry, 0, scene))):
        _check_flat(guard, scene)
    for summand in scene.summands:
        for guard in _guards_with_values(summand.formula, int(summand.target is None), scene):
            if summand.sites.kind == "single":
                _check_flat(guard, scene)
            else:
                _check_sites(guard, summand.sites, scene)


def _guards_with_values(formula: sympy.Expr, derivatives: int, scene: System) -> list[Guard]:
    """The guards with numbers for parameters; terms with a factor 0 need no guard unless they divide by zero."""
    import sympy

    values = filled(formula, scene)
    return guards(formula if values.has(sympy.zoo, sympy.nan, sympy.oo) else values, derivatives)


def _check_flat(guard: Guard, scene: System) -> None:
    formula = filled(guard.formula, scene)
    if scene.start is not None:
        symbols = cast("set[sympy.Symbol]", formula.free_symbols)
        values = {symbol: scene.start[scene.places[symbol.name]] for symbol in symbols if symbol.name in scene.places}
        _check_at(guard, formula, values)
    else:
        _check(guard, formula)


def _check_sites(guard: Guard, sites: Sites, scene: System) -> None:
    """Check a guard in double precision at every row of sites, then exactly at rows with values near zero."""
    import numpy as np

    formula = filled(guard.formula, scene)
    symbols = sorted(cast("set[sympy.Symbol]", formula.free_symbols), key=str)
    known = [values for symbol in symbols if (values := _site_values(symbol.name, sites.count, scene)) is not None]
    if len(known) < len(symbols):  # without values, only a repeated site in a row can make a difference vanish
        rows = () if sites.kind == "pairs" else sites.rows()  # pairs, of which there may be very many, have two sites
        for row in {row for row in rows if len(set(row)) < len(row)}:
            _check(guard, at_row(formula, row, scene), row)
        return
    rows = _rows(sites, [values.doubles for values in known if values.varies])
    arguments = [values.doubles[rows[:, values.role]] for values in known]
    with np.errstate(all="ignore"):
        found = np.broadcast_to(as_function(symbols, formula, "numpy")(*arguments), len(rows))
    size = np.abs(found) if guard.relation == "!=" else found
    suspects = np.flatnonzero(~(size > SMALL))
    for row in rows[suspects[np.argsort(size[suspects])][:MAX_SUSPECTS]]:
        exact = {symbol: values.exact[row[values.role]] for symbol, values in zip(symbols, known, strict=True)}
        _check_at(guard, formula, exact, row)


class _SiteValues(NamedTuple):
    """Values of a local symbol at all sites, exact and as doubles; `role` is its position in a row of sites."""

    role: int
    exact: Sequence[sympy.Expr]
    doubles: np.ndarray
    varies: bool = False


def _site_values(name: str, sites: int, scene: System) -> _SiteValues | None:
    """The values of a local symbol; None for a symbolic parameter or a variable without start values."""
    import numpy as np

    if name == TIME and scene.start is not None:
        time = scene.places[TIME]
        return _SiteValues(0, [scene.start[time]] * sites, np.full(sites, scene.y0[time]))
    if not is_local(name, scene):
        return None
    role, parameter = ROLES.index(name[-1]), scene.parameters.get(name[:-2])
    if isinstance(parameter, tuple):
        return _SiteValues(role, parameter, np.array([as_float(value) for value in parameter]))
    places = component_places(name[:-2], scene.blocks)
    if scene.start is None or places is None:
        return None
    return _SiteValues(role, scene.start[places], scene.y0[places], varies=True)


def _rows(sites: Sites, variables: Sequence[np.ndarray]) -> np.ndarray:
    """The rows of sites to check, as an array: all, or only neighbours if there are very many pairs."""
    import numpy as np

    if sites.kind == "pairs" and sites.size > MAX_ROWS:
        order = np.lexsort(variables) if variables else np.arange(sites.count)
        return np.column_stack([order[:-1], order[1:]])
    return np.array(list(sites.rows()), dtype=int).reshape(-1, sites.roles)


def _check_at(
    guard: Guard, formula: sympy.Expr, values: Mapping[sympy.Symbol, sympy.Expr], row: Iterable[int] = ()
) -> None:
    """Refuse values that do not satisfy a guard, unless they make it too large to be computed."""
    with suppress(ArithmeticError):
        _check(guard, substituted(formula, values), row)


def _check(guard: Guard, value: sympy.Expr, row: Iterable[int] = ()) -> None:
    """Refuse a value, perhaps at a row of sites, that does not satisfy a guard."""
    if guard.holds(value):
        return
    sites = ", ".join(str(site + 1) for site in row)
    where = f" for the sites {sites}" if sites else ""
    must = {">": "positive", ">=": "not negative", "!=": "other than zero"}[guard.relation]
    formula, number = shorten(str(guard.formula)), shorten(str(value if value.is_Rational else value.evalf(6)))
    raise IntegratorError(f"parameters and start must make {formula} {must}, but it was {number}{where}")


def can_be_checked(scene: System) -> bool:
    """Whether the field has at most `MAX_TERMS` terms and no symbolic parameter."""
    numbers = not any(value.free_symbols for value in scene.parameter_values.values())
    return numbers and sum(summand.sites.size for summand in scene.summands) <= MAX_TERMS


def defects(scene: System) -> dict[str, float]:
    """The largest |Σ ∂I/∂y_k f_k| / Σ |∂I/∂y_k f_k| near the start, for each I that is not a first integral."""
    import mpmath

    if not can_be_checked(scene):
        raise IntegratorError(
            f"scene must have numbers for parameters and at most {MAX_TERMS} terms to check its invariants, but did not"
        )
    random, found = Random(1), dict[str, float]()
    centre = [1.0] * scene.dimension if scene.start is None else scene.y0.tolist()
    with mpmath.workdps(DIGITS):
        field = precise_field(scene)
        derivatives = {name: _derivative(name, scene) for name in scene.invariants}
        for _ in range(POINTS):
            y = [mpmath.mpf(x) + (1 + abs(x)) * random.uniform(-1, 1) / 8 for x in centre]
            try:
                f = field(y)
                rates = {name: derivative(y, f) for name, derivative in derivatives.items()}
            except (ArithmeticError, ValueError):
                raise IntegratorError(
                    f"field and invariants of {scene.name} must be defined near the start, but were not at one point"
                ) from None
            for name, terms in rates.items():
                size = mpmath.fsum(terms, absolute=True)
                if abs(mpmath.fsum(terms)) > NOISE * size:
                    found[name] = max(found.get(name, 0.0), float(abs(mpmath.fsum(terms)) / size))
    return found


def precise_field(scene: System) -> Callable[[Sequence[Number]], list[Number]]:
    """f(y) as a function of mpmath numbers, in mpmath's precision at the time of the call."""
    import mpmath
    import sympy

    made: list[tuple[LocalTerm, Function, Function]] = []
    for term in scene.numeric_terms:
        symbols = [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))]
        symbols += [sympy.Symbol(f"d{k}") for k in range(len(term.data))]
        values = [output_formula(term, output) for output in term.outputs]
        data = as_function((), [list(data.values) for data in term.data], "mpmath")
        made.append((term, as_function(symbols, values, "mpmath"), data))

    def field(y: Sequence[Number]) -> list[Number]:
        out = [mpmath.mpf(0)] * len(y)
        for term, values, data in made:
            at_sites = data()
            for row in term.sites.rows():
                local = [y[plus.at(row)] - (y[minus.at(row)] if minus else 0) for plus, minus in term.arguments]
                local += [numbers[row[x.role]] for numbers, x in zip(at_sites, term.data, strict=True)]
                for output, value in zip(term.outputs, values(*local), strict=True):
                    out[output.place.at(row)] += value
        return out

    return field


def _derivative(name: str, scene: System) -> Callable[[Sequence[Number], Sequence[Number]], list[Number]]:
    """The terms ∂I/∂y_k f_k of an invariant as a function of y and f(y)."""
    formula = filled(scene.invariants[name], scene)
    symbols = sorted(cast("set[sympy.Symbol]", formula.free_symbols), key=str)
    places = [scene.places[symbol.name] for symbol in symbols]
    partial = [formula.diff(symbol) for symbol in symbols]
    gradient = as_function(symbols, partial, "mpmath")
    return lambda y, f: [g * f[k] for g, k in zip(gradient(*(y[k] for k in places)), places, strict=True)]
