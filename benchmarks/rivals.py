"""Other packages at the same work in the same run, and figures that others publish."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import bseries as bs

from .kinds import Case
from .timing import ROOT, Sample, Sampler, run

WORKER = Path(__file__).with_name("rival_worker.py")
DEFAULT = ROOT / ".venv-rivals"


class Rival(NamedTuple):
    """A package, its task and the order it is asked for, and the case of ours that does the same work."""

    package: str
    task: str
    order: int
    opponent: str
    bar: float | None
    """How many times faster ours shall be."""
    note: str

    @property
    def name(self) -> str:
        """Its name among the cases, beside the opponent's."""
        return f"{self.opponent}/{self.package}"


class Published(NamedTuple):
    """A figure measured by others on their machine."""

    package: str
    work: str
    seconds: float
    opponent: str
    source: str


RIVALS = (
    Rival("pybs", "modified equation", 9, "midpoint-9-all", 1000, "exact, memoised"),
    Rival("kauri", "modified equation", 7, "midpoint-7-all", None, "floats, memoised"),
    Rival("kauri", "modifying integrator", 6, "modifying-6", None, "floats, memoised"),
    Rival("pybs", "composition", 7, "compose-7", None, "exact, memoised"),
    Rival("kauri", "composition", 7, "compose-7", None, "floats, memoised"),
    Rival("kauri", "substitution", 6, "substitute-6", None, "floats, memoised"),
    Rival("pybs", "symplecticity", 9, "symplectic-9", None, "exact, memoised"),
    Rival("pybs", "energy preservation", 7, "energy-7", None, "exact series, numerical test"),
    Rival("nodepy", "error coefficients", 8, "errors-8", None, "exact, by SymPy"),
    Rival("nodepy", "order conditions of gauss3", 7, "order-7", None, "floats, conditions written out in full"),
)


def _midpoint(order: int) -> bs.BSeries:
    return bs.series(bs.method("explicit-midpoint"), order)


def _modified(order: int) -> bs.BSeries:
    return bs.modified_equation(bs.method("explicit-midpoint"), order)


OURS: dict[str, Callable[[int], Any]] = {
    "modified equation": lambda n: sum(_modified(n).coefficients()),
    "modifying integrator": lambda n: sum(bs.modifying_integrator(bs.method("explicit-midpoint"), n).coefficients()),
    "composition": lambda n: sum(bs.compose(_midpoint(n), bs.series(bs.method("rk4"), n)).coefficients()),
    "substitution": lambda n: sum(bs.substitute(_modified(n), bs.series(bs.method("rk4"), n)).coefficients()),
    "symplecticity": lambda n: Fraction(bs.symplecticity(bs.method("implicit-midpoint"), n).order),
    "energy preservation": lambda n: Fraction(bs.energy_preservation(bs.method("avf"), n).order),
    "error coefficients": lambda n: sum(
        e for _, e in bs.analysis.error_coefficients(bs.method("explicit-midpoint"), n - 1).terms
    ),
    "order conditions of gauss3": lambda n: Fraction(bs.order_of(bs.method("gauss3"), n)),
}
"""The number that a rival's answer must agree with: a sum of coefficients, or an order."""

PUBLISHED = (
    Published(
        "BSeries.jl 0.1.71",
        "modified equation, order 9, exact, compiled and warm",
        0.0539,
        "midpoint-9-all",
        "https://ranocha.de/BSeries.jl/stable/benchmarks/, AMD EPYC 7763; pybs there 5.69 s, 106 times as long",
    ),
    Published(
        "BSeries.jl 0.1.71",
        "energy preservation of the average vector field method, order 9, exact, warm",
        0.057,
        "energy-9",
        "https://ranocha.de/BSeries.jl/stable/benchmarks/, AMD EPYC 7763",
    ),
    Published(
        "BSeries.jl 0.1.71",
        "symplecticity of the implicit midpoint rule, order 9, exact, warm",
        0.00073,
        "symplectic-9",
        "https://ranocha.de/BSeries.jl/stable/benchmarks/, AMD EPYC 7763",
    ),
)


def rival_versions(environment: Path) -> dict[Rival, str | None]:
    """The version of every rival in this virtual environment (see README.md); None where it is not installed."""
    return {rival: _version(environment, rival.package) for rival in RIVALS}


def _version(environment: Path, package: str) -> str | None:
    code = "import sys, importlib.metadata as m; print(m.version(sys.argv[1]))"
    try:
        return run([_python(environment), "-c", code, package])[1].strip()
    except (OSError, RuntimeError):
        return None


def rival_cases(environment: Path, versions: Mapping[Rival, str | None]) -> list[Case]:
    """A case for each rival that is installed."""
    installed = [rival for rival in RIVALS if versions[rival]]
    return [
        Case(rival.name, f"{rival.package}, {rival.task}, order {rival.order}", _prepare(environment, rival))
        for rival in installed
    ]


def _python(environment: Path) -> str:
    return str(environment.resolve() / ("Scripts/python.exe" if os.name == "nt" else "bin/python"))


def _prepare(environment: Path, rival: Rival) -> Callable[[], Sampler]:
    def prepare() -> Sampler:
        expected = OURS[rival.task](rival.order)

        def sample() -> Sample:
            _, printed = run([_python(environment), str(WORKER), rival.package, rival.task, str(rival.order)])
            answer = json.loads(printed)
            if abs(Fraction(answer["sum"]) - expected) > 1e-12 * max(1, abs(expected)):
                raise RuntimeError(f"{rival.package} gives another {rival.task}: its sum is {answer['sum']}")
            return Sample(answer["seconds"])

        return sample

    return prepare
