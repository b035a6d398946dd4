"""How verbs read texts: numbers, assignments, names or files; and the options --step, --order and --max-children."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import click

from bseries.cli.application import Refusal
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from fractions import Fraction

    from click.shell_completion import CompletionItem

T = TypeVar("T")
Decorator: TypeAlias = Callable[[Callable[..., T]], Callable[..., T]]
Limits: TypeAlias = int | list[list[int | None]] | None


class WholeNumber(click.ParamType):
    """An integer; the library checks its range."""

    name = "N"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Read the text."""
        try:
            return int(value)
        except ValueError:
            name = param.name if param else "number"
            raise Refusal(f"{name} must be a whole number, but was {value!r:.60}") from None


class Number(click.ParamType):
    """A number such as ``1/3`` or ``2*pi``: the nearest double, a fraction that is exact if it can be, or a list."""

    name = "X"

    def __init__(self, *, exact: bool = False, positive: bool = False, many: bool = False):
        self.exact, self.positive, self.many = exact, positive, many

    def convert(
        self, value: str, param: click.Parameter | None, ctx: click.Context | None
    ) -> Fraction | float | list[Fraction | float]:
        """Read the text."""
        name = param.opts[0].lstrip("-") if param else "number"
        if self.many:
            return [self.read(piece, name) for piece in split_row(value)]
        return self.read(value, name)

    def read(self, text: str, option: str) -> Fraction | float:
        """The number of an option."""
        from fractions import Fraction

        from integrators.exact.expressions import parse_constant

        value = parse_constant(text, argument=option)
        try:
            if self.exact:
                return value if isinstance(value, Fraction) else Fraction(float(value))
            number = float(value)
        except OverflowError:
            raise Refusal(f"{option} must be a number that a double can hold, but was {text!r:.60}") from None
        if self.positive and not number > 0:
            raise Refusal(f"{option} must be positive, but was {text!r:.60}")
        return number


REAL, REALS, POSITIVE, EXACT = Number(), Number(many=True), Number(positive=True), Number(exact=True)


def takes_step(verb: Callable[..., T]) -> Callable[..., T]:
    """Add the option --step to a verb that cannot do without; it receives `h`."""

    @click.option("--step", "h", metavar="H", type=EXACT, help="The step size, 0.1 or 1/10; negative for backwards.")
    @functools.wraps(verb)
    def call(*, h: Fraction | None, **options: object) -> T:
        if h is None:
            raise Refusal("step must be given, as in --step 1/10, but was not")
        return verb(h=h, **options)

    return call


def read_assignments(texts: Iterable[str], option: str, example: str) -> dict[str, str]:
    """The values of ``NAME=VALUE`` by name."""
    values: dict[str, str] = {}
    for text in texts:
        name, _, value = (part.strip() for part in text.partition("="))
        if not (name and value):
            raise Refusal(f"{option} must be NAME=VALUE, as in {example}, but was {text!r:.60}")
        if name in values:
            raise Refusal(f"{option} must give each name once, as in {example}, but gave {name!r:.60} twice")
        values[name] = value
    return values


def is_file(source: str, suffixes: tuple[str, ...]) -> bool:
    """Whether a METHOD or a SCENE is a file, or standard input."""
    return source == "-" or "/" in source or "\\" in source or source.lower().endswith(suffixes)


def completions(names: Iterable[tuple[str, str]], incomplete: str, files: tuple[str, ...] = ()) -> list[CompletionItem]:
    """Names with their help that complete a word; files if it begins one with such a suffix, or no name."""
    from click.shell_completion import CompletionItem

    begins_file = is_file(incomplete, files) or incomplete.startswith(".")
    found = [CompletionItem(name, help=text) for name, text in names if name.startswith(incomplete)]
    return [CompletionItem(incomplete, type="file")] if files and (begins_file or not found) else found


def adds(*options: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Several decorators as one."""
    return lambda verb: functools.reduce(lambda command, option: option(command), reversed(options), verb)


DEFAULT_ORDER = 5
takes_powers = adds(
    click.option(
        "--order", type=WholeNumber(),
        help=f"Trees with 1 to N nodes, powers h^0 to h^(N-1); by default {DEFAULT_ORDER}, or for --power.",
    ),
    click.option("--power", type=WholeNumber(), metavar="K", help="Only what h^K multiplies."),
    click.option("--nonzero", is_flag=True, help="Leave out zero terms."),
)  # fmt: skip
"""Adds options to a verb, of which `read_powers` reads the first two."""


def read_powers(order: int | None, power: int | None) -> tuple[int, range]:
    """The order, and the powers of h to write."""
    from trees.counting import check_order

    if order is None:
        order = DEFAULT_ORDER if power is None or power < 0 else power + 1
    check_order(order)
    if power is not None and not 0 <= power < order:
        raise Refusal(f"power must be from 0 to {order - 1}, but was {power}")
    return order, range(order) if power is None else range(power, power + 1)


class ChildLimits(click.ParamType):
    """Bounds on the number of children: one number, or K rows of K numbers or ``inf``, as in ``0,inf;inf,0``."""

    name = "LIMITS"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Limits:
        """Read the text; the library checks the numbers."""
        try:
            rows = [
                [None if entry.strip() in ("inf", "*") else int(entry) for entry in row.split(",")]
                for row in value.split(";")
            ]
        except ValueError:
            example = "2 or 0,inf;inf,0"
            raise Refusal(f"max_children must be numbers or inf, as in {example}, but was {value!r:.60}") from None
        return rows[0][0] if len(rows) == len(rows[0]) == 1 else rows


takes_max_children = click.option(
    "--max-children", type=ChildLimits(),
    help='Largest number of children of a node: one number, or a row for each colour, as in "0,inf;inf,0".',
)  # fmt: skip
