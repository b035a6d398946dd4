"""Scene as the source of masses, potentials and forces at given positions."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from bseries.exceptions import SeriesError
from integrators import Scene
from integrators.compile.modules import load_module
from integrators.compile.printer import ModuleText
from integrators.compile.scene_source import energy_lines, field_lines
from integrators.scenes.model.blocks import Block
from integrators.scenes.particles.parts import Piece, degrees

FORMULAS = '''\
"""Potentials and their gradients.

{state}
"""

{imports}
from integrators.compile.machine import inlined, kept
{constants}
'''

LOOP = """\
for k in range(positions.shape[0]):
    state[first : first + positions.shape[1]] = positions[k]
    field(state, out)
    for d in range(positions.shape[1]):
        gradients[k, d] = -out[momenta + d]
    potentials[k] = energy(state)"""


class SceneForces:
    """Potentials and their gradients of a scene with H = pᵀM⁻¹p/2 + U(q); others are refused.

    `names` are those of momenta and of positions, and `inverse_masses` is the matrix M⁻¹.
    """

    def __init__(self, scene: Scene):
        self._p, self._q = _blocks(scene)
        self.names = self._p.variables, self._q.variables
        self._module = _module(scene)
        self._state, self._out = np.zeros(scene.dimension), np.empty(scene.dimension)
        units = np.eye(self._p.dimension)
        at_rest = self._velocities(np.zeros(self._p.dimension))
        self.inverse_masses = np.array([self._velocities(unit) - at_rest for unit in units])  # q' is linear in p
        if at_rest.any():
            raise SeriesError(f"scene must have velocities M^-1 p, but those of {scene.name} are not zero for p = 0")

    def _velocities(self, momenta: np.ndarray) -> np.ndarray:
        """q' for given momenta; it does not depend on the positions."""
        self._state[self._p.offset : self._p.end] = momenta
        self._module.field(self._state, self._out)
        self._state[self._p.offset : self._p.end] = 0.0
        return self._out[self._q.offset : self._q.end].copy()

    def __call__(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The gradients (steps, coordinates) and the potentials (steps,) at positions (steps, coordinates)."""
        gradients, potentials = np.empty(positions.shape), np.empty(len(positions))
        places = self._q.offset, self._p.offset
        self._module.sweep(positions, self._state, self._out, *places, gradients, potentials)
        return gradients, potentials


def _blocks(scene: Any) -> tuple[Block, Block]:
    """The blocks of momenta and positions of a scene with a quadratic kinetic energy."""
    if not isinstance(scene, Scene):
        raise SeriesError(f"scene must be a Scene, but was {scene!r:.60}")
    blocks = scene.canonical_pair if scene.is_hamiltonian else None
    if blocks is None:
        raise SeriesError(f"scene must have a Hamiltonian of momenta and positions, but {scene.name} has none")
    momenta, positions = blocks
    of_p, of_q = degrees(scene, [Piece(frozenset({block.name})) for block in blocks])
    if of_p[0] != 0 or of_q[:2] != [1, 0]:
        raise SeriesError(
            f"scene must have the Hamiltonian p^T M^-1 p/2 + U(q) with constant masses, but that of {scene.name} is "
            "another"
        )
    return momenta, positions


def _module(scene: Scene) -> ModuleType:
    """The compiled functions of a scene, with a loop over positions at zero momenta."""
    from integrators.compile import machine

    writer = ModuleText()
    lines = field_lines(scene.numeric_terms, lambda term: term.outputs, range(scene.dimension), writer)
    writer.function("field(y, out)", "Put f(y) in out.", lines, "@kept")
    writer.function("energy(y)", "The Hamiltonian at y.", energy_lines(scene, writer), "@inlined")
    signature = "sweep(positions, state, out, first, momenta, gradients, potentials)"
    writer.function(signature, "Put gradients and potentials in their arrays.", LOOP.split("\n"), "@kept")
    return load_module(writer.source(scene, FORMULAS), helpers=[machine])
