"""Butcher tableaus as arrays in LaTeX and as rows of CSV, rewritten line by line as assignments for the reader."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

ARRAY = re.compile(
    r"\\begin\{(array|tabular)\}\s*(?:\[\w\]\s*)?\{([^{}\n]{1,200})\}((?:(?!\\begin\{).)*?)\\end\{\1\}", re.S
)
RULES = re.compile(r"\\(?:hline|toprule|midrule|bottomrule|(?:cline|cmidrule)(?:\([lr]+\))?\{[^{}]*\})")
SPACES = re.compile(r"\\(?:left|right|displaystyle|textstyle|[,;:! ])|[$~]")
ROW = re.compile(r"(?:\\\\(?:\s*\[[^\]\n]*\])?|\\tabularnewline)")
FRACTION = re.compile(r"\\[dt]?frac\s*(?:\{([^{}]*)\}|(\d))\s*(?:\{([^{}]*)\}|(\d))")
ROOT = re.compile(r"\\sqrt\s*(?:\{([^{}]*)\}|(\d))")
NEW_LINE = "\n"
MOST_NESTED = 10
"""Fractions and roots inside others."""


def rewritten(text: str, suffix: str = "") -> str | None:
    r"""A text in which tableaus in LaTeX or CSV are assignments of Julia, and all other lines are comments.

    Args:
        text: The text.
        suffix: The suffix of its file; `.csv` for rows of numbers.

    Returns:
        The text with as many lines; None where there is no tableau of this kind.

    Example:
        >>> source = r"\begin{array}{c|c} \frac12 & \frac{1}{2} \\ \hline & 1 \end{array}"
        >>> print(rewritten(source))
        # \begin{array}{c|c}
        function tableau1(); A = zeros(1,1); b = zeros(1); c = zeros(1); c[1] = 1/2; A[1,1] = 1/2; b[1] = 1# \end{array}
    """
    if suffix == ".csv":
        lines = text.splitlines()
        table = [[cell.strip().strip('"') for cell in line.split(",")] for line in lines]
        rows = [(row, (1, 0)) for row in table]
        return _block(1, rows).removeprefix(NEW_LINE) if _is_tableau(table) else None
    parts, end, found = [], 0, 0
    for match in ARRAY.finditer(text):
        rows = list(_rows(match[3]))
        if "|" in match[2] and _is_tableau([row for row, _ in rows]):
            found += 1
            parts += [_commented(text[end : match.start(3)]), _block(found, rows)]
            end = match.end(3)
    return "".join([*parts, _commented(text[end:])]) if found else None


def _rows(body: str) -> Iterator[tuple[list[str], tuple[int, int]]]:
    """The cells of each row of an array, as formulas, and the ends of lines before and behind them."""
    for row in ROW.split(RULES.sub("", body)):
        before = row[: len(row) - len(row.lstrip())].count(NEW_LINE)
        yield [_formula(cell) for cell in row.split("&")], (before, row.count(NEW_LINE) - before)


def _formula(cell: str) -> str:
    """A formula without fractions and roots of LaTeX."""
    text = " ".join(SPACES.sub("", re.sub(r"(?m)(?<!\\)%.*$", "", cell)).split())
    text = text.replace(r"\cdot", "*").replace(r"\times", "*")
    for _ in range(MOST_NESTED):
        changed = ROOT.sub(lambda match: f"sqrt({match[1] or match[2]})", text)
        changed = FRACTION.sub(
            lambda match: f"{_grouped(match[1] or match[2])}/{_grouped(match[3] or match[4])}", changed
        )
        if changed == text:
            break
        text = changed
    return text.replace("{", "(").replace("}", ")")


def _grouped(text: str) -> str:
    """A part of a quotient, in brackets if it is no number."""
    return text if re.fullmatch(r"\s*-?[\d.]+\s*", text) else f"({text})"


def _is_tableau(table: Sequence[Sequence[str]]) -> bool:
    """Whether rows have a node and entries, and at least one last row has weights and no node."""
    rows = [row for row in table if any(row)]
    nodes = [bool(row[0]) for row in rows]
    stages = sum(nodes)
    shapes = {len(row) for row in rows}
    return 0 < stages < len(rows) <= stages + 3 and nodes[:stages] == [True] * stages and max(shapes) == stages + 1


def _block(number: int, rows: Sequence[tuple[Sequence[str], tuple[int, int]]]) -> str:
    """The assignments of a tableau, each in its line."""
    stages = sum(bool(row[0]) for row, _ in rows)
    parts = []
    weights = iter(("b", "bhat", "bhat2"))
    i = 0
    for row, (before, behind) in rows:
        entries = []
        if parts:
            parts.append(NEW_LINE * before)
        else:
            zeros = f"A = zeros({stages},{stages}); b = zeros({stages}); c = zeros({stages})"
            parts.append(f"{NEW_LINE * max(before, 1)}function tableau{number}(); {zeros}")
        if row[0]:
            i += 1
            entries = [f"c[{i}] = {row[0]}", *(f"A[{i},{j}] = {x}" for j, x in enumerate(row[1:], 1) if x)]
        elif any(row):
            name = next(weights)
            entries = [f"{name}[{j}] = {x}" for j, x in enumerate(row[1:], 1) if x]
        parts.append("".join(f"; {entry}" for entry in entries) + NEW_LINE * behind)
    return "".join(parts)


def _commented(text: str) -> str:
    """Lines as comments."""
    return re.sub(r"(?m)^(?=.*\S)", "# ", text)
