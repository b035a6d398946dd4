"""`bseries compose`: compositions of methods."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import complete_method, read_method
from bseries.cli.options.values import Limits
from bseries.cli.output import Output
from bseries.cli.verbs.series import answer, count_rows, takes_series_options
from bseries_base.table import Table
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from bseries.algebra.bseries import BSeries


@click.command()
@click.argument("sources", metavar="METHOD METHOD...", nargs=-1, required=True, shell_complete=complete_method)
@click.option("--steps", metavar="ROW", help='Length of each step, in units of h, as in "1/2,1/2"; by default 1 each.')
@click.option("--modified", is_flag=True, help="The modified equation of the composition, not its B-series.")
@takes_series_options
def compose(
    sources: tuple[str, ...],
    steps: str | None,
    modified: bool,
    order: int,
    max_children: Limits,
    output: Output,
    **options: Any,
) -> Table:
    """The B-series of a composition of methods; the first METHOD acts first.

    Where the steps add up to 1, the composition is a method for the step h. Each METHOD is a name or a file, as for the
    other verbs.

    \b
    Examples:
      bseries compose implicit-euler explicit-euler --steps 1/2,1/2
      bseries compose symplectic-euler-p symplectic-euler-q --steps 1/2,1/2 --modified --order 3
      bseries compose rk4 rk4 --steps 1/2,1/2 --order 6 --nonzero
    """
    from bseries.algebra.composition import compose as compose_series
    from bseries.algebra.modified import series
    from integrators.exact.entries import read_entry

    methods: Any = [read_method(source) for source in sources]
    texts = split_row(steps) if steps is not None else ["1"] * len(methods)
    if len(texts) != len(methods):
        raise Refusal(f"steps must be as many as methods, {len(methods)}, but were {len(texts)}")
    lengths = [read_entry(text, f"steps[{i}]") for i, text in enumerate(texts, 1)]
    for other in methods[1:]:
        if other.names != methods[0].names:
            raise Refusal(f"METHODs must have the same parts, but {_parts(methods[0])} and {_parts(other)}")
    output.check_rows(count_rows(order, len(methods[0].names), max_children))

    def one(method: Any, length: Any) -> BSeries:
        return series(method, order, max_children=max_children).scale_step(length)

    s = functools.reduce(compose_series, map(one, methods, lengths))
    parts = (name.name if text == "1" else f"{name.name} ({text} h)" for name, text in zip(methods, texts, strict=True))
    s = (s.log() if modified else s).with_label(", then ".join(parts), "modified" if modified else "series")
    issues = list(dict.fromkeys(issue for method in methods for issue in method.issues))
    return answer(s, issues, **options)


def _parts(method: Any) -> str:
    return f"{method.name} has {', '.join(method.names)}" if any(method.names) else f"{method.name} has none"
