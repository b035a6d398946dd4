"""Observed quantities: the energy, first integrals, and functions of the user, as one C function."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from bseries_base.errors import shorten
from bseries_base.machine_code import MachineCode
from integrators.compile.c_functions import OBSERVER, c_function, data
from integrators.compile.function_keys import function_key
from integrators.compile.printer import ModuleText
from integrators.compile.scene_source import energy_lines, flat_lines
from integrators.core.errors import IntegratorError
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene

ENERGY, INVARIANTS = "energy", "invariants"

FORMULAS = '''\
"""Observed quantities of a scene.

{state}
"""

{imports}
from integrators.compile.c_functions import OBSERVER
from integrators.compile.machine import in_c, stack

{constants}
'''

UNWRITTEN = np.uint64(0x7FF8_0000_0B5E_27ED)
"""The bits of the nan that stands for a value until a function has given it."""


@dataclass(frozen=True)
class UserFunction:
    """A function of the user, equal to others with the same machine code."""

    key: Hashable
    function: Callable[..., object] = field(compare=False)


class Observers:
    """Compiled functions of (t, y), evaluated together; made by `observers`."""

    def __init__(self, scene: Scene, quantities: Mapping[str, str | Callable[..., object]]):
        self.scene, self.names = scene, tuple(quantities)
        self._quantities = tuple(quantities.values())

    def __repr__(self) -> str:
        return f"<Observers {', '.join(self.names)} on {self.scene.name}>"

    def __reduce__(self) -> tuple[object, ...]:
        return observers, (self.scene, dict(zip(self.names, self._quantities, strict=True)))

    def __len__(self) -> int:
        return len(self.names)

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        """The quantities at a time and a state, (names,); nan for functions that raise an error."""
        state, out = np.array(y, dtype=float), np.full(len(self), UNWRITTEN).view(float)
        if self.address:
            OBSERVER(self.address)(t, data(state), data(out))
        return out

    @property
    def address(self) -> int:
        """The address of the C function ``void (double t, double *y, double *out)``; 0: no quantities.

        The machine code is kept in memory by this object.
        """
        return self._codes[-1].address if self.names else 0

    @cached_property
    def _codes(self) -> tuple[MachineCode, ...]:
        quantities = (x if isinstance(x, str) else UserFunction(function_key(x), x) for x in self._quantities)
        return observer_codes(self.scene, self.names, tuple(quantities))

    def check(self, t: float, y: np.ndarray) -> None:
        """Call the functions of the user once, since the C function cannot raise; refuse those that do."""
        for k in np.flatnonzero(self(t, y).view(np.uint64) == UNWRITTEN):
            function: Any = self._quantities[k]
            try:
                with np.errstate(all="ignore"):
                    getattr(function, "py_func", function)(t, y)
            except Exception as error:
                what = shorten(f"{type(error).__name__}: {error}")
            else:
                what = "an error"
            raise IntegratorError(
                f"observe must have functions with a value at the start, but {self.names[k]} raised {what}"
            )


def observers(scene: Scene, observe: object) -> Observers:
    """Compile the quantities to observe on a scene."""
    quantities: dict[str, str | Callable[..., object]] = {}
    for name, quantity in _pairs(scene, observe):
        if not isinstance(name, str) or not name.isprintable() or not name.strip() or set("/\\<>") & set(name):
            what = "a lambda, which has none" if name == "<lambda>" else shorten(repr(name))
            raise IntegratorError(f"observe must give names, as in {{'radius': function}}, but one was {what}")
        if name in quantities or name in ("t", *scene.variables):
            what = "was there twice" if name in quantities else "is a variable"
            raise IntegratorError(f"observe must have names of their own, but {shorten(name)} {what}")
        quantities[name] = quantity
    formulas = [quantity for quantity in quantities.values() if isinstance(quantity, str)]
    for quantity in formulas:
        if quantity not in (known := [*[ENERGY] * (_with_energy(scene) is not None), *_base(scene).invariants]):
            those, one = shorten(", ".join(known) or "it has none"), shorten(quantity)
            raise IntegratorError(
                f"observe must hold functions, or quantities of {scene.name} ({those}), but one was {one!r}"
            )
    made = Observers(scene, quantities)
    if len(formulas) < len(quantities):
        _ = made.address  # refused here if numba cannot compile it
    return made


def _pairs(scene: Scene, observe: object) -> list[tuple[object, Any]]:
    """Pairs of a name and a quantity."""
    if observe is None:
        return []
    given = observe if isinstance(observe, Sequence) and not isinstance(observe, str) else [observe]
    pairs: list[tuple[object, Any]] = []
    for item in given:
        if item == INVARIANTS and item not in _base(scene).invariants:
            names = dict.fromkeys([*[ENERGY] * scene.is_hamiltonian, *scene.invariants])
            pairs += ((name, name) for name in names if name not in given)
        elif isinstance(item, str):
            pairs.append((item, item))
        elif isinstance(item, Mapping):
            pairs += item.items()
        else:
            pairs.append((getattr(item, "__name__", None), item))
    for name, quantity in pairs:
        if not isinstance(quantity, str) and not (callable(quantity) and isinstance(quantity, Hashable)):
            where = "one" if name is None else f"{shorten(str(name))}"
            raise IntegratorError(
                f"observe must be of names and functions of (t, y), but {where} was {shorten(repr(quantity))}"
            )
    return pairs


def _base(scene: Scene) -> Scene:
    """The scene without effects, whose variables come first in the state."""
    return scene.with_effects() if scene.active else scene


def _with_energy(scene: Scene) -> Scene | None:
    """The scene, or else its base, if it has a Hamiltonian."""
    return next((system for system in (scene, _base(scene)) if system.is_hamiltonian), None)


@lru_cache(maxsize=64)
def observer_codes(
    scene: Scene, names: tuple[str, ...], quantities: tuple[str | UserFunction, ...]
) -> tuple[MachineCode, ...]:
    """The C function, after those that it calls; the machine code of formulas is kept on disk."""
    formulas = {k: quantity for k, quantity in enumerate(quantities) if isinstance(quantity, str)}
    functions = {k: (names[k], x.function) for k, x in enumerate(quantities) if not isinstance(x, str)}
    codes = (_formulas(scene, formulas),) if formulas else ()
    if not functions:
        return codes
    from integrators.compile.user_functions import observer_code  # loads numba

    return *codes, observer_code(functions, scene.dimension, codes[0].address if codes else 0)


def _formulas(scene: Scene, quantities: Mapping[int, str]) -> MachineCode:
    """The C function that writes formulas to an array."""
    writer, lines, base = ModuleText(lanes=True, plain=True), [], _base(scene)
    integrals = {}
    for k, quantity in quantities.items():
        system = _with_energy(scene) if quantity == ENERGY else None
        if system is not None:
            writer.function("energy(y)", "The Hamiltonian at y.", energy_lines(system, writer))
            lines.append(f"out[{k}] = energy(y)")
        else:
            integrals[f"out[{k}]"] = filled(base.invariants[quantity], base)
    lines += flat_lines(scene, integrals, writer)
    writer.function("observe(t, y, out)", "Put the quantities in out.", lines, "@in_c(OBSERVER)")
    return c_function(writer.source(scene, FORMULAS), "observe")
