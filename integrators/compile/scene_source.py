"""Functions of a scene: its field, Hamiltonian and first integrals.

Terms over single variables become scalar code, and terms over particles loops around local formulas. Nothing is
allocated. The text depends on formulas, blocks and numbers only, not on names or on effects that are off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import ModuleType
from typing import Any

import sympy

from integrators.compile.modules import load_module
from integrators.compile.particle_loops import INDICES, SiteSum, entry, zeros
from integrators.compile.printer import KEPT, ModuleText
from integrators.scenes.model.system import LocalTerm, Output, System, output_formula
from integrators.scenes.particles.expansion import constant_terms, filled, flat_hamiltonian


def compiled_scene(scene: System) -> ModuleType:
    """Compile the functions of a scene, or load them from the cache on disk.

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


def scene_source(scene: System) -> str:
    """Write the source of the functions of a scene.

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
    writer = ModuleText()
    field = field_lines(scene.numeric_terms, lambda term: term.outputs, range(scene.dimension), writer)
    writer.function("field(y, out)", "Put f(y) in out.", field)
    if scene.is_hamiltonian:
        writer.function("energy(y)", "The Hamiltonian at y.", energy_lines(scene, writer))
    if scene.invariants:
        total = SiteSum.flat(scene, {k: filled(formula, scene) for k, formula in enumerate(scene.invariants.values())})
        lines = total.lines({k: f"out[{k}] =" for k in total.outputs}, writer)
        writer.function("invariants(y, out)", "Put the first integrals in out.", lines)
    return writer.source(scene)


def field_lines(
    terms: Iterable[LocalTerm],
    outputs: Callable[[LocalTerm], Iterable[Output]],
    entries: Iterable[int],
    writer: ModuleText,
) -> list[str]:
    """Statements for the outputs and entries of a piece of a field: first contributions are assigned, others added."""
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
    return [*zeros(set(entries) - assigned), *lines]


def energy_lines(scene: System, writer: ModuleText) -> list[str]:
    """Statements for the Hamiltonian."""
    if scene.poisson is not None:
        sums = [SiteSum.flat(scene, {"energy": flat_hamiltonian(scene.summands, scene)})]  # local terms give the field
    else:
        constant = SiteSum.flat(scene, {"energy": _constant(scene)})
        sums = gathered(scene.numeric_terms, lambda term: [("energy", term.formula)], constant)
    targets = ({"energy": f"total {sign}"} for sign in ("=", *("+=" for _ in sums[1:])))
    lines = [line for total, target in zip(sums, targets, strict=True) for line in total.lines(target, writer)]
    return [*lines, "return total"]


def _constant(scene: System) -> sympy.Expr:
    """The constant part of the Hamiltonian, which local terms omit because the field does not need it."""
    constants: list[Any] = []
    for term in constant_terms(scene):
        constants += [term.formula.xreplace(term.data_at(row)) for row in term.sites.rows()]
    return sympy.Add(*constants)


def gathered(
    terms: Iterable[LocalTerm], outputs: Callable[[LocalTerm], Iterable[Any]], first: SiteSum | None = None
) -> list[SiteSum]:
    """Sums of terms over the same sites: over single variables, then over each particle, then over several."""
    sums = {} if first is None else {first.sites: first}
    for term in terms:
        sums.setdefault(term.sites, SiteSum(term.sites)).add(term, outputs(term))
    return sorted(sums.values(), key=lambda total: total.sites.roles if total.sites.kind != "table" else len(INDICES))
