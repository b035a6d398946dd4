"""The report of `check`: order, principal error, structure, and linear stability of a method."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import exact_values, modified_equation, series, table_of
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.analysis.conjugation import CONJUGATE_STRUCTURES, ConjugateVerdict
from bseries.analysis.generalised_order import generalised_orders, is_product_of_two
from bseries.analysis.memory_properties import memory_properties
from bseries.analysis.order import (
    MOST_STRUCTURE_TREES,
    MOST_TREES,
    ErrorCoefficients,
    Verdict,
    affordable_order,
    decide_order,
    error_coefficients,
    order_of,
    structure_order,
    trusted,
)
from bseries.analysis.rounding import RoundedOrder, hidden_order
from bseries.analysis.simplifying_assumptions import Assumptions, simplifying_assumptions
from bseries.analysis.stability import criteria
from bseries.analysis.stability.field_elements import has_exact_zero_test
from bseries.analysis.stability.rational_functions import StabilityFunction
from bseries.analysis.structure import STRUCTURES, block_names
from bseries.exceptions import SeriesError
from bseries_base.errors import as_sentence
from bseries_base.numbers import latex_number, number_text
from bseries_base.table import Column, Table, as_frame, as_html, as_text, latex_text
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.core.errors import IntegratorError
from integrators.exact.entries import EntryRow
from integrators.exact.expressions import format_number, parse_number
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import MethodWithMemory
from integrators.methods.programs.program import Method
from trees.counting import check_order, count_trees
from trees.hopf.forests import Forest

MOST_STAGES = 30
"""Methods with more stages would take many seconds."""

STABILITY: dict[str, Callable[[StabilityFunction], object]] = {
    "stability_function": str,
    "stability_at_infinity": lambda function: function.at_infinity,
    "linear_order": criteria.linear_order,
    "dispersion_order": criteria.dispersion_order,
    "dissipation_order": lambda R: math.inf if (order := criteria.dissipation_order(R)) is None else order,
    "i_stable": criteria.is_i_stable,
    "a_stable": criteria.is_a_stable,
    "l_stable": criteria.is_l_stable,
    "stability_angle": criteria.stability_angle,
    "real_stability_interval": criteria.real_stability_interval,
    "imaginary_stability_interval": criteria.imaginary_stability_interval,
    "linear_ssp_coefficient": criteria.linear_ssp_coefficient,
}
CONTRACTIVITY: dict[str, Callable[[RungeKutta], object]] = {
    "algebraically_stable": criteria.is_algebraically_stable,
    "ssp_coefficient": criteria.ssp_coefficient,
}

SLOW_FORMULAS = ("dispersion_order", "dissipation_order")
"""Facts that take SymPy seconds for formulas with both roots and symbols."""


class Report(NamedTuple):
    """Results of `check`.

    Attributes:
        method: The method.
        order: The order of accuracy.
        tested_to: The largest number of nodes of the order conditions tested.
        error: The principal error; None where there are too many trees.
        embedded_orders: The orders of the embedded weights.
        properties: Properties that the coefficients decide for every order: true or false.
        structure: Properties that hold up to some order, each with its verdict.
        assumptions: The simplifying assumptions B(p), C(q), D(r); None where they are not decided.
        stability: Linear stability and contractivity (see `tableau_properties`); for methods with memory also their
            error constant and parasitic modes (see `memory_properties`).
        rounded: The order of the method if its entries are rounded numbers, where it is larger (see `rounded_order`).
        generalised: The generalised order where a part of the field is small, by the part, if it is larger (see
            `generalised_order`).
    """

    method: Method
    order: int
    tested_to: int
    error: ErrorCoefficients | None
    embedded_orders: tuple[int, ...]
    properties: dict[str, bool]
    structure: dict[str, Verdict | ConjugateVerdict]
    assumptions: Assumptions | None
    stability: dict[str, Any]
    rounded: RoundedOrder | None = None
    generalised: Mapping[str, tuple[int, ...]] = MappingProxyType({})

    @property
    def _names(self) -> tuple[str, ...] | None:
        """The names of the parts where there are several."""
        return self.method.names if len(self.method.names) > 1 else None

    @property
    def row_sums(self) -> tuple[EntryRow, ...]:
        """Row sums of A for each part; in floats where they are roots of high degree."""
        parts = self.method.partitions if isinstance(self.method, RungeKutta | PartitionedRungeKutta) else ()
        return tuple((p.to_float() if p.algebra is not None and p.stages > 3 else p).row_sums for p in parts)

    @property
    def stage_order(self) -> int | None:
        """The largest q for which B(q) and C(q) hold."""
        return None if self.assumptions is None else min(self.assumptions.B, self.assumptions.C)

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON-ready data."""
        method, names = self.method, self._names
        data: dict[str, Any] = {
            "schema": 1,
            "kind": "check",
            "method": method.name,
            "stages": method.stages,
            "order": self.order,
            "tested_to": self.tested_to,
        }
        if isinstance(method, RungeKutta) and method.form is not None:
            data["form"] = {"kind": method.form.kind, "registers": method.form.registers}
        if self.rounded is not None:
            data["rounded_order"] = self.rounded.to_dict()
        if self.generalised:
            data["generalised_orders"] = {part: list(orders) for part, orders in self.generalised.items()}
        if self.embedded_orders:
            data["embedded_orders"] = list(self.embedded_orders)
        verdicts = {
            name: {"order": v.order, "breaks": None if v.breaks is None else v.breaks.text(names)}
            for name, v in self.structure.items()
        }
        data["properties"] = {**self.properties, **verdicts}
        data["structure_tested_to"] = max((v.tested_to for v in self.structure.values()), default=0)
        if self.assumptions is not None:
            data["stage_order"] = self.stage_order
            data["assumptions"] = dict(zip("BCD", self.assumptions, strict=True))
        if self.stability:
            data["stability"] = self.stability
        digits = method.digits
        data["row_sums"] = [[number_text(x, digits) for x in sums] for sums in self.row_sums]
        data["issues"] = list(method.issues)
        if self.error is not None:
            terms = [{"tree": t.text(names), "coefficient": number_text(e, digits)} for t, e in self.error.terms]
            norms = {"norm_squared": number_text(self.error.norm_squared, digits), "norm": self.error.norm}
            largest = None if self.error.largest is None else number_text(self.error.largest, digits)
            data["error"] = {**norms, "largest": largest, "terms": terms}
        return data

    def to_table(self, *, nonzero: bool = False) -> Table:
        """The report as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            nonzero: Leave out error coefficients that are zero.
        """
        digits = self.method.digits

        def text(value: _Value) -> str:
            return value if isinstance(value, str) else ", ".join(number_text(x, digits) for x in value)

        def latex(value: _Value) -> str:
            if isinstance(value, str):
                return f"${value}$" if value.isdecimal() else latex_text(value)
            return ", ".join(f"${latex_number(x, digits)}$" for x in value)

        def data() -> dict[str, Any]:
            found = self.to_dict()
            if nonzero and "error" in found:
                found["error"]["terms"] = [term for term in found["error"]["terms"] if term["coefficient"] != "0"]
            return found

        columns = (
            Column("quantity", get=lambda fact: fact.name, latex=lambda fact: fact.heading or latex_text(fact.name)),
            Column("value", get=lambda fact: text(fact.value), latex=lambda fact: fact.latex or latex(fact.value)),
        )
        facts, notes = list(_facts(self)), list(_notes(self))
        terms = self.error.terms if self.error is not None else ()
        errors = [
            _Fact(f"e({tree.text(self._names)})", [e], None, f"$e({Forest([tree]).to_latex(self._names)})$")
            for tree, e in terms
            if e or not nonzero
        ]
        many = len(errors) > MOST_TERMS
        if many:
            notes.append(f"The {len(errors)} principal error coefficients are listed by --format csv and json.")
        return Table(
            f"Order and properties of {self.method.name}",
            columns,
            facts if many else [*facts, *errors],
            notes,
            data=data,
            section=lambda fact: fact.name.startswith("e("),
            records=Table("", columns, [*facts, *errors]),
        )

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame

    def __repr__(self) -> str:
        return f"<Report of {self.method.name}: order {self.order}>"


def check(method: Method | str, order: int | None = None) -> Report:
    """Order, principal error, structure, and linear stability of a method.

    Args:
        method: A method.
        order: Largest number of nodes to test; by default as many as the order of the method needs, and for structure
            some more. `check` tests structure on at most 1,300 trees (10 nodes without colours, 6 with two); the single
            tests have no such limit.

    Returns:
        A `Report`.

    Raises:
        SeriesError: `method` is no method.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is.

    Example:
        >>> import bseries as bs
        >>> report = bs.check(bs.method("implicit-midpoint"))
        >>> report.order, report.properties["symplectic_tableau"], report.properties["explicit"]
        (2, True, False)
        >>> report.structure["energy_preserving"][:2], report.stability["a_stable"]
        ((2, Tree('[τ,τ]')), True)

    References:
        HLW, theorems V.2.3 (symmetry) and VI.4.3, VI.4.6 (symplecticity); `bseries.analysis.structure` and
        `bseries.analysis.conjugation` name the sources of the other tests.
    """
    method = as_method(method)
    found, tested_to = decide_order(method, order)
    is_tableau = isinstance(method, RungeKutta)
    rows: list[RungeKutta] = []
    if isinstance(method, RungeKutta):
        rows = [RungeKutta(method.A, b, method.c, digits=method.digits, warn=False) for b in method.embedded or ()]
    is_rational = is_tableau and (method.algebra is not None or method.domain == "QQ")
    has_few_trees = sum(count_trees(min(found + 1, 60), len(method.names))) <= MOST_TREES and found < tested_to
    if order is None:
        nodes = structure_order(method, found)
    else:
        nodes = min(check_order(order), affordable_order(len(method.names), MOST_STRUCTURE_TREES))
    return Report(
        method,
        found,
        tested_to,
        error_coefficients(method, found) if has_few_trees else None,
        tuple(map(order_of, rows)),
        {"consistent": found >= 1, **_properties(method)},
        structure_of(method, nodes, found),
        simplifying_assumptions(method, 2 * method.stages + 1) if is_rational else None,
        _linear_stability(method),
        hidden_order(method, found),
        _generalised(method, found),
    )


def _linear_stability(method: Method) -> dict[str, Any]:
    """Linear stability where it is known for the kind of the method."""
    if isinstance(method, MethodWithMemory):
        return memory_properties(method)
    return tableau_properties(method) if isinstance(method, RungeKutta) else {}


def _generalised(method: Method, order: int) -> dict[str, tuple[int, ...]]:
    """The generalised orders of a splitting method that are larger than its order."""
    if not is_product_of_two(method) or method.stages > MOST_STAGES:
        return {}
    found = zip(method.names, generalised_orders(method, order), strict=True)
    return {part: orders for part, orders in found if len(orders) > 1}


def structure_of(method: Method, order: int, accuracy: int) -> dict[str, Verdict | ConjugateVerdict]:
    """Verdicts of all structure tests up to some order; none for methods with auxiliary parts."""
    if auxiliary_colors(check_method(method)):
        return {}
    exact = trusted(method)
    if accuracy >= order and exact.digits is None:
        table = table_of(exact, order, None)
        flow = BSeries(table, exact_values(table), 1, names=exact.names)
    else:
        flow = series(exact, order)
    field = modified_equation(flow)
    found: dict[str, Any] = {}
    for structure in (*STRUCTURES, *CONJUGATE_STRUCTURES):
        try:
            found |= dict.fromkeys(structure.names, structure.test(field if structure.of_field else flow))
        except SeriesError:  # inconsistent methods, or trees of special systems
            continue
    return found


def _properties(method: Method) -> dict[str, bool]:
    """Properties that the coefficients decide for every order."""
    found = {"explicit": method.is_explicit}
    if isinstance(method, RungeKutta):
        found["diagonally_implicit"] = method.is_diagonally_implicit
    if isinstance(method, PartitionedRungeKutta):
        found["explicit_if_separable"] = method.is_explicit_if_separable
    if isinstance(method, RungeKutta | PartitionedRungeKutta):
        found["symmetric_tableau"] = method.is_symmetric
        found["symplectic_tableau"] = method.is_symplectic
    return found


def tableau_properties(method: RungeKutta | str) -> dict[str, Any]:
    """Linear stability and contractivity of a tableau as JSON-ready data.

    Args:
        method: a Runge–Kutta method.

    Returns:
        The keys stability_function, stability_at_infinity, linear_order, dispersion_order, dissipation_order, i_stable,
        a_stable, l_stable, stability_angle, real_stability_interval, imaginary_stability_interval,
        linear_ssp_coefficient, algebraically_stable, ssp_coefficient and undecided. Orders are integers, answers are
        booleans, other numbers are text (``"inf"`` if infinite). Undecided values are None, with the reason in
        ``undecided``.

    Raises:
        IntegratorError: `method` is no `RungeKutta`.

    Example:
        >>> import bseries as bs
        >>> facts = bs.analysis.tableau_properties(bs.method("lobatto-iiic3"))
        >>> facts["l_stable"], facts["algebraically_stable"], facts["linear_order"], facts["ssp_coefficient"]
        (True, True, 4, '0')
        >>> facts["undecided"]
        {'linear_ssp_coefficient': 'the stability function is no polynomial'}
    """
    method = criteria.checked_method(method)
    undecided: dict[str, str] = {}
    if method.stages > MOST_STAGES:
        names = (*STABILITY, *CONTRACTIVITY)
        reason = f"more than {MOST_STAGES} stages would take long: ask for each fact by its own function"
        return dict.fromkeys(names) | {"undecided": dict.fromkeys(names, reason)}
    try:
        function = criteria.stability_function(method)
    except IntegratorError as error:
        found: dict[str, Any] = dict.fromkeys(STABILITY)
        undecided |= dict.fromkeys(STABILITY, str(error))
    else:
        if function.parameters and not all(map(has_exact_zero_test, (*function.p, *function.q))):
            undecided |= dict.fromkeys(SLOW_FORMULAS, "formulas with roots and symbols would take long")
        found = {name: None if name in undecided else _ready(ask(function)) for name, ask in STABILITY.items()}
    found |= {name: _ready(ask(method)) for name, ask in CONTRACTIVITY.items()}
    if method.parameters:
        reason = f"depends on {', '.join(method.parameters)}"
    elif method.precision:
        reason = "the digits of the tableau do not show it"
    else:
        reason = "the tableau has roots of too high a degree"
    for name, value in found.items():
        if value is None:
            no_polynomial = name == "linear_ssp_coefficient" and found["stability_at_infinity"] != "inf"
            undecided.setdefault(name, "the stability function is no polynomial" if no_polynomial else reason)
    return found | {"undecided": undecided}


def _ready(value: object) -> bool | int | str | None:
    """A value for JSON: numbers other than integers as text."""
    return value if value is None or isinstance(value, bool | int | str) else format_number(value)


MOST_TERMS = 50
"""More error coefficients than these are left to JSON and CSV."""
_NAMES = {
    "i_stable": "I-stable",
    "a_stable": "A-stable",
    "l_stable": "L-stable",
    "zero_stable": "zero-stable",
    "stability_angle": "stability angle in degrees",
    "linear_ssp_coefficient": "linear SSP coefficient",
    "ssp_coefficient": "SSP coefficient",
}
"""Names of facts that are no plain words."""
_Value = str | list[Any]
"""Text, or numbers of the method."""


class _Fact(NamedTuple):
    """A row of the table; value and name have LaTeX of their own where it is not that of their text."""

    name: str
    value: _Value
    latex: str | None = None
    heading: str | None = None


def _facts(report: Report) -> Iterator[_Fact]:
    """The rows of the table above the error coefficients."""
    for name, value, *latex in _rows(report):
        yield _Fact(name, value, *latex)


def _rows(report: Report) -> Iterator[tuple[Any, ...]]:
    method = report.method
    yield "order", str(report.order) if report.order < report.tested_to else f"at least {report.order}"
    if report.rounded is not None:
        yield f"order to {report.rounded.digits} digits", str(report.rounded.order)
    for part, orders in report.generalised.items():
        text = f"({', '.join(map(str, orders))})"
        yield f"generalised order for small {part}", text, f"${text}$"
    yield "order conditions tested", f"to {report.tested_to} nodes"
    if report.embedded_orders:
        yield "order of embedded weights", list(report.embedded_orders)
    yield "stages", str(method.stages)
    if isinstance(method, RungeKutta) and method.form is not None:
        yield "form", f"{method.form.kind}, in {method.form.registers} registers"
    for name, holds in report.properties.items():
        as_blocks = name == "symplectic_tableau" and len(method.names) > 1 and block_names(method.names) is None
        yield name.replace("_", " ") + " for momenta and positions" * as_blocks, "yes" if holds else "no"
    for name, verdict in report.structure.items():
        until = f"to all {verdict.tested_to} nodes tested", None
        if verdict.breaks is not None:
            before = f"to {verdict.order} node{'s' * (verdict.order != 1)}, not for "
            tree = Forest([verdict.breaks]).to_latex(report._names)
            until = before + verdict.breaks.text(report._names), f"{before}${tree}$"
        yield name.replace("_", " "), *until
    if report.assumptions is not None:
        yield "stage order", str(report.stage_order)
        named = [f"{x}({k})" for x, k in zip("BCD", report.assumptions, strict=True)]
        yield "simplifying assumptions", ", ".join(named), ", ".join(f"${x}$" for x in named)
    for name, value in report.stability.items():
        if value is not None and name != "undecided":
            answer = {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)
            is_prose = isinstance(value, bool) or name == "parasitic_modes"
            latex = None if is_prose else _formula(report.method, name, answer)
            yield _NAMES.get(name, name.replace("_", " ")), answer, latex
    for sums, name in zip(report.row_sums, method.names, strict=False):  # only tableaux have row sums
        yield f"row sums of {name}" if name else "row sums", list(sums)
    if report.error is not None:
        if report.error.norm is not None:
            yield "principal error norm", [report.error.norm]
            yield "largest error coefficient", [report.error.largest]
        yield "square of the norm", [report.error.norm_squared]


def _formula(method: Any, name: str, text: str) -> str:
    """A fact on stability in LaTeX; decimals stay as they are."""
    if name == "stability_function":
        return f"${criteria.stability_function(method).to_latex()}$"
    if text in ("inf", "-inf"):
        return "$" + text.replace("inf", r"\infty") + "$"
    return f"${latex_number(parse_number(text, names=method.parameters))}$" if "." not in text else f"${text}$"


def _notes(report: Report) -> Iterator[str]:
    """Sentences below the table."""
    if report.error is not None:
        p = report.order
        yield f"e(τ) = (a(τ) - 1/γ(τ))/σ(τ): the error of a step is h^{p + 1} Σ e(τ) F(τ) + O(h^{p + 2})."
    if report.rounded is not None:
        yield (
            f"The residuals up to order {report.rounded.order} are those of entries rounded to {report.rounded.digits} "
            f"digits: with digits = {report.rounded.digits} they count as zero."
        )
    if report.method.digits is not None:
        yield (
            f"The tableau has decimals with {report.method.digits} correct digits: numbers are rounded to as many, "
            "and residuals that these digits cannot tell from zero count as zero."
        )
    elif trusted(report.method).digits is not None:
        yield "Floating point: an order condition counts as satisfied if its residual is within rounding errors."
    names = report.method.names
    if report.structure and len(names) > 1:
        if (pair := block_names(names)) is not None:
            p, q = pair
            yield f"Structure: {p} and {q} are taken as blocks of variables, {p}' = -H_{q} and {q}' = H_{p}."
        else:
            yield f"Structure: {', '.join(names)} are taken as parts of the field, each with the property itself."
    if not report.stability:
        yield "Linear stability is computed for Runge-Kutta tableaux and methods with memory only."
    if report.structure and max(v.tested_to for v in report.structure.values()) <= report.order:
        yield "Up to its order a method has every structure that the exact flow has; more nodes: --order N."
    undecided: dict[str, str] = report.stability.get("undecided", {})
    for reason in dict.fromkeys(undecided.values()):
        facts = ", ".join(_NAMES.get(name, name.replace("_", " ")) for name, why in undecided.items() if why == reason)
        yield as_sentence(f"Not decided: {facts}: {reason}")
    if isinstance(report.method, MethodWithMemory):
        yield "Order, error and structure are those of the underlying one-step method."
    for issue in report.method.issues:
        yield f"Warning: {issue}."
