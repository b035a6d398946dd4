"""Scene: an initial value problem as exact data, with optional effects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING
from unicodedata import name as unicode_name

from bseries_base.errors import shorten
from bseries_base.formulas import formula_text
from bseries_base.table import Column, Document, Table, Tabular, latex_text
from integrators.core.arguments import check_label
from integrators.exact.arithmetic import simplest
from integrators.exact.expressions import decimal_text
from integrators.scenes.checks import check_domain, defects
from integrators.scenes.model import declarations
from integrators.scenes.model.blocks import ROLES
from integrators.scenes.model.declarations import Declaration
from integrators.scenes.model.system import LocalTerm, System
from integrators.scenes.model.terms import Effect, Term, check_active, check_effects, sorted_summands
from integrators.scenes.particles import expansion

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.black_boxes import BlackBox

    Fact = tuple[str, str | Sequence[sympy.Expr]]

UNNAMED = "scene"
GREEK = "GREEK SMALL LETTER "
TIME_NOTE = "the field depends on the time t: made autonomous by the variable t with t' = 1"

MOST_CHARACTERS = 300
"""Longer formulas and lists, those of many particles, are shortened for readers."""
SUMS = {
    "each": "each site",
    "chain": "neighbours in a chain",
    "ring": "neighbours in a ring",
    "pairs": "pairs of sites",
}


class Scene(System, Tabular):
    """An initial value problem y' = f(y), possibly Hamiltonian, with parameters, start values and effects.

    Formulas are text or SymPy expressions and are kept exact; a float denotes the decimal that it prints as. The same
    formulas as text, in a file or in SymPy give equal scenes.

    Args:
        variables: The blocks of the state by name: a number n of sites (variables ``p``, or ``p1`` … ``pn``),
            ``[n, d]`` (n sites in d dimensions, ``px1, py1, px2, …``), or a list of names.
        hamiltonian: The Hamiltonian H. Without `poisson` the blocks p and q are momenta and positions, p' = −H_q,
            q' = H_p, in any order. Other names of such a pair are allowed: one of P, v, omega, a, I, J, L with one of
            Q, x, r, theta, phi.
        field: Maps variables to their derivatives.
        terms: Terms over sites, added to `hamiltonian` and `field`.
        poisson: A skew-symmetric matrix B(y) of formulas: y' = B(y) ∇H(y).
        parameters: Their values: numbers, lists with a number for each site, or the parameter's own name, which leaves
            it a symbol.
        invariants: First integrals by name (the Hamiltonian need not be among them).
        start: Start values by block: a list, or one row for each site.
        effects, active: Effects by name, and the names of those that are on; see `with_effects`.
        positive: Formulas that are positive wherever the field is defined.
        name, reference, summary: The name in messages and files, the source, and one line about the scene.

    Attributes:
        effects: The effects as declared; their current values are in `parameters`.
        active: The names of the effects that are on.

    Raises:
        IntegratorError: A formula is invalid or uses unknown names, an equation is missing, sizes do not match, or the
            start is outside the domain.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", start={"p": [0], "q": ["-3/2"]})
        >>> pendulum.field
        (-sin(q), p)
        >>> damped = bs.Scene({"p": 1, "q": 1}, field={"p": "-sin(q) - c*p", "q": "p"}, parameters={"c": 0.1})
        >>> damped.field, damped.hamiltonian
        ((-p/10 - sin(q), p), None)

    References:
        HLW, sections I.1, I.2 (examples), VI.1 and VII.2 (Hamiltonian and Poisson systems).
    """

    def __init__(
        self, variables: Mapping[str, object], *, hamiltonian: object = None, field: Mapping[str, object] | None = None,
        terms: Iterable[Term] = (), poisson: object = None, parameters: Mapping[str, object] | None = None,
        invariants: Mapping[str, object] | None = None, start: Mapping[str, object] | None = None,
        effects: Mapping[str, Effect] | None = None, positive: Iterable[object] = (), active: Iterable[str] = (),
        name: str | None = None, reference: str | None = None, summary: str | None = None,
    ):  # fmt: skip
        labels = {"name": name, "reference": reference, "summary": summary}
        for argument, label in labels.items():
            check_label(label, argument, lines=argument != "name")
        effects = check_effects(effects or {})
        declaration = declarations.read_declaration(
            variables, hamiltonian, field, terms, poisson, parameters or {}, invariants or {}, start or {}, positive,
            effects,
        )  # fmt: skip
        self._initialize(declaration, check_active(active, effects), effects, labels)

    reference: str | None
    summary: str | None
    effects: Mapping[str, Effect]
    active: tuple[str, ...]
    declaration: Declaration

    def _initialize(
        self, declaration: Declaration, active: tuple[str, ...], effects: Mapping[str, Effect],
        labels: Mapping[str, str | None],
    ) -> None:  # fmt: skip
        """Set all attributes, with these effects on."""
        system = declarations.assemble(declaration, active)
        broken = {name for effect in active for name in declaration.effects[effect].breaks}
        starts = dict(declaration.base.start)
        for effect in active:
            starts |= declaration.effects[effect].start
        self.__dict__.update(
            labels,
            name=labels["name"] or UNNAMED,
            declaration=declaration,
            active=active,
            effects=MappingProxyType(effects),
            blocks=system.blocks,
            parameters=MappingProxyType(system.parameters),
            poisson=declaration.poisson,
            invariants=MappingProxyType({k: v for k, v in declaration.invariants.items() if k not in broken}),
            positive=declaration.positive,
            start=declarations.join_start(starts, system.blocks) if declaration.base.start else None,
            summands=sorted_summands(system.summands, system.blocks),
            base_summands=sorted_summands(declaration.base.summands, declaration.base.blocks),
        )
        self.__dict__["notes"] = *[TIME_NOTE] * system.timed, *map(_box_note, self.black_boxes)
        check_domain(self)

    @property
    def _data(self) -> tuple[object, ...]:
        return self.declaration, self.active

    def __hash__(self) -> int:
        return hash((self.blocks, self.summands, self.active))

    def __repr__(self) -> str:
        return f"<Scene {self.title}: {self.dimension} variables in {len(self.blocks)} blocks>"

    @property
    def title(self) -> str:
        """The name, and the effects that are on."""
        return f"{self.name} with {', '.join(self.active)}" if self.active else self.name

    @cached_property
    def field(self) -> tuple[sympy.Expr, ...]:
        """The right-hand side f(y), one formula for each variable, parameters filled in."""
        return expansion.flat_field(self)

    @cached_property
    def hamiltonian(self) -> sympy.Expr | None:
        """The Hamiltonian, parameters filled in; None if the field, with its effects, has none."""
        return expansion.flat_hamiltonian(self.summands, self)

    @cached_property
    def base_hamiltonian(self) -> sympy.Expr | None:
        """The Hamiltonian without effects, an observable even where an effect is not Hamiltonian."""
        return expansion.flat_hamiltonian(self.base_summands, self)

    @cached_property
    def local_terms(self) -> tuple[LocalTerm, ...]:
        """The field as terms in few local variables; parameters that are symbols stay in the formulas."""
        return tuple(term for term in expansion.all_terms(self) if term.outputs)

    def invariant_defects(self) -> dict[str, float]:
        """The declared invariants that are not constant along the field, tested at random points near the start.

        Each has the relative size of its derivative along the field, from 1e-25 to 1. A scene with symbols for
        parameters or too many terms is refused.

        Example:
            >>> import bseries as bs
            >>> invariants = {"square": "x^2 + y^2", "sum": "x + y"}
            >>> rotation = bs.Scene({"z": ["x", "y"]}, field={"x": "y", "y": "-x"}, invariants=invariants)
            >>> list(rotation.invariant_defects())
            ['sum']
        """
        return defects(self)

    def with_effects(self, /, *names: str, **parameters: object) -> Scene:
        """The scene with exactly these effects on, and new values of parameters, its own or those of these effects.

        Example:
            >>> import bseries as bs
            >>> drag = bs.Effect(field={"p": "-c*p"}, parameters={"c": "1/10"})
            >>> oscillator = bs.Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2", effects={"drag": drag})
            >>> oscillator.with_effects("drag", c="1/5").field
            (-p/5 - q, p)
        """
        active = check_active(names, self.effects)
        return self._changed(declarations.with_values(self.declaration, active, parameters), active)

    def with_parameters(self, /, **values: object) -> Scene:
        """The scene with other values of parameters, of the base system or of effects that are on."""
        return self._changed(declarations.with_values(self.declaration, self.active, values), self.active)

    def with_start(self, /, **values: object) -> Scene:
        """The scene with other start values of some blocks, or of single variables.

        Raises:
            IntegratorError: There is no such block or variable, or a block has another number of variables.

        Example:
            >>> import bseries as bs
            >>> scene = bs.Scene({"p": 2, "q": 2}, hamiltonian="p1^2 + q2", start={"p": [0, 0], "q": [1, 2]})
            >>> scene.with_start(q2=3).y0
            array([0., 0., 1., 3.])
        """
        return self._changed(declarations.with_start_values(self.declaration, self.active, values), self.active)

    def to_table(self) -> Table:
        """Variables, formulas, parameters, effects, first integrals and start; `print` and notebooks show it."""

        def text(fact: Fact) -> str:
            value = fact[1]
            return value if isinstance(value, str) else ", ".join(_decimal(x) or formula_text(x) for x in value)

        def latex(fact: Fact) -> str:
            value = fact[1]
            if isinstance(value, str):
                return latex_text(value)
            return ", ".join(f"${_decimal(x) or latex_formula(x, self)}$" for x in value)

        what, facts = Column("what"), list(_facts(self))
        return Table(
            self.title + (f": {self.summary}" if self.summary else ""),
            (what, Column("value", get=lambda fact: shorten(text(fact), MOST_CHARACTERS), latex=latex)),
            facts,
            [f"{note[0].upper()}{note[1:]}." for note in self.notes],
            data=lambda: {"schema": 1, "kind": "scene", "dimension": self.dimension, **self.to_dict()},
            records=Table("", (what, Column("value", get=text)), facts),
        )

    def to_toml(self) -> str:
        """The scene as the text of a TOML file, from which `load_scene` reads an equal one.

        Example:
            >>> import bseries as bs
            >>> print(bs.Scene({"y": 1}, field={"y": "-k*y"}, parameters={"k": 0.1}).to_toml(), end="")
            [variables]
            y = 1
            <BLANKLINE>
            [field]
            y = "-k*y"
            <BLANKLINE>
            [parameters]
            k = "0.1"
        """
        import tomli_w

        return tomli_w.dumps(self.to_dict())

    def to_dict(self) -> Document:
        """The content of `to_toml` as dictionaries and lists of integers and text, valid in JSON."""
        labels = self._labels | ({"name": None} if self.name == UNNAMED else {})
        return declarations.declaration_table(self.declaration, labels, self.effects, self.active)

    @property
    def _labels(self) -> dict[str, str | None]:
        return {"name": self.name, "summary": self.summary, "reference": self.reference}

    def _changed(self, declaration: Declaration, active: tuple[str, ...]) -> Scene:
        return _restored(declaration, active, dict(self.effects), self._labels)

    def __reduce__(self) -> tuple[object, ...]:
        return _restored, (self.declaration, self.active, dict(self.effects), self._labels)


def _restored(
    declaration: Declaration, active: tuple[str, ...], effects: Mapping[str, Effect], labels: dict[str, str | None]
) -> Scene:
    scene = Scene.__new__(Scene)
    scene._initialize(declaration, active, effects, labels)
    return scene


def _box_note(box: BlackBox) -> str:
    """A sentence about a compiled function."""
    without = "neither formulas nor derivatives" if box.jacobian is None else "no formulas"
    return f"the compiled function {box.name} has values, but {without}"


def labelled(scene: Scene, *, name: str, summary: str, reference: str) -> Scene:
    """The scene with these labels wherever it has none."""
    copy = Scene.__new__(Scene)
    name = name if scene.name == UNNAMED else scene.name
    labels = {"name": name, "summary": scene.summary or summary, "reference": scene.reference or reference}
    copy.__dict__.update(scene.__dict__ | labels)
    return copy


def _decimal(number: sympy.Expr) -> str | None:
    """The decimal form of a rational number, if it is shorter than the fraction; else None."""
    if not number.is_Rational:
        return None
    decimal = decimal_text(simplest(number))
    return decimal if len(decimal) < len(str(number)) else None


def _facts(scene: Scene) -> Iterator[Fact]:
    """The rows of the table of a scene: text, or formulas."""
    yield "variables", ", ".join(scene.variables)
    yield "blocks", ", ".join(f"{block.name} of {block.dimension}" for block in scene.blocks)
    for summand in scene.summands:  # H or a derivative, the sites of its sum, and its part of the field
        target = "H" if summand.target is None else f"{summand.target}'"
        sites = "; ".join(" ".join(str(site + 1) for site in row) for row in summand.sites.table)
        where = f"sites {shorten(sites)}" if sites else SUMS.get(summand.sites.kind)
        part = summand.part and f"part {summand.part}"
        yield ", ".join(filter(None, [target, where, part])), [summand.formula]
    for k, row in enumerate(scene.poisson or (), 1):
        yield f"Poisson matrix, row {k}", row
    for name, value in scene.parameters.items():
        yield f"parameter {name}", value if isinstance(value, tuple) else [value]
    for name, effect in scene.effects.items():
        state, parameters = ("on", {}) if name in scene.active else ("off", effect.parameters)
        values = (f"{key} = {typed_value(value)}" for key, value in parameters.items())
        yield f"effect {name} ({state})", "; ".join(filter(None, [effect.summary, *values]))
    for name, formula in scene.invariants.items():
        yield f"invariant {name}", [formula]
    if scene.positive:
        yield "positive", scene.positive
    if scene.start is not None:
        yield from ((f"start {block.name}", scene.start[block.offset : block.end]) for block in scene.blocks)
    if scene.reference:
        yield "reference", scene.reference


def typed_value(value: object) -> str:
    """A value in the notation of --parameter NAME=."""
    if not isinstance(value, tuple):
        return str(value)
    return (";" if isinstance(value[0], tuple) else ",").join(map(typed_value, value))


def latex_formula(formula: sympy.Expr, scene: System) -> str:
    """A formula in variables and parameters of a scene."""
    import sympy

    names = {symbol: _latex_name(str(symbol)) for symbol in formula.free_symbols}
    return sympy.latex(formula, symbol_names=names | _latex_components(scene))


def _latex_name(name: str) -> str:
    """The name of a variable or parameter: Greek letters and indices as LaTeX writes them."""
    import sympy

    if name.startswith("_"):
        return f"\\mathrm{{{latex_text(name)}}}"
    known = ((letter, unicode_name(letter, "")) for letter in name)
    spelled = (text.removeprefix(GREEK).lower() if text.startswith(GREEK) else letter for letter, text in known)
    return sympy.latex(sympy.Symbol("".join(spelled)))


@lru_cache(maxsize=1)
def _latex_components(scene: System) -> dict[sympy.Symbol, str]:
    """The names of components at sites: p_{x,1} for px1, and p_{x,i} for px_i in a term over sites."""
    import sympy

    names = {}
    for block in scene.blocks:
        base = _latex_name(block.name)
        for component in block.components if block.components != (block.name,) else ():
            axis = component.removeprefix(block.name)
            for site, symbol in enumerate(scene.symbols[block.places(component)], 1):
                names[symbol] = f"{base}_{{{axis},{site}}}"
            names |= {sympy.Symbol(f"{component}_{role}"): f"{base}_{{{axis},{role}}}" for role in ROLES}
    return names
