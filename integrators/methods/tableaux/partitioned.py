"""Partitioned Runge–Kutta methods: one tableau for each part of the field."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from itertools import combinations

from bseries_base.errors import shorten, shown
from bseries_base.table import Document, Table
from integrators.core.arguments import check_partition_names, read_labels
from integrators.core.errors import IntegratorError
from integrators.core.text_files import errors_from
from integrators.methods.programs.builder import in_color_order
from integrators.methods.programs.program import Method, Program
from integrators.methods.tableaux.presentation import tableau_picture, tableau_table
from integrators.methods.tableaux.runge_kutta import RungeKutta, are_symmetric, check_known, emit, tableau_program

DOMAINS = ("QQ", "decimal", "algebraic", "symbolic", "float")
"""The domains of entries, ascending."""


class PartitionedRungeKutta(Method):
    """A partitioned Runge–Kutta method: one tableau for each part (colour) of the field, with common stages.

    For y split into blocks, or f into a sum, the stages are Y_i = y + h Σ_ν Σ_j a^ν_ij f^ν(Y_j). This includes additive
    Runge–Kutta methods with any number of parts, such as implicit–explicit ones; for parts with their own stages see
    `GeneralizedAdditiveRungeKutta`.

    Args:
        partitions: at least two named tableaux, each a `RungeKutta` or a mapping with A, b and optionally c. Their
            order is that of the colours 0, 1, …, but p always precedes q; names start with a letter, and t and τ are
            reserved.
        parameters: the symbols allowed in formulas.
        name, reference: the name of the method in messages, and its publication.
        warn: whether to emit a `TableauWarning` for each of `issues`, except those of parts that are `RungeKutta`s.

    Raises:
        IntegratorError: fewer than two parts, an invalid name, different numbers of stages, or an invalid tableau.

    Example:
        The Störmer–Verlet method, kick–drift–kick:

        >>> import bseries as bs
        >>> kick = bs.RungeKutta([["1/2", 0], ["1/2", 0]], ["1/2", "1/2"])
        >>> drift = bs.RungeKutta([[0, 0], ["1/2", "1/2"]], ["1/2", "1/2"])
        >>> verlet = bs.PartitionedRungeKutta({"p": kick, "q": drift}, name="stormer-verlet")
        >>> verlet.is_symplectic, verlet.is_symmetric, verlet.is_explicit, verlet.is_explicit_if_separable
        (True, True, False, True)

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.2 and III.2.
    """

    partitions: tuple[RungeKutta, ...]

    def __init__(
        self, partitions: Mapping[str, RungeKutta | Mapping[str, object]], *, parameters: Iterable[str] = (),
        name: str | None = None, reference: str | None = None, warn: bool = True,
    ) -> None:  # fmt: skip
        if not isinstance(partitions, Mapping) or len(partitions) < 2:
            raise IntegratorError(f"partitions must map two or more names to tableaux, but was {shown(partitions)}")
        check_partition_names(partitions)
        names = in_color_order(partitions)
        parts = tuple(_read_part(key, partitions[key], parameters) for key in names)
        for key, part in zip(names, parts, strict=True):
            if part.stages != parts[0].stages:
                raise IntegratorError(
                    f"partitions must have the same number of stages, "
                    f"but {names[0]} has {parts[0].stages} and {key} has {part.stages}"
                )
        if len({part.domain for part in parts} & {"float", "symbolic"}) == 2:
            domains = ", ".join(f"{key} is {part.domain}" for key, part in zip(names, parts, strict=True))
            raise IntegratorError(f"partitions must not mix floats and symbols, but {shorten(domains)}")
        self.__dict__.update(names=names, partitions=parts, **read_labels(name, reference))
        if warn:
            emit(issue for key, issue in self._part_issues if not isinstance(partitions[key], RungeKutta))

    @property
    def _data(self) -> tuple[object, ...]:
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

    def to_latex(self) -> str:
        """The tableaus as LaTeX arrays."""
        return "\n".join(part.to_latex() for part in self.partitions)

    plot = tableau_picture

    def to_dict(self) -> Document:
        """The content of a tableau file; see `load_method`."""
        labels = {"name": self.name} | ({} if self.reference is None else {"reference": self.reference})
        parts = zip(self.names, self.partitions, strict=True)
        return {**labels, "partitions": {name: part.to_dict() for name, part in parts}}

    def to_table(self) -> Table:
        """The tableaus as rows."""
        return tableau_table(self, self.to_latex)

    @property
    def stages(self) -> int:
        """The number of stages of every part."""
        return self.partitions[0].stages

    algebra: None = None  # only the parts may have algebras
    embedded: tuple[()] = ()
    max_children = None  # type: ignore[assignment]  # tableaux apply to all fields

    @cached_property
    def digits(self) -> int | None:
        """The smallest number of correct digits of the parts; None if all are exact."""
        return min((part.digits for part in self.partitions if part.digits is not None), default=None)

    @cached_property
    def domain(self) -> str:
        """The smallest domain that contains the entries of all parts: QQ, decimal, algebraic, symbolic or float."""
        return max((part.domain for part in self.partitions), key=DOMAINS.index)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in all parts, sorted."""
        return tuple(sorted({name for part in self.partitions for name in part.parameters}))

    @cached_property
    def _part_issues(self) -> tuple[tuple[str, str], ...]:
        pairs = zip(self.names, self.partitions, strict=True)
        return tuple((name, f"partition {name}: {issue}") for name, part in pairs for issue in part.issues)

    @cached_property
    def issues(self) -> tuple[str, ...]:
        """The issues of the parts, with their names."""
        return tuple(issue for _, issue in self._part_issues)

    @cached_property
    def is_explicit(self) -> bool:
        """Whether every part is explicit, so the method is explicit for all fields."""
        return all(part.is_explicit for part in self.partitions)

    @cached_property
    def is_explicit_if_separable(self) -> bool:
        """Whether the method is explicit if no block's field depends on the block itself.

        Examples are the Störmer–Verlet and symplectic Euler methods for H(p, q) = T(p) + U(q).
        """
        return _is_acyclic([part.sure_sparsity for part in self.partitions]) and _is_acyclic(
            [part.sparsity for part in self.partitions]
        )

    @cached_property
    def is_symplectic(self) -> bool:
        """Whether b_i = b̂_i and b_i â_ij + b̂_j a_ji = b_i b̂_j for every two parts (HLW, Theorem VI.4.6).

        With two parts p and q the method is then symplectic for every Hamiltonian; for separable ones b_i = b̂_i is
        not necessary.
        """
        return all(first.is_symplectic_with(second) for first, second in combinations(self.partitions, 2))

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether every part is its own adjoint under a common reversal of the stages (HLW, V.2)."""
        return are_symmetric(self.partitions)

    @cached_property
    def program(self) -> Program:
        """The stages and the step as a program, with one evaluation for each part and stage."""
        return tableau_program(self.partitions, self.names, **self.labels)

    def rational_program(self, decimals: int) -> Program:
        """The program, with rational numbers within 10^-decimals of entries that come from stage algebras."""
        if all(part.algebra is None for part in self.partitions):
            return self.program
        return self._map(lambda part: part.approximated(decimals)).program

    def substitute(self, values: Mapping[str, object]) -> PartitionedRungeKutta:
        """The method with values substituted for symbols, as `RungeKutta.substitute`."""
        check_known(values, self.parameters)
        return self._map(lambda part: part.substitute({k: v for k, v in values.items() if k in part.parameters}))

    def to_float(self) -> PartitionedRungeKutta:
        """The method with every entry rounded to the nearest double."""
        return self._map(RungeKutta.to_float)

    def _map(self, function: Callable[[RungeKutta], RungeKutta]) -> PartitionedRungeKutta:
        parts = dict(zip(self.names, map(function, self.partitions), strict=True))
        return PartitionedRungeKutta(parts, name=self.name, reference=self.reference, warn=False)


def _is_acyclic(sparsities: Sequence[Sequence[Sequence[bool]]]) -> bool:
    """Whether stages can be computed in some order if the field of each part depends only on the other parts.

    For each a^ν_ij ≠ 0, stage i of part ν depends on the field of ν at stage j, hence on stage j of all other parts.
    """
    parts = range(len(sparsities))
    needs = {
        (part, i): {(other, j) for j, used in enumerate(row) if used for other in parts if other != part}
        for part, rows in enumerate(sparsities)
        for i, row in enumerate(rows)
    }
    try:
        TopologicalSorter(needs).prepare()
    except CycleError:
        return False
    return True


def _read_part(name: str, part: object, parameters: Iterable[str]) -> RungeKutta:
    if isinstance(part, RungeKutta):
        return part
    if not isinstance(part, Mapping) or not {"A", "b"} <= part.keys() <= {"A", "b", "c"}:
        raise IntegratorError(
            f"partition {name} must be a RungeKutta or have A, b and perhaps c, but was {shown(part)}"
        )
    with errors_from(f"partition {name}"):
        return RungeKutta(**part, parameters=parameters, name=name, warn=False)
