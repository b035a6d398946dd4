"""C written by hand for every scene and method of the comparison: compiled, and called through ctypes.

Coefficients and masses come from the catalogue and the scene, as constants of the program, so that both sides compute
with the same numbers.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Iterable
from functools import lru_cache
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import bseries as bs

from ..timing import run as run_process

if TYPE_CHECKING:
    import numpy as np

SOURCES = Path(__file__).with_name("c")
COMPILE = ("gcc", "-O3", "-march=native", "-fno-math-errno", "-Wall", "-shared", "-fPIC")
"""No -ffast-math. That `errno` stays untouched changes no result, and lets gcc take several square roots at once."""
STEP_SIZES = {
    "pendulum": 0.1,
    "kepler": 2 * pi / 200,
    "toda": 0.05,
    "lennard-jones": 0.005,
    "outer-solar-system": 50.0,
}
"""The scenes, each with the step size of the comparison."""
GAUSS = ("implicit-midpoint", "gauss2", "gauss3", "gauss4")
METHODS = ("stormer-verlet-kdk", "rk4", "yoshida6", *GAUSS)
DIGITS = 40

Run: TypeAlias = Callable[["np.ndarray", float, int], None]
"""run(y, h, steps) moves the state y on, in place."""


class CFailure(RuntimeError):
    """An iteration that does not end, or a state that is not finite."""


def c_steps(scene: str, method: str) -> Run:
    """The C program for a scene and a method of the comparison."""
    function: Any = getattr(_library(scene), "composition" if method == "yoshida6" else method.replace("-", "_"))
    function.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_long]
    further: tuple[Any, ...] = ()
    if method == "yoshida6":
        sizes = yoshida6_sizes()
        function.argtypes += [ctypes.c_int, ctypes.c_void_p]
        further = (len(sizes), (ctypes.c_double * len(sizes))(*sizes))

    def run(y: np.ndarray, h: float, steps: int) -> None:
        if function(y.ctypes.data, h, steps, *further):
            raise CFailure(f"{method} on {scene} with h = {h} fails in C")

    return run


def yoshida6_sizes() -> list[float]:
    """The steps of Störmer–Verlet that make up yoshida6: those of the drifts."""
    composed: Any = bs.method("yoshida6")
    return [float(size) for part, size in composed.flows if part == "b"]


@lru_cache(maxsize=1)
def scratch_folder() -> tempfile.TemporaryDirectory[str]:
    """Where programs are compiled; it is removed when the interpreter ends."""
    return tempfile.TemporaryDirectory()


@lru_cache(maxsize=len(STEP_SIZES))
def _library(scene: str) -> ctypes.CDLL:
    folder = Path(scratch_folder().name)
    (folder / "coefficients.h").write_text(_coefficients())
    target = folder / f"{scene}.so"
    run_process([*COMPILE, f'-DSCENE="{scene}.h"', f"-I{folder}", str(SOURCES / "steps.c"), "-o", str(target), "-lm"])
    return ctypes.CDLL(str(target))


@lru_cache(maxsize=1)
def _coefficients() -> str:
    """The header with the numbers of all Gauss methods and the masses of the outer solar system."""
    solar: Any = bs.scene("outer-solar-system").parameters
    lines = [_array("mass", solar["m"]), _array("gravity", [solar["G"] * m for m in solar["m"]])]
    for method in GAUSS:
        for name, values in gauss_coefficients(method).items():
            lines.append(_array(f"{method.replace('-', '_')}_{name}", values))
    return "".join(lines)


def _array(name: str, values: Iterable[Any]) -> str:
    numbers = [repr(float(x)) for x in values]
    return f"static const double {name}[{len(numbers)}] = {{{', '.join(numbers)}}};\n"


def gauss_coefficients(method: str) -> dict[str, list[Any]]:
    """What `gauss.h` needs, each number rounded once: matrices row by row, `ahead` is the extrapolation."""
    import mpmath

    with mpmath.workdps(DIGITS):
        chosen: Any = bs.method(method)
        A, b, c = chosen.algebra.tableau_decimal(DIGITS) if chosen.algebra else (chosen.A, chosen.b, chosen.c)
        stages = range(len(b))
        return {
            "c": list(c),
            "A2": [sum(A[i][k] * A[k][j] for k in stages) for i in stages for j in stages],
            "b": list(b),
            "bA": [sum(b[i] * A[i][j] for i in stages) for j in stages],
            "ahead": [_lagrange(c, j, 1 + c[i]) for i in stages for j in stages],
        }


def _lagrange(nodes: Any, j: int, x: Any) -> Any:
    """The polynomial that is 1 at node j and 0 at the others, at x."""
    product = 1
    for k, node in enumerate(nodes):
        if k != j:
            product = product * (x - node) / (nodes[j] - node)
    return product
