"""Symplectic methods as stages with kicks and drifts, and the condition for a generating function.

With a stage for each point and each part H^k of the Hamiltonian evaluated there,

    P_i = p − h Σ_j a_ij H^j_q(P_j, Q_j),    Q_i = q + h Σ_j â_ij H^j_p(P_j, Q_j),

and the step has the same form with the weights b and b̂. It is symplectic if b_i â_ij + b̂_j a_ji = b_i b̂_j for kicks
i and drifts j, and b_i = b̂_i for stages with both (HLW, theorems VI.4.3 and VI.4.6, for any number of parts).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import sympy

from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.exact.entries import Entry, cancels, multiply_entries, sum_entries
from integrators.methods.programs.evaluations import Evaluation, Field, Flow, LinearForm
from integrators.methods.programs.program import Method
from integrators.scenes.particles.expansion import flat_hamiltonian
from integrators.scenes.particles.parts import Parts, Piece, pieces_of
from integrators.scenes.scene import Scene

Multiples = Mapping[int, Entry]  # the factors of h H_q or h H_p at a stage in the evaluations k_e of a program


class Stage(NamedTuple):
    """Stage: a part of the Hamiltonian, evaluated at a point."""

    hamiltonian: sympy.Expr
    kicks: bool  # whether H depends on positions and so changes momenta
    drifts: bool  # whether H depends on momenta and so changes positions
    at: LinearForm
    forces: Multiples  # the evaluations that are multiples of −h H_q
    velocities: Multiples  # the evaluations that are multiples of h H_p
    number: int  # of the stage in the method


class Stages(NamedTuple):
    """Stages of a symplectic method, and the end point of its step."""

    stages: tuple[Stage, ...]
    end: LinearForm

    def weight(self, stage: Stage) -> Entry:
        """The weight b_i or b̂_i of the Hamiltonian at a stage."""
        return entry(self.end, stage.forces if stage.kicks else stage.velocities)


def entry(at: LinearForm, multiples: Multiples) -> Entry:
    """The factor of the increment of a stage in a point."""
    return sum_entries(multiply_entries(at.terms[e], multiple) for e, multiple in multiples.items() if e in at.terms)


def canonical_pairs(scene: Scene) -> list[tuple[int, int]]:
    """The indices of p_i and q_i in the state; the scene must be Hamiltonian and canonical."""
    pair = scene.canonical_pair
    if not scene.is_hamiltonian or pair is None:
        raise SeriesError(f"scene must be Hamiltonian in canonical variables p and q, but {scene.name} is not")
    return list(zip(range(pair[0].offset, pair[0].end), range(pair[1].offset, pair[1].end), strict=True))


def symplectic_stages(method: Method, scene: Scene, parts: Parts | None = None) -> Stages:
    """The stages of a symplectic method on a canonical Hamiltonian scene."""
    canonical_pairs(scene)
    program = check_method(method).program
    if method.domain in ("decimal", "float"):
        raise SeriesError(f"method must be exact, but the coefficients of {method.name} are decimals")
    pieces = pieces_of(method.names, scene, parts)
    groups: dict[tuple[str | None, LinearForm], list[int]] = {}
    for e, evaluation in enumerate(program.evaluations):
        if not isinstance(evaluation, Field | Flow) or (isinstance(evaluation, Flow) and evaluation.forcing):
            raise SeriesError(f"method must evaluate the field itself only, but k{e + 1} of {method.name} does not")
        groups.setdefault((_piece(evaluation, pieces).part, evaluation.at), []).append(e)
    size = len(method.names) if isinstance(method, RungeKutta | PartitionedRungeKutta) else 1
    found: list[Stage] = []
    for (part, at), members in groups.items():  # stages for T(p), U(q) and the remaining terms of a part
        evaluations = {e: program.evaluations[e] for e in members}
        forces, velocities = (
            {
                e: evaluation.time if isinstance(evaluation, Flow) else Fraction(1)
                for e, evaluation in evaluations.items()
                if (covered := _piece(evaluation, pieces).blocks) is None or block.name in covered
            }
            for block in scene.canonical_pair or ()
        )
        separated = list(_separated(scene, part))
        kicking = any(forces and kicks for _, kicks, _ in separated)
        drifting = any(velocities and drifts for _, _, drifts in separated)
        both = any(kicks and drifts for _, kicks, drifts in separated) or (kicking and drifting)
        first = members[0]
        if both and any(isinstance(evaluation, Flow) for evaluation in evaluations.values()):
            raise SeriesError(f"method must have flows that kick or drift, but k{first + 1} of {method.name} does both")
        for formula, kicks, drifts in separated:
            if (forces and kicks) or (velocities and drifts):
                found.append(Stage(formula, kicks, drifts, at, forces, velocities, first // size + 1))
    stages = Stages(tuple(found), program.result)
    _check_symplectic(stages, method)
    return stages


def _piece(evaluation: Evaluation, pieces: Sequence[Piece]) -> Piece:
    return Piece() if evaluation.part is None else pieces[evaluation.part]


def _separated(scene: Scene, part: str | None) -> Iterator[tuple[sympy.Expr, bool, bool]]:
    """T(p), U(q), mixed terms and constant of (a part of) a Hamiltonian, with their dependence on q and on p."""
    momenta, positions = (
        {scene.symbols[place] for place in places} for places in zip(*canonical_pairs(scene), strict=True)
    )
    summands = [summand for summand in scene.summands if part in (None, summand.part)]
    energy = flat_hamiltonian(summands, scene) or sympy.Integer(0)
    sums: dict[tuple[bool, bool], list[sympy.Expr]] = {}

    def kind(formula: sympy.Expr) -> tuple[bool, bool]:
        return bool(formula.free_symbols & positions), bool(formula.free_symbols & momenta)

    for summand in sympy.Add.make_args(energy):
        pieces = sympy.Add.make_args(summand.expand()) if all(kind(summand)) else (summand,)
        for piece in pieces:
            sums.setdefault(kind(piece), []).append(piece)
    for (kicks, drifts), terms in sums.items():
        yield sympy.Add(*terms), kicks, drifts


def energy_constant(scene: Scene) -> sympy.Expr:
    """The constant terms of a Hamiltonian, which the stages lack."""
    return sympy.Add(*(formula for formula, kicks, drifts in _separated(scene, None) if not (kicks or drifts)))


def _check_symplectic(stages: Stages, method: Method) -> None:
    """Check the conditions for a generating function."""
    if isinstance(method, RungeKutta | PartitionedRungeKutta) and method.is_symplectic:
        return
    equal, pairs = "b_i = b̂_i", "b_i â_ij + b̂_j a_ji = b_i b̂_j"
    if isinstance(method, RungeKutta):
        pairs = "b_i a_ij + b_j a_ji = b_i b_j"
    end = stages.end
    for one in stages.stages:
        b = entry(end, one.forces)
        if one.kicks and one.drifts and not cancels((b, -entry(end, one.velocities)), 0):
            raise _not_symplectic(method, equal, f"i = {one.number}, where H depends on p and q")
        for other in stages.stages:
            if not (one.kicks and other.drifts):
                continue
            b_hat = entry(end, other.velocities)
            products = (
                multiply_entries(b, entry(one.at, other.velocities)),
                multiply_entries(b_hat, entry(other.at, one.forces)),
                -multiply_entries(b, b_hat),
            )
            if not cancels(products, 0):
                raise _not_symplectic(method, pairs, f"i = {one.number}, j = {other.number}")


def _not_symplectic(method: Method, condition: str, where: str) -> SeriesError:
    return SeriesError(f"method must be symplectic, but {method.name} is not: {condition} does not hold for {where}")
