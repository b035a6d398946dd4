"""Symplectic changes of coordinates y = ψ(z): verified, and applied to Hamiltonian systems."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from bseries.exceptions import SeriesError
from bseries.fields.inputs import read_states
from bseries.fields.symbolic.differential_rings import DifferentialRing
from bseries.fields.symbolic.sparse_polynomials import TooLarge
from bseries.hamiltonians.action_angle.variable_pairs import (
    MOST_MONOMIALS,
    check_mapping,
    names_of,
    read_pair,
    simplified_from_within,
    sizes,
)
from integrators.core.arguments import items
from integrators.core.immutable import ImmutableValue
from integrators.scenes.model.blocks import Block, check_symbols, poisson_matrix
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    import sympy


MOST_STEPS = 50
SETTLED = 1e-10
"""An iteration that moves by less has converged; it goes on until it comes no nearer."""


class CoordinateMaps:
    """ψ and its inverse for arrays (variables,) or (variables, n).

    Args:
        formulas: ψ.
        symbols: The variables z.
        brackets: Ω⁻¹ of the new variables, their brackets among themselves.
        inverse: Ω of the old variables, the inverse of their brackets.
    """

    def __init__(
        self,
        formulas: Iterable[sympy.Expr],
        symbols: Sequence[sympy.Symbol],
        brackets: Sequence[Sequence[int]],
        inverse: Sequence[Sequence[int]],
    ):
        import sympy

        self._size = len(symbols)
        self._brackets, self._inverse = np.array(brackets, float), np.array(inverse, float)
        rows = list(formulas)
        slopes = [row.diff(symbol) for row in rows for symbol in symbols]
        self._psi, self._slopes = (
            sympy.lambdify(symbols, entries, "numpy", cse=True, dummify=True) for entries in (rows, slopes)
        )

    def to_old(self, z: Any) -> np.ndarray:
        """ψ(z)."""
        states, shape = read_states(z, self._size)
        return self._value(self._psi, states.T).reshape(shape)

    def to_new(self, y: Any, near: Any) -> np.ndarray:
        """The z with ψ(z) = y, from guesses: one for all, or one for each."""
        states, shape = read_states(y, self._size)
        guesses, _ = read_states(near, self._size)
        if len(guesses) not in (1, len(states)):
            raise SeriesError(f"near must be one point or {len(states)}, but was {len(guesses)}")
        wanted = states.T
        z = np.broadcast_to(guesses.T, wanted.shape).copy()
        moved = np.inf
        for _ in range(MOST_STEPS):
            jacobian = self._value(self._slopes, z).reshape(self._size, *z.shape)
            residual = self._value(self._psi, z) - wanted
            # ψ' is symplectic: its inverse is Ω⁻¹ ψ'ᵀ Ω.
            step = np.einsum("ij,kjn,kl,ln->in", self._brackets, jacobian, self._inverse, residual)
            z -= step
            last, moved = moved, float(np.max(np.abs(step) / (1 + np.abs(z)), initial=0.0))
            if moved == 0 or moved >= last < SETTLED:
                return z.reshape(shape)
        raise SeriesError("near must be closer to the solution, but from there Newton's method did not converge")

    def _value(self, function: Any, z: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.array([np.broadcast_to(entry, z.shape[1:]) for entry in function(*z)], float)


class CoordinateChange(ImmutableValue):
    """A change of coordinates y = ψ(z), from new coordinates z = (P, Q) to old ones y = (p, q).

    Args:
        old: A scene, or the blocks of its variables, as `Scene` takes them: the momenta p and the positions q.
        new: The blocks of the new variables.
        formulas: Maps every old variable to a formula in the new ones.
        parameters: The names of parameters that formulas may use.
        positive: The new variables that are positive, such as a radius.

    Raises:
        SeriesError: A formula is missing, or there are not as many new variables as old ones.
        IntegratorError: A formula is none, or uses other names.

    Attributes:
        old: The blocks of old variables.
        new: The blocks of new variables.
        formulas: ψ by the names of old variables.
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
        import sympy

        return tuple(map(sympy.Symbol, names_of(self.new)))

    def with_parameters(self, /, **values: Any) -> CoordinateChange:
        """The same change with numbers for parameters.

        Raises:
            SeriesError: There is no such parameter.
        """

        unknown = [name for name in values if name not in self.parameters]
        if unknown:
            raise SeriesError(
                f"parameters must be among {', '.join(self.parameters) or 'none'}, but had {unknown[0]:.60}"
            )
        return self._filled({name: read_formula(value, (), name) for name, value in values.items()})

    def _filled(self, values: Mapping[str, sympy.Expr]) -> CoordinateChange:
        """The same change with these values, numbers or their own symbols, for parameters."""
        import sympy

        known = {sympy.Symbol(name): values[name] for name in self.parameters if name in values}
        formulas = {name: formula.xreplace(known) for name, formula in self.formulas.items()}
        rest = [name for name in self.parameters if name not in values or values[name].free_symbols]
        old, new = sizes(self.old), sizes(self.new)
        return CoordinateChange(old, new, formulas, parameters=rest, positive=self.positive)

    # Symplecticity.

    @cached_property
    def is_symplectic(self) -> bool:
        """Whether ψ'(z) Ω⁻¹ ψ'(z)ᵀ = Ω⁻¹ for all z: whether old variables have their brackets in new ones."""
        return self._defect is None

    def check(self) -> CoordinateChange:
        """The change itself.

        Raises:
            SeriesError: It is not symplectic; the message names a bracket that is not what it must be.
        """
        if self._defect is not None:
            pair, bracket, must = self._defect
            raise SeriesError(
                f"formulas must be symplectic, with {{{pair}}} = {must}, but this bracket was {bracket!s:.60}"
            )
        return self

    @cached_property
    def _defect(self) -> tuple[str, sympy.Expr, int] | None:
        """A pair of old variables, their bracket {A, B} = A_Q·B_P − A_P·B_Q, and what it must be."""
        try:
            return self._find_defect()
        except TooLarge:
            raise SeriesError(
                f"formulas must be simpler to verify: a bracket would have more than {MOST_MONOMIALS} monomials"
            ) from None

    def _find_defect(self) -> tuple[str, sympy.Expr, int] | None:

        ring = DifferentialRing.of(self.formulas.values(), self.symbols, limit=MOST_MONOMIALS)
        slopes = [[ring.derivative(x, i) for i in range(len(self.symbols))] for x in ring.elements]
        names, matrix = names_of(self.old), poisson_matrix(self.old)
        momenta, positions = (range(block.offset, block.end) for block in self.new)
        # The positions first, so that each bracket must be 0 or 1.
        for j, k in combinations([names.index(name) for block in self.old[::-1] for name in block.variables], 2):
            left, right = slopes[j], slopes[k]
            forth = ring.dot((left[q], right[p]) for p, q in zip(momenta, positions, strict=True))
            back = ring.dot((left[p], right[q]) for p, q in zip(momenta, positions, strict=True))
            if not ring.is_zero(forth - back - matrix[j][k]):
                return f"{names[j]}, {names[k]}", ring.to_expression(forth - back), matrix[j][k]
        return None

    # Application.

    def composed(self, formula: sympy.Expr) -> sympy.Expr:
        """A formula in old variables, written in new ones: F(ψ(z)).

        Raises:
            SeriesError: A symbol that is no old variable bears the name of a new one.

        Example:
            >>> import sympy
            >>> p, q = sympy.symbols("p q")
            >>> angles = {"p": "sqrt(2*a)*cos(theta)", "q": "sqrt(2*a)*sin(theta)"}
            >>> change = CoordinateChange({"p": 1, "q": 1}, {"a": 1, "theta": 1}, angles)
            >>> change.composed((p**2 + q**2) / 2)
            a
        """
        import sympy

        others = {str(symbol) for symbol in formula.free_symbols} - set(names_of(self.old))
        shared = sorted(others & set(names_of(self.new)))
        if shared:
            raise SeriesError(f"new must have names of its own, but {shared[0]} is also a symbol in {formula!s:.60}")
        signed = {sympy.Symbol(name): sympy.Symbol(name, positive=True) for name in self.positive}
        psi = {sympy.Symbol(name): value.xreplace(signed) for name, value in self.formulas.items()}
        plain = {symbol: name for name, symbol in signed.items()}
        symbols = [signed.get(symbol, symbol) for symbol in self.symbols]
        return simplified_from_within(formula.xreplace(psi), symbols).xreplace(plain)

    def hamiltonian(self, scene: Scene, *, start: Mapping[str, Any] | None = None) -> Scene:
        """The same system in new variables: a scene with the Hamiltonian K(z) = H(ψ(z)).

        Args:
            scene: The scene in old variables. Where formulas have parameters, it tells their values.
            start: Start values in new variables.

        Raises:
            SeriesError: The change is not symplectic, the scene has other variables or no Hamiltonian, or a parameter
                that is a symbol bears the name of a new variable.

        References:
            HLW, theorem VI.2.8; E. Hairer, lecture on long-time behaviour, exercise 4.
        """

        self.check()
        if not isinstance(scene, Scene) or read_pair(scene, "scene") != self.old:
            raise SeriesError(f"scene must be one in {', '.join(names_of(self.old)):.60}, but was {scene!r:.60}")
        if scene.hamiltonian is None:
            raise SeriesError(f"scene must have a Hamiltonian, but {scene.name} has none")
        # All parameters get their values before z comes in: a variable may bear the name of one.
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
        """ψ(z) at one point (variables,) or many (variables, n).

        Raises:
            SeriesError: `z` does not fit, or a parameter has no number.
        """
        return self._maps.to_old(z)

    def to_new(self, y: Any, near: Any) -> np.ndarray:
        """The z with ψ(z) = y, by Newton's method.

        Args:
            y: One point (variables,), or many (variables, n).
            near: Where to look: one point for all, or one for each.

        Raises:
            SeriesError: An argument does not fit, or the iteration does not converge from there.
        """
        self.check()
        z = self._maps.to_new(y, near)
        for name, row in zip(names_of(self.new), z, strict=True):
            if name in self.positive and not (row > 0).all():
                raise SeriesError(f"near must be closer to the solution, but from there {name} was not positive")
        return z

    @cached_property
    def _maps(self) -> CoordinateMaps:

        if self.parameters:
            raise SeriesError(f"parameters must be numbers, but {self.parameters[0]} is a symbol: see with_parameters")
        inverse = [[-x for x in row] for row in poisson_matrix(self.old)]
        return CoordinateMaps(self.formulas.values(), self.symbols, poisson_matrix(self.new), inverse)


def canonical_transformation(
    old: Scene | Mapping[str, Any],
    new: Mapping[str, Any],
    formulas: Mapping[str, Any],
    *,
    parameters: Iterable[str] = (),
    positive: Iterable[str] = (),
) -> CoordinateChange:
    """A symplectic change of coordinates from its formulas, verified.

    Args:
        old: A scene, or the blocks of its variables: the momenta p and the positions q.
        new: The blocks of the new variables.
        formulas: Maps every old variable to a formula in the new ones.
        parameters: The names of parameters that formulas may use.
        positive: The new variables that are positive, such as a radius.

    Raises:
        SeriesError: It is not symplectic, or does not fit.
        IntegratorError: A formula is none.

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
