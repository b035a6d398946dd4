"""`bseries trees`: rooted trees with everything that is said about them, or their number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.options.trees import takes_max_children
from bseries.cli.output import WholeNumber, names_or_none, takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    from bseries.cli.output import Output
    from trees import Tree, TreeTable

FIELDS = ("id", "tree", "levels", "colors", "order", "symmetry", "density", "alpha", "differential", "weight")
COLUMNS = (
    Column("id", True),
    Column("|τ|", True),
    Column("tree τ"),
    Column("σ", True),
    Column("γ", True),
    Column("α", True),
    Column("differential"),
    Column("elementary weight"),
)
COUNT_COLUMNS = (Column("nodes", True), Column("trees", True), Column("so far", True))


@click.command()
@click.option("--order", type=WholeNumber(), default=5, show_default=True, help="Largest number of nodes.")
@click.option("--colors", type=WholeNumber(), default=1, show_default=True, help="Number of colours of the nodes.")
@takes_max_children
@click.option("--count", is_flag=True, help="Only count the trees, without listing them; to order 60.")
@takes_output
def trees(order: int, colors: int, max_children: Any, count: bool, output: Output) -> Iterable[str]:
    """Rooted trees with their numbers and formulas.

    For each tree τ: symmetry σ, density γ, α = |τ|!/(σγ), elementary differential and elementary weight. With two
    colours p and q the trees are those of partitioned methods. CSV and JSON have levels, the distances of the nodes
    from the root.

    \b
    Examples:
      bseries trees --order 4
      bseries trees --order 3 --colors 2
      bseries trees --order 8 --colors 2 --max-children "0,inf;inf,0"
      bseries trees --order 40 --count
      bseries trees --order 15 --format csv -o trees.csv
    """
    from trees import TreeTable, count_trees

    counts = count_trees(order, colors, max_children)
    if count:
        return count_answer(counts, colors, output)
    output.check_rows(sum(counts))
    return tree_answer(TreeTable(order, colors, max_children), output)


def count_answer(counts: Sequence[int], colors: int, output: Output) -> Iterable[str]:
    """The numbers of trees per order and in all."""
    numbers = list(zip(range(1, len(counts) + 1), counts, accumulate(counts), strict=True))
    if output.format == "json":
        rows = [{"order": n, "trees": own, "total": total} for n, own, total in numbers]
        return [table.json({"schema": 1, "kind": "tree-counts", "colors": colors, "counts": rows}, "counts")]
    rows = [tuple(map(str, row)) for row in numbers]
    if output.format == "csv":
        return table.csv(("order", "trees", "total"), rows)
    if output.format == "latex":
        return [table.latex(COUNT_COLUMNS, rows)]
    if output.format == "markdown":
        return [table.markdown(COUNT_COLUMNS, rows, title="Numbers of rooted trees", notes=[])]
    return [table.text(COUNT_COLUMNS, rows, output.width)]


def tree_answer(listed: TreeTable, output: Output) -> Iterable[str]:
    """The trees in any format."""
    from trees.names import default_names

    names = names_or_none(default_names(listed.colors))
    trees = enumerate(output.track(listed, len(listed)))
    if output.format == "json":
        data = {"schema": 1, "kind": "trees", "order": listed.max_order, "colors": list(default_names(listed.colors))}
        return [table.json({**data, "trees": [_record(i, tree, names) for i, tree in trees]}, "trees")]
    if output.format == "csv":
        return table.csv(FIELDS, (_csv_row(_record(i, tree, names)) for i, tree in trees))
    if output.format == "latex":
        return [table.latex(COLUMNS, (_latex_row(i, tree, names) for i, tree in trees))]
    rows = (_row(i, tree, names) for i, tree in trees)
    title = f"{len(listed)} rooted trees with at most {listed.max_order} nodes"
    notes = ["σ: symmetry; γ: density, the exact flow has 1/γ; α = |τ|!/(σγ): number of monotonic labellings."]
    if output.format == "markdown":
        return [table.markdown(COLUMNS, rows, title=title, notes=notes)]
    text = table.text(COLUMNS, table.sections(rows, 1), output.width)
    return [table.paragraphs([title, ""], output.width), text, table.paragraphs(["", *notes], output.width)]


def _record(at: int, tree: Tree, names: Sequence[str] | None) -> dict[str, Any]:
    """Everything about a tree, under the names of `FIELDS`."""
    return {
        "id": at,
        "tree": tree.text(names),
        "levels": list(tree.levels),
        "colors": list(tree.colors),
        "order": tree.order,
        "symmetry": tree.symmetry,
        "density": tree.density,
        "alpha": tree.alpha,
        "differential": tree.differential(names=names),
        "weight": tree.weight(names=names),
    }


def _csv_row(record: dict[str, Any]) -> table.Row:
    return [" ".join(map(str, value)) if isinstance(value, list) else str(value) for value in record.values()]


def _row(at: int, tree: Tree, names: Sequence[str] | None) -> table.Row:
    return (*_numbers(at, tree, tree.text(names)), tree.differential(names=names), tree.weight(names=names))


def _latex_row(at: int, tree: Tree, names: Sequence[str] | None) -> table.Row:
    formulas = (f"${formula('latex', names)}$" for formula in (tree.differential, tree.weight))
    return (*_numbers(at, tree, f"${tree.text(names)}$".replace("τ", r"\tau ")), *formulas)


def _numbers(at: int, tree: Tree, text: str) -> Iterator[str]:
    return map(str, (at, tree.order, text, tree.symmetry, tree.density, tree.alpha))
