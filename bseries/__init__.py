"""B-series and backward error analysis: the algebra of series, and the roof over `trees` and `integrators`.

``import bseries as bs`` is enough: the public names of all three packages are here. Heavy imports wait until a name is
used (PEP 562); ``__init__.pyi`` lists the names for type checkers.
"""

from pathlib import Path as _Path

import lazy_loader as _lazy_loader

import integrators as _integrators
import trees as _trees

for _package in (_integrators, _trees):
    _found = _Path(_package.__file__ or ".").resolve().parent
    if _found != _Path(__file__).resolve().parent.parent / _package.__name__:
        raise ImportError(f"bseries needs its own package {_package.__name__!r}, but {_found} hides it")

_get_own, _, _own_names = _lazy_loader.attach(
    __name__,
    submod_attrs={
        "algebra": ["compose", "lie_derivative"],
        "conditions": ["error_coefficients", "order_of"],
        "conjugation": ["ConjugateVerdict", "bracket", "conjugate", "conjugate_symplecticity", "effective_order"],
        "convergence": ["ConvergenceRadius", "convergence_radius"],
        "evaluation": ["SceneSeries", "modified_field", "modifying_field", "series_map"],
        "exceptions": ["SeriesError"],
        "figures.registry": ["figure", "figure_names"],
        "brackets.bracket_series": ["BracketSeries"],
        "brackets.campbell_hausdorff": ["bch", "bracket_hamiltonian"],
        "action_angle.canonical": ["CoordinateChange", "canonical_transformation"],
        "hamiltonians.convergent": ["ClosedHamiltonian", "closed_hamiltonian"],
        "drift.mean_rates": ["energy_drift"],
        "drift.report": ["DriftReport"],
        "hamiltonians.generating_functions": ["GeneratingFunction", "exact_generating_function", "generating_function"],
        "hamiltonians.hamilton_jacobi": ["generating_hamiltonian"],
        "action_angle.lindstedt": ["lindstedt_poincare"],
        "hamiltonians.result": ["ModifiedHamiltonian"],
        "hamiltonians.routes": ["modified_hamiltonian"],
        "action_angle.normal_form": ["NormalForm"],
        "advice.effect_cost_rows": ["CostRow", "EffectCosts", "effect_costs"],
        "advice.effect_influences": ["effect_influence"],
        "advice.effect_report": ["EffectReport", "EffectRow", "Influence"],
        "advice.prediction": ["ExpectedError", "Prediction", "predict_run"],
        "advice.recommendation": ["Recommendation"],
        "advice.precision_curves": ["WorkPrecision", "work_precision"],
        "drift.turn_integrals": ["takahashi_imada_integral"],
        "action_angle.transformation_kinds": [
            "generating_transformation",
            "harmonic_action_angle",
            "point_transformation",
        ],
        "hamiltonians.variational": ["variational_generating_function"],
        "hamiltonians.verdicts": ["HamiltonianVerdict", "hamiltonian_verdict"],
        "modified": ["exact_flow", "modified_equation", "series"],
        "modified_invariants": ["ModifiedInvariant", "divergence", "modified_invariant"],
        "modifying_runs": ["modifying_steps"],
        "substitution": ["modifying_integrator", "substitute", "substitution_inverse"],
        "order_theory.compiling": ["CompiledConditions"],
        "order_theory.condition": ["OrderCondition"],
        "order_theory.generating": ["order_conditions"],
        "order_theory.listing": ["OrderConditions"],
        "reports": ["check"],
        "shadow.trajectory_energies": ["shadow_energy"],
        "shadow.coefficients": ["ShadowFormula", "shadow_formula"],
        "shadow.report": ["ShadowReport"],
        "structure": [
            "accuracy",
            "cubic_invariants",
            "energy_preservation",
            "hamiltonian_field",
            "symmetry",
            "symplecticity",
            "volume_preservation",
        ],
        "term_sizes": ["Reach", "TruncationWarning", "reach"],
        "truncated": ["BSeries"],
        "verdicts": ["Verdict"],
    },
)
_owners = {name: package for package in (_trees, _integrators) for name in package.__all__}
__all__ = sorted([*_own_names, *_owners, "errors"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name == "errors":
        return (_trees.TreeError, _integrators.IntegratorError, _get_own("SeriesError"))
    if name in _owners:
        return getattr(_owners[name], name)
    return _get_own(name)


def __dir__() -> list[str]:
    return __all__.copy()
