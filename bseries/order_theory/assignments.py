"""Residual and Jacobian as a list of assignments to scalars, with everything that trees share computed once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from .layout import layout, named_blocks
from .scalars import Scalars, gradient, left_side

if TYPE_CHECKING:
    from .languages import Language
    from .listing import OrderConditions


class Assignments(NamedTuple):
    """Temporaries (name, expression) in order, results (index, expression), and what the columns of a Jacobian are.

    `temporary_count` is the largest number that names a temporary.
    """

    temporaries: list[tuple[str, Any]]
    results: list[tuple[tuple[int, ...], Any]]
    columns: list[str]
    temporary_count: int


class Recorder:
    """Gives a name to every expression worth one; equal expressions have one name."""

    def __init__(self, pattern: str):
        self._pattern = pattern
        self._names: dict[Any, Any] = {}

    def __call__(self, value: Any) -> Any:
        """The name of an expression; numbers and names stand for themselves."""
        if isinstance(value, int) or value.is_Symbol or value.is_Number:
            return value
        if value not in self._names:
            from sympy import Symbol

            self._names[value] = Symbol(self._pattern.format(len(self._names) + 1))
        return self._names[value]

    def __len__(self) -> int:
        return len(self._names)

    def needed(self, results: Sequence[Any]) -> list[tuple[str, Any]]:
        """The assignments that the results depend on."""
        used = {symbol for result in results for symbol in result.free_symbols}
        kept = []
        for value, name in reversed(self._names.items()):
            if name in used:
                used |= value.free_symbols
                kept.append((name.name, value))
        return kept[::-1]


def _machine(conditions: OrderConditions, stages: int, language: Language) -> tuple[Scalars, Recorder]:
    from sympy import Symbol

    def symbol(argument: Any, at: tuple[int, ...]) -> Any:
        return Symbol(language.entry(argument.name, at, argument.shape(stages)))

    recorder = Recorder(language.temporary)
    program = conditions.system.program
    blocks = named_blocks(program, conditions.request.structures, stages, symbol)
    return Scalars(program, stages, blocks, recorder), recorder


def residual_assignments(conditions: OrderConditions, stages: int, language: Language) -> Assignments:
    """The assignments of the residual."""
    from sympy import sympify

    machine, recorder = _machine(conditions, stages, language)
    system = conditions.system
    values = system.program.run(machine, system.size)
    results = [
        ((k,), sympify(left_side(equation, machine, values) - equation.right, strict=True))
        for k, equation in enumerate(system.equations)
    ]
    return _assignments(recorder, results, [])


def jacobian_assignments(conditions: OrderConditions, stages: int, language: Language) -> Assignments:
    """The assignments of the entries of the Jacobian that are not zero."""
    from sympy import sympify

    machine, recorder = _machine(conditions, stages, language)
    system = conditions.system
    gradients = system.gradients
    values = system.program.run(machine)
    free = [entry for entry in layout(system.program, conditions.request.structures, stages) if entry.is_free]
    results = []
    for k, slopes in enumerate(gradients):
        derivatives = gradient(system.program, slopes, stages, values)
        for column, entry in enumerate(free):
            value = sympify(derivatives[entry.block][entry.place], strict=True)
            if value != 0:
                results.append(((k, column), value))
    columns = [language.entry(entry.argument.name, entry.at, entry.argument.shape(stages)) for entry in free]
    return _assignments(recorder, results, columns)


def _assignments(recorder: Recorder, results: list[tuple[tuple[int, ...], Any]], columns: list[str]) -> Assignments:
    temporaries = recorder.needed([value for _, value in results])
    return Assignments(temporaries, results, columns, len(recorder))
