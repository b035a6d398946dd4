"""Symplectic changes of coordinates y = ψ(z): verification, and application to Hamiltonian systems."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
import sympy

from bseries.exceptions import SeriesError
from bseries.fields.inputs import read_states
from bseries.fields.symbolic.differential_rings import DifferentialRing
from bseries.fields.symbolic.polynomials import TooLarge
from integrators.core.arguments import items
from integrators.core.immutable import ImmutableValue
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

    Attributes:
        old: The blocks of old variables.
        new: The blocks of new variables.
        formulas: The formulas of ψ by the names of old variables.
        positive: The new variables that are positive.

    Example:
        >>> shear = CoordinateChange({"p": 1, "q": 1}, {"P": 1, "Q": 1}, {"p": "P + sin(Q)", "q": "Q"})
        >>> shear.is_symplectic
        True
        >>> CoordinateChange({"p": 1, "q": 1}, {"P": 1, "Q": 1}, {"p": "2*P", "q": "Q"}).is_symplectic
        False
    """

    old: tuple[Block, ...]
    new: tuple[Block, ...]
    formulas: Mapping[str, sympy.Expr]
    parameters: tuple[str, ...]
    positive: tuple[str, ...]

    def __init__(
        self,
        old: Scene | Mapping[str, Any],
        new: Mapping[str, Any],
        formulas: Mapping[str, Any],
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
    def _data(self) -> tuple[Any, ...]:
        return self.old, self.new, tuple(self.formulas.items()), self.parameters, self.positive

    def __repr__(self) -> str:
        return f"<CoordinateChange from {', '.join(names_of(self.new))} to {', '.join(names_of(self.old))}>"

    def __str__(self) -> str:
        return "\n".join(f"{name} = {formula}" for name, formula in self.formulas.items())

    @cached_property
    def symbols(self) -> tuple[sympy.Symbol, ...]:
        """The new variables as SymPy symbols."""
        return tuple(map(sympy.Symbol, names_of(self.new)))

    def with_parameters(self, /, **values: Any) -> CoordinateChange:
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
        pairs = [(p, q) for p, q in zip(*(range(block.offset, block.end) for block in self.new), strict=True)]
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
            >>> import sympy
            >>> p, q = sympy.symbols("p q")
            >>> angles = {"p": "sqrt(2*a)*cos(theta)", "q": "sqrt(2*a)*sin(theta)"}
            >>> change = CoordinateChange({"p": 1, "q": 1}, {"a": 1, "theta": 1}, angles)
            >>> change.composed((p**2 + q**2) / 2)
            a
        """
        others = {str(symbol) for symbol in formula.free_symbols} - set(names_of(self.old))
        shared = sorted(others & set(names_of(self.new)))
        if shared:
            raise SeriesError(f"new must have names of its own, but {shared[0]} is also a symbol in {formula!s:.60}")
        signed = {sympy.Symbol(name): sympy.Symbol(name, positive=True) for name in self.positive}
        psi = {sympy.Symbol(name): value.xreplace(signed) for name, value in self.formulas.items()}
        plain = {symbol: name for name, symbol in signed.items()}
        symbols = [signed.get(symbol, symbol) for symbol in self.symbols]
        return simplified_inside_out(formula.xreplace(psi), symbols).xreplace(plain)

    def hamiltonian(self, scene: Scene, *, start: Mapping[str, Any] | None = None) -> Scene:
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

    def to_old(self, z: Any) -> np.ndarray:
        """Evaluate ψ(z) at one point (variables,) or many (variables, n).

        Raises:
            SeriesError: `z` has the wrong shape, or a parameter is a symbol.
        """
        states, shape = read_states(z, len(self.symbols))
        return self._evaluated(states)[0].T.reshape(shape)

    def to_new(self, y: Any, near: Any) -> np.ndarray:
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
            columns = [np.broadcast_to(column, len(z)) for column in self._functions(*z.T)]
        values = np.array(columns, float).T
        return values[:, :size], values[:, size:].reshape(-1, size, size)

    @cached_property
    def _functions(self) -> Callable[..., list[Any]]:
        """The entries of ψ and, row by row, of ψ' as functions of NumPy's arrays."""
        if self.parameters:
            raise SeriesError(f"parameters must be numbers, but {self.parameters[0]} is a symbol: see with_parameters")
        rows = list(self.formulas.values())
        derivatives = [row.diff(symbol) for row in rows for symbol in self.symbols]
        return sympy.lambdify(self.symbols, rows + derivatives, "numpy", cse=True, dummify=True)


MOST_MONOMIALS = 10_000
"""Formulas with more monomials are not simplified."""


def simplified(formula: sympy.Expr, symbols: Sequence[sympy.Symbol]) -> sympy.Expr:
    """Simplify a formula: factored, with sin² + cos² = 1; very long formulas are unchanged."""
    try:
        ring = DifferentialRing([formula], symbols, limit=MOST_MONOMIALS)
        return ring.to_expression(ring.elements[0])
    except TooLarge:
        return formula


def simplified_inside_out(formula: Any, symbols: Sequence[sympy.Symbol]) -> Any:
    """Simplify a formula from the innermost arguments outwards, as √(x² + y²) needs; factored, or a sum if shorter."""

    def inner(part: Any) -> Any:
        return part.func(*(simplified(argument, symbols) for argument in part.args))

    def is_opaque(part: Any) -> bool:
        return bool(part.is_Function or (part.is_Pow and not part.exp.is_Integer))

    factored: Any = simplified(formula.replace(is_opaque, inner), symbols)
    return min(sympy.expand_mul(factored), factored, key=sympy.count_ops)


def read_pair(blocks: Any, argument: str) -> tuple[Block, Block]:
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


def sizes(pair: Sequence[Block]) -> dict[str, Any]:
    """The sizes of blocks, as `Scene` takes them, in the order of the state."""
    return {block.name: block.size for block in sorted(pair, key=lambda block: block.offset)}


def names_of(pair: Sequence[Block]) -> tuple[str, ...]:
    """The names of all variables, in the order of the state."""
    return tuple(name for block in sorted(pair, key=lambda block: block.offset) for name in block.variables)


def check_mapping(formulas: Any, names: Sequence[str], argument: str) -> None:
    """Check that a mapping has a formula for each name, and no others."""
    keys = list(formulas) if isinstance(formulas, Mapping) else None
    if keys is None or set(keys) != set(names):
        was = repr(formulas) if keys is None else f"for {', '.join(map(str, keys)) or 'none'}"
        raise SeriesError(f"{argument} must have a formula for each of {', '.join(names):.60}, but was {was:.60}")


MOST_STEPS = 200
CONVERGED = 1e-8
"""Newton's method has converged if its step is smaller; it continues until steps no longer decrease."""
CONTINUATIONS = (1, 8, 64)
"""The numbers of steps of the continuation, tried in this order: of 2,000 points near a small denominator, 75 would
reach another solution without, and 45 with 8 steps at most."""


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


def continued(shift: Equations, origin: np.ndarray) -> np.ndarray:
    """Solve x + g(x) = origin at each row, for the solution that continues the identity; nan where that fails.

    The equations have other solutions far away. The wanted one is followed in x + s·g(x) = origin from s = 0 to 1, with
    Newton steps that at least halve. If a continuation fails, one with more steps is tried; in the end, plain Newton
    steps.

    References:
        P. Deuflhard, *Newton Methods for Nonlinear Problems*, section 5.1 (continuation with the monotonicity test).
    """
    x, identity = np.full_like(origin, np.nan), np.eye(origin.shape[1])
    for count, growth in [*((count, 0.5) for count in CONTINUATIONS), (1, np.inf)]:
        rest = np.flatnonzero(np.isnan(x).any(axis=1))
        found = origin[rest]
        for share in np.arange(1, count + 1) / count:

            def equations(
                z: np.ndarray, k: np.ndarray, share: float = share, at: np.ndarray = rest
            ) -> tuple[np.ndarray, np.ndarray]:
                value, matrix = shift(z, at[k])
                return z + share * value - origin[at[k]], identity + share * matrix

            found = newton(equations, found, growth)
        x[rest] = found
    return x
