"""The routes to the modified Hamiltonian of a method on a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bseries.algebra.bseries import BSeries
from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from bseries.fields.modified_invariants import modified_invariant
from bseries.fields.scene_series import modified_field
from bseries.fields.symbolic.differential_rings import DifferentialRing
from bseries.hamiltonians.brackets.on_scenes import bracket_terms
from bseries.hamiltonians.evaluation import EnergyFormulas
from bseries.hamiltonians.from_trees import energy_series, energy_trees
from bseries.hamiltonians.generating_functions import generating_terms
from bseries.hamiltonians.modified_hamiltonian_class import ModifiedHamiltonian
from bseries.hamiltonians.verdicts import hamiltonian_verdict
from integrators.core.errors import IntegratorError
from integrators.scenes.scene import Scene
from trees.counting import check_order

if TYPE_CHECKING:
    import sympy

    from bseries.hamiltonians.evaluation import EnergySeries
    from integrators.methods.program.program import Method

ROUTES = ("auto", "trees", "brackets", "generating-function", "integration")


def modified_hamiltonian(
    method: Method | BSeries, scene: Scene, order: int | None = None, *, parts: Any = None, route: str = "auto"
) -> ModifiedHamiltonian:
    """The modified Hamiltonian of a method on a scene: the Hamiltonian of its modified equation, truncated.

    Args:
        method: A method, or a field series (such as `modified_equation` gives).
        scene: The scene: canonical, or a Poisson system.
        order: The number of terms N: powers h^0 … h^(N−1). For a series None means its own order.
        parts: For methods that treat parts of the field: maps their names to blocks or parts of the scene, where it is
            not clear from the names.
        route: ``"trees"`` (elementary Hamiltonians), ``"brackets"`` (nested Poisson brackets, for splittings and
            compositions), ``"generating-function"`` (the Hamilton–Jacobi equation), ``"integration"`` (of the modified
            equation on this scene), or ``"auto"``: trees where the method is symplectic, else brackets on a Poisson
            system, else integration.

    Raises:
        SeriesError: The modified equation is not Hamiltonian on the scene; the route does not lead to it; an argument
            is out of its range.

    Example:
        >>> import bseries as bs
        >>> H = modified_hamiltonian(bs.method("stormer-verlet"), bs.scene("henon-heiles"), 3)
        >>> print(H)
        the modified Hamiltonian of stormer-verlet-kdk on henon-heiles
        h^0   p1**2/2 + p2**2/2 + q1**2*q2 + q1**2/2 - q2**3/3 + q2**2/2
        h^1   0
        h^2   p1**2*q2/6 + p1**2/12 + p1*p2*q1/3 - p2**2*q2/6 + p2**2/12 - q1**4/24 - q1**2*q2**2/12 - ...

        A method that is not symplectic has none:

        >>> modified_hamiltonian(bs.method("rk4"), bs.scene("henon-heiles"), 5)
        Traceback (most recent call last):
        bseries.exceptions.SeriesError: method must be symplectic on henon-heiles, but rk4 is Hamiltonian for all H
        to order 4, where [τ,[[τ]]] breaks it, and on henon-heiles to order 4, where the term with h^4 breaks it

    References:
        HLW, sections IX.3, IX.4 and IX.9, theorem IX.9.8.
    """
    if route not in ROUTES:
        raise SeriesError(f"route must be one of {', '.join(ROUTES)}, but was {route!r:.60}")
    if not isinstance(scene, Scene):
        raise SeriesError(f"scene must be a Scene, but was {scene!r:.60}")
    if isinstance(method, BSeries):
        order = check_order(method.order if order is None else order)
        if method.empty != 0:
            raise SeriesError(
                f"method must be a method or the series of a field, but its empty tree has {method.empty}"
            )
        if route in ("brackets", "generating-function"):
            raise SeriesError(f"method must be a method for the route {route!r}, but was a series")
    else:
        check_method(method)
        if order is None:
            raise SeriesError("order must be given for a method, but was None")
        order = check_order(order)
    found, energy = _found(method, scene, order, parts, route)
    return ModifiedHamiltonian(method, scene, order, parts, found, energy)


def _found(
    method: Method | BSeries, scene: Scene, order: int, parts: Any, route: str
) -> tuple[str, EnergySeries | EnergyFormulas]:
    """The route that leads to H̃, and H̃."""
    canonical = scene.is_hamiltonian and scene.poisson is None
    if route == "trees" or (route == "auto" and canonical):
        found = _by_trees(method, scene, order, parts, canonical)
        if found is not None:
            return "trees", found
        if route == "trees":
            verdict = hamiltonian_verdict(method, scene, order, parts=parts)
            raise SeriesError(f"method must be symplectic for the route 'trees', but {verdict}")
    is_method = not isinstance(method, BSeries)
    if is_method and (route == "brackets" or (route == "auto" and scene.poisson is not None)):
        try:
            return "brackets", EnergyFormulas(scene.symbols, bracket_terms(method, scene, order, parts))
        except SeriesError:
            if route == "brackets":
                raise
    if is_method and route == "generating-function":
        return route, EnergyFormulas(scene.symbols, generating_terms(method, scene, order, parts))
    _check_hamiltonian(method, scene, order, parts)
    terms = modified_invariant(modified_field(method, scene, order, parts=parts)).terms
    if route == "integration":
        terms = _with_constants(terms, method, scene, order, parts, "trees" if canonical else "brackets")
    return "integration", EnergyFormulas(scene.symbols, terms)


def _with_constants(
    terms: tuple[sympy.Expr, ...], method: Method | BSeries, scene: Scene, order: int, parts: Any, route: str
) -> tuple[sympy.Expr, ...]:
    """Integrals with the constants that elementary Hamiltonians or brackets have, where one of these is their sum."""
    if route == "brackets" and isinstance(method, BSeries):
        return terms
    try:
        _, energy = _found(method, scene, order, parts, route)
    except (SeriesError, IntegratorError):
        return terms
    found = [terms[0]]
    for k, term in enumerate(terms[1:], 1):
        ring = DifferentialRing.of([energy.symbolic(k) - term], scene.symbols)
        gap = ring.elements[0]
        is_constant = all(ring.is_zero(ring.derivative(gap, i)) for i in range(scene.dimension))
        found.append(term + ring.to_expression(gap) if is_constant else term)
    return tuple(found)


def _by_trees(method: Method | BSeries, scene: Scene, order: int, parts: Any, canonical: bool) -> EnergySeries | None:
    """H̃ by trees; None if the modified equation is not Hamiltonian for all Hamiltonians like that of the scene."""
    if not canonical:
        raise SeriesError(f"scene must be given by a Hamiltonian in canonical variables, but {scene.title} is not")
    trees = energy_trees(method, scene, order, parts)
    return energy_series(trees) if trees.verdict.holds else None


def _check_hamiltonian(method: Method | BSeries, scene: Scene, order: int, parts: Any) -> None:
    """Refuse a modified equation that is not Hamiltonian on the scene."""
    verdict = hamiltonian_verdict(method, scene, order, parts=parts)
    if verdict.order == 0:
        raise SeriesError(f"scene must be Hamiltonian, but the field of {scene.title} is not")
    if not verdict.holds:
        kind = "symplectic" if scene.poisson is None else "a Poisson integrator"
        raise SeriesError(f"method must be {kind} on {scene.title}, but {verdict}")
