"""Runs of a scene with and without effects, and how far they are apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from .distances import energy_size, relative_change, relative_distance
from .effect_report import Influence

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.base import Scene

    from ..coefficients import Method
    from .effect_variants import EffectVariants, Names

LOOKS = 1000
"""At about how many times two runs are compared."""
PIECES = 4
"""Of a method of order p this shows 1 − 4^(−p) of its error: 3/4 of it at least."""


class EffectRuns:
    """Runs of one method from one start, each with some of the effects; none is made twice.

    Args:
        variants: The scene.
        method: The method.
        h: The step size.
        steps: How many steps.
        options: Further options of `integrate`.
        progress: Called with the number of steps made and of all, in all runs.
    """

    def __init__(
        self,
        variants: EffectVariants,
        method: Method | str,
        h: float,
        steps: int,
        options: Mapping[str, Any],
        progress: Callable[[int, int], object] | None = None,
    ):
        self.variants, self.method, self.h, self.steps = variants, method, h, steps
        self._options, self._progress = dict(options), progress
        self._known: dict[Names, np.ndarray | None] = {}
        self._made = 0

    @property
    def needed(self) -> set[Names]:
        """The effects that are on in the runs that tell all influences, but for that with pieces of a step."""
        names = self.variants.names
        return {names, (), *((name,) for name in names), *(self.variants.without(name) for name in names)}

    def own_error(self) -> Influence:
        """The error of the method with all effects: what steps cut into pieces would change.

        Raises:
            StepError: A step failed.
        """
        names = self.variants.names
        self._known[names] = self._states(names)
        return self._apart(names, self._known[names], names, self._states(names, pieces=PIECES))

    def alone(self, name: str) -> Influence:
        """What an effect does in the scene that has no other."""
        return self._apart((name,), self.run((name,)), (), self.run(()))

    def without(self, *left_out: str) -> Influence:
        """What leaving some out of all effects does."""
        more, less = self.variants.names, self.variants.without(*left_out)
        return self._apart(more, self.run(more), less, self.run(less))

    def run(self, names: Names) -> np.ndarray | None:
        """The states of a run; None if a step failed, as without a potential that keeps bodies apart."""
        from integrators.steppers.states import StepError

        if names not in self._known:
            try:
                self._known[names] = self._states(names)
            except StepError:
                self._known[names] = None
        return self._known[names]

    def _states(self, names: Names, pieces: int = 1) -> np.ndarray:
        """The states at the times of comparison, (variables, times), by steps that are cut into pieces."""
        from integrators.loop import integrate

        scene, every = self.variants.build(names), -(-self.steps // LOOKS)  # rounded up
        options = {**self._options, "parts": self.variants.parts(self._options.get("parts"), scene)}
        h, steps, save_every = self.h / pieces, self.steps * pieces, every * pieces
        try:
            return integrate(
                scene, self.method, h=h, steps=steps, save_every=save_every, progress=self._show, **options
            ).y
        finally:
            self._made += steps

    def _show(self, done: int, total: int) -> None:
        """Say how many steps of all runs are made; those that a recommendation takes are not known before."""
        if self._progress is not None:
            known = self.steps * (len(self.needed) + PIECES)
            self._progress(self._made + done, max(known, self._made + total))

    def _apart(self, more: Names, first: np.ndarray | None, less: Names, second: np.ndarray | None) -> Influence:
        """How far two runs are apart, the second one with the same effects or fewer: what overflows is infinite."""
        import numpy as np

        base = self.variants.build(less).with_effects()
        if first is None or second is None:
            return Influence(inf, inf if base.is_hamiltonian else None)
        at_first, at_second = self.variants.shared(more, less)
        y, z = first[at_first], second[at_second]
        with np.errstate(over="ignore", invalid="ignore"):
            distance = relative_distance(z, y)
            change = None
            if base.is_hamiltonian:
                without, with_more = (x[: base.dimension] for x in (z, y))
                size = energy_size(base, with_more[:, 0])
                change = relative_change(_energies(base, without), size, _energies(base, with_more))
        return Influence(_infinite_unless_finite(distance), None if change is None else _infinite_unless_finite(change))


def _infinite_unless_finite(value: float) -> float:
    return value if isfinite(value) else inf


def _energies(scene: Scene, y: np.ndarray) -> np.ndarray:
    """The Hamiltonian of a scene, whose variables come first in any state, at many states."""
    import numpy as np

    from integrators.observers import observers

    energy = observers(scene, "energy")
    return np.array([energy(0.0, state)[0] for state in y.T])
