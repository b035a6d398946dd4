"""Steps beside C, and work for a given precision beside other packages: what is kept of them, and how it is shown."""

from __future__ import annotations

import shutil
from pathlib import Path
from statistics import geometric_mean, median
from typing import TYPE_CHECKING

from ..kinds import Figure, Row, Study, Table
from ..texts import times
from .c_steps import GAUSS, STEP_SIZES
from .our_steps import our_steps_like_c
from .precision import OURS, PRECISE, RIVALS, Curve, all_curves, leads, problems
from .problems import Point
from .ratios import Cell, compare

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

LEADS = {
    "kepler": {"scipy": (50.0, 1e-10), "rebound, leapfrog": (1.0, 1e-10), "heyoka": (1.0, 1e-7)},
    "outer-solar-system": {"scipy": (50.0, 1e-10), "rebound, leapfrog": (1.0, 1e-10), "heyoka": (1.0, 1e-10)},
}
"""How many times as long others shall take at least, at every error of energy from 1e-3 to the one given."""
BUDGET, FINER = 0.5, 2.0
"""A curve ends with its first run that takes more CPU seconds; each run has so many times as many steps as the last."""
ABOUT_C = """\
A step over the same step in C, written by hand and compiled with `gcc -O3 -march=native`: the median over rounds that
take turns, in CPU time, and the geometric mean over the scenes."""
ABOUT_PRECISION = """\
CPU time against the largest relative error of energy, of runs with ever smaller steps or tolerances. The tables tell
the least time of ours that reaches an error, and how many times as long the best of each of the others takes; a dash
stands where one of the two does not reach it."""


def over_c(rivals: Path | None = None, *, rounds: int = 9) -> list[Row]:
    """All scenes and methods: seconds a step, ours and in C; nothing without gcc."""
    if shutil.which("gcc") is None:
        return []
    return [row_of(cell) for cell in compare(our_steps_like_c, rounds=rounds)]


def row_of(cell: Cell) -> Row:
    """What is kept of the rounds."""
    return {
        "scene": cell.scene,
        "method": cell.method,
        "ours": median(cell.ours),
        "theirs": median(cell.theirs),
        "ratio": cell.ratio,
    }


def ratio_means(rows: list[Row]) -> dict[str, float]:
    """For every method the geometric mean of its ratios."""
    methods = dict.fromkeys(row["method"] for row in rows)
    return {method: geometric_mean(row["ratio"] for row in rows if row["method"] == method) for method in methods}


def ratio_tables(rows: list[Row]) -> list[Table]:
    """Times in C, and ratios."""
    averages = ratio_means(rows)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    found = {(row["method"], row["scene"]): row for row in rows}
    costs = [[name, *(f"{found[name, scene]['theirs'] * 1e9:.3g}" for scene in scenes)] for name in averages]
    ratios = [
        [name, *(f"{found[name, scene]['ratio']:.3f}" for scene in scenes), f"{average:.3f}"]
        for name, average in averages.items()
    ]
    return [
        Table("C: ns a step", ["method", *scenes], costs),
        Table("Ours over C, and geometric mean", ["method", *scenes, "mean"], ratios),
    ]


def ratio_figures(rows: list[Row]) -> list[Figure]:
    """The means, each with its bar."""
    work = f"a step over the same in C, mean over {len(STEP_SIZES)} scenes"
    return [
        Figure(f"{name}: {work}", mean, 1.10 if name in GAUSS else 1.05) for name, mean in ratio_means(rows).items()
    ]


def curves(rivals: Path, *, budget: float = BUDGET) -> list[Row]:
    """The curves of both problems, ours and those of packages installed in a virtual environment."""
    rough = [problem._replace(finer=FINER) for problem in problems()]
    return [curve.to_dict() for problem in rough for curve in all_curves(problem, rivals, PRECISE, budget=budget)]


def curves_of(rows: list[Row]) -> list[Curve]:
    """Curves from what is kept of them."""
    return [Curve(**{**row, "points": [Point(*point) for point in row["points"]]}) for row in rows]


def precision_tables(rows: list[Row]) -> list[Table]:
    """The leads on each problem."""
    found = curves_of(rows)
    versions = {curve.package: curve.version for curve in found}
    headings = ["error", f"{OURS}, ms", *(f"{kind} {versions.get(RIVALS[kind][0], '')}".strip() for kind in RIVALS)]
    tables = []
    for problem in problems():
        own = [curve for curve in found if curve.problem == problem.name]
        if own:
            tables.append(Table(problem.title, headings, [_cells(row) for row in leads(own)]))
    return tables


def _cells(row: Row) -> list[str]:
    mine = "–" if row[OURS] is None else f"{row[OURS] * 1e3:.3g}"
    return [f"{row['error']:.0e}", mine, *(times(row[kind]) for kind in RIVALS)]


def precision_figures(rows: list[Row]) -> list[Figure]:
    """The least leads over the other packages, each with its bar."""
    found, curves = [], curves_of(rows)
    for problem in problems():
        own = leads([curve for curve in curves if curve.problem == problem.name])
        for kind, (bar, last) in LEADS[problem.name].items():
            within = [row for row in own if row["error"] > last / 2]
            ratios = [row[kind] if row[OURS] else 0.0 for row in within if not row[OURS] or row[kind] is not None]
            if any(curve.package == RIVALS[kind][0] and curve.problem == problem.name for curve in curves) and ratios:
                work = f"{problem.title}: time of {kind} over ours, least for energy errors from 1e-03 to {last:.0e}"
                found.append(Figure(work, min(ratios), bar, at_least=True))
    return found


def draw_precision(rows: list[Row]) -> Picture:
    """The work-precision diagram."""
    from .diagram import draw

    found = curves_of(rows)
    shown = {curve.problem for curve in found}
    return draw(found, [problem for problem in problems() if problem.name in shown])


OVER_C = Study("stepping-c", ABOUT_C, over_c, ratio_tables, ratio_figures)
PRECISION = Study("stepping-precision", ABOUT_PRECISION, curves, precision_tables, precision_figures, draw_precision)
