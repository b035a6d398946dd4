"""Canonical transformations from formulas, point transformations, generating functions, action-angle variables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import sympy
from sympy.solvers.solveset import NonlinearError

from bseries.exceptions import SeriesError
from bseries.hamiltonians.action_angle.coordinate_change import (
    CoordinateChange,
    check_mapping,
    names_of,
    read_pair,
    simplified,
)
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.scene import Scene


def canonical_transformation(
    old: Scene | Mapping[str, Any],
    new: Mapping[str, Any],
    formulas: Mapping[str, Any],
    *,
    parameters: Iterable[str] = (),
    positive: Iterable[str] = (),
) -> CoordinateChange:
    """A verified symplectic change of coordinates, from its formulas.

    Args:
        old, new, formulas, parameters, positive: As for `CoordinateChange`.

    Raises:
        SeriesError: The change is not symplectic, or variables do not fit.
        IntegratorError: A formula is invalid.

    Example:
        >>> angles = {"p": "sqrt(2*a)*cos(theta)", "q": "sqrt(2*a)*sin(theta)"}
        >>> change = canonical_transformation({"p": 1, "q": 1}, {"a": 1, "theta": 1}, angles)
        >>> import bseries as bs
        >>> change.hamiltonian(bs.parse_hamiltonian("(p^2 + q^2)/2 + q^4/4")).hamiltonian
        a**2*sin(theta)**4 + a
        >>> canonical_transformation({"p": 1, "q": 1}, {"a": 1, "theta": 1}, {"p": "a*cos(theta)", "q": "a*sin(theta)"})
        Traceback (most recent call last):
            ...
        bseries.exceptions.SeriesError: formulas must be symplectic, with {q, p} = 1, but this bracket was a

    References:
        HLW, section VI.5 and theorem VI.2.8; E. Hairer, lecture on long-time behaviour, exercise 4.
    """
    return CoordinateChange(old, new, formulas, parameters=parameters, positive=positive).check()


def point_transformation(
    old: Scene | Mapping[str, Any],
    new: Mapping[str, Any],
    positions: Mapping[str, Any],
    *,
    parameters: Iterable[str] = (),
    positive: Iterable[str] = (),
) -> CoordinateChange:
    """The symplectic change of coordinates that extends a change of positions q = χ(Q).

    Momenta become P = χ'(Q)ᵀ p; the generating function is p·χ(Q).

    Args:
        old, new, parameters, positive: As for `CoordinateChange`; the new variables are P, Q.
        positions: A map from the old positions to formulas in the new ones.

    Raises:
        SeriesError: The Jacobian matrix is singular everywhere, or positions do not fit.
        IntegratorError: A formula is invalid.

    Example:
        >>> new = {"p": ["p_r", "p_phi"], "q": ["r", "phi"]}
        >>> positions = {"q1": "r*cos(phi)", "q2": "r*sin(phi)"}
        >>> polar = point_transformation({"p": 2, "q": 2}, new, positions, positive=["r"])
        >>> print(polar)
        p1 = (-p_phi*sin(phi) + p_r*r*cos(phi))/r
        p2 = (p_phi*cos(phi) + p_r*r*sin(phi))/r
        q1 = r*cos(phi)
        q2 = r*sin(phi)
        >>> import bseries as bs
        >>> polar.hamiltonian(bs.scene("kepler")).hamiltonian
        p_phi**2/(2*r**2) + p_r**2/2 - 1/r

    References:
        E. Hairer, lecture on long-time behaviour, exercise 3 and (26); HLW, section VI.5.
    """
    before, after = read_pair(old, "old"), read_pair(new, "new")
    check_mapping(positions, before[1].variables, "positions")
    parameters = tuple(parameters)
    known = (*after[1].variables, *parameters)
    chi = [read_formula(positions[name], known, f"positions.{name}") for name in before[1].variables]
    momenta, places = (list(map(sympy.Symbol, block.variables)) for block in after)
    if len(chi) != len(places):
        raise SeriesError(f"new must have {len(chi)} positions, as old has, but had {len(places)}")
    jacobian = sympy.Matrix(chi).jacobian(places)
    solved = _solved(jacobian.T, sympy.Matrix(momenta), places, "positions")
    formulas = dict(zip((*before[0].variables, *before[1].variables), (*solved, *chi), strict=True))
    return canonical_transformation(old, new, formulas, parameters=parameters, positive=positive)


def generating_transformation(
    old: Scene | Mapping[str, Any],
    new: Mapping[str, Any],
    S: Any,
    *,
    positions: Mapping[str, Any] | None = None,
    parameters: Iterable[str] = (),
    positive: Iterable[str] = (),
) -> CoordinateChange:
    """The change of coordinates with a generating function S(P, q): p = ∇_q S, Q = ∇_P S.

    Args:
        old, new, parameters, positive: As for `CoordinateChange`; the new variables P, Q have other names.
        S: A formula in new momenta and old positions; P·q gives the identity.
        positions: The solution q of Q = ∇_P S(P, q), as formulas in P and Q by the names of q; needed for equations
            that are not linear in q.

    Raises:
        SeriesError: `positions` do not solve the equations, or arguments do not fit.
        IntegratorError: A formula is invalid.

    Example:
        >>> print(generating_transformation({"p": 1, "q": 1}, {"P": 1, "Q": 1}, "P*q + q^2/2 + sin(P)"))
        p = P + Q - cos(P)
        q = Q - cos(P)
        >>> S, solution = "P*exp(q)", {"q": "log(Q)"}
        >>> print(generating_transformation({"p": 1, "q": 1}, {"P": 1, "Q": 1}, S, positions=solution, positive=["Q"]))
        p = P*Q
        q = log(Q)

    References:
        HLW, section VI.5.1; E. Hairer, lecture on long-time behaviour, section 5 and exercise 3.
    """
    before, after = read_pair(old, "old"), read_pair(new, "new")
    shared = sorted(set(names_of(before)) & set(names_of(after)))
    if shared:
        raise SeriesError(f"new must have other names than old, but both have {shared[0]}")
    parameters = tuple(parameters)
    given: Any = read_formula(S, (*after[0].variables, *before[1].variables, *parameters), "S")
    momenta, places = (list(map(sympy.Symbol, block.variables)) for block in after)
    q = list(map(sympy.Symbol, before[1].variables))
    if len(q) != len(places):
        raise SeriesError(f"new must have {len(q)} positions, as old has, but had {len(places)}")
    relations = [given.diff(momentum) for momentum in momenta]
    if positions is None:
        equations = [relation - place for relation, place in zip(relations, places, strict=True)]
        try:
            solution = _solved(*sympy.linear_eq_to_matrix(equations, q), [*momenta, *places], "S")
        except NonlinearError:
            raise SeriesError(
                "positions must be given where S is not quadratic in the old positions, but were not"
            ) from None
    else:
        check_mapping(positions, before[1].variables, "positions")
        known = (*names_of(after), *parameters)
        solution = [read_formula(positions[name], known, f"positions.{name}") for name in before[1].variables]
    values = dict(zip(q, solution, strict=True))
    for relation, place in zip(relations, places, strict=True):
        rest = simplified(relation.xreplace(values) - place, [*momenta, *places])
        if rest != 0:
            raise SeriesError(f"positions must solve {place} = {relation!s:.60}, but leave {rest!s:.60}")
    p = [simplified(given.diff(at).xreplace(values), [*momenta, *places]) for at in q]
    formulas = dict(zip((*before[0].variables, *before[1].variables), (*p, *solution), strict=True))
    return canonical_transformation(old, new, formulas, parameters=parameters, positive=positive)


def harmonic_action_angle(
    old: Scene | Mapping[str, Any],
    new: Mapping[str, Any],
    frequencies: Sequence[Any],
    *,
    parameters: Iterable[str] = (),
) -> CoordinateChange:
    """Action-angle variables of H = Σ (p_i² + ω_i² q_i²)/2 = Σ ω_i a_i: p = √(2aω) cos θ, q = √(2a/ω) sin θ.

    Args:
        old, new, parameters: As for `CoordinateChange`; the new blocks are the actions and the angles.
        frequencies: The frequencies ω_i, numbers or formulas in parameters.

    Raises:
        SeriesError: The frequencies or variables do not fit.
        IntegratorError: A frequency is not a formula.

    Example:
        >>> change = harmonic_action_angle({"p": 1, "q": 1}, {"a": 1, "theta": 1}, [2])
        >>> print(change)
        p = 2*sqrt(a)*cos(theta)
        q = sqrt(a)*sin(theta)
    """
    before, after, parameters = read_pair(old, "old"), read_pair(new, "new"), tuple(parameters)
    size = before[0].dimension
    if isinstance(frequencies, str) or not isinstance(frequencies, Sequence) or len(frequencies) != size:
        raise SeriesError(f"frequencies must be {size}, one for each pair of variables, but were {frequencies!r:.60}")
    formulas: dict[str, Any] = {}
    for k, value in enumerate(frequencies):
        omega: Any = read_formula(value, parameters, f"frequencies[{k + 1}]")
        if not omega or omega.is_negative:
            raise SeriesError(f"frequencies must be positive, but one was {omega}")
        a, theta = (sympy.Symbol(block.variables[k]) for block in after)
        root, scale = sympy.sqrt(2) * sympy.sqrt(a), sympy.sqrt(omega)
        formulas[before[0].variables[k]] = root * scale * sympy.cos(theta)
        formulas[before[1].variables[k]] = root / scale * sympy.sin(theta)
    return canonical_transformation(old, new, formulas, parameters=parameters, positive=after[0].variables)


def _solved(matrix: Any, right: Any, symbols: Sequence[Any], argument: str) -> list[Any]:
    """Solve a linear system; the solution is simplified."""
    determinant = simplified(matrix.det(method="berkowitz"), symbols)
    if determinant == 0:
        raise SeriesError(f"{argument} must determine new coordinates, but a determinant vanishes for all of them")
    return [simplified(value, symbols) for value in matrix.adjugate() * right / determinant]
