"""Lindstedt–Poincaré series: nearly integrable Hamiltonians in action-angle variables without their angles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.sparse_polynomials import TooLarge
from bseries.hamiltonians.action_angle.elimination import Elimination
from bseries.hamiltonians.action_angle.fourier import FourierRing
from bseries.hamiltonians.action_angle.normal_form import NormalForm
from bseries.hamiltonians.action_angle.variable_pairs import read_pair
from integrators.core.arguments import items
from integrators.scenes.model.blocks import check_symbols
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.blocks import Block

MOST_MONOMIALS = 100_000
"""Series with longer coefficients are refused."""


def lindstedt_poincare(
    scene: Scene,
    order: int,
    *,
    parameter: str = "eps",
    perturbations: Iterable[Any] | None = None,
    keep_resonant: bool = False,
    limit: int = MOST_MONOMIALS,
) -> NormalForm:
    """Eliminate the angles of H = K(a) + ε H_1(a, θ) + ε² H_2(a, θ) + … through a power of ε.

    The symplectic change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ) with S = ε S_1 + … + ε^N S_N takes H to
    K(b) + ε K_1(b) + … + ε^N K_N(b) + O(ε^(N+1)): along solutions b changes by O(t ε^(N+1)) only. All is exact; what
    is divided by are the functions k·ω(b), ω = ∇K, for finitely many k.

    Args:
        scene: The system in action-angle variables: blocks of actions and of angles, which play the parts of p and q.
        order: The power N of ε to eliminate the angles through.
        parameter: The name of ε: that of a parameter of the scene, whatever its value.
        perturbations: H_1, H_2, …, as formulas in the scene's variables, to be added to its Hamiltonian; the
            parameter need then not be one of the scene's.
        keep_resonant: Keep modes with k·ω = 0 for all actions in the new Hamiltonian, which then depends on the
            resonant combinations of angles, instead of refusing them.
        limit: Most monomials that a coefficient may have on the way.

    Returns:
        The series; see `NormalForm`.

    Raises:
        SeriesError: The scene is not Hamiltonian in all its variables, H has infinitely many Fourier modes or depends
            on angles without the perturbation, there is a resonance, or the formulas grow too large.

    Example:
        >>> import bseries as bs
        >>> rotor = bs.Scene({"a": 1, "theta": 1}, hamiltonian="a^2/2 + eps*cos(theta)", parameters={"eps": "1/10"})
        >>> form = lindstedt_poincare(rotor, 4)
        >>> print(form)
        normal form of scene
        eps^0   a**2/2
        eps^1   0
        eps^2   1/(4*a**2)
        eps^3   0
        eps^4   5/(64*a**6)
        >>> form.generating_function(1), dict(form.denominators)
        (-sin(theta)/a, {(1,): a, (2,): 2*a, (3,): 3*a, (4,): 4*a})

    References:
        HLW, section X.2; E. Hairer, lecture on long-time behaviour, section 7; for resonant modes F. G. Gustavson,
        Astron. J. 71 (1966) 670, doi:10.1086/110172.
    """
    if isinstance(order, bool) or not isinstance(order, int) or order < 1:
        raise SeriesError(f"order must be a whole number ≥ 1, but was {order!r:.60}")
    layout = _layout(scene)
    given = None if perturbations is None else items(perturbations, "perturbations")
    energies = _powers(scene, parameter, order, given)

    actions, angles = (scene.symbols[block.offset : block.end] for block in layout)
    try:
        fourier = FourierRing(energies, actions, angles, limit=limit)
        elimination = Elimination(fourier, [fourier.read(term) for term in energies], keep_resonant=keep_resonant)
    except TooLarge:
        raise SeriesError(f"order must be smaller: a coefficient would have more than {limit} monomials") from None
    except RecursionError:
        raise SeriesError("hamiltonian must be nested less deeply than the interpreter's limit") from None
    return NormalForm(scene, parameter, layout, elimination)


def _layout(scene: Any) -> tuple[Block, Block]:
    """The blocks of actions and of angles."""
    if not isinstance(scene, Scene):
        raise SeriesError(f"scene must be a Scene, but was {scene!r:.60}")
    if not scene.is_hamiltonian:
        raise SeriesError(f"scene must be Hamiltonian, but {scene.name} is not")
    return read_pair(scene, "scene")


def _powers(scene: Scene, parameter: str, order: int, perturbations: Sequence[Any] | None) -> list[sympy.Expr]:
    """H_0 = K, H_1, …, the Taylor coefficients of the Hamiltonian in the parameter."""
    import sympy

    known = isinstance(parameter, str) and parameter in scene.parameters
    if not known and perturbations is None:
        names = ", ".join(scene.parameters) or "none"
        raise SeriesError(f"parameter must be one of the scene's parameters, {names:.60}, but was {parameter!r:.60}")
    if parameter in scene.variables:
        raise SeriesError(f"parameter must have a name of its own, but {parameter:.60} is a variable")
    check_symbols([parameter], "parameter")
    rest: Any = (scene.with_parameters(**{parameter: parameter}) if known else scene).hamiltonian
    eps, zero, found, factorial = sympy.Symbol(parameter), sympy.Integer(0), [], 1
    for m in range(order + 1):
        term: Any = rest.xreplace({eps: zero})
        if term.has(sympy.nan, sympy.zoo, sympy.oo):
            raise SeriesError(
                f"parameter must be one that can be small, but at {parameter} = 0 there is no Hamiltonian"
            )
        found.append(term / factorial)
        rest, factorial = rest.diff(eps), factorial * (m + 1)
    names = [*scene.variables, *scene.parameter_values]
    for m, formula in enumerate(perturbations or [], 1):
        added = filled(read_formula(formula, names, f"perturbations[{m}]"), scene)
        if m <= order:
            found[m] += added
    return found
