"""Every public class in all forms that `print`, notebooks and files show."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

import bseries as bs
import integrators
import trees
from bseries_base.table import MOST_LATEX, MOST_ROWS

ROOMS = (
    bs, trees, trees.hopf, integrators, bs.methods, bs.analysis, bs.stability, bs.algebra, bs.conditions, bs.fields,
    bs.hamiltonians, bs.shadow, bs.advice, bs.runs,
)  # fmt: skip
SHORT = 300
LONG = 60_000
"""The most characters of `repr` and `print`."""
ROWS_OF_OTHERS = {"CostRow", "EffectRow", "ExpectedError", "Influence"}
"""Rows of results, which show them."""
BUILDERS = {"Method", "Program", "GeneralizedAdditiveRungeKutta", "ForceGradient", "TakahashiImada", "ProgramBuilder"}
"""Kinds of methods that show themselves as `Splitting` and `Rosenbrock` do, and the builder of programs."""


@cache
def run() -> Any:
    return bs.integrate("stormer-verlet", "kepler", h=0.05, steps=1000, observe="energy")


@cache
def precision() -> Any:
    return bs.work_precision(["rk4", "stormer-verlet"], "pendulum", span=5, errors=(1e-2, 1e-4))


def field(scene: str = "kepler", order: int = 5) -> Any:
    return bs.modified_field("stormer-verlet", bs.scene(scene), order)


SHEAR = {"p": 1, "q": 1}, {"P": 1, "Q": 1}, {"p": "P + sin(Q)", "q": "Q"}
ROTOR = bs.Scene({"a": 1, "theta": 1}, hamiltonian="a^2/2 + eps*cos(theta)", parameters={"eps": "1/9"})
DRIFT = {"y0": [2.5, 0], "h": 0.2}
EXAMPLES: dict[str, Callable[[], Any]] = {
    "BSeries": lambda: bs.modified_equation("rk4", 12),
    "Series": lambda: bs.series("strang", trees.Words(9)),
    "Effect": lambda: bs.Effect(hamiltonian="q^4"),
    "Term": lambda: bs.Term(hamiltonian="q^4"),
    "PartitionedRungeKutta": lambda: bs.method("lobatto-iiia-iiib3"),
    "RungeKutta": lambda: bs.method("dop853"),
    "Splitting": lambda: bs.method("blanes-moan4"),
    "NystromSplitting": lambda: bs.method("blanes-moan-rkn6"),
    "Rosenbrock": lambda: bs.method("grk4a"),
    "WMethod": lambda: bs.method("ros2-w"),
    "ContinuousStageRungeKutta": lambda: bs.method("avf"),
    "LawsonMethod": lambda: bs.method("lawson4"),
    "RungeKuttaNystrom": lambda: bs.method("rkn-nystrom5"),
    "TwoDerivativeRungeKutta": lambda: bs.method("tdrk4"),
    "LinearMultistep": lambda: bs.method("bdf3"),
    "GeneralLinear": lambda: bs.method("ab3").to_general_linear(),
    "TwoStepRungeKutta": lambda: bs.TwoStepRungeKutta([0], 0, [[0]], ["3/2"], [[0]], ["-1/2"]),
    "Scene": lambda: bs.scene("outer-solar-system"),
    "Trajectory": run,
    "Tree": lambda: bs.Tree("[τ,[τ,[τ]]]"),
    "TreeTable": lambda: bs.TreeTable(12),
    "Basis": lambda: trees.Words(3, 4),
    "Words": lambda: trees.Words(9),
    "Forest": lambda: trees.Forest("τ·[τ]"),
    "FormalSum": lambda: bs.hopf.coproduct(bs.Tree("[[τ,[τ]],τ,[τ,τ]]")),
    "FreeTree": lambda: trees.free_tree_classes(5)[0],
    "EffectCosts": lambda: bs.effect_costs("stormer-verlet", "kepler", h=0.01, effects="oblateness"),
    "EffectReport": lambda: bs.effect_influence("rk4", "kepler", h=0.02, span=6, accept=0.05),
    "Prediction": lambda: bs.predict_run("stormer-verlet", "pendulum", h=0.1, steps=1000, timed=False),
    "WorkPrecision": precision,
    "Recommendation": lambda: precision().best(1e-3),
    "ConjugateVerdict": lambda: bs.conjugate_symplecticity("rk4", 6),
    "Verdict": lambda: bs.symplecticity("rk4", 6),
    "CompiledConditions": lambda: bs.order_conditions("runge-kutta", 4).compile(3),
    "OrderCondition": lambda: bs.order_conditions("runge-kutta", 4)[3],
    "OrderConditions": lambda: bs.order_conditions("runge-kutta", 7),
    "ConvergenceRadius": lambda: bs.fields.convergence_radius("gauss2"),
    "ModifiedInvariant": lambda: bs.modified_invariant(bs.modified_field("symplectic-euler-p", "lotka-volterra", 3)),
    "Reach": lambda: bs.fields.reach(field("pendulum"), [0.0, 1.0], 0.1),
    "SceneSeries": field,
    "BracketSeries": lambda: bs.bch(10),
    "ClosedHamiltonian": lambda: bs.hamiltonians.closed_hamiltonian("symplectic-euler-p", "harmonic-oscillator"),
    "CoordinateChange": lambda: bs.hamiltonians.CoordinateChange(*SHEAR),
    "DriftReport": lambda: bs.energy_drift(
        "simplified-takahashi-imada", bs.scene("pendulum", effects=["asymmetry"]), **DRIFT
    ),
    "GeneratingFunction": lambda: bs.hamiltonians.generating_function("implicit-midpoint", "pendulum", 3),
    "HamiltonianVerdict": lambda: bs.hamiltonians.hamiltonian_verdict("rk4", "pendulum", 5),
    "ModifiedHamiltonian": lambda: bs.modified_hamiltonian("stormer-verlet", "kepler", 5),
    "NormalForm": lambda: bs.hamiltonians.lindstedt_poincare(ROTOR, 3),
    "EnsembleResult": lambda: bs.ensemble("stormer-verlet", "pendulum", h=0.1, steps=50, y0=[[0, 1], [0, 2]]),
    "RoundedOrder": lambda: bs.analysis.rounded_order(
        bs.RungeKutta([[0, 0], ["0.666666666666667", 0]], ["0.25", "0.75"])
    ),
    "ReferenceSolution": lambda: bs.reference_solution("pendulum", 5.0, full=True),
    "StageAlgebra": lambda: bs.method("gauss3").algebra,
    "State": lambda: bs.stepper("rk4", "pendulum").start(h=0.1),
    "Stepper": lambda: bs.stepper("rk4", "pendulum"),
    "ShadowFormula": lambda: bs.shadow.shadow_formula(4),
    "ShadowReport": lambda: bs.shadow_energy(run()),
    "EnergyLog": lambda: bs.shadow.energy_log([f"{k % 7}" for k in range(600)]),
    "StabilityFunction": lambda: bs.stability_function("gauss3"),
    "MethodEntry": lambda: bs.catalogue()[0],
    "SceneEntry": lambda: bs.scene_catalogue()[0],
}


SHORTER: dict[str, Callable[[], Any]] = {
    "BSeries": lambda: bs.modified_equation("rk4", 8),
    "Series": lambda: bs.series("strang", trees.Words(5)),
    "Words": lambda: trees.Words(5),
    "TreeTable": lambda: bs.TreeTable(8),
}
"""Whole tables are as long as the results, which displays cut."""


@cache
def example(name: str) -> Any:
    return EXAMPLES[name]()


def public_classes() -> dict[str, type]:
    """The public classes by name, without exceptions, warnings and protocols."""
    members = (pair for room in ROOMS for pair in ((name, getattr(room, name)) for name in dir(room)))
    classes = {name: value for name, value in members if inspect.isclass(value) and not name.startswith("_")}
    return {
        name: value
        for name, value in classes.items()
        if not issubclass(value, Exception) and not getattr(value, "_is_protocol", False)
    }


def test_every_public_class_is_displayed():
    assert set(public_classes()) - ROWS_OF_OTHERS - BUILDERS == set(EXAMPLES)


@pytest.mark.parametrize("name", EXAMPLES)
def test_displays_are_short(name):
    thing = example(name)
    assert isinstance(thing, public_classes()[name])
    shown, text = repr(thing), str(thing)
    forms = {form: getattr(thing, form, lambda: None)() for form in ("_repr_html_", "_repr_latex_", "_repr_svg_")}
    assert len(shown) <= SHORT
    assert " object at 0x" not in shown + text
    assert len(text) <= LONG
    assert all(form is None or len(form) < 20 * MOST_LATEX for form in forms.values())
    assert len(forms["_repr_latex_"] or "") <= MOST_LATEX + 20
    assert text.count("\n") <= 2 * MOST_ROWS + 20


@pytest.mark.parametrize("name", [name for name in EXAMPLES if hasattr(public_classes()[name], "to_table")])
def test_tables_have_all_formats(name):
    thing = SHORTER[name]() if name in SHORTER else example(name)
    table = thing.to_table()
    for text in (table.to_text(80), table.to_markdown(), table.to_latex(), table.to_html(), "".join(table.to_csv())):
        assert text.strip()
    json.loads(table.to_json())
    if hasattr(thing, "to_dict"):
        json.dumps(thing.to_dict())
