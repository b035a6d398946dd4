"""Methods among the assignments of a source: their tables, with what is said about them nearby."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from integrators.methods.exchange.assignments import CONSTRUCTORS, Block, Unknown, Variable
from integrators.methods.exchange.numbers import ZERO, Number, Struct
from integrators.methods.exchange.records import Record
from integrators.methods.exchange.shapes import (
    MOST_STAGES,
    NEAR,
    agree,
    as_row,
    as_square,
    flattened,
    is_explicit,
    is_pair,
    lower_matrix,
    near,
    plain_name,
    row_and_column,
    row_sum,
    with_diagonal,
)
from integrators.methods.exchange.tokens import Source

MATRICES = ("A", "a", "a_lower", "Abase", "Amat", "A_mat")
WEIGHTS = ("b", "b_sol", "bbase", "B", "α", "alpha", "w")
NODES = ("c", "C")
EMBEDDED = (
    *("bhat", "b_hat", "bh", "bembed", "bemb", "b_emb", "b_embedded", "αEEst", "alphaEEst", "d", "bstar", "b_star"),
    *("b2", "bm", "bs", "bhat1", "αEEst2", "bhat2"),
)
ERRORS = ("b_error", "btilde", "b_tilde", "E", "er")
CLAIMS = ("order", "embedded_order", "adaptiveorder", "q", "p", "o", "name", "shortname", "description", "stages")


MADE = re.compile(r"Register|Tableau|RungeKutta|_Create|RK(?:Method|Pair)|SplittingCoefficients")
"""In the names of functions that make a method of its tables."""
RESULTS = ("xf", "xnew", "x1", "yf", "ynew", "y1", "yout", "unew", "u1", "y", "x", "u")
"""Names of the state at the end of a step, the likeliest first."""
MOST_TOKENS = 20_000
"""Of a method, that are searched for what it says of itself."""


class Found(Protocol):
    """Where the methods of a source are gathered."""

    source: Source
    first: int
    records: list[Record]
    unread: list[str]
    used: set[tuple[int, ...]]


class Group:
    """The variables of one method or of several with names of their own."""

    def __init__(self, finder: Found, block: Block, k: int) -> None:
        self.finder = finder
        self.block = block
        self.start = block.starts[k]
        self.end = block.starts[k + 1] if k + 1 < len(block.starts) else block.end
        self.variables = block.tables[k]
        self.stages = {name: v.value.stages for name, v in self.variables.items() if isinstance(v.value, Struct)}
        self.values: dict[str, Any] = {}
        self.lines: dict[str, int] = {}
        self.faults: dict[str, str] = {}
        self.families: dict[str, dict[tuple[str, ...], Number]] = {}
        self.said: str | None = None
        self._collect()

    def _collect(self) -> None:
        """Values by normalised name; entries with names of their own become families."""
        for name, variable in self.variables.items():
            value = self._dense(name, variable)
            plain = plain_name(name)
            if isinstance(value, Unknown):
                self.faults[plain] = value.what
                self.lines.setdefault(plain, variable.line)
            elif isinstance(value, list) and value:
                self.values[plain] = value
                self.lines[plain] = variable.line
            elif isinstance(value, Number):
                self.values.setdefault(plain, value)
                self.lines.setdefault(plain, variable.line)
                member = re.fullmatch(r"(.*?[^\W\d])_?(\d+)(?:_(\d+))?(_?[a-z]?)", plain)
                if member:
                    key = member[1] + member[4]
                    index = (member[2], member[3]) if member[3] else (member[2],)
                    self.families.setdefault(key, {})[index] = value
        self._merge_families()

    def _dense(self, name: str, variable: Variable) -> Any:
        """The value of a variable; entries by index get the size of the structure that they are in."""
        first = 1 if self.finder.first else 0
        if variable.value is None and variable.entries and variable.shape is None:
            size = self.stages.get(name.rpartition(".")[0])
            rank = len(next(iter(variable.entries)))
            if size is not None and all(max(index) < size + first for index in variable.entries) and rank < 3:
                variable.shape = (size,) * rank
        return variable.dense(self.finder.first)

    def _merge_families(self) -> None:
        """Turn a11, a21, … into matrices and b1, b2, … into rows, as dictionaries of their entries."""
        for key, members in self.families.items():
            two = [index for index in members if len(index) == 2]
            long = [index for index in members if len(index) == 1 and len(index[0]) > 1]
            if two or (long and len(long) == len(members)):
                entries = {row_and_column(index): value for index, value in members.items()}
                if len(entries) == len(members) and all(len(index) == 2 for index in entries):
                    matrix = lower_matrix(entries)
                    if matrix is not None and key not in self.values:
                        self.values[key] = matrix
                        self.lines[key] = min(v.line for v in members.values())
            elif key not in self.values:
                self.values[key] = {int(index[0]): value for index, value in members.items()}
                self.lines[key] = min(v.line for v in members.values())

    # Finding.

    def find(self) -> None:
        """Report the methods of this group."""
        if self.block.stages:
            self._steps()
            return
        if self._composition():
            return
        parts = list(self._tableaus())
        for fixed in (self._nystrom, self._rosenbrock, self._shu_osher):
            found = fixed(parts)
            if found:
                return
        if len(parts) >= 2:
            parts = self._paired(parts)
        for name, tables in parts:
            self._report(name, "additive" if "A_explicit" in tables else "runge-kutta", tables)
        if not parts and not self._low_storage() and not self._coupling() and not self._splitting():
            self._numeric_families()

    def say_faults(self) -> None:
        """A sentence for each array of a method that was found without them."""
        for name, what in self.faults.items():
            match = re.fullmatch(r"(.*?)(A|a|a_lower|b|b_sol)(|_hat|hat|t|e|i)", name)
            others = (
                [match[1] + other + match[3] for other in ("A", "a", "a_lower", "b", "b_sol", "α")] if match else []
            )
            is_alone = name in self.families
            if is_alone or any(other != name and other in {**self.values, **self.faults} for other in others):
                sentence = f"{self.finder.source.name}, line {self.lines[name]}: {name} {what}"
                self.finder.unread.append(sentence)

    def _names(self, pre: str, role: tuple[str, ...], post: str) -> Iterator[str]:
        for name in role:
            yield f"{pre}{name}{post}"
            if post:
                yield f"{pre}{name}_{post.lstrip('_')}"

    def _partner(self, pre: str, role: tuple[str, ...], post: str, *, around: bool = True) -> tuple[str, Any] | None:
        """The array that has a role beside another with the same stem, here or around."""
        for name in self._names(pre, role, post):
            value = self.values.get(name)
            if isinstance(value, list | dict) or (isinstance(value, Number) and not name.startswith("d")):
                return name, value
            if around and name not in self.faults:
                outer = self.block.find(name) or self.block.find(f"_{name}")
                value = outer.dense(self.finder.first) if outer is not None else None
                if isinstance(value, list):
                    return name, value
        return None

    def _tableaus(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Pairs of a stage matrix and weights, with nodes and embedded weights."""
        seen: set[str] = set()
        whole = [name for name in self.values if name not in self.families]
        for name in (*whole, *self.families):
            if name in self.families and seen.difference(self.families):
                break  # entries with names of their own fill the arrays
            value = self.values.get(name)
            for letter in MATRICES if isinstance(value, list | Number) else ():
                for match in re.finditer(re.escape(letter), name):
                    pre, post = name[: match.start()], name[match.end() :]
                    if post and not re.fullmatch(r"_?(?:hat|ex\w*|im\w*|t|e|i|E|I|F|S|base|sb|f|tilde|\d{0,3})", post):
                        continue
                    weights = self._partner(pre, WEIGHTS, post)
                    if weights is None and post == "":
                        continue
                    if weights is None:
                        weights = self._partner(pre, WEIGHTS, "")
                    if weights is None or weights[0] == name:
                        continue
                    tables = self._tableau(name, value, weights[1], pre, post)
                    if tables is not None and name not in seen:
                        seen.add(name)
                        yield name, tables
                    break
                if name in seen:
                    break
        if not seen:
            yield from self._without_weights()
            yield from self._without_matrix()

    def _without_weights(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Matrices whose last stage is the end of the step, so that their last rows are the weights."""
        for name, post in (("a", ""), ("ea", ""), ("A", ""), ("At", "t")):
            value = self.values.get(name)
            rows = as_square(value, 0) if isinstance(value, list) else None
            if rows is None or len(rows) < 2 or not (name in self.families or {"A", "At"} <= self.values.keys()):
                continue
            last = as_square(self.values["At"], len(rows)) if "At" in self.values else rows
            tables = self._tableau(
                name, value, [*(last or rows)[-1]], name[:-1] if not post and name != "A" else "", post
            )
            if tables is not None and ("error" in tables or abs(near(row_sum(tables["b"])) - 1) < NEAR):
                yield name, tables

    def _without_matrix(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Structures with weights only: a method whose matrix is zero."""
        for name, stages in self.stages.items():
            weights = self.values.get(f"{name}.b")
            if isinstance(weights, list) and len(weights) == stages:
                rows = [[ZERO] * stages for _ in range(stages)]
                tables = self._tableau(f"{name}.A", rows, weights, f"{name}.", "")
                if tables is not None:
                    yield f"{name}.A", tables

    def _tableau(self, name: str, A: Any, b: Any, pre: str, post: str) -> dict[str, Any] | None:
        """The tables of a stage matrix and its weights; None if their shapes do not fit."""
        weights = as_row(b)
        matrix = self._padded(A, len(weights)) if name in self.families else as_square(A, len(weights))
        if isinstance(b, dict) and matrix is None and isinstance(A, list):
            matrix = as_square(A, 0)
            weights = as_row(b, len(matrix)) if matrix else weights
        if matrix is None:
            if isinstance(A, list) and isinstance(A[0], list):
                self.faults[name] = f"has {len(A)} rows, but there are {len(weights)} weights"
            return None
        diagonal = self._partner(pre, ("a_diagonal", "diagonal"), post, around=False)
        if diagonal is not None:
            matrix = with_diagonal(matrix, as_row(diagonal[1]))
        stages = len(matrix)
        if len(weights) < stages and isinstance(b, dict):
            weights = as_row(b, stages)
        if len(weights) != stages or stages > MOST_STAGES or not all(isinstance(x, Number) for x in weights):
            return None
        if isinstance(A, Number) and (pre or post):
            return None
        tables: dict[str, Any] = {"A": matrix, "b": weights}
        nodes = self._partner(pre, NODES, post) or (self._partner(pre, NODES, "") if post else None)
        found = self._nodes(matrix, nodes[1]) if nodes else None
        if found is not None:
            tables["c"] = found
        if name in self.families and self._lacks_diagonal(name, matrix, found):
            return None
        total = near(row_sum(weights))
        if found is None and (total != 1 if stages == 1 else any(map(near, weights)) and abs(total) < NEAR):
            self.faults[name] = f"has no nodes, and weights of sum {total:g}"
            return None
        for role, names in (("embedded", EMBEDDED), ("error", ERRORS)):
            for one in names:
                partner = self._partner(pre, (one,), post, around=len(self.block.tables) < 2)
                row = as_row(partner[1], stages) if partner and isinstance(partner[1], list | dict) else []
                if len(row) != stages or not all(isinstance(x, Number) for x in row):
                    continue
                if all(x.text == "zeros" for x in row):
                    continue  # nothing was written
                is_zero = any(map(near, row)) and abs(sum(map(near, row))) < NEAR
                kept = "error" if role == "error" or (is_zero and not re.search("hat|emb|star", one)) else "embedded"
                if row not in tables.setdefault(kept, []):
                    tables[kept].append(row)
        return tables

    def _padded(self, matrix: Any, stages: int) -> list[list[Number]] | None:
        """A matrix of entries with names of their own, whose last rows and columns may be zero."""
        more = stages - len(matrix) if isinstance(matrix, list) else 0
        if more <= 0:
            return as_square(matrix, stages)
        return [[*row, *[ZERO] * more] for row in matrix] + [[ZERO] * stages for _ in range(more)]

    def _lacks_diagonal(self, name: str, matrix: list[list[Number]], nodes: list[Number] | None) -> bool:
        """Whether entries with names of their own leave out the diagonal γ of an implicit method."""
        gamma = self.values.get("γ", self.values.get("gamma"))
        if gamma is None or name.startswith("e"):
            return False
        if not is_explicit(matrix):
            given = [agree(row[i], gamma) for i, row in enumerate(matrix)]
            if not any(given) or all(given[1:]) or near(matrix[-1][-1]):
                return False
            self.faults[name] = "has γ on a part of its diagonal only"
            return True
        sums = [row_sum(row) for row in matrix[1:]]
        fitting = sum(agree(x, s) for x, s in zip((nodes or [])[1:], sums, strict=False))
        if fitting > len(sums) // 2:
            return False
        self.faults[name] = "has no diagonal, although there is γ"
        return True

    def _nodes(self, matrix: list[list[Number]], given: Any) -> list[Number] | None:
        """The nodes of the rows, which may start with the second stage."""
        stages = len(matrix)
        if isinstance(given, dict):
            shifts = [shift for shift in (1, 0) if all(0 <= key - shift < stages for key in given)]
            choices = [[given.get(i + shift) for i in range(stages)] for shift in shifts or (1, 0)]
        else:
            row = as_row(given)
            if not all(isinstance(x, Number) for x in row):
                return None
            if len(row) == stages:
                return row
            choices = [[None, *row, None][:stages]] if len(row) in (stages - 1, stages - 2) else []
        if not choices:
            return None
        sums = [row_sum(row) for row in matrix]
        best = max(choices, key=lambda row: sum(x is not None and agree(x, s) for x, s in zip(row, sums, strict=True)))
        return [ZERO if x is None and i == 0 else x if x is not None else sums[i] for i, x in enumerate(best)]

    def _steps(self) -> None:
        """A method written as steps: the states of its evaluations, its result and its error."""
        stages = len(self.block.stages)
        rows = {n: v for n, v in self.values.items() if isinstance(v, list) and len(v) == self.block.most_stages + 1}
        errors = [n for n in rows if "err" in n and not near(rows[n][0])]
        results = [n for n in rows if n in RESULTS and abs(near(rows[n][0]) - 1) < NEAR]
        if not results or not all(abs(near(state[0]) - 1) < NEAR for _, state in self.block.stages):
            return
        tables: dict[str, Any] = {
            "A": [state[1 : stages + 1] for _, state in self.block.stages],
            "b": rows[results[0]][1 : stages + 1],
            "c": [time for time, _ in self.block.stages],
        }
        if errors:
            tables["error"] = [rows[n][1 : stages + 1] for n in errors]
        self._report(results[0], "runge-kutta", tables)

    # Kinds.

    def _paired(self, parts: list[tuple[str, dict[str, Any]]]) -> list[tuple[str, dict[str, Any]]]:
        """Two tableaus whose names differ by a mark of the explicit or implicit part, as one additive method."""
        found, used = [], set()
        for i, (name, tables) in enumerate(parts):
            if i in used:
                continue
            for j in range(i + 1, len(parts)):
                other, more = parts[j]
                if j not in used and not any(map(near, more["b"])):
                    used.add(j)  # no second part
                elif j not in used and is_pair(name, other) and len(more["b"]) - len(tables["b"]) in (0, 1, -1):
                    used.add(j)
                    first, second = (tables, more) if not is_explicit(tables["A"]) else (more, tables)
                    tables = {**first, **{f"{key}_explicit": value for key, value in second.items()}}
                    break
            found.append((name, tables))
        return found

    def _nystrom(self, parts: list[Any]) -> bool:
        """A matrix and weights for positions, and weights for velocities."""
        matrix, b = self.values.get("a", self.values.get("A")), self.values.get("b")
        velocities = next((self.values[n] for n in ("bp", "bbar", "b̄", "bprime", "dbp") if n in self.values), None)
        if matrix is None or b is None or velocities is None:
            return False
        weights = as_row(velocities)
        rows = as_square(matrix, len(weights))
        if rows is None:
            return False
        tables = {"A": rows, "b": as_row(b, len(weights)), "b_velocity": weights}
        for key, names in (("A_velocity", ("abar", "Abar", "ap")), ("c", NODES), ("error", ("btilde",)),
                           ("error_velocity", ("bptilde",))):  # fmt: skip
            value = next((self.values[n] for n in names if isinstance(self.values.get(n), list)), None)
            if value is not None:
                row = value if key == "A_velocity" else as_row(value)
                tables[key] = [ZERO, *row] if key == "c" and len(row) == len(weights) - 1 else row
        self._report("a", "nystrom", tables)
        return True

    def _rosenbrock(self, parts: list[Any]) -> bool:
        """Two matrices A and C or Γ, and weights."""
        found = False
        for name in list(self.values):
            match = re.fullmatch(r"(.*)(Gamma|Γ|C)(.*)", name)
            if not match or not isinstance(self.values[name], list | Number):
                continue
            pre, letter, post = match.groups()
            A = self.values.get(f"{pre}A{post}")
            matrix = as_square(A, 0)
            other = as_square(self.values[name], 0)
            if matrix is None or other is None or isinstance(self.values[name], list) != isinstance(A, list):
                continue
            tables = {"A": matrix, "C" if letter == "C" else "Gamma": other}
            for key, names in (("b", ("b",)), ("c", ("c",)), ("d", ("d",)), ("error", ("btilde",)),
                               ("embedded", ("b2", "b1", "bembed", "bm")), ("gamma", ("gamma", "γ", "g"))):  # fmt: skip
                partner = self._partner(pre, names, post)
                if partner is not None:
                    tables[key] = as_row(partner[1]) if key not in ("gamma",) else partner[1]
            if "b" in tables or pre:
                self._report(name, "rosenbrock", tables)
                found = True
        return found

    def _shu_osher(self, parts: list[Any]) -> bool:
        """Matrices α and β with one row for each stage and the result."""
        alpha, beta = (
            next((self.values[n] for n in names if isinstance(self.values.get(n), list)), None)
            for names in (("alpha", "α"), ("beta", "β"))
        )
        if alpha is None or beta is None or parts:
            return False
        if not all(isinstance(row, list) for row in (*alpha, *beta)) or len(alpha) != len(beta):
            return False
        if sum(abs(sum(map(near, row)) - 1) < NEAR for row in alpha) < 1:
            return False
        self._report("alpha", "shu-osher", {"alpha": alpha, "beta": beta})
        return True

    def _low_storage(self) -> bool:
        """Vectors of registers: 2N methods with A and B, 2S* methods with γ1, γ2, β and δ."""
        rows = {name: value for name, value in self.values.items() if isinstance(value, list | dict)}
        A = next((rows[n] for n in ("A", "A2end", "a", "coef_a") if n in rows), None)
        B = next((rows[n] for n in ("B", "b", "B2end", "coef_b", "β") if n in rows), None)
        gammas = [n for n in rows if re.fullmatch(r"(?:gamma|γ)\d{2,3}(?:end)?|(?:gamma|γ)\d(?:end)?", n)]
        if len(gammas) >= 2:
            self._report(
                gammas[0],
                "2s",
                {n: as_row(rows[n]) for n in rows if all(isinstance(x, Number) for x in as_row(rows[n]))},
            )
            return True
        if (
            A is None
            or B is None
            or not ("B2end" in rows or {"A", "B"} <= rows.keys() or {"coef_a", "coef_b"} <= rows.keys())
        ):
            return False
        a, b = as_row(A), as_row(B)
        first = self.values.get("B1")
        if "B2end" in rows and isinstance(first, Number):
            a, b = [ZERO, *as_row(rows["A2end"])], [first, *as_row(rows["B2end"])]
        if len(a) != len(b) or not all(isinstance(x, Number) for x in (*a, *b)):
            return False
        tables = {"A": a, "B": b}
        nodes = rows.get("c2end", rows.get("c"))
        if nodes is not None:
            c = as_row(nodes)
            tables["c"] = [ZERO, *c] if len(c) == len(a) - 1 else c
        self._report("B1" if "B1" in self.lines else "A", "2n", tables)
        return True

    def _coupling(self) -> bool:
        """Matrices of couplings W and G of multirate methods."""
        for name in self.stages:
            arrays = {
                key: self.values[f"{name}.{key}"]
                for key in ("W", "G")
                if isinstance(self.values.get(f"{name}.{key}"), list)
            }
            if arrays:
                nodes = self.values.get(f"{name}.c")
                self._report(f"{name}.{next(iter(arrays))}", "coupling", {**arrays, **({"c": nodes} if nodes else {})})
                return True
        return False

    def _splitting(self) -> bool:
        """Two rows of fractions of a step."""
        found = False
        for pre in dict.fromkeys(name.rpartition(".")[0] for name in self.values):
            dot = f"{pre}." if pre else ""
            for one, two in (("a", "ahat"), ("a", "b"), ("c", "d"), ("alpha", "beta")):
                a, b = self.values.get(f"{dot}{one}"), self.values.get(f"{dot}{two}")
                if a is None or b is None or isinstance(a, Number) or isinstance(b, Number):
                    continue
                x, y = as_row(a), as_row(b)
                size = max(len(x), len(y))
                flat = all(isinstance(v, Number) for v in (*x, *y)) and len(x) - len(y) in (-1, 0, 1)
                fitting = [flat and abs(sum(map(near, row)) - 1) < NEAR for row in (x, y)]
                is_said = any(fitting) and {"order", "q"} & self._claims().keys()  # of one row a time may be wrong
                if (all(fitting) or is_said) and size <= MOST_STAGES:
                    self._report(f"{dot}{one}", "splitting", {one: x, two: y})
                    found = True
                    break
                if two == "beta" and dot and isinstance(b, list):
                    self._report(f"{dot}{one}", "splitting", {one: x, two: b})
                    found = True
                    break
        return found

    def _composition(self) -> bool:
        """The rows of times in a constructor."""
        for name, names in CONSTRUCTORS.items():
            rows = {key: self.values.get(f"{name}.{key}") for key in names}
            if all(isinstance(row, list) and all(isinstance(x, Number) for x in row) for row in rows.values()):
                kinds = {"method": "composition", "half": "symmetric-composition"}
                self._report(f"{name}.{names[0]}", kinds.get(names[0], "splitting"), rows)
                return True
        return False

    def _numeric_families(self) -> None:
        """Families of other letters: nodes are row sums, and weights sum to 1."""
        matrices = [n for n, v in self.values.items() if isinstance(v, list) and n in self.families]
        vectors = {n: v for n, v in self.values.items() if isinstance(v, dict)}
        for name in matrices:
            rows = as_square(self.values[name], 0)
            if rows is None or len(rows) < 2 or name in self.faults:
                continue
            stages = len(rows)
            fitting = {n: as_row(v, stages) for n, v in vectors.items() if max(v) <= stages}
            sums = [row_sum(row) for row in rows]
            scores = {
                n: sum(agree(x, s) for x, s in zip(v, sums, strict=True))
                for n, v in fitting.items()
                if len(v) == stages
            }
            nodes = max(scores, key=scores.__getitem__, default=None)
            if nodes is None or scores[nodes] < max(2, stages // 2):
                continue
            weights = [n for n, v in fitting.items() if n != nodes and abs(sum(map(near, v)) - 1) < NEAR]
            if not weights:
                continue
            tables = {"A": rows, "b": fitting[weights[0]], "c": fitting[nodes]}
            if len(weights) > 1:
                tables["embedded"] = [fitting[n] for n in weights[1:]]
            self._report(name, "runge-kutta", tables)
            return

    # Reports.

    def _report(self, name: str, kind: str, tables: Mapping[str, Any]) -> None:
        """Add a record, unless a block around or before has had the same numbers."""
        key = tuple(id(x) for array in tables.values() for x in flattened(array) if isinstance(x, Number))
        if key in self.finder.used or not any(near(x) for array in tables.values() for x in flattened(array)):
            return
        self.finder.used.add(key)
        line = self.lines.get(name) or next(iter(self.lines.values()), 1)
        claims = self._claims()
        self.said = self._said_name(claims)
        self.finder.records.append(Record(self._title(name), self.finder.source.name, line, kind, tables, claims))

    def _title(self, name: str) -> str:
        """The name of the method of a table: what it says of itself, the stem of its own name, or that of its block."""
        tail = name.rpartition(".")[2]
        stem = re.sub(r"_?(?:A|a|a_lower|Gamma|C)(?:_?(?:hat|\w))?$", "", tail)
        if re.match("alpha|gamma|γ|α|a_lower|method$|half$|B1$", tail):
            stem = ""
        if len(stem.strip("_")) > 1 and not self.block.stages:
            return stem.strip("_")
        if self.said is not None:
            return self.said
        block: Block | None = self.block
        while block is not None:
            if len(block.name) > 2:
                return block.name
            block = block.parent
        return name

    def _claims(self) -> dict[str, str]:
        """What the source says of the method: numbers with such names, texts, and the comment before."""
        claims = {}
        for name, variable in self.variables.items():
            key = name.rpartition(".")[2]
            if key in CLAIMS and isinstance(variable.value, Number):
                claims[key] = str(variable.value.value)
        source = self.finder.source
        tokens = source.tokens
        for i in range(self.start, min(self.end or len(tokens), self.start + MOST_TOKENS)):
            key = tokens[i - 2].text.strip("\"'") if tokens[i].kind == "text" else ""
            if key in CLAIMS and tokens[i - 1].text in ("=", ":"):
                claims.setdefault(key, tokens[i].text.strip("\"'ru"))
            elif tokens[i].kind == "name" and tokens[i + 1].text in ("(", "{") and MADE.search(tokens[i].text):
                end = source.partner.get(i + 1, i + 1)
                if tokens[i + 1].text == "{":
                    end = source.partner.get(end + 1, end)
                if i > self.start + 1 and "call" not in claims:
                    last = tokens[min(end, len(tokens) - 1)]
                    claims["call"] = " ".join(source.text[tokens[i].start : last.start + 1].split())[:500]
        first = next((i for i in range(self.start, len(tokens)) if tokens[i].kind != "line"), self.start)
        begins = self.block.parent is not None and self.start == self.block.start
        said = [source.comment(tokens[first].start), source.leading_comment(first) if begins else ""]
        if any(said):
            claims["comment"] = "\n".join(filter(None, said))
        return claims

    def _said_name(self, claims: Mapping[str, str]) -> str | None:
        """A name in a text or in the call that makes the method."""
        if "name" in claims:
            return claims["name"]
        match = re.search(r"[({,]\s*(?::|Symbol\()?[\"']?([A-Za-z][\w-]{2,})", claims.get("call", ""))
        is_constant = match is not None and (match[1].isupper() or ":" + match[1] in claims["call"])
        return match[1] if match is not None and (is_constant or '"' in match[0]) else None
