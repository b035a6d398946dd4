"""Tables of trees and of numbers of trees."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import accumulate
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from foundation.table import Column, LazyRows, Table, listed
from trees.notation import default_names

if TYPE_CHECKING:
    from trees.tree import Tree


def listing(trees: Collection[Tree], order: int, color_count: int) -> Table:
    """Trees with their numbers and formulas."""
    colors = default_names(color_count)
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
        return {"schema": 1, "kind": "trees", "order": order, "colors": list(colors), "trees": records}

    return Table(
        f"{len(trees)} rooted trees with at most {order} nodes",
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
