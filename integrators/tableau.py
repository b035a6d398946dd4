"""Runge–Kutta methods and partitioned ones as frozen, validated, exact data."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

from . import entries, structure
from .errors import IntegratorError
from .frozen import Frozen
from .tableau_input import check_label, check_partition_names, read_tableau

if TYPE_CHECKING:
    from typing import Self

    from .entries import Entry
    from .stage_algebra import StageAlgebra

    Row = tuple[Entry, ...]

DOMAINS = ("QQ", "decimal", "algebraic", "symbolic", "float")
"""The domains of entries, each containing those before."""

FLOAT_PRECISION = 2.0**-50


class TableauWarning(UserWarning):
    """A tableau is usable but contradicts itself: a row sum is not its node, or the weights do not sum to 1."""


class RungeKutta(Frozen):
    """A Runge–Kutta method: its Butcher tableau, exact and immutable.

    Entries may be integers, fractions, decimals (``decimal.Decimal`` or text, taken exactly), formulas as text such as
    ``"1/2 - sqrt(3)/6"``, SymPy expressions, or floats. Rational entries become `Fraction`; what is exact but
    irrational stays a SymPy expression; one float makes every entry a float. Symbols are plain ``sympy.Symbol``s,
    without assumptions. Two methods are equal if their entries, domain and digits are; names do not count.

    Args:
        A: the stage matrix, a square array by rows.
        b: the weights.
        c: the nodes; the row sums of A if not given.
        embedded: a second row of weights for error estimates, or a sequence of several; kept as a tuple of rows.
        parameters: the symbols that formulas in text may use.
        name: what messages call the method.
        digits: for a tableau published as decimals, how many significant digits are correct; None if entries are exact.
        reference: where the method was published.
        warn: whether to emit a `TableauWarning` for each of `issues`.

    Raises:
        IntegratorError: sizes do not fit, or an entry is not a finite real number or formula.

    Example:
        >>> midpoint = RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="explicit-midpoint")
        >>> midpoint.A[1][0], midpoint.c, midpoint.is_explicit
        (Fraction(1, 2), (Fraction(0, 1), Fraction(1, 2)), True)
        >>> print(midpoint)
        0   │
        1/2 │ 1/2
        ────┼───────
            │ 0    1

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.1;
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.1.
    """

    name: str
    embedded: tuple[Row, ...]
    digits: int | None
    reference: str | None
    algebra: StageAlgebra | None

    def __init__(
        self,
        A: Any,
        b: Any,
        c: Any = None,
        *,
        embedded: Any = None,
        parameters: Iterable[str] = (),
        name: str | None = None,
        digits: int | None = None,
        reference: str | None = None,
        warn: bool = True,
    ) -> None:
        matrix, weights, nodes, extra = read_tableau(A, b, c, embedded, parameters, digits)
        nodes = tuple(map(entries.sum_entries, matrix)) if nodes is None else nodes
        self.__dict__.update(A=matrix, b=weights, c=nodes, embedded=extra, digits=digits, algebra=None)
        self._label(name, reference)
        if warn:
            _emit(self.issues)

    @classmethod
    def from_algebra(cls, algebra: StageAlgebra, *, name: str | None = None, reference: str | None = None) -> Self:
        """The method that a stage algebra stands for; its tableau is computed, exactly, when asked for.

        Such a method equals another exactly if their algebras are equal. No warnings are emitted; see `issues`.

        Args:
            algebra: node polynomial, stage matrix and weights as rational data.
            name: what messages call the method.
            reference: where the method was published.

        Returns:
            The method.
        """
        method = cls.__new__(cls)
        method.__dict__.update(embedded=(), digits=None, algebra=algebra)
        method._label(name, reference)
        return method

    def _label(self, name: str | None, reference: str | None) -> None:
        check_label(name, "name")
        check_label(reference, "reference")
        self.__dict__.update(name="custom" if name is None else name, reference=reference)

    @property
    def _data(self) -> tuple[Any, ...]:
        if self.algebra is not None:
            return (self.algebra,)
        return self.domain, self.A, self.b, self.c, self.embedded, self.digits

    def __repr__(self) -> str:
        return f"<RungeKutta {self.name}: {self.stages} stage{'s' * (self.stages > 1)}>"

    def __str__(self) -> str:
        from .printing import tableau_text

        return tableau_text(self)

    def _repr_html_(self) -> str:
        from .printing import tableau_html

        return tableau_html(self)

    @cached_property
    def _exact(self) -> tuple[tuple[Row, ...], Row, Row]:
        assert self.algebra is not None
        return self.algebra.tableau_exact()

    @cached_property
    def A(self) -> tuple[Row, ...]:
        """The stage matrix, by rows."""
        return self._exact[0]

    @cached_property
    def b(self) -> Row:
        """The weights."""
        return self._exact[1]

    @cached_property
    def c(self) -> Row:
        """The nodes."""
        return self._exact[2]

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.algebra.stages if self.algebra is not None else len(self.b)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parts: one, without a name."""
        return ("",)

    @property
    def partitions(self) -> tuple[Self]:
        """The parts: the method itself."""
        return (self,)

    @cached_property
    def _entries(self) -> tuple[Entry, ...]:
        return tuple(v for row in (*self.A, self.b, self.c, *self.embedded) for v in row)

    @cached_property
    def domain(self) -> str:
        """The smallest domain that holds the entries: QQ, decimal, algebraic, symbolic or float."""
        if self.algebra is not None:
            return "QQ" if self.algebra.has_rational_nodes else "algebraic"
        domain = entries.find_domain(self._entries)
        return "decimal" if self.digits is not None and domain == "QQ" else domain

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the tableau, sorted."""
        return entries.symbol_names(self._entries) if self.domain == "symbolic" else ()

    @property
    def precision(self) -> Fraction | float:
        """The relative error of the entries: 0 if they are exact."""
        published = Fraction(0) if self.digits is None else Fraction(10, 10**self.digits)
        return max(published, FLOAT_PRECISION) if self.domain == "float" else published

    @cached_property
    def row_sums(self) -> Row:
        """The sums of the rows of A."""
        return tuple(map(entries.sum_entries, self.A))

    @property
    def weight_sum(self) -> Entry:
        """The sum of the weights: 1 for a consistent method."""
        if self.algebra is not None:
            return self.algebra.b[0]
        return entries.sum_entries(self.b)

    @cached_property
    def issues(self) -> tuple[str, ...]:
        """One sentence for each contradiction: a row sum that is not its node, weights that do not sum to 1."""
        return structure.find_issues(self)

    @cached_property
    def _sparsity(self) -> tuple[tuple[bool, ...], ...]:
        """Which entries of A are not zero."""
        return tuple(tuple(entries.cancels([v], self.precision) is not True for v in row) for row in self.A)

    @cached_property
    def _sure_sparsity(self) -> tuple[tuple[bool, ...], ...]:
        """Entries of A that are certainly not zero, found without exact roots."""
        if self.algebra is None:
            return self._sparsity
        return tuple(tuple(abs(v) > 1e-9 for v in row) for row in self.algebra.tableau_float()[0])

    @cached_property
    def is_explicit(self) -> bool:
        """Whether A is strictly lower triangular: every stage is given by those before."""
        return _is_lower(self._sure_sparsity, 0) and _is_lower(self._sparsity, 0)

    @cached_property
    def is_diagonally_implicit(self) -> bool:
        """Whether A is lower triangular but not strictly: the stages are solved for one after another."""
        return _is_lower(self._sure_sparsity, 1) and _is_lower(self._sparsity, 1) and not self.is_explicit

    @cached_property
    def is_symplectic(self) -> bool:
        """Whether b_i a_ij + b_j a_ji = b_i b_j: all quadratic invariants are kept (HLW, Theorems IV.2.2 and VI.4.3).

        The condition is sufficient, and for irreducible methods necessary. It must hold for every value of the symbols.
        """
        return structure.is_symplectic_pair(self, self)

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether the method is its own adjoint by the tableau: a_σ(i)σ(j) + a_ij = b_j (HLW, Theorem V.2.3).

        σ reverses the stages, as they stand or in order of their row sums. The condition is sufficient, and for
        irreducible methods necessary.
        """
        return structure.is_symmetric([self])

    def substitute(self, values: Mapping[str, Any]) -> RungeKutta:
        """The method with values in place of symbols.

        Args:
            values: what to put for some or all of `parameters`: numbers, formulas as text, SymPy expressions.

        Returns:
            A new method.

        Raises:
            IntegratorError: a name is no parameter, or an entry becomes infinite.

        Example:
            >>> family = RungeKutta([["gamma"]], [1], parameters=["gamma"], name="theta")
            >>> family.substitute({"gamma": "1/2"}).A
            ((Fraction(1, 2),),)
        """
        _check_known(values, self.parameters)
        if not values:
            return self
        import sympy

        read = {name: entries.read_entry(value, name, self.parameters) for name, value in values.items()}
        replacements = {sympy.Symbol(name): sympy.sympify(value) for name, value in read.items()}
        table = [
            [entries.substitute(v, replacements, f"{label}[{j}]") for j, v in enumerate(row, 1)]
            for label, row in self._labelled_rows()
        ]
        return self._with(table)

    def to_float(self) -> RungeKutta:
        """The method with every entry rounded to the nearest double.

        Raises:
            IntegratorError: the tableau has symbols without values.
        """
        if self.parameters:
            raise IntegratorError(
                f"parameters must have values before rounding, but {', '.join(self.parameters)} had none"
            )
        if self.algebra is not None:
            a, b, c = self.algebra.tableau_float()
            return self._with([*a, b, c])
        return self._with([map(entries.round_entry, row) for _, row in self._labelled_rows()])

    def _labelled_rows(self) -> list[tuple[str, Row]]:
        """Every row of the tableau with what a message calls it."""
        rows = [(f"A[{i}]", row) for i, row in enumerate(self.A, 1)]
        return [
            *rows,
            ("b", self.b),
            ("c", self.c),
            *((f"embedded[{k}]", row) for k, row in enumerate(self.embedded, 1)),
        ]

    def _with(self, table: Iterable[Iterable[Entry]]) -> RungeKutta:
        """The same method with other entries, in the order of `_labelled_rows`."""
        rows = list(map(tuple, table))
        s = self.stages
        return RungeKutta(
            rows[:s],
            rows[s],
            rows[s + 1],
            embedded=rows[s + 2 :],
            name=self.name,
            digits=self.digits,
            reference=self.reference,
            warn=False,
        )


def _is_lower(sparsity: Sequence[Sequence[bool]], first: int) -> bool:
    """Whether row i is zero from place i + first on."""
    return not any(any(row[i + first :]) for i, row in enumerate(sparsity))


def _check_known(values: Mapping[str, Any], parameters: Sequence[str]) -> None:
    for name in values:
        if name not in parameters:
            known = ", ".join(parameters) or "of which there are none"
            raise IntegratorError(f"values must be for the parameters {known}, but one was for {name!r:.60}")


def _emit(issues: Iterable[str]) -> None:
    """Warn of each issue, at the line that called the constructor."""
    for issue in issues:
        warnings.warn(issue, TableauWarning, stacklevel=3)


def _read_part(name: str, part: Any, parameters: Iterable[str]) -> RungeKutta:
    if isinstance(part, RungeKutta):
        return part
    if not isinstance(part, Mapping) or not {"A", "b"} <= part.keys() <= {"A", "b", "c"}:
        raise IntegratorError(f"partition {name} must be a RungeKutta or have A, b and perhaps c, but was {part!r:.60}")
    try:
        return RungeKutta(**part, parameters=parameters, name=name, warn=False)
    except IntegratorError as error:
        raise IntegratorError(f"partition {name}: {error}") from None


class PartitionedRungeKutta(Frozen):
    """A partitioned Runge–Kutta method: one tableau for each part (colour) of the field, all with the same stages.

    With y split into blocks, or f into a sum, part ν has the stages Y_i = y + h Σ_ν Σ_j a^ν_ij f^ν(Y_j).

    Args:
        partitions: at least two named tableaux, each a `RungeKutta` or a mapping with A, b and perhaps c. Their order
            is that of the colours 0, 1, …; names start with a letter, and t and τ are reserved.
        parameters: the symbols that formulas in text may use.
        name: what messages call the method.
        reference: where the method was published.
        warn: whether to emit a `TableauWarning` for each of `issues`; a part that is a `RungeKutta` has warned itself.

    Raises:
        IntegratorError: fewer than two parts, a bad name, different numbers of stages, or a part that is no tableau.

    Example:
        The Störmer–Verlet method, kick–drift–kick:

        >>> kick = RungeKutta([["1/2", 0], ["1/2", 0]], ["1/2", "1/2"])
        >>> drift = RungeKutta([[0, 0], ["1/2", "1/2"]], ["1/2", "1/2"])
        >>> verlet = PartitionedRungeKutta({"p": kick, "q": drift}, name="stormer-verlet")
        >>> verlet.is_symplectic, verlet.is_symmetric, verlet.is_explicit, verlet.is_explicit_if_separable
        (True, True, False, True)

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.2 and III.2.
    """

    name: str
    names: tuple[str, ...]
    partitions: tuple[RungeKutta, ...]
    reference: str | None

    def __init__(
        self,
        partitions: Mapping[str, RungeKutta | Mapping[str, Any]],
        *,
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        warn: bool = True,
    ) -> None:
        if not isinstance(partitions, Mapping) or len(partitions) < 2:
            raise IntegratorError(f"partitions must map two or more names to tableaux, but was {partitions!r:.60}")
        check_partition_names(partitions)
        parts = tuple(_read_part(key, value, parameters) for key, value in partitions.items())
        names = tuple(partitions)
        for key, part in zip(names, parts, strict=True):
            if part.stages != parts[0].stages:
                raise IntegratorError(
                    f"partitions must have the same number of stages, "
                    f"but {names[0]} has {parts[0].stages} and {key} has {part.stages}"
                )
        if len({part.domain for part in parts} & {"float", "symbolic"}) == 2:
            raise IntegratorError("partitions must not mix floats and symbols, but did")
        check_label(name, "name")
        check_label(reference, "reference")
        self.__dict__.update(
            names=names, partitions=parts, name="custom" if name is None else name, reference=reference
        )
        if warn:
            _emit(issue for key, issue in self._part_issues if not isinstance(partitions[key], RungeKutta))

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.names, self.partitions

    def __repr__(self) -> str:
        stages = f"{self.stages} stage{'s' * (self.stages > 1)}"
        return f"<PartitionedRungeKutta {self.name}: {', '.join(self.names)}, {stages}>"

    def __str__(self) -> str:
        return "\n\n".join(f"{name}:\n{part}" for name, part in zip(self.names, self.partitions, strict=True))

    def _repr_html_(self) -> str:
        return "".join(
            f"<div>{name}</div>{part._repr_html_()}" for name, part in zip(self.names, self.partitions, strict=True)
        )

    @property
    def stages(self) -> int:
        """The number of stages of every part."""
        return self.partitions[0].stages

    @property
    def algebra(self) -> None:
        """None: the parts may have one each."""
        return None

    @property
    def embedded(self) -> tuple[()]:
        """The embedded weights: none."""
        return ()

    @property
    def digits(self) -> int | None:
        """The smallest number of correct digits of a part, None if all are exact."""
        return min((part.digits for part in self.partitions if part.digits is not None), default=None)

    @property
    def domain(self) -> str:
        """The smallest domain that holds the entries of all parts: QQ, decimal, algebraic, symbolic or float."""
        return max((part.domain for part in self.partitions), key=DOMAINS.index)

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in all parts, sorted."""
        return tuple(sorted({name for part in self.partitions for name in part.parameters}))

    @cached_property
    def _part_issues(self) -> tuple[tuple[str, str], ...]:
        pairs = zip(self.names, self.partitions, strict=True)
        return tuple((name, f"partition {name}: {issue}") for name, part in pairs for issue in part.issues)

    @property
    def issues(self) -> tuple[str, ...]:
        """The issues of the parts, each with the name of its part."""
        return tuple(issue for _, issue in self._part_issues)

    @cached_property
    def is_explicit(self) -> bool:
        """Whether every part is explicit, so that nothing needs solving whatever the fields depend on."""
        return all(part.is_explicit for part in self.partitions)

    @cached_property
    def is_explicit_if_separable(self) -> bool:
        """Whether the stages can be computed in some order when no block's field depends on the block itself.

        So it is for the Störmer–Verlet method and symplectic Euler methods on H(p, q) = T(p) + U(q).
        """
        return all(
            structure.is_acyclic([getattr(part, sparsity) for part in self.partitions])
            for sparsity in ("_sure_sparsity", "_sparsity")
        )

    @cached_property
    def is_symplectic(self) -> bool:
        """Whether b_i = b̂_i and b_i â_ij + b̂_j a_ji = b_i b̂_j for every two parts (HLW, Theorem VI.4.6).

        With two parts p and q the method is then symplectic for every Hamiltonian; a separable one does not need
        b_i = b̂_i.
        """
        return all(structure.is_symplectic_pair(first, second) for first, second in combinations(self.partitions, 2))

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether one reversal of the stages shows that every part is its own adjoint (HLW, V.2)."""
        return structure.is_symmetric(self.partitions)

    def substitute(self, values: Mapping[str, Any]) -> PartitionedRungeKutta:
        """The method with values in place of symbols, as `RungeKutta.substitute`."""
        _check_known(values, self.parameters)
        return self._map(lambda part: part.substitute({k: v for k, v in values.items() if k in part.parameters}))

    def to_float(self) -> PartitionedRungeKutta:
        """The method with every entry rounded to the nearest double."""
        return self._map(RungeKutta.to_float)

    def _map(self, function: Callable[[RungeKutta], RungeKutta]) -> PartitionedRungeKutta:
        parts = dict(zip(self.names, map(function, self.partitions), strict=True))
        return PartitionedRungeKutta(parts, name=self.name, reference=self.reference, warn=False)
