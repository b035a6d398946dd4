"""Symplectic changes of coordinates y = ψ(z): from formulas, of positions, by generating functions, to angles."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import TypeAlias

import numpy as np
import sympy
from numpy.typing import ArrayLike
from sympy.solvers.solveset import NonlinearError

from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.inputs import Formula, read_states
from bseries.fields.polynomials import TooLarge
from bseries_base.formulas import formula_text
from integrators.core.arguments import items
from integrators.core.immutable import ImmutableValue
from integrators.exact.functions import as_function
from integrators.scenes.model.blocks import Block, canonical_blocks, check_symbols, poisson_matrix, read_blocks
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene

Equations: TypeAlias = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Functions from rows x, and their numbers among all points, to f(x) and the matrices f'(x)."""


class CoordinateChange(ImmutableValue):
    """Change of coordinates y = ψ(z), from new coordinates z = (P, Q) to old coordinates y = (p, q).

    Args:
        old: A scene, or the blocks of its variables, as `Scene` takes them: the momenta p and the positions q.
        new: The blocks of the new variables.
        formulas: A map from every old variable to a formula in the new ones.
        parameters: The names of parameters in formulas.
        positive: The new variables that are positive, such as a radius.

    Raises:
        SeriesError: A formula is missing, or the numbers of new and old variables differ.
        IntegratorError: A formula is invalid, or uses other names.

    Example:
        >>> import bseries as bs
        >>> shear = bs.hamiltonians.CoordinateChange({"p": 1, "q": 1}, {"P": 1, "Q": 1}, {"p": "P + sin(Q)", "q": "Q"})
        >>> shear.is_symplectic
        True
        >>> bs.hamiltonians.CoordinateChange({"p": 1, "q": 1}, {"P": 1, "Q": 1}, {"p": "2*P", "q": "Q"}).is_symplectic
        False
    """

    old: tuple[Block, ...]
    new: tuple[Block, ...]
    formulas: Mapping[str, sympy.Expr]
    parameters: tuple[str, ...]
    positive: tuple[str, ...]

    def __init__(
        self,
        old: Scene | Mapping[str, object],
        new: Mapping[str, object],
        formulas: Mapping[str, object],
        *,
        parameters: Iterable[str] = (),
        positive: Iterable[str] = (),
    ):
        before, after = read_pair(old, "old"), read_pair(new, "new")
        if len(names_of(before)) != len(names_of(after)):
            raise SeriesError(
                f"new must have {len(names_of(before))} variables, as old has, but had {len(names_of(after))}"
            )
        check_mapping(formulas, names_of(before), "formulas")
        parameters, positive = check_symbols(parameters, "parameters"), tuple(items(positive, "positive"))
        unknown = [name for name in positive if name not in names_of(after)]
        if unknown:
            raise SeriesError(f"positive must be new variables, but {unknown[0]!r:.60} is none")
        taken = [name for name in parameters if name in (*names_of(before), *names_of(after))]
        if taken:
            raise SeriesError(f"parameters must have names of their own, but {taken[0]:.60} is a variable")
        known = (*names_of(after), *parameters)
        read = {name: read_formula(formulas[name], known, f"formulas.{name}") for name in names_of(before)}
        self.__dict__.update(old=before, new=after, formulas=read, parameters=parameters, positive=positive)

    @property
    def _data(self) -> tuple[object, ...]:
        return self.old, self.new, tuple(self.formulas.items()), self.parameters, self.positive

    def __repr__(self) -> str:
        return f"<CoordinateChange from {', '.join(names_of(self.new))} to {', '.join(names_of(self.old))}>"

    def __str__(self) -> str:
        return "\n".join(f"{name} = {formula_text(formula)}" for name, formula in self.formulas.items())

    @cached_property
    def symbols(self) -> tuple[sympy.Symbol, ...]:
        """The new variables as SymPy symbols."""
        return tuple(map(sympy.Symbol, names_of(self.new)))

    def with_parameters(self, /, **values: object) -> CoordinateChange:
        """The same change with numbers for parameters.

        Raises:
            SeriesError: A name is not that of a parameter.
        """
        for name in values.keys() - set(self.parameters):
            raise SeriesError(f"parameters must be among {', '.join(self.parameters) or 'none'}, but had {name:.60}")
        return self._filled({name: read_formula(value, (), name) for name, value in values.items()})

    def _filled(self, values: Mapping[str, sympy.Expr]) -> CoordinateChange:
        """The same change with values, numbers or their own symbols, for parameters."""
        known = {sympy.Symbol(name): values[name] for name in self.parameters if name in values}
        formulas = {name: formula.xreplace(known) for name, formula in self.formulas.items()}
        rest = [name for name in self.parameters if name not in values or values[name].free_symbols]
        old, new = sizes(self.old), sizes(self.new)
        return CoordinateChange(old, new, formulas, parameters=rest, positive=self.positive)

    # Symplecticity.

    @cached_property
    def is_symplectic(self) -> bool:
        """Whether ψ'(z) Ω⁻¹ ψ'(z)ᵀ = Ω⁻¹ for all z, so that brackets are preserved."""
        return self._defect is None

    def check(self) -> CoordinateChange:
        """Check symplecticity; returns the change itself.

        Raises:
            SeriesError: The change is not symplectic; the message names a wrong bracket.
        """
        if self._defect is not None:
            pair, bracket, must = self._defect
            raise SeriesError(
                f"formulas must be symplectic, with {{{pair}}} = {must}, but this bracket was {bracket!s:.60}"
            )
        return self

    @cached_property
    def _defect(self) -> tuple[str, sympy.Expr, int] | None:
        """A pair of old variables with a wrong bracket {A, B} = A_Q·B_P − A_P·B_Q, this bracket, and the right one."""
        names, matrix = names_of(self.old), poisson_matrix(self.old)
        pairs = list(zip(*(range(block.offset, block.end) for block in self.new), strict=True))
        try:
            ring = DifferentialRing(self.formulas.values(), self.symbols, limit=MOST_MONOMIALS)
            slopes = [[ring.derivative(x, i) for i in range(len(self.symbols))] for x in ring.elements]
            # Positions first, so that each bracket must be 0 or 1.
            for j, k in combinations([names.index(name) for block in self.old[::-1] for name in block.variables], 2):
                bracket = ring.dot(
                    product
                    for p, q in pairs
                    for product in ((slopes[j][q], slopes[k][p]), (-slopes[j][p], slopes[k][q]))
                )
                if not ring.is_zero(bracket - matrix[j][k]):
                    return f"{names[j]}, {names[k]}", ring.to_expression(bracket), matrix[j][k]
        except TooLarge:
            raise SeriesError(
                f"formulas must be simpler to verify: a bracket would have more than {MOST_MONOMIALS} monomials"
            ) from None
        return None

    # Application.

    def composed(self, formula: sympy.Expr) -> sympy.Expr:
        """The composition F(ψ(z)) with a formula F in old variables.

        Raises:
            SeriesError: A parameter in the formula has the name of a new variable.

        Example:
            >>> import bseries as bs
            >>> import sympy
            >>> p, q = sympy.symbols("p q")
            >>> angles = {"p": "sqrt(2*a)*cos(theta)", "q": "sqrt(2*a)*sin(theta)"}
            >>> change = bs.hamiltonians.CoordinateChange({"p": 1, "q": 1}, {"a": 1, "theta": 1}, angles)
            >>> change.composed((p**2 + q**2) / 2)
            a
        """
        others = {str(symbol) for symbol in formula.free_symbols} - set(names_of(self.old))
        shared = sorted(others & set(names_of(self.new)))
        if shared:
            raise SeriesError(f"new must have names of its own, but {shared[0]} is also a symbol in {formula!s:.60}")
        signed = {sympy.Symbol(name): sympy.Symbol(name, positive=True) for name in self.positive}
        psi = {sympy.Symbol(name): value.xreplace(signed) for name, value in self.formulas.items()}
        symbols = [signed.get(symbol, symbol) for symbol in self.symbols]

        def inner(part: Formula) -> Formula:
            return part.func(*(simplified(argument, symbols) for argument in part.args))

        # Innermost arguments first, as √(x² + y²) needs; factored, or a sum if that is shorter.
        inserted: Formula = formula.xreplace(psi).replace(
            lambda part: part.is_Function or (part.is_Pow and not part.exp.is_Integer), inner
        )
        factored = simplified(inserted, symbols)
        shortest: Formula = min(sympy.expand_mul(factored), factored, key=sympy.count_ops)
        return shortest.xreplace({symbol: name for name, symbol in signed.items()})

    def hamiltonian(self, scene: Scene, *, start: Mapping[str, object] | None = None) -> Scene:
        """The system in new variables: a scene with the Hamiltonian K(z) = H(ψ(z)).

        Args:
            scene: The scene in old variables, which gives the values of parameters.
            start: Initial values in new variables.

        Raises:
            SeriesError: The change is not symplectic, the scene has other variables or no Hamiltonian, or a parameter
                that is a symbol has the name of a new variable.

        References:
            HLW, theorem VI.2.8; E. Hairer, lecture on long-time behaviour, exercise 4.
        """
        self.check()
        if not isinstance(scene, Scene) or read_pair(scene, "scene") != self.old:
            raise SeriesError(f"scene must be one in {', '.join(names_of(self.old)):.60}, but was {scene!r:.60}")
        if scene.hamiltonian is None:
            raise SeriesError(f"scene must have a Hamiltonian, but {scene.name} has none")
        # Parameters get values before z is inserted: a new variable may have the name of a parameter.
        energies = {"": scene.hamiltonian} | {k: filled(v, scene) for k, v in scene.invariants.items()}
        psi = self._filled(scene.parameter_values)
        new = {name: psi.composed(formula) for name, formula in energies.items()}
        used = {str(symbol) for formula in new.values() for symbol in formula.free_symbols}
        return Scene(
            sizes(self.new),
            hamiltonian=new.pop(""),
            invariants=new,
            parameters={name: name for name in sorted(used - set(names_of(self.new)))},
            positive=self.positive,
            start=start,
            name=f"{scene.name} in {', '.join(names_of(self.new))}",
        )

    def to_old(self, z: ArrayLike) -> np.ndarray:
        """Evaluate ψ(z) at one point (variables,) or many (variables, n).

        Raises:
            SeriesError: `z` has the wrong shape, or a parameter is a symbol.
        """
        states, shape = read_states(z, len(self.symbols))
        return self._evaluated(states)[0].T.reshape(shape)

    def to_new(self, y: ArrayLike, near: ArrayLike) -> np.ndarray:
        """Solve ψ(z) = y by Newton's method.

        Args:
            y: One point (variables,), or many (variables, n).
            near: Initial guesses: one point for all, or one for each.

        Raises:
            SeriesError: An argument has the wrong shape, or the iteration does not converge.
        """
        self.check()
        states, shape = read_states(y, len(self.symbols))
        guesses, _ = read_states(near, len(self.symbols))
        if len(guesses) not in (1, len(states)):
            raise SeriesError(f"near must be one point or {len(states)}, but was {len(guesses)}")

        def equations(z: np.ndarray, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, jacobian = self._evaluated(z)
            return value - states[k], jacobian

        z = newton(equations, np.broadcast_to(guesses, states.shape)).T
        if not np.isfinite(z).all():
            raise SeriesError("near must be closer to the solution, but from there Newton's method did not converge")
        for name, row in zip(names_of(self.new), z, strict=True):
            if name in self.positive and not (row > 0).all():
                raise SeriesError(f"near must be closer to the solution, but from there {name} was not positive")
        return z.reshape(shape)

    def _evaluated(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ψ and the matrix ψ' at each row."""
        size = len(self.symbols)
        with np.errstate(all="ignore"):
            values = np.array([np.broadcast_to(column, len(z)) for column in self._functions(*z.T)], float).T
        return values[:, :size], values[:, size:].reshape(-1, size, size)

    @cached_property
    def _functions(self) -> Callable[..., list[np.ndarray | float]]:
        """The entries of ψ and, row by row, of ψ' as functions of NumPy's arrays."""
        if self.parameters:
            raise SeriesError(f"parameters must be numbers, but {self.parameters[0]} is a symbol: see with_parameters")
        rows = list(self.formulas.values())
        derivatives = [row.diff(symbol) for row in rows for symbol in self.symbols]
        return as_function(self.symbols, rows + derivatives, "numpy")


MOST_MONOMIALS = 10_000  # formulas with more monomials are not simplified


def simplified(formula: Formula, symbols: Sequence[sympy.Symbol]) -> sympy.Expr:
    """Simplify a formula: factored, with sin² + cos² = 1; very long formulas are unchanged."""
    try:
        ring = DifferentialRing([formula], symbols, limit=MOST_MONOMIALS)
        return ring.to_expression(ring.elements[0])
    except TooLarge:
        return formula


def read_pair(blocks: Scene | Mapping[str, object], argument: str) -> tuple[Block, Block]:
    """Read momenta and positions, which must be the only blocks, with the canonical structure."""
    if isinstance(blocks, Scene) and blocks.poisson is not None:
        raise SeriesError(f"{argument} must be canonical, but {blocks.name} has a Poisson structure of its own")
    found = blocks.blocks if isinstance(blocks, Scene) else read_blocks(blocks, argument)
    pair = canonical_blocks(found)
    if pair is None or len(found) != 2:
        names = ", ".join(block.name for block in found)
        raise SeriesError(
            f"{argument} must be momenta and as many positions, with names such as p and q, "
            f"but was {names or 'empty':.60}"
        )
    return pair


def sizes(pair: Sequence[Block]) -> dict[str, int | list[int] | list[str]]:
    """The sizes of blocks, as `Scene` takes them, in the order of the state."""
    return {block.name: block.size for block in sorted(pair, key=lambda block: block.offset)}


def names_of(pair: Sequence[Block]) -> tuple[str, ...]:
    """The names of all variables, in the order of the state."""
    return tuple(name for block in sorted(pair, key=lambda block: block.offset) for name in block.variables)


def check_mapping(formulas: object, names: Sequence[str], argument: str) -> None:
    """Check that a mapping has a formula for each name, and no others."""
    keys = list(formulas) if isinstance(formulas, Mapping) else None
    if keys is None or set(keys) != set(names):
        was = repr(formulas) if keys is None else f"for {', '.join(map(str, keys)) or 'none'}"
        raise SeriesError(f"{argument} must have a formula for each of {', '.join(names):.60}, but was {was:.60}")


MOST_STEPS = 200
CONVERGED = 1e-8  # Newton's method has converged if its step is smaller; it continues until steps no longer decrease


def newton(equations: Equations, start: np.ndarray, growth: float = float("inf")) -> np.ndarray:
    """Solve f(x) = 0 at each row of `start`; nan where a step exceeds the previous one times `growth`, or steps end."""
    x, last = start.copy(), np.full(len(start), np.inf)
    active = np.flatnonzero(np.isfinite(x).all(axis=1))
    for _ in range(MOST_STEPS):
        if not active.size:
            break
        with np.errstate(all="ignore"):
            residual, matrix = equations(x[active], active)
            matrix[np.linalg.det(matrix) == 0] = np.nan
            step = np.linalg.solve(matrix, residual[..., None])[..., 0]
        x[active] -= step
        moved, before = (np.abs(step) / (1 + np.abs(x[active]))).sum(axis=1), last[active]
        done = (moved == 0) | ((moved >= before) & (before < CONVERGED))
        failed = ~done & ~(moved <= growth * before) & ~(before < CONVERGED)
        x[active[failed]] = np.nan
        last[active] = moved
        active = active[~done & ~failed]
    x[active] = np.nan
    return x


def canonical_transformation(
    old: Scene | Mapping[str, object],
    new: Mapping[str, object],
    formulas: Mapping[str, object],
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
        >>> import bseries as bs
        >>> angles = {"p": "sqrt(2*a)*cos(theta)", "q": "sqrt(2*a)*sin(theta)"}
        >>> change = bs.hamiltonians.canonical_transformation({"p": 1, "q": 1}, {"a": 1, "theta": 1}, angles)
        >>> change.hamiltonian(bs.parse_hamiltonian("(p^2 + q^2)/2 + q^4/4")).hamiltonian
        a**2*sin(theta)**4 + a
        >>> wrong = {"p": "a*cos(theta)", "q": "a*sin(theta)"}
        >>> bs.hamiltonians.canonical_transformation({"p": 1, "q": 1}, {"a": 1, "theta": 1}, wrong)
        Traceback (most recent call last):
            ...
        bseries.exceptions.SeriesError: formulas must be symplectic, with {q, p} = 1, but this bracket was a

    References:
        HLW, section VI.5 and theorem VI.2.8; E. Hairer, lecture on long-time behaviour, exercise 4.
    """
    return CoordinateChange(old, new, formulas, parameters=parameters, positive=positive).check()


def point_transformation(
    old: Scene | Mapping[str, object],
    new: Mapping[str, object],
    positions: Mapping[str, object],
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
        >>> import bseries as bs
        >>> new = {"p": ["p_r", "p_phi"], "q": ["r", "phi"]}
        >>> positions = {"q1": "r*cos(phi)", "q2": "r*sin(phi)"}
        >>> polar = bs.hamiltonians.point_transformation({"p": 2, "q": 2}, new, positions, positive=["r"])
        >>> print(polar)
        p1 = (-p_phi*sin(phi) + p_r*r*cos(phi))/r
        p2 = (p_phi*cos(phi) + p_r*r*sin(phi))/r
        q1 = r*cos(phi)
        q2 = r*sin(phi)
        >>> polar.hamiltonian(bs.scene("kepler")).hamiltonian
        p_phi**2/(2*r**2) + p_r**2/2 - 1/r

    References:
        E. Hairer, lecture on long-time behaviour, exercise 3 and (26); HLW, section VI.5.
    """
    parameters = tuple(parameters)
    (p, q), (momenta, places) = _symbols_of(old, new)
    chi = _read_positions(positions, q, (*map(str, places), *parameters))
    solved = _solved(sympy.Matrix(chi).jacobian(places).T, sympy.Matrix(momenta), places, "positions")
    formulas = dict(zip(map(str, (*p, *q)), (*solved, *chi), strict=True))
    return canonical_transformation(old, new, formulas, parameters=parameters, positive=positive)


def generating_transformation(
    old: Scene | Mapping[str, object],
    new: Mapping[str, object],
    S: object,
    *,
    positions: Mapping[str, object] | None = None,
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
        >>> import bseries as bs
        >>> print(bs.hamiltonians.generating_transformation({"p": 1, "q": 1}, {"P": 1, "Q": 1}, "P*q + q^2/2 + sin(P)"))
        p = P + Q - cos(P)
        q = Q - cos(P)
        >>> old, new, S, back = {"p": 1, "q": 1}, {"P": 1, "Q": 1}, "P*exp(q)", {"q": "log(Q)"}
        >>> print(bs.hamiltonians.generating_transformation(old, new, S, positions=back, positive=["Q"]))
        p = P*Q
        q = log(Q)

    References:
        HLW, section VI.5.1; E. Hairer, lecture on long-time behaviour, section 5 and exercise 3.
    """
    parameters = tuple(parameters)
    (p, q), (momenta, places) = _symbols_of(old, new)
    variables = [*momenta, *places]
    shared = sorted(map(str, {*p, *q} & {*variables}))
    if shared:
        raise SeriesError(f"new must have other names than old, but both have {shared[0]}")
    given = read_formula(S, (*map(str, (*momenta, *q)), *parameters), "S")
    relations = [given.diff(momentum) for momentum in momenta]
    if positions is None:
        equations = [relation - place for relation, place in zip(relations, places, strict=True)]
        try:
            solution = _solved(*sympy.linear_eq_to_matrix(equations, q), variables, "S")
        except NonlinearError:
            raise SeriesError(
                "positions must be given where S is not quadratic in the old positions, but were not"
            ) from None
    else:
        solution = _read_positions(positions, q, (*map(str, variables), *parameters))
    values = dict(zip(q, solution, strict=True))
    for relation, place in zip(relations, places, strict=True):
        rest = simplified(relation.xreplace(values) - place, variables)
        if rest != 0:
            raise SeriesError(f"positions must solve {place} = {relation!s:.60}, but leave {rest!s:.60}")
    old_momenta = [simplified(given.diff(at).xreplace(values), variables) for at in q]
    formulas = dict(zip(map(str, (*p, *q)), (*old_momenta, *solution), strict=True))
    return canonical_transformation(old, new, formulas, parameters=parameters, positive=positive)


def harmonic_action_angle(
    old: Scene | Mapping[str, object],
    new: Mapping[str, object],
    frequencies: Sequence[object],
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
        >>> import bseries as bs
        >>> change = bs.hamiltonians.harmonic_action_angle({"p": 1, "q": 1}, {"a": 1, "theta": 1}, [2])
        >>> print(change)
        p = 2*sqrt(a)*cos(theta)
        q = sqrt(a)*sin(theta)
    """
    parameters = tuple(parameters)
    (p, q), (actions, angles) = _symbols_of(old, new)
    if isinstance(frequencies, str) or not isinstance(frequencies, Sequence) or len(frequencies) != len(p):
        raise SeriesError(f"frequencies must be {len(p)}, one for each pair of variables, but were {frequencies!r:.60}")
    formulas: dict[str, sympy.Expr] = {}
    for k, value in enumerate(frequencies):
        omega = read_formula(value, parameters, f"frequencies[{k + 1}]")
        if not omega or omega.is_negative:
            raise SeriesError(f"frequencies must be positive, but one was {omega}")
        root, scale = sympy.sqrt(2) * sympy.sqrt(actions[k]), sympy.sqrt(omega)
        formulas[str(p[k])] = root * scale * sympy.cos(angles[k])
        formulas[str(q[k])] = root / scale * sympy.sin(angles[k])
    return canonical_transformation(old, new, formulas, parameters=parameters, positive=map(str, actions))


def _symbols_of(old: Scene | Mapping[str, object], new: Mapping[str, object]) -> Iterator[list[list[sympy.Symbol]]]:
    """The symbols of p and q, and those of P and Q."""
    before, after = read_pair(old, "old"), read_pair(new, "new")
    size, found = len(before[1].variables), len(after[1].variables)
    if size != found:
        raise SeriesError(f"new must have {size} positions, as old has, but had {found}")
    for pair in (before, after):
        yield [list(map(sympy.Symbol, block.variables)) for block in pair]


def _read_positions(
    positions: Mapping[str, object], q: Sequence[sympy.Symbol], known: Sequence[str]
) -> list[sympy.Expr]:
    """The formulas of the old positions in new variables."""
    check_mapping(positions, list(map(str, q)), "positions")
    return [read_formula(positions[str(x)], known, f"positions.{x}") for x in q]


def _solved(
    matrix: sympy.Matrix, right: sympy.Matrix, symbols: Sequence[sympy.Symbol], argument: str
) -> list[sympy.Expr]:
    """Solve a linear system; the solution is simplified."""
    determinant = simplified(matrix.det(method="berkowitz"), symbols)
    if determinant == 0:
        raise SeriesError(f"{argument} must determine new coordinates, but a determinant vanishes for all of them")
    return [simplified(value, symbols) for value in matrix.adjugate() * right / determinant]
