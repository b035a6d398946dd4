"""Tables of things that are no results: trees, numbers of trees, methods, scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import accumulate
from operator import attrgetter, itemgetter
from typing import TYPE_CHECKING, Any

from bseries.algebra.presentation import latex_number
from bseries.scene_text import latex_formula, with_effects
from bseries.table import Column, LazyRows, Table, latex_text, listed, paragraphs
from integrators import PartitionedRungeKutta, RungeKutta, catalogue, scene_catalogue
from integrators.core.errors import shorten
from integrators.exact.expressions import decimal_text
from integrators.methods.tableaux.files import dumps_method
from integrators.scenes.model.formulas import formula_text
from trees.names import default_names

if TYPE_CHECKING:
    import sympy

    from integrators import Method, Scene
    from integrators.methods.catalogue.entry import MethodEntry
    from integrators.scenes.catalogue.registry import SceneEntry
    from integrators.scenes.model.terms import Summand
    from trees import TreeTable

    Fact = tuple[str, str | Sequence[sympy.Expr]]

MOST_EXACT_STAGES = 3
"""Roots of higher degree fill pages: methods with irrational entries and more stages are shown in floats."""
MOST_CHARACTERS = 300
"""Longer formulas and lists, those of many particles, are shortened for readers."""
METHOD_FIELDS = ("name", "kind", "stages", "order", "description", "aliases", "parameters", "reference")
SCENE_FIELDS = ("name", "dimension", "effects", "options", "aliases", "summary", "reference")
SUMS = {
    "each": "each site",
    "chain": "neighbours in a chain",
    "ring": "neighbours in a ring",
    "pairs": "pairs of sites",
}


def tree_table(trees: TreeTable) -> Table:
    """Trees with their numbers and formulas.

    Example:
        >>> from trees import TreeTable
        >>> print(tree_table(TreeTable(2)).title)
        2 rooted trees with at most 2 nodes
    """
    colors = default_names(trees.colors)
    names = colors if len(colors) > 1 else None

    def latex(formula: str) -> Any:
        return lambda row: f"${getattr(row[1], formula)('latex', names)}$"

    columns = (
        Column("id", True, itemgetter(0)),
        Column("|τ|", True, lambda row: row[1].order),
        Column(
            "tree τ",
            get=lambda row: row[1].text(names),
            latex=lambda row: f"${row[1].text(names)}$".replace("τ", r"\tau "),
        ),
        Column("σ", True, lambda row: row[1].symmetry),
        Column("γ", True, lambda row: row[1].density),
        Column("α", True, lambda row: row[1].alpha),
        Column("differential", get=lambda row: row[1].differential(names=names), latex=latex("differential")),
        Column("elementary weight", get=lambda row: row[1].weight(names=names), latex=latex("weight")),
    )
    fields = {
        "id": itemgetter(0),
        "tree": columns[2].get,
        "levels": lambda row: list(row[1].levels),
        "colors": lambda row: list(row[1].colors),
        "order": columns[1].get,
        "symmetry": columns[3].get,
        "density": columns[4].get,
        "alpha": columns[5].get,
        "differential": columns[6].get,
        "weight": columns[7].get,
    }
    rows: LazyRows = LazyRows(lambda: enumerate(trees), len(trees))

    def data() -> dict[str, Any]:
        records = [{name: get(row) for name, get in fields.items()} for row in rows]
        return {"schema": 1, "kind": "trees", "order": trees.max_order, "colors": list(colors), "trees": records}

    return Table(
        f"{len(trees)} rooted trees with at most {trees.max_order} nodes",
        columns,
        rows,
        ["σ: symmetry; γ: density, the exact flow has 1/γ; α = |τ|!/(σγ): number of monotonic labellings."],
        data=data,
        items="trees",
        section=columns[1].get,
        records=listed(fields.items(), rows),
    )


def count_table(counts: Sequence[int], colors: int) -> Table:
    """Numbers of trees by their number of nodes."""
    names = ("order", "trees", "total")
    rows = list(zip(range(1, len(counts) + 1), counts, accumulate(counts), strict=True))

    def data() -> dict[str, Any]:
        records = [dict(zip(names, row, strict=True)) for row in rows]
        return {"schema": 1, "kind": "tree-counts", "colors": colors, "counts": records}

    return Table(
        "Numbers of rooted trees",
        (Column("nodes", True), Column("trees", True), Column("so far", True)),
        rows,
        data=data,
        items="counts",
        records=Table("", list(map(Column, names)), rows),
        titled=False,
    )


def methods_table() -> Table:
    """The catalogue of methods."""
    entries = catalogue()

    def stages(entry: MethodEntry) -> object:
        return entry.stages or (f"s ≥ {entry.least_stages}" if entry.least_stages > 1 else "s")

    def description(entry: MethodEntry) -> str:
        lists = (("also", entry.aliases), ("parameters", entry.parameters))
        return "\n".join([entry.description, *(f"{what}: {', '.join(names)}" for what, names in lists if names)])

    fields: dict[str, Any] = {field: attrgetter(field) for field in METHOD_FIELDS}
    fields |= {"name": _method_name, "stages": lambda entry: entry.stages or "s"}

    def data() -> dict[str, Any]:
        records = [{field: get(entry) for field, get in fields.items()} for entry in entries]
        return {"schema": 1, "kind": "methods", "methods": records}

    return Table(
        "Methods",
        (
            Column("name", get=_method_name),
            Column("stages", True, stages),
            Column("order", True, lambda entry: entry.order),
            Column("description", get=description),
        ),
        entries,
        ["`bseries methods NAME` shows a tableau and its source; --format csv and json list all sources."],
        data=data,
        items="methods",
        section=lambda entry: entry.kind.upper(),
        records=listed(fields.items(), entries),
        titled=False,
    )


def _method_name(entry: MethodEntry) -> str:
    return entry.name + "{s}" * entry.is_family


def method_table(method: Method) -> Table:
    """The tableau or the program of a method, and the facts about it; rows and columns are those of the tableaux."""
    facts = list(_method_facts(method))
    own = {
        "table": lambda width: f"{method.name}\n\n{method}\n\n" + paragraphs(facts, width),
        "markdown": lambda width: f"{method.name}\n\n```text\n{method}\n```\n\n" + "".join(f"- {x}\n" for x in facts),
    }
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        return Table(method.name, (), (), facts, own=own)
    own["json"] = lambda width: dumps_method(method, "json")
    own["latex"] = lambda width: "".join(map(_latex_tableau, method.partitions))
    headings = ("part", "row", "node", *map(str, range(1, method.stages + 1)))
    return Table(method.name, list(map(Column, headings)), list(_tableau_rows(method)), facts, own=own)


def _method_facts(method: Method) -> Iterator[str]:
    """Sentences on a method beside its tableau."""
    found = (e for e in catalogue() if method.name == (f"{e.name}{method.stages}" if e.is_family else e.name))
    entry = next(found, None)
    if entry is not None:
        order = f"{entry.order} with s stages" if entry.is_family else str(entry.order)
        yield entry.description
        yield f"kind: {entry.kind}, stages: {method.stages}, order: {order}"
        if entry.aliases:
            yield f"aliases: {', '.join(entry.aliases)}"
    if method.parameters:
        yield f"parameters: {', '.join(method.parameters)}"
    if method.digits is not None:
        yield f"published as decimals with {method.digits} digits"
    if method.reference:
        yield f"reference: {method.reference}"


def _readable(part: RungeKutta) -> RungeKutta:
    """The method, in floats if its exact entries fill pages."""
    too_long = part.algebra is not None and part.domain != "QQ" and part.stages > MOST_EXACT_STAGES
    return part.to_float() if too_long else part


def _tableau_rows(method: RungeKutta | PartitionedRungeKutta) -> Iterator[tuple[Any, ...]]:
    for part, name in zip(map(_readable, method.partitions), method.names, strict=True):
        for i, row in enumerate(part.A):
            yield name, f"A{i + 1}", part.c[i], *row
        for label, weights in [("b", part.b), *(("embedded", row) for row in part.embedded)]:
            yield name, label, "", *weights


def _latex_tableau(method: RungeKutta) -> str:
    part: Any = _readable(method)
    rows = [(c, *row) for c, row in zip(part.c, part.A, strict=True)]
    lines = [" & ".join(latex_number(x, part.digits) for x in row) + r" \\" for row in rows]
    lines[-1] += r" \hline"
    lines += [" & ".join(["", *(latex_number(x, part.digits) for x in w)]) + r" \\" for w in (part.b, *part.embedded)]
    return "\n".join([f"\\begin{{array}}{{c|{'c' * part.stages}}}", *lines, r"\end{array}"]) + "\n"


def scenes_table() -> Table:
    """The built-in scenes; their dimensions are those with default options."""

    def record(entry: SceneEntry) -> dict[str, Any]:
        return {
            field: entry.build().dimension if field == "dimension" else getattr(entry, field) for field in SCENE_FIELDS
        }

    def description(row: dict[str, Any]) -> str:
        lists = (("also", row["aliases"]), ("options", row["options"]))
        return "\n".join([row["summary"], *(f"{what}: {', '.join(names)}" for what, names in lists if names)])

    def field(name: str) -> Any:
        return lambda row: row[name] if isinstance(row[name], str | int) else tuple(row[name])

    rows = list(map(record, scene_catalogue()))
    return Table(
        "Scenes",
        (
            Column("name", get=itemgetter("name")),
            Column("variables", True, itemgetter("dimension")),
            Column("effects", get=lambda row: ", ".join(row["effects"])),
            Column("description", get=description),
        ),
        rows,
        ["`bseries scenes NAME` shows one in detail; --format csv and json list all sources."],
        data=lambda: {"schema": 1, "kind": "scenes", "scenes": rows},
        items="scenes",
        records=listed([(name, field(name)) for name in SCENE_FIELDS], rows),
        titled=False,
    )


def scene_table(scene: Scene, effects: Sequence[str] | None = None) -> Table:
    """The variables, formulas, parameters, effects, first integrals and start of a scene.

    Args:
        scene: The scene.
        effects: Effects for the title; by default those that are on.
    """

    def text(fact: Fact) -> str:
        value = fact[1]
        return value if isinstance(value, str) else ", ".join(_decimal(x) or formula_text(x) for x in value)

    def latex(fact: Fact) -> str:
        value = fact[1]
        if isinstance(value, str):
            return latex_text(value)
        return ", ".join(f"${_decimal(x) or latex_formula(x, scene)}$" for x in value)

    what, facts = Column("what"), list(_scene_facts(scene))
    title = with_effects(scene.name, scene.active if effects is None else effects)
    return Table(
        title + (f": {scene.summary}" if scene.summary else ""),
        (what, Column("value", get=lambda fact: shorten(text(fact), MOST_CHARACTERS), latex=latex)),
        facts,
        [f"{note[0].upper()}{note[1:]}." for note in scene.notes],
        data=lambda: {"schema": 1, "kind": "scene", "dimension": scene.dimension, **scene.to_dict()},
        records=Table("", (what, Column("value", get=text)), facts),
    )


def _decimal(number: Any) -> str | None:
    """The decimal form of a rational number, if it is shorter than the fraction; else None."""
    if not number.is_Rational:
        return None
    decimal = decimal_text(Fraction(int(number.p), int(number.q)))
    return decimal if len(decimal) < len(str(number)) else None


def _scene_facts(scene: Scene) -> Iterator[Fact]:
    """The rows of the table of a scene: text, or formulas."""
    entry = next((entry for entry in scene_catalogue() if entry.name == scene.name), None)
    yield "variables", ", ".join(scene.variables)
    yield "blocks", ", ".join(f"{block.name} of {block.dimension}" for block in scene.blocks)
    for summand in scene.summands:
        yield _summand_place(summand), [summand.formula]
    for k, row in enumerate(scene.poisson or (), 1):
        yield f"Poisson matrix, row {k}", row
    for name, value in scene.parameters.items():
        yield f"parameter {name}", value if isinstance(value, tuple) else [value]
    for name, value in entry.options.items() if entry else ():
        if name not in scene.parameters:
            yield f"option {name}", f"by default {_typed(value)}"
    for name, effect in scene.effects.items():
        state, parameters = ("on", {}) if name in scene.active else ("off", effect.parameters)
        values = (f"{key} = {_typed(value)}" for key, value in parameters.items())
        yield f"effect {name} ({state})", "; ".join(filter(None, [effect.summary, *values]))
    for name, summary in ((entry and entry.built_in_effects) or {}).items():
        yield f"effect {name}", summary
    for name, formula in scene.invariants.items():
        yield f"invariant {name}", [formula]
    if scene.positive:
        yield "positive", scene.positive
    if scene.start is not None:
        yield from ((f"start {block.name}", scene.start[block.offset : block.end]) for block in scene.blocks)
    if entry and entry.aliases:
        yield "also called", ", ".join(entry.aliases)
    if scene.reference:
        yield "reference", scene.reference


def _summand_place(summand: Summand) -> str:
    """The place of a formula: H or a derivative, the sites of its sum, and its part of the field."""
    target = "H" if summand.target is None else f"{summand.target}'"
    sites = "; ".join(" ".join(str(site + 1) for site in row) for row in summand.sites.table)
    where = f"sites {shorten(sites)}" if sites else SUMS.get(summand.sites.kind)
    part = summand.part and f"part {summand.part}"
    return ", ".join(filter(None, [target, where, part]))


def _typed(value: Any) -> str:
    """A value as it is typed behind --parameter NAME=."""
    if not isinstance(value, tuple):
        return str(value)
    return (";" if isinstance(value[0], tuple) else ",").join(map(_typed, value))
