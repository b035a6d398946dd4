"""Candidate methods for a scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from bseries.algebra.stages import check_method
from integrators.core.errors import IntegratorError, shorten
from integrators.methods.catalogue.registry import RECOMMENDED, catalogue, method
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene
from integrators.steppers.stepping import stepper

Methods = Iterable[Method | str] | Method | str

NYSTROM = (
    *("stormer-verlet", "chin4a", "chin4c", *RECOMMENDED["nystrom splitting"].values(), "blanes-moan-rkn6-11"),
    *("dormand-prince54", "dop853", "gauss4", "gauss8", "lobatto-iiia-iiib8"),
)
"""For q'' = g(q). These and the next two lists are the methods of the catalogue that were the cheapest for some error
on some scene, and simple methods of orders 2 and 4 for comparison."""
SPLIT = (
    *("stormer-verlet", "blanes-moan4", "blanes-moan6", "sofroniou-spaletta8", "rk4", "tsit5", "dormand-prince54"),
    *("dop853", "implicit-midpoint", "gauss2", "gauss4"),
)
"""For two parts whose flows are known."""
WHOLE = (
    *("rk4", "dormand-prince54", "tsit5", "verner65", "dop853", "implicit-midpoint", "gauss2", "gauss4", "gauss6"),
    *("radau-iia2", "radau-iia3", "rodas4"),
)
"""For any field."""
AUTO, ALL = "auto", "all"
MOST_STAGES = 8
"""Most stages of families, if all methods are requested: more stages are not more accurate in double precision."""


class Candidate(NamedTuple):
    """A method with its name, and the solver for its implicit stages; see `integrators.stepper`."""

    name: str
    method: Method
    solver: str = "fixed-point"


def candidates(scene: Scene, methods: Methods = AUTO) -> tuple[list[Candidate], dict[str, str]]:
    """The methods of a selection that fit a scene, and the reasons why others do not, by name; see `work_precision`.

    ``"all"`` are those of the catalogue without parameters, of families those with few stages.

    Example:
        >>> import bseries as bs
        >>> [candidate.name for candidate in candidates(bs.scene("lorenz"))[0]][:3]
        ['rk4', 'dormand-prince54', 'tsit5']
    """
    left_out = dict[str, str]()
    found = []
    for name, given in _named(scene, methods).items():
        try:
            found.append(candidate(scene, given))
        except IntegratorError as error:
            left_out[name] = str(error)
    if not found:
        reason = next(iter(left_out.values()), "")
        raise IntegratorError(f"methods must have one that fits {scene.name}, but had none: {shorten(reason, 200)}")
    return found, {} if methods == AUTO else left_out  # default methods were not requested by name


def candidate(scene: Scene, given: Method | str) -> Candidate:
    """A method, or the name of one, as a candidate for a scene."""
    found = Candidate(given, method(given)) if isinstance(given, str) else Candidate(given.name, given)
    stepper(found.method, scene, solver=found.solver)
    return found


def _named(scene: Scene, methods: Methods) -> dict[str, Method | str]:
    """Methods by name, checked."""
    if methods in (AUTO, ALL):
        return {name: name for name in (_usual(scene) if methods == AUTO else _everything())}
    found: dict[str, Method | str] = {}
    for given in [methods] if isinstance(methods, str) or not isinstance(methods, Iterable) else methods:
        name = given if isinstance(given, str) else check_method(given).name
        if isinstance(given, str):
            method(given)  # refuses unknown names
        if found.setdefault(name, given) != given:
            raise IntegratorError(f"methods must have different names, but two are called {name}")
    if not found:
        raise IntegratorError("methods must name at least one method, but named none")
    return found


def _usual(scene: Scene) -> tuple[str, ...]:
    """Methods known to be efficient on scenes of this structure."""
    for names, typical in ((NYSTROM, "rkn-verlet"), (SPLIT, "strang")):
        try:
            stepper(typical, scene)
        except IntegratorError:
            continue
        return names
    return WHOLE


def _everything() -> Iterator[str]:
    for entry in catalogue():
        if entry.is_family:
            yield from (f"{entry.name}{stages}" for stages in range(entry.least_stages, MOST_STAGES + 1))
        elif not entry.parameters:
            yield entry.name
