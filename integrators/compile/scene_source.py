"""Functions of a scene: its field, Hamiltonian and first integrals, compiled or for numbers of mpmath.

Terms over single variables become scalar code, and terms over particles loops around local formulas. Nothing is
allocated. The text depends on formulas, blocks and numbers only, not on names or on effects that are off.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from textwrap import wrap
from types import ModuleType
from typing import TYPE_CHECKING, Any

from integrators.compile.modules import load_module
from integrators.compile.operation_graph import simplest
from integrators.compile.particle_loops import INDICES, SiteSum, entry, indented, zeros
from integrators.compile.printer import FUNCTIONS
from integrators.exact.number_text import exact_text, literal
from integrators.scenes.model.local_terms import output_formula
from integrators.scenes.particles.expansion import filled, written_out
from integrators.scenes.particles.local_form import independent_pieces

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.local_terms import LocalTerm, Output
    from integrators.scenes.model.system import System

MAX_KEPT_DATA = 100_000
"""Numbers in a constant array beyond which machine code is not cached on disk (a megabyte)."""
KEPT, COMPILED = "from foundation.machine_code import njit", "from numba import njit"
MAX_WIDTH = 100

DOUBLE = '''\
"""The field f of y' = f(y) and its observables in double precision.

{state}
"""

{imports}

compiled = njit(nogil=True, error_model="numpy", fastmath={{"contract"}})
{constants}
'''

EXACT = '''\
"""The field f of y' = f(y) and its observables for numbers of mpmath, in its current precision.

{state}
"""

{imports}


def number(p, q):
    """The fraction p/q."""
    return mpf(p) / q
'''


def compiled_scene(scene: System) -> ModuleType:
    """Compile the functions of a scene, or load them from the cache on disk.

    Args:
        scene: The scene; its parameters must be numbers.

    Returns:
        A module with ``field(y, out)``, ``energy(y)`` if the scene has a Hamiltonian, and ``invariants(y, out)`` if it
        has first integrals, where `y` and `out` are different contiguous arrays of doubles. Outside the domain the
        results are infinite or nan.

    Raises:
        IntegratorError: A parameter is a symbol, or a number beyond the range of doubles.

    Example:
        >>> import numpy as np
        >>> from integrators.scenes.scene import Scene
        >>> pendulum = compiled_scene(Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)"))
        >>> out = np.empty(2)
        >>> pendulum.field(np.array([0.5, 0.0]), out)
        >>> out, pendulum.energy(np.array([0.5, 0.0]))
        (array([-0. ,  0.5]), -0.875)
    """
    source = scene_source(scene)
    return load_module(source, keep=KEPT in source)


def precise_scene(scene: System) -> ModuleType:
    """The same functions for lists of mpmath numbers, in mpmath's precision at the time of the call.

    Example:
        >>> import mpmath
        >>> from integrators.scenes.scene import Scene
        >>> riccati = precise_scene(Scene({"y": 1}, field={"y": "y^2/3"}))
        >>> out = [None]
        >>> with mpmath.workdps(30):
        ...     riccati.field([mpmath.mpf(1)], out)
        >>> mpmath.nstr(out[0], 30)
        '0.333333333333333333333333333333'
    """
    return load_module(scene_source(scene, precise=True), keep=False)


def scene_source(scene: System, *, precise: bool = False) -> str:
    """Write the source of the functions of a scene.

    Args:
        scene: The scene; its parameters must be numbers.
        precise: Whether the text is for mpmath instead of numba.

    Returns:
        The text of a module; see `compiled_scene`.

    Example:
        >>> from integrators.scenes.scene import Scene
        >>> print(scene_source(Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)")))
        ... # doctest: +ELLIPSIS
        \"""The field f of y' = f(y) ...
        def field(y, out):
            \"""Put f(y) in out.\"""
            y0 = y[0]
            y1 = y[1]
            out[0] = -sin(y1)
            out[1] = y0
        ...
    """
    writer = ModuleText(precise)
    field = field_lines(scene.numeric_terms, lambda term: term.outputs, range(scene.dimension), writer)
    writer.function("field(y, out)", "Put f(y) in out.", field)
    if scene.is_hamiltonian:
        writer.function("energy(y)", "The Hamiltonian at y.", energy_lines(scene, writer))
    if scene.invariants:
        total = SiteSum.flat(scene, {k: filled(formula, scene) for k, formula in enumerate(scene.invariants.values())})
        lines = total.lines({k: f"out[{k}] =" for k in total.outputs}, writer)
        writer.function("invariants(y, out)", "Put the first integrals in out.", lines)
    return writer.source(scene)


class ModuleText:
    """Functions of a module, and their constant arrays.

    Args:
        precise: Whether the text is for mpmath instead of numba.
        lanes: Whether sums over many particles are written for SIMD instructions, with work arrays on the stack.
        plain: Whether functions are lowered with their callers instead of being compiled one by one.
    """

    def __init__(self, precise: bool, *, lanes: bool = False, plain: bool = False):
        self.number, self.zero = ("number", "0") if precise else (None, "0.0")
        self.lanes, self.decorator = lanes, "" if plain or precise else "@compiled\n"
        self._functions: list[str] = []
        self._arrays: dict[tuple[str, ...], str] = {}

    def numbers(self, values: Sequence[sympy.Expr]) -> str:
        """Define a constant array of exact numbers and return its name."""
        exact = map(simplest, values)
        return self._array(literal(x) if self.number is None else exact_text(x, self.number) for x in exact)

    def sites(self, values: Sequence[int]) -> str:
        """Define a constant array of integers and return its name."""
        return self._array(map(str, values))

    def _array(self, texts: Iterable[str]) -> str:
        return self._arrays.setdefault(tuple(texts), f"D{len(self._arrays)}")

    def _definitions(self, opening: str, closing: str) -> list[str]:
        """The constant arrays, a few numbers on each line."""
        lines = []
        for texts, name in self._arrays.items():
            lines += [f"{name} = {opening}", *indented(wrap(f"{', '.join(texts)},", MAX_WIDTH)), closing]
        return lines

    def function(self, signature: str, summary: str, body: Sequence[str], decorator: str | None = None) -> None:
        """Add a function; exact numbers are created in its body, since their precision may change between calls."""
        decorator = self.decorator if decorator is None else f"{decorator}\n"
        if self.number is not None:
            body = [*self._definitions("(", ")"), *body]
            self._arrays.clear()
        lines = [f"{decorator}def {signature}:", f'    """{summary}"""', *indented(body)]
        self._functions.append("\n".join(lines))

    @property
    def bodies(self) -> str:
        """The functions so far."""
        return "\n\n\n".join(self._functions)

    def source(self, scene: System, template: str | None = None) -> str:
        """The text of the module; the template of its head is by default that of a scene's functions."""
        bodies = self.bodies
        called = ", ".join(name for name in FUNCTIONS if re.search(rf"\b{name}\(", bodies))
        if self.number is None:
            imports = ["import numpy as np"] * bool(self._arrays) + [f"from math import {called}"] * bool(called)
            if template is None:
                imports.append(KEPT if all(len(texts) <= MAX_KEPT_DATA for texts in self._arrays) else COMPILED)
        else:
            imports = [f"from mpmath import mpf, pi{called and ', '}{called}"]
        head = (template or (DOUBLE if self.number is None else EXACT)).format(
            state="\n".join(f"y[{b.offset}:{b.end}] = {_shown(b.variables)}" for b in scene.blocks),
            imports="\n".join(imports),
            constants="\n".join(self._definitions("np.array([", "])")),
        )
        return f"{head.rstrip()}\n\n\n{bodies}\n"


def _shown(names: Sequence[str]) -> str:
    return ", ".join(names if len(names) < 8 else (*names[:4], "…", names[-1]))


def field_lines(
    terms: Iterable[LocalTerm],
    outputs: Callable[[LocalTerm], Iterable[Output]],
    entries: Iterable[int],
    writer: ModuleText,
) -> list[str]:
    """Statements for a field, or a piece of it: first contributions are assigned, others added.

    Args:
        terms: The terms of the field.
        outputs: Maps a term to its outputs in the piece.
        entries: The entries of ``out`` in the piece.
        writer: The module under construction.
    """
    lines: list[str] = []
    assigned: set[int] = set()
    touched: set[int] = set()
    for total in gathered(terms, lambda term: ((x.place, output_formula(term, x)) for x in outputs(term))):
        targets = {}
        for place in sorted(total.outputs):
            covered = total.covered(place)
            assigns = bool(covered) and covered.isdisjoint(touched)
            targets[place] = f"{entry('out', place)} {'=' if assigns else '+='}"
            touched |= covered
            assigned |= covered if assigns else set()
        lines += total.lines(targets, writer)
    return [*zeros(set(entries) - assigned, writer.zero), *lines]


def energy_lines(scene: System, writer: ModuleText) -> list[str]:
    """Statements for the Hamiltonian."""
    if scene.poisson is not None:
        sums = [SiteSum.flat(scene, {"energy": scene.hamiltonian})]  # its terms are those of the field
    else:
        constant = SiteSum.flat(scene, {"energy": _constant(scene)})
        sums = gathered(scene.numeric_terms, lambda term: [("energy", term.formula)], constant)
    targets = ({"energy": f"total {sign}"} for sign in ("=", *("+=" for _ in sums[1:])))
    lines = [line for total, target in zip(sums, targets, strict=True) for line in total.lines(target, writer)]
    return [*lines, "return total"]


def _constant(scene: System) -> sympy.Expr:
    """The constant part of the Hamiltonian, which local terms omit because the field does not need it."""
    import sympy

    of_sites = {name for name, value in scene.parameters.items() if isinstance(value, tuple)}
    constants: list[sympy.Expr] = []
    for summand in scene.summands:
        formula: Any = filled(summand.formula, scene)
        data = {x for x in formula.free_symbols if summand.sites.kind != "single" and x.name[:-2] in of_sites}
        variables = sorted(formula.free_symbols - data, key=str)
        for piece in independent_pieces(formula, variables):
            if piece.free_symbols.isdisjoint(variables):
                constants += [value for _, value in written_out(summand._replace(formula=piece), scene)]
    return sympy.Add(*constants)


def gathered(
    terms: Iterable[LocalTerm], outputs: Callable[[LocalTerm], Iterable[Any]], first: SiteSum | None = None
) -> list[SiteSum]:
    """Sums of terms over the same sites: over single variables, then over each particle, then over several."""
    sums = {} if first is None else {first.sites: first}
    for term in terms:
        sums.setdefault(term.sites, SiteSum(term.sites)).add(term, outputs(term))
    return sorted(sums.values(), key=lambda total: total.sites.roles if total.sites.kind != "table" else len(INDICES))
