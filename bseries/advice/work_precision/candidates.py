"""Candidate methods for a scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from bseries.fields.modified_fields import modifying_field
from integrators.core.errors import IntegratorError, shorten
from integrators.methods.catalogue.recommendations import RECOMMENDED
from integrators.methods.catalogue.registry import catalogue, method
from integrators.scenes.scene import Scene
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np

    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene
    from integrators.steppers.stepping import Stepper

    Methods = Iterable[Method | str] | Method | str | None


MOST_VARIABLES = 8
MOST_MONOMIALS = 2000
"""Size of the largest formulas that are worth their cost."""


def modifying_scene(method: Method, scene: Scene, order: int) -> Scene:
    """The modifying field f + h f_2 + … + h^(N−1) f_N as a scene with h as its last variable, h' = 0.

    So one compiled code serves every step size. The method applied to it with the step h has order N on the scene.
    What the scene calls its energy is observable under that name.

    Example:
        >>> import bseries as bs
        >>> modifying_scene(bs.method("implicit-midpoint"), bs.scene("riccati"), 3).field
        (-h**2*y**4/4 + y**2, 0)

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Numerical integrators based on modified differential equations*,
        Math. Comp. 76 (2007), doi:10.1090/S0025-5718-07-01967-9.
    """
    import sympy

    if len(method.names) > 1:
        raise SeriesError(f"method must treat the whole field alike, but {method.name} has {', '.join(method.names)}")
    if scene.dimension > MOST_VARIABLES:
        raise SeriesError(f"scene must have at most {MOST_VARIABLES} variables, but {scene.name} has {scene.dimension}")
    series = modifying_field(method, scene, order).symbolic_series(limit=MOST_MONOMIALS)
    name = _free_name(scene)
    h = sympy.Symbol(name)
    terms = [series.term(k) for k in range(1, order + 1)]
    field = [sympy.Add(*(h**k * term[i] for k, term in enumerate(terms))) for i in range(scene.dimension)]
    blocks = {block.name: list(scene.variables[block.offset : block.end]) for block in scene.blocks}
    return Scene(
        {**blocks, name: 1},
        field=dict(zip(scene.variables, field, strict=True)) | {name: 0},
        invariants={"energy": scene.hamiltonian} if scene.hamiltonian is not None else None,
        positive=scene.positive,
        name=f"{scene.name} modified for {method.name}, order {order}",
    )


def _free_name(scene: Scene) -> str:
    """A name for the step size that the scene does not use."""
    taken = {*scene.variables, *scene.parameters, *(block.name for block in scene.blocks)}
    return next(name for name in ("h", *(f"h_{k}" for k in range(len(taken) + 1))) if name not in taken)


NYSTROM = (
    *("stormer-verlet", "chin4a", "chin4c", *RECOMMENDED["nystrom splitting"].values(), "blanes-moan-rkn6-11"),
    *("dormand-prince54", "dop853", "gauss4", "gauss8", "lobatto-iiia-iiib8"),
)
"""For q'' = g(q)."""
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
MODIFYING = "modifying-midpoint"
"""The implicit midpoint rule on its modifying field; the order follows the name."""
MODIFYING_ORDERS = (4, 6)
ALL = "all"
MOST_STAGES = 8
"""Most stages of methods from families, if all methods are requested."""


class Candidate(NamedTuple):
    """A method, with the scene that it is applied to.

    Attributes:
        name: The name.
        method: The method.
        scene: The scene; for modifying integrators that of their field, whose last variable is the step size.
        is_modifying: Whether it is a modifying integrator.
        solver: The solver for implicit stages; see `integrators.stepper`.
    """

    name: str
    method: Method
    scene: Scene
    is_modifying: bool = False
    solver: str = "fixed-point"

    def start(self, y0: np.ndarray, h: float) -> np.ndarray:
        """The initial state of a run with step size h."""
        import numpy as np

        return np.append(y0, h) if self.is_modifying else y0

    def stepper(self) -> Stepper:
        """The compiled steps."""
        return stepper(self.scene, self.method, solver=self.solver)


class Candidates(NamedTuple):
    """The methods that fit a scene, and the reasons why others do not, by name."""

    found: list[Candidate]
    left_out: dict[str, str]


def candidates(scene: Scene, methods: Methods = None) -> Candidates:
    """The methods of a selection that fit a scene.

    Args:
        scene: The scene.
        methods: Methods, names of the catalogue, or ``modifying-midpoint`` followed by an order; ``"all"`` are those
            of the catalogue without parameters, of families those with few stages; None are those known to be good on
            scenes of this structure.

    Raises:
        IntegratorError: A name is unknown or given twice, or no method fits.

    Example:
        >>> import bseries as bs
        >>> [candidate.name for candidate in candidates(bs.scene("lorenz")).found][:3]
        ['rk4', 'dormand-prince54', 'tsit5']
    """
    left_out = dict[str, str]()
    found = []
    for name, given in _named(scene, methods).items():
        try:
            found.append(candidate(scene, given))
        except (IntegratorError, SeriesError) as error:
            left_out[name] = str(error)
    if not found:
        reason = next(iter(left_out.values()), "")
        raise IntegratorError(f"methods must have one that fits {scene.name}, but had none: {shorten(reason, 200)}")
    return Candidates(found, {} if methods is None else left_out)  # default methods were not requested by name


def candidate(scene: Scene, given: Method | str) -> Candidate:
    """A method, or the name of one, as a candidate for a scene."""
    if not isinstance(given, str):
        found = Candidate(given.name, given, scene)
    elif (order := _modifying_order(given)) is None:
        found = Candidate(given, method(given), scene)
    else:
        basic = method("implicit-midpoint")
        found = Candidate(given, basic, modifying_scene(basic, scene, order), True)
    found.stepper()
    return found


def _named(scene: Scene, methods: Methods) -> dict[str, Method | str]:
    """Methods by name, checked."""
    if methods is None or methods == ALL:
        return {name: name for name in (_usual(scene) if methods is None else _everything())}
    found: dict[str, Method | str] = {}
    for given in [methods] if isinstance(methods, str) or not isinstance(methods, Iterable) else methods:
        if not isinstance(given, str):
            check_method(given)
        elif _modifying_order(given) is None:
            method(given)
        name = given if isinstance(given, str) else given.name
        if found.setdefault(name, given) != given:
            raise IntegratorError(f"methods must have different names, but two are called {name}")
    if not found:
        raise IntegratorError("methods must name at least one method, but named none")
    return found


def _modifying_order(name: str) -> int | None:
    """The order of the modifying integrator with a name; None for other methods."""
    spelt, order = name.lower().replace("_", "-"), 0
    if spelt.startswith(MODIFYING):
        digits = spelt.removeprefix(MODIFYING)
        order = int(digits) if digits.isascii() and digits.isdecimal() and len(digits) < 3 else 0
        if order not in range(4, 11, 2):
            raise IntegratorError(
                f"methods must have an even order from 4 to 10 behind {MODIFYING}, but one was {name!r:.60}"
            )
    return order or None


def _usual(scene: Scene) -> Iterator[str]:
    """Methods known to be efficient on scenes of this structure."""
    if _fits(scene, "rkn-verlet"):
        yield from NYSTROM
    elif _fits(scene, "strang"):
        yield from SPLIT
    else:
        yield from WHOLE
    yield from (f"{MODIFYING}{order}" for order in MODIFYING_ORDERS)


def _fits(scene: Scene, name: str) -> bool:
    try:
        stepper(scene, name)
    except IntegratorError:
        return False
    return True


def _everything() -> Iterator[str]:
    for entry in catalogue():
        if entry.is_family:
            yield from (f"{entry.name}{stages}" for stages in range(entry.least_stages, MOST_STAGES + 1))
        elif not entry.parameters:
            yield entry.name
    yield from (f"{MODIFYING}{order}" for order in MODIFYING_ORDERS)
