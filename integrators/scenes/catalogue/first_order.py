"""Small first-order systems: linear and nonlinear oscillators, populations, chemistry, flows."""

from __future__ import annotations

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.model.terms import Term
from integrators.scenes.scene import Scene


def riccati() -> Scene:
    """y' = y², y(0) = 1."""
    return Scene({"y": 1}, field={"y": "y^2"}, start={"y": [1]})


ROTATION = ((0, -1), (1, 0))


def linear(*, matrix: object = ROTATION) -> Scene:
    """y' = A y, from y = (1, …, 1).

    Args:
        matrix: The rows of A, exact numbers.
    """
    import sympy

    rows = [items(row, f"row {i} of matrix") for i, row in enumerate(items(matrix, "matrix"), 1)]
    size = len(rows)
    if not rows:
        raise IntegratorError("matrix must have at least one row, but was empty")
    for i, row in enumerate(rows, 1):
        if len(row) != size:
            raise IntegratorError(f"matrix must be square, but row {i} of {size} has length {len(row)}")
    entries = [
        [read_formula(x, (), f"matrix[{i}][{j}]") for j, x in enumerate(row, 1)] for i, row in enumerate(rows, 1)
    ]
    y = sympy.symbols(f"y1:{size + 1}") if size > 1 else (sympy.Symbol("y"),)
    skew = all(entries[i][j] == -entries[j][i] for i in range(size) for j in range(i + 1))
    return Scene(
        {"y": size},
        field={str(y[i]): sympy.Add(*(a * x for a, x in zip(row, y, strict=True))) for i, row in enumerate(entries)},
        invariants={"squared_norm": sympy.Add(*(x**2 for x in y))} if skew else {},
        start={"y": [1] * size},
    )


def nonlinear_oscillator() -> Scene:
    """u1' = −u2/|u|², u2' = u1/|u|², from (1, 0)."""
    return Scene(
        {"u": 2},
        field={"u1": "-u2/(u1^2 + u2^2)", "u2": "u1/(u1^2 + u2^2)"},
        invariants={"squared_norm": "u1^2 + u2^2"},
        start={"u": [1, 0]},
        positive=["u1^2 + u2^2"],
    )


def lotka_volterra() -> Scene:
    """p' = p (β − q), q' = q (p − α): the structure B = p q [[0, −1], [1, 0]] and H = p − α ln p + q − β ln q."""
    return Scene(
        {"p": 1, "q": 1},
        hamiltonian="p - alpha*log(p) + q - beta*log(q)",
        poisson=[[0, "-p*q"], ["p*q", 0]],
        parameters={"alpha": 1, "beta": 2},
        start={"p": [2], "q": [2]},
        positive=["p", "q"],
    )


def rigid_body() -> Scene:
    """y' = y × ∇H, H = Σ y_k²/(2 I_k): y is the angular momentum in the body frame, |y|² a Casimir function."""
    return Scene(
        {"y": 3},
        hamiltonian="y1^2/(2*I1) + y2^2/(2*I2) + y3^2/(2*I3)",
        poisson=[[0, "-y3", "y2"], ["y3", 0, "-y1"], ["-y2", "y1", 0]],
        parameters={"I1": 2, "I2": 1, "I3": "2/3"},
        invariants={"casimir": "y1^2 + y2^2 + y3^2"},
        start={"y": ["cos(11/10)", 0, "sin(11/10)"]},
    )


def abc_flow() -> Scene:
    """x' = A sin z + C cos y, y' = B sin x + A cos z, z' = C sin y + B cos x, with A = B = C = 1.

    The parts a, b, c are the three equations. Each changes one variable and does not depend on it, so it preserves
    volume and Euler's method integrates it exactly.
    """
    return Scene(
        {"x": ["x", "y", "z"]},
        terms=[
            Term(field={"x": "A*sin(z) + C*cos(y)"}, part="a"),
            Term(field={"y": "B*sin(x) + A*cos(z)"}, part="b"),
            Term(field={"z": "C*sin(y) + B*cos(x)"}, part="c"),
        ],
        parameters={"A": 1, "B": 1, "C": 1},
        start={"x": [1, 2, 3]},
    )


def brusselator() -> Scene:
    """u' = A + u² v − (B + 1) u, v' = B u − u² v, with A = 1, B = 3."""
    return Scene(
        {"u": 1, "v": 1},
        field={"u": "A + u^2*v - (B + 1)*u", "v": "B*u - u^2*v"},
        parameters={"A": 1, "B": 3},
        start={"u": ["3/2"], "v": [3]},
    )


def van_der_pol() -> Scene:
    """y1' = y2, y2' = ((1 − y1²) y2 − y1)/ε, from (2, 0), with ε = 10⁻⁶.

    With time in units of √ε this is the other usual form, y'' = μ (1 − y²) y' − y with μ = 1/√ε = 1000.
    """
    return Scene(
        {"y": 2},
        field={"y1": "y2", "y2": "((1 - y1^2)*y2 - y1)/epsilon"},
        parameters={"epsilon": "1/1000000"},
        start={"y": [2, 0]},
    )


def lorenz() -> Scene:
    """x' = σ(y − x), y' = x(ρ − z) − y, z' = xy − βz, with σ = 10, ρ = 28, β = 8/3, from (0, 1, 0)."""
    return Scene(
        {"x": ["x", "y", "z"]},
        field={"x": "sigma*(y - x)", "y": "x*(rho - z) - y", "z": "x*y - beta*z"},
        parameters={"sigma": 10, "rho": 28, "beta": "8/3"},
        start={"x": [0, 1, 0]},
    )


SCENES = (
    SceneEntry("riccati", riccati, "y' = y², with the solution 1/(1 − t)",
        "HLW, example IX.1.1; E. Hairer, lecture on long-time behaviour, example 1 and figure 1", title="Riccati"),
    SceneEntry("linear", linear, "y' = A y with any matrix A; a rotation of the plane if none is given",
        "E. Hairer, lecture on long-time behaviour, example 3"),
    SceneEntry("nonlinear-oscillator", nonlinear_oscillator,
        "a rotation with angular velocity 1/|u|², which keeps |u|²",
        "H. Ranocha, D. I. Ketcheson, SIAM J. Numer. Anal. 58 (2020), doi:10.1137/19M1290346",
        title="nonlinear oscillator"),
    SceneEntry("lotka-volterra", lotka_volterra, "prey p and predators q: closed orbits of a Poisson system",
        "HLW, sections I.1.1 and VII.2; E. Hairer, lecture on long-time behaviour, example 2 and exercise 2",
        aliases=("predator-prey",), title="Lotka–Volterra"),
    SceneEntry("rigid-body", rigid_body, "the free rigid body: Euler's equations for its angular momentum",
        "HLW, section IV.1 and figure IV.1.1 (moments of inertia, start), section VII.5 (the Lie–Poisson structure)",
        aliases=("euler-top",), title="rigid body"),
    SceneEntry("abc-flow", abc_flow,
        "the Arnold–Beltrami–Childress flow in space: divergence-free, a sum of three shears",
        "T. Dombre et al., J. Fluid Mech. 167 (1986) 353, doi:10.1017/S0022112086002859; "
        "E. Hairer, lecture on long-time behaviour, exercise 6",
        aliases=("abc",), title="ABC flow"),
    SceneEntry("brusselator", brusselator, "the Brusselator, a chemical reaction with a limit cycle (where B > 1 + A²)",
        "R. Lefever, G. Nicolis, J. Theor. Biol. 30 (1971) 267; HNW, sections I.16 (the form) and II.4 (the start)"),
    SceneEntry("van-der-pol", van_der_pol, "Van der Pol's equation ε y'' = (1 − y²) y' − y, stiff",
        "HW, sections IV.1 (this form, time scaled to the period) and IV.10 (ε = 10⁻⁶)", title="Van der Pol"),
    SceneEntry("lorenz", lorenz, "Lorenz's model of convection: a strange attractor",
        "E. N. Lorenz, J. Atmos. Sci. 20 (1963) 130; HNW, section I.16", title="Lorenz"),
)  # fmt: skip
