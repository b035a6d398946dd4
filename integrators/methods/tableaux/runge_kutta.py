"""Runge–Kutta methods as exact, immutable Butcher tableaux."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any, Self

from bseries_base.errors import shorten, shown, warn_user
from bseries_base.table import Document, Table
from integrators.core.arguments import check_digits, items, read_labels
from integrators.core.errors import IntegratorError
from integrators.exact import entries, polynomials
from integrators.exact.arithmetic import in_sympy
from integrators.exact.entries import Entry, EntryRow, Matrix
from integrators.exact.expressions import check_names, decimal_text, format_number
from integrators.methods.programs.builder import ProgramBuilder, entry_count
from integrators.methods.programs.evaluations import combination
from integrators.methods.programs.program import MAX_STAGES, Method, Program
from integrators.methods.tableaux import presentation
from integrators.methods.tableaux.registers import FromRegisters
from integrators.methods.tableaux.stage_algebra import StageAlgebra


class TableauWarning(UserWarning):
    """Inconsistency of a tableau: a row sum differs from its node, or the weights do not sum to 1."""


class RungeKutta(FromRegisters, Method):
    """A Runge–Kutta method: its Butcher tableau, exact and immutable.

    Entries may be integers, fractions, decimals (``decimal.Decimal`` or text, taken exactly), formulas as text such as
    ``"1/2 - sqrt(3)/6"``, SymPy expressions, or floats. Rational entries become `Fraction`s, irrational ones remain
    SymPy expressions; a single float makes all entries floats. Symbols are plain ``sympy.Symbol``s without
    assumptions. Methods with equal entries, domain and digits are equal, whatever their names.

    Args:
        A, b: the stage matrix, by rows, and the weights; rows of a strictly lower triangular matrix may end at the
            diagonal.
        c: the nodes; by default the row sums of A.
        embedded: a second row of weights for error estimates, or a sequence of rows; stored as a tuple of rows.
        parameters: the symbols allowed in formulas.
        name, reference: the name of the method in messages, and its publication.
        digits: the number of correct significant digits of a tableau published as decimals; None if it is exact, or
            in doubles. By default 7 for entries in single precision, 3 in half precision.
        warn: whether to emit a `TableauWarning` for each of `issues`.

    Raises:
        IntegratorError: sizes do not match, or an entry is not a finite real number or formula.

    Example:
        >>> import bseries as bs
        >>> midpoint = bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="explicit-midpoint")
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

    embedded: Matrix
    algebra: StageAlgebra | None

    def __init__(
        self, A: object, b: object, c: object = None, *, embedded: object = None, parameters: Iterable[str] = (),
        name: str | None = None, digits: int | None = None, reference: str | None = None, warn: bool = True,
    ) -> None:  # fmt: skip
        digits = entries.digits_of(A, b, c, embedded) if digits is None else digits
        matrix, weights, nodes, extra = _read_tableau(A, b, c, embedded, check_names(parameters, "parameters"), digits)
        nodes = nodes or tuple(map(entries.sum_entries, matrix))
        self.__dict__.update(A=matrix, b=weights, c=nodes, embedded=extra, digits=digits, algebra=None)
        self.__dict__.update(names=("",), **read_labels(name, reference))
        if warn:
            emit(self.issues)

    @classmethod
    def from_algebra(cls, algebra: StageAlgebra, *, name: str | None = None, reference: str | None = None) -> Self:
        """The method of a stage algebra; its exact tableau is computed on demand.

        Such methods are equal if and only if their algebras are: nodes are simple, and stages sorted by them. No
        warnings are emitted; see `issues`.
        """
        if not isinstance(algebra, StageAlgebra):
            raise IntegratorError(f"algebra must be a StageAlgebra, but was {shown(algebra)}")
        method = cls.__new__(cls)
        method.__dict__.update(names=("",), embedded=(), digits=None, algebra=algebra, **read_labels(name, reference))
        return method

    @property
    def _data(self) -> tuple[object, ...]:
        if self.algebra is not None and self.domain == "algebraic":
            return (self.algebra,)
        return self.domain, self.A, self.b, self.c, self.embedded, self.digits

    def __eq__(self, other: object) -> bool:
        equal = super().__eq__(other)
        if equal is not False or not isinstance(other, RungeKutta):
            return equal
        one, two = (self, other) if self.algebra is not None else (other, self)
        if one.algebra is None or two.algebra is not None or {one.domain, two.domain} != {"algebraic"}:
            return False
        if two.embedded or two.stages != one.stages:
            return False
        floats = zip(one.to_float()._entries, two.to_float()._entries, strict=True)
        return all(abs(x - y) < 1e-9 * (1 + abs(x)) for x, y in floats) and one._entries == two._entries  # type: ignore[operator]

    def __hash__(self) -> int:  # exact entries of a stage algebra take long
        return hash(("RungeKutta", self.stages)) if self.domain == "algebraic" else super().__hash__()

    def __repr__(self) -> str:
        return f"<RungeKutta {self.name}: {self.stages} stage{'s' * (self.stages > 1)}>"

    __str__ = presentation.tableau_text
    _repr_html_ = presentation.tableau_html

    def to_latex(self) -> str:
        """The tableau as a LaTeX array; long irrational entries are rounded to floats.

        Example:
            >>> import bseries as bs
            >>> print(bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1]).to_latex())
            \\begin{array}{c|cc}
            0 & 0 & 0 \\\\
            \\frac{1}{2} & \\frac{1}{2} & 0 \\\\ \\hline
             & 0 & 1 \\\\
            \\end{array}
        """
        return presentation.tableau_latex(self)

    plot = presentation.tableau_picture

    def to_dict(self) -> Document:
        """The content of a tableau file, without absent entries; see `load_method`."""
        plain = presentation.plain_entries
        data: Document = {"name": self.name, "reference": self.reference}
        if self.algebra is not None:
            polynomial, b = plain(self.algebra.polynomial), plain(self.algebra.b)
            data["algebra"] = {"polynomial": polynomial, "A": list(map(plain, self.algebra.A)), "b": b}
        else:
            write = decimal_text if self.domain == "decimal" else format_number
            # Formulas of row sums can exceed the limit of length; summing again gives equal ones.
            given = self.domain not in ("algebraic", "symbolic") or self.c != self.row_sums
            data |= {
                "parameters": list(self.parameters) or None,
                "digits": self.digits,
                "domain": "float" if self.domain == "float" else None,
            }
            if self.form is not None:
                data["form"] = self.form.to_dict(lambda row: plain(row, write))
                return {key: value for key, value in data.items() if value is not None}
            data |= {
                "A": [plain(row, write) for row in self.A],
                "b": plain(self.b, write),
                "c": plain(self.c, write) if given else None,
                "embedded": [plain(row, write) for row in self.embedded] or None,
            }
        return {key: value for key, value in data.items() if value is not None}

    def to_table(self) -> Table:
        """The tableau as rows."""
        return presentation.tableau_table(self, self.to_latex)

    @cached_property
    def _exact(self) -> tuple[Matrix, EntryRow, EntryRow]:
        assert self.algebra is not None
        return self.algebra.tableau_exact()

    @cached_property
    def A(self) -> Matrix:
        """The stage matrix, by rows."""
        return self._exact[0]

    @cached_property
    def b(self) -> EntryRow:
        """The weights."""
        return self._exact[1]

    @cached_property
    def c(self) -> EntryRow:
        """The nodes."""
        return self._exact[2]

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.algebra.stages if self.algebra is not None else len(self.b)

    max_children = None  # type: ignore[assignment]  # tableaux apply to all fields

    @property
    def partitions(self) -> tuple[Self]:
        """The parts: the method itself."""
        return (self,)

    @cached_property
    def _entries(self) -> tuple[Entry, ...]:
        return tuple(v for row in (*self.A, self.b, self.c, *self.embedded) for v in row)

    @cached_property
    def domain(self) -> str:
        """The smallest domain that contains the entries: QQ, decimal, algebraic, symbolic or float."""
        if self.algebra is not None:
            return "QQ" if self.algebra.has_rational_nodes else "algebraic"
        domain = entries.find_domain(self._entries)
        return "decimal" if self.digits is not None and domain == "QQ" else domain

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the tableau, sorted."""
        return entries.symbol_names(self._entries) if self.domain == "symbolic" else ()

    @cached_property
    def program(self) -> Program:
        """The stages and the step as a program."""
        return tableau_program([self], self.names, **self.labels)

    def rational_program(self, decimals: int) -> Program:
        """The program, with rational numbers within 10^-decimals of the entries if they come from a stage algebra."""
        return self.approximated(decimals).program

    def approximated(self, decimals: int) -> RungeKutta:
        """The tableau, with rational numbers within 10^-decimals of the entries if they come from a stage algebra."""
        if self.algebra is None:
            return self
        from mpmath.libmp import to_rational

        A, b, c = self.algebra.tableau_decimal(decimals + 3)
        rows = [[Fraction(*map(int, to_rational(x._mpf_))) for x in row] for row in (*A, b, c)]
        return RungeKutta(rows[:-2], rows[-2], rows[-1], name=self.name, warn=False)

    @cached_property
    def row_sums(self) -> EntryRow:
        """The sums of the rows of A."""
        if self.algebra is not None:
            return self.algebra.values(self.algebra.row_sums)
        return tuple(map(entries.sum_entries, self.A))

    @property
    def weight_sum(self) -> Entry:
        """The sum of the weights: 1 for a consistent method."""
        if self.algebra is not None:
            return self.algebra.b[0]
        return entries.sum_entries(self.b)

    @cached_property
    def issues(self) -> tuple[str, ...]:
        """One sentence for each inconsistency: row sums that are not the nodes, weights that do not sum to 1."""
        if self.algebra is not None:
            agree, consistent = self.algebra.rows_sum_to_nodes(), self.algebra.b[0] == 1
        else:
            rows = zip(self.A, self.c, strict=True)
            agree = [self._sums_to((*row, -node), 0) for row, node in rows]
            consistent = self._sums_to(self.b, 1)
        found = [
            f"row {i + 1} of A sums to {_entry_text(self.row_sums[i])}, but c[{i + 1}] is {_entry_text(self.c[i])}"
            for i, agrees in enumerate(agree)
            if agrees is False
        ]
        if consistent is False:
            rounded = self.domain in ("QQ", "decimal", "float") and abs(self.weight_sum - 1) < 1e-3
            advice = "; if its entries are rounded decimals, write them as text and give digits = N" if rounded else ""
            found.append(f"weights b sum to {_entry_text(self.weight_sum)}, not 1: the method is inconsistent{advice}")
        for k, row in enumerate(self.embedded, 1):
            if entries.cancels((*row, -1), self.precision) is False:
                which = f"row {k} of embedded weights sums" if len(self.embedded) > 1 else "embedded weights sum"
                found.append(f"{which} to {_entry_text(entries.sum_entries(row))}, not 1: they have order 0")
        return tuple(found)

    def _sums_to(self, values: Sequence[Entry], total: int) -> bool | None:
        """Whether entries sum to a number, within their digits."""
        if self.digits is None or self.domain != "decimal":
            return entries.cancels((*values, -total), self.precision)
        gap = abs(sum(values) - total)
        return not gap or gap <= sum(entries.half_unit(x, self.digits) for x in values)

    @cached_property
    def sparsity(self) -> tuple[tuple[bool, ...], ...]:
        """Which entries of A are not zero."""
        return tuple(tuple(entries.cancels([v], self.precision) is not True for v in row) for row in self.A)

    @cached_property
    def sure_sparsity(self) -> tuple[tuple[bool, ...], ...]:
        """Entries of A that are certainly not zero, found without computing exact roots."""
        if self.algebra is None:
            return self.sparsity
        return tuple(tuple(abs(v) > 1e-9 for v in row) for row in self.algebra.tableau_float()[0])

    @cached_property
    def is_explicit(self) -> bool:
        """Whether A is strictly lower triangular."""
        return _is_lower(self.sure_sparsity, 0) and _is_lower(self.sparsity, 0)

    @cached_property
    def is_diagonally_implicit(self) -> bool:
        """Whether A is lower triangular but not strictly, so the stages are solved successively."""
        return _is_lower(self.sure_sparsity, 1) and _is_lower(self.sparsity, 1) and not self.is_explicit

    @cached_property
    def is_symplectic(self) -> bool:
        """Whether b_i a_ij + b_j a_ji = b_i b_j, so quadratic invariants are preserved (HLW, Theorems IV.2.2, VI.4.3).

        The condition is sufficient, and necessary for irreducible methods. It must hold for all values of the symbols.
        """
        return self.is_symplectic_with(self)

    def is_symplectic_with(self, other: RungeKutta) -> bool:
        """Whether b_i = b̂_i and b_i â_ij + b̂_j a_ji = b_i b̂_j for all i and j (HLW, Theorems VI.4.3 and VI.4.6).

        The partitioned method with the tableau of the other part, with as many stages, is then symplectic.
        """
        one, two = self.algebra, other.algebra
        if one is not None and two is not None and one.polynomial == two.polynomial:
            return one.is_symplectic_with(two)
        precision = max(self.precision, other.precision)
        b, b_hat, stages = self.b, other.b, range(self.stages)
        return all(entries.cancels((b[i], -b_hat[i]), precision) for i in stages) and all(
            entries.cancels((b[i] * other.A[i][j], b_hat[j] * self.A[j][i], -b[i] * b_hat[j]), precision)
            for i in stages
            for j in stages
        )

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether the method is its own adjoint: a_σ(i)σ(j) + a_ij = b_j (HLW, Theorem V.2.3).

        σ reverses the stages in the given order or sorted by row sums. The condition is sufficient, and necessary for
        irreducible methods.
        """
        return are_symmetric([self])

    def substitute(self, values: Mapping[str, object]) -> RungeKutta:
        """The method with values substituted for symbols.

        Args:
            values: numbers, formulas as text or SymPy expressions for some or all of `parameters`.

        Raises:
            IntegratorError: a name is not a parameter, or an entry becomes infinite.

        Example:
            >>> import bseries as bs
            >>> family = bs.RungeKutta([["gamma"]], [1], parameters=["gamma"], name="theta")
            >>> family.substitute({"gamma": "1/2"}).A
            ((Fraction(1, 2),),)
        """
        check_known(values, self.parameters)
        if not values:
            return self
        import sympy

        read = {name: entries.read_entry(value, name, self.parameters) for name, value in values.items()}
        replacements = {sympy.Symbol(name): in_sympy(value) for name, value in read.items()}

        def substituted(value: Entry, place: str) -> Entry:
            return entries.read_entry(value.xreplace(replacements), place) if entries.is_sympy(value) else value

        if self.form is not None:
            return self.from_form(self.form.map(substituted), name=self.name, reference=self.reference, warn=False)
        return self._mapped(substituted, nodes=self.c != self.row_sums)

    def to_float(self) -> RungeKutta:
        """The method with every entry rounded to the nearest double, as a tableau.

        Raises:
            IntegratorError: the tableau has symbols.
        """
        if self.parameters:
            raise IntegratorError(
                f"parameters must have values before rounding, but {', '.join(self.parameters)} had none"
            )
        if self.algebra is not None:
            return RungeKutta(*self.algebra.tableau_float(), name=self.name, reference=self.reference, warn=False)
        return self._mapped(lambda value, _: entries.round_entry(value), nodes=True)

    def with_digits(self, digits: int | None) -> RungeKutta:
        """The tableau with another number of correct digits of its decimals; None if they are exact."""
        labels: Document = {"name": self.name, "reference": self.reference, "warn": False}
        return RungeKutta(self.A, self.b, self.c, embedded=self.embedded, digits=digits, **labels)

    def _mapped(self, function: Callable[[Entry, str], Entry], *, nodes: bool) -> RungeKutta:
        """The method with a function of every entry and its label; the nodes become row sums unless `nodes` is set."""

        def row(values: EntryRow, label: str) -> list[Entry]:
            return [function(value, f"{label}[{j}]") for j, value in enumerate(values, 1)]

        return RungeKutta(
            [row(values, f"A[{i}]") for i, values in enumerate(self.A, 1)],
            row(self.b, "b"),
            row(self.c, "c") if nodes else None,
            embedded=[row(values, f"embedded[{k}]") for k, values in enumerate(self.embedded, 1)],
            name=self.name,
            digits=self.digits,
            reference=self.reference,
            warn=False,
        )


def _read_tableau(
    A: object, b: object, c: object, embedded: object, names: tuple[str, ...], digits: int | None
) -> tuple[Matrix, EntryRow, EntryRow, Matrix]:
    """The stage matrix, weights, nodes (empty if not given) and rows of embedded weights, in one domain."""
    raw = [items(row, f"row {i} of A") for i, row in enumerate(items(A, "A"), 1)]
    stages = len(raw)
    if not 1 <= stages <= MAX_STAGES:
        size = f"at most {MAX_STAGES} rows, but has {stages}" if stages else "at least one row, but was empty"
        raise IntegratorError(f"A must have {size}")
    if stages > 1 and all(len(row) == i for i, row in enumerate(raw)):  # explicit rows, as books write them
        raw = [row + [0] * (stages - len(row)) for row in raw]
    first = len(raw[0])
    for i, row in enumerate(raw, 1):
        if len(row) != first:
            raise IntegratorError(f"A must be square, but row {i} has {entry_count(len(row))} and row 1 has {first}")
    if first != stages:
        raise IntegratorError(f"A must be square, but has {stages} row{'s' * (stages > 1)} of {entry_count(first)}")

    def read(values: object, argument: str) -> EntryRow:
        row = items(values, argument)
        if len(row) != stages:
            raise IntegratorError(f"{argument} must have as many entries as A has rows, {stages}, but has {len(row)}")
        return tuple(entries.read_entry(value, f"{argument}[{j}]", names) for j, value in enumerate(row, 1))

    extra = [] if embedded is None else items(embedded, "embedded")
    if extra and (isinstance(extra[0], str) or not isinstance(extra[0], Iterable)):  # one row
        extra = [extra]
    rows = [*(read(row, f"A[{i}]") for i, row in enumerate(raw, 1)), read(b, "b")]
    rows += [read(row, f"embedded[{k}]" if len(extra) > 1 else "embedded") for k, row in enumerate(extra, 1)]
    rows = _in_one_domain([*rows, () if c is None else read(c, "c")], digits)
    return tuple(rows[:stages]), rows[stages], rows[-1], tuple(rows[stages + 1 : -1])


def _in_one_domain(rows: list[EntryRow], digits: int | None) -> list[EntryRow]:
    """The rows; a single float makes all entries floats."""
    check_digits(digits)
    values = [value for row in rows for value in row]
    domain = entries.find_domain(values)
    if digits is not None and domain in ("algebraic", "symbolic"):
        raise IntegratorError(f"digits must be left out for a tableau with roots or symbols, but was {digits}")
    if domain != "float":
        return rows
    if entries.find_domain(value for value in values if not isinstance(value, float)) == "symbolic":
        raise IntegratorError("A, b and c must not mix floats and symbols: write the floats as fractions or as text")
    return [tuple(map(entries.round_entry, row)) for row in rows]


def tableau_program(tableaux: Sequence[RungeKutta], names: Sequence[str], **labels: Any) -> Program:
    """The program of k^ν_i = h f^ν(y + Σ_μ Σ_j a^μ_ij k^μ_j), y1 = y + Σ_ν Σ_i b^ν_i k^ν_i.

    Its order is stage by stage, and within a stage part by part; `labels` are those of `ProgramBuilder.program`.
    """
    count, stages = len(tableaux), tableaux[0].stages
    parts = tuple(names) if count > 1 else ()
    builder = ProgramBuilder(parts)
    registers = builder.unknowns(count * stages)
    increments = [registers[part::count] for part in range(count)]
    for i in range(stages):
        at = builder.y
        for tableau, k in zip(tableaux, increments, strict=True):
            at = at + combination(tableau.A[i], k)
        for name, k in zip(parts or (None,), increments, strict=True):
            builder.field(at, name, into=k[i])
    result = builder.y
    for tableau, k in zip(tableaux, increments, strict=True):
        result = result + combination(tableau.b, k)
    return builder.program(result, **labels)


def _is_lower(sparsity: Sequence[Sequence[bool]], first: int) -> bool:
    """Whether row i is zero from column i + first on."""
    return not any(any(row[i + first :]) for i, row in enumerate(sparsity))


def are_symmetric(parts: Sequence[RungeKutta]) -> bool:
    """Whether all parts satisfy a_σ(i)σ(j) + a_ij = b_j for one reversal σ of the stages (HLW, Theorem V.2.3).

    The stages are reversed in the given order or sorted by row sums. That b_σ(j) = b_j follows. The roots of stage
    algebras are not computed if the nodes are symmetric, or are row sums that are not (c_σ(i) + c_i = Σ b_j = 1).
    """
    algebras = [part.algebra for part in parts if part.algebra is not None]
    symmetric = [algebra for algebra in algebras if algebra.has_symmetric_nodes]
    if len(symmetric) == len(parts):
        return all(algebra.is_symmetric() for algebra in symmetric)
    if any(algebra.b[0] == 1 and algebra.row_sums == polynomials.X for algebra in algebras if algebra not in symmetric):
        return False
    stages = list(range(parts[0].stages))
    orders = [stages]
    if not any(part.parameters for part in parts):
        sums = [[entries.round_entry(x) if entries.is_sympy(x) else x for x in part.row_sums] for part in parts]
        orders.append(sorted(stages, key=lambda i: [row[i] for row in sums]))

    def is_reversible(part: RungeKutta, order: Sequence[int]) -> bool:
        a, b, partner = part.A, part.b, dict(zip(order, reversed(order), strict=True))
        terms = ((a[partner[i]][partner[j]], a[i][j], -b[j]) for i in order for j in order)
        return all(entries.cancels(x, part.precision) for x in terms)

    return any(all(is_reversible(part, order) for part in parts) for order in orders)


def _entry_text(value: Entry) -> str:
    return shorten(format_number(value))


def check_known(values: Mapping[str, object], parameters: Sequence[str]) -> None:
    """Refuse values for names that are not parameters."""
    for name in values:
        if name not in parameters:
            known = ", ".join(parameters) or "of which there are none"
            raise IntegratorError(f"values must be for the parameters {known}, but one was for {shown(name)}")


def emit(issues: Iterable[str]) -> None:
    """Warn of each issue."""
    for issue in issues:
        warn_user(issue, TableauWarning)
