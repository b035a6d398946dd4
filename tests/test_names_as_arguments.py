"""Names of methods and scenes stand for the objects wherever these are arguments."""

from __future__ import annotations

import inspect

import pytest

import bseries as bs
import integrators

ROOMS = (
    bs,
    integrators,
    bs.analysis,
    bs.stability,
    bs.fields,
    bs.hamiltonians,
    bs.runs,
    bs.advice,
    bs.integrators,
    bs.memory,
)
NUMBERS = {
    "order": 3, "h": 0.1, "steps": 4, "y0": [0.1, 0.2], "y": ["0.1", "0.2"], "t": 1, "spread": 0.1, "temperature": 1,
    "text": "p^2/2 + U(q)",
}  # fmt: skip
METHODS = {
    "bracket_hamiltonian": "strang", "closed_hamiltonian": "symplectic-euler-p", "generating_function": "gauss2",
    "modified_hamiltonian": "gauss2", "named_hamiltonian": "gauss2", "stepper": "gauss2", "ssp_coefficient": "ssprk33",
    "generalised_order": "strang", "scipy_solver": "tsit5", "underlying_one_step": "ab2", "parasitic_modes": "bdf2",
    "memory_properties": "bdf2",
    "root_locus": "bdf2", "starting_procedure": "ab3", "starting_values": "ab2",
}  # fmt: skip
SCENES = {"closed_hamiltonian": "harmonic-oscillator"}
OBJECTS_ONLY = {
    "adjoint_composition", "adjoint_method", "extrapolation", "repeat", "suzuki_fractal", "symmetric_composition",
    "triple_jump", "save_method", "save_scene", "lindstedt_poincare", "takahashi_imada_integral", "reach",
    "shadow_energy", "predict_run", "work_precision", "effect_costs", "effect_influence",
}  # fmt: skip
"""Functions that make methods of methods, that write files, or whose other arguments need more than numbers."""


def functions():
    """Public functions with arguments `method` or `scene`, by name."""
    found = {}
    for room in ROOMS:
        for name in dir(room):
            value = getattr(room, name)
            if inspect.isfunction(value) and {"method", "scene"} & set(inspect.signature(value).parameters):
                found[name] = value
    return {name: value for name, value in found.items() if name not in OBJECTS_ONLY}


def arguments(function, names):
    """The required arguments of a function, and `order`."""
    own = {"method": METHODS.get(function.__name__, "rk4"), "scene": SCENES.get(function.__name__, "pendulum")}
    if not names:
        own = {"method": bs.method(own["method"]), "scene": bs.scene(own["scene"])}
    optional = set() if function.__name__ == "energy_drift" else {"steps", "order"}
    for name, parameter in inspect.signature(function).parameters.items():
        if name in own:
            yield name, own[name]
        elif parameter.default is parameter.empty or name in optional:
            yield name, NUMBERS[name]
        elif function.__name__ == "ensemble" and name == "y0":
            yield name, [[0.1, 0.2], [0.2, 0.1]]


@pytest.mark.parametrize("name", sorted(functions()))
def test_names_stand_for_objects(name):
    function = functions()[name]
    found, expected = (function(**dict(arguments(function, names))) for names in (True, False))
    assert repr(found).partition(" at 0x")[0] == repr(expected).partition(" at 0x")[0]


def test_unknown_names_are_refused_with_a_suggestion():
    with pytest.raises(bs.IntegratorError, match="but was 'rk5'; the nearest are"):
        bs.modified_equation("rk5", 3)
    with pytest.raises(bs.IntegratorError, match="must be one of the catalogue, but was 'pendulom'; did you mean"):
        bs.integrate("rk4", "pendulom", h=0.1, steps=1)
    with pytest.raises(bs.IntegratorError, match="scene must be a Scene or the name of one, but was 3"):
        bs.modified_field("rk4", 3, 2)
