"""Rows on modified Hamiltonians: brackets, formulas, values, and what a stored trajectory says of its step."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import bseries as bs

from .kinds import Case
from .scene_cases import per_point
from .timing import Sample, Sampler, time_calls

STATES, ATOM_STEP = 10**6, 0.001


def once(work: Callable[[], object]) -> Callable[[], Sampler]:
    """Work with tables of trees at hand."""

    def prepare() -> Sampler:
        work()
        return lambda: time_calls(work)

    return prepare


def verlet_brackets(order: int, *, quadratic: bool) -> bs.hamiltonians.BracketSeries:
    """The nested brackets of Störmer–Verlet."""
    return bs.hamiltonians.bracket_hamiltonian(bs.method("stormer-verlet-kdk"), order, quadratic_kinetic=quadratic)


def written_out(route: str) -> object:
    """H̃ of the implicit midpoint rule on the pendulum through h^6, simplified."""
    H = bs.modified_hamiltonian(bs.method("implicit-midpoint"), bs.scene("pendulum"), 7, route=route)
    return [H.symbolic(k) for k in range(7)]


def energy(method: str, scene: str, order: int) -> bs.hamiltonians.ModifiedHamiltonian:
    """H̃ of a method on a scene."""
    return bs.modified_hamiltonian(bs.method(method), bs.scene(scene), order)


def stored_trajectory() -> Sampler:
    """Modified energies of order 2 to 8 along a million states of 9 atoms in the plane, read from a file."""
    folder: Any = tempfile.TemporaryDirectory()
    path = Path(folder.name) / "atoms.npz"
    scene = bs.scene("lennard-jones")
    bs.integrate("stormer-verlet", scene, h=ATOM_STEP, steps=STATES - 1, to=path)
    bs.shadow_energy(path, order=8)

    def sample(kept: Any = folder) -> Sample:
        begin = perf_counter()
        bs.shadow_energy(path, order=8)
        return Sample(perf_counter() - begin)

    return sample


def cases() -> list[Case]:
    """All rows."""
    brackets = "brackets of stormer-verlet-kdk through h^8"
    formulas = "H of implicit-midpoint on the pendulum through h^6, written out"
    return [
        Case("brackets-9", f"{brackets}, any T", once(lambda: verlet_brackets(9, quadratic=False)), 10.0),
        Case(
            "brackets-9-quadratic", f"{brackets}, quadratic T", once(lambda: verlet_brackets(9, quadratic=True)), 10.0
        ),
        Case("hamiltonian-7", f"{formulas}, from trees", once(lambda: written_out("trees")), 10.0),
        Case(
            "hamiltonian-7-generated",
            f"{formulas}, from the generating function",
            once(lambda: written_out("generating-function")),
            10.0,
        ),
        Case(
            "hamiltonian-9",
            "H of implicit-midpoint on the pendulum, order 9, per point",
            per_point(lambda: energy("implicit-midpoint", "pendulum", 9)),
            2e-6,
        ),
        Case(
            "hamiltonian-atoms",
            "H of stormer-verlet-kdk on lennard-jones, order 5, per point, N = 9",
            per_point(lambda: energy("stormer-verlet-kdk", "lennard-jones", 5)),
        ),
        Case("shadow-8", "shadow energies to order 8, 9 planar atoms, 10^6 states on disk", stored_trajectory, 2.0),
    ]
