"""The built-in scenes of many particles: energies and forces, first integrals, starts, effects, options."""

from __future__ import annotations

import json
from collections.abc import Callable
from fractions import Fraction
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

from integrators import Effect, IntegratorError, Scene, method, scene, scene_catalogue
from integrators.scenes.catalogue import particles
from integrators.scenes.catalogue.particles import cluster, thermal_momenta

REFERENCE = Path(__file__).parents[2] / "reference"
SOLAR_SYSTEM = json.loads((REFERENCE / "outer_solar_system.json").read_text())
TODA = json.loads((REFERENCE / "lecture_values.json").read_text())["figure9_toda"]
PLANETS = ("jupiter", "saturn", "uranus", "neptune", "pluto")


def numbers(values: Any) -> np.ndarray:
    """Exact numbers as doubles."""
    return np.array([float(x) for x in np.ravel(np.array(values, dtype=object))])


# A scene's terms, evaluated one row of sites after another


def evaluated(built: Scene, y: np.ndarray) -> tuple[np.ndarray, float]:
    """The field, and the sum of the formulas: the Hamiltonian but for its constants."""
    field, energy = np.zeros_like(y), 0.0
    for term in built.local_terms:
        data = [numbers(values) for _, values in term.data]
        names = sympy.symbols(f"x:{len(term.arguments)}")
        formulas = [term.formula, *(term.formula.diff(x) for x in names)]
        compute = sympy.lambdify([names, sympy.symbols(f"d:{len(data)}")], formulas)
        for row in term.sites.rows():
            x = [y[a.plus.at(row)] - (0 if a.minus is None else y[a.minus.at(row)]) for a in term.arguments]
            value, *slopes = compute(x, [d[row[role]] for d, (role, _) in zip(data, term.data, strict=True)])
            energy += value
            for output in term.outputs:
                field[output.place.at(row)] += output.sign * slopes[output.derivative]
    return field, energy


# The same systems in NumPy, written down from their sources


def toda(p: np.ndarray, q: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    bond = np.exp(q - np.roll(q, -1))
    return p @ p / 2 + bond.sum(), np.roll(bond, 1) - bond, p


def fermi_pasta_ulam(p: np.ndarray, q: np.ndarray, omega: float = 50.0) -> tuple[float, np.ndarray, np.ndarray]:
    """The chain of 2m masses between walls; x_{0,i} and x_{1,i} are sum and difference of neighbours over √2."""
    turn = np.array([[1, -1], [1, 1]]) / np.sqrt(2)
    masses, momenta = (turn @ q.reshape(-1, 2).T).T.ravel(), (turn @ p.reshape(-1, 2).T).T.ravel()
    springs = np.diff(np.array([0, *masses, 0]))
    soft, stiff = springs[::2], springs[1::2]
    tension = np.empty_like(springs)
    tension[::2], tension[1::2] = 4 * soft**3, omega**2 / 2 * stiff
    force = np.diff(tension)
    energy = momenta @ momenta / 2 + omega**2 / 4 * stiff @ stiff + (soft**4).sum()
    return energy, (force.reshape(-1, 2) @ turn).ravel(), p


def pairwise(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Differences q_i − q_j and distances, infinite for i = j."""
    difference = q[:, None] - q[None, :]
    return difference, np.sqrt((difference**2).sum(axis=2) + np.diag(np.full(len(q), np.inf)))


def lennard_jones(p: np.ndarray, q: np.ndarray, dimension: int, k: float = 0.0) -> tuple[float, np.ndarray, np.ndarray]:
    q = q.reshape(-1, dimension)
    difference, r = pairwise(q)
    slope = 4 * (-12 / r**13 + 6 / r**7)
    force = -(slope / r)[:, :, None] * difference
    energy = p @ p / 2 + 2 * (1 / r**12 - 1 / r**6).sum() + k / 2 * (q * q).sum()
    return energy, (force.sum(axis=1) - k * q).ravel(), p


def gravity(
    p: np.ndarray, q: np.ndarray, masses: Any, constant: float = 1.0, epsilon: float = 0.0
) -> tuple[float, np.ndarray, np.ndarray]:
    q, m = q.reshape(len(masses), -1), np.array(masses, dtype=float)
    difference, r = pairwise(q)
    r = np.sqrt(r**2 + epsilon**2)
    weights = constant * np.outer(m, m)
    force = (-(weights / r**3)[:, :, None] * difference).sum(axis=1)
    momenta = p.reshape(len(m), -1)
    velocities = momenta / m[:, None]
    return (momenta * velocities).sum() / 2 - (weights / r).sum() / 2, force.ravel(), velocities.ravel()


MASSES = [1.5, 0.25, 2.0, 1.0]
SQUARE = [[0, 0], [1, 0], [0, 1], [1, 2]]
CUBE = [[0, 0, 1], [1, 0, 0], [0, 1, 0], [1, 2, 1]]


def bodies(rows: Any, **options: Any) -> Scene:
    return scene("n-body", masses=MASSES, positions=rows, velocities=rows, **options)


SYSTEMS: dict[str, tuple[Callable[[], Scene], Callable[..., Any]]] = {
    **{f"toda {n}": (lambda n=n: scene("toda", n=n), toda) for n in (2, 3, 4, 5, 6, 20)},
    **{f"fpu {m}": (lambda m=m: scene("fpu", m=m), fermi_pasta_ulam) for m in (1, 2, 3, 8)},
    "fpu soft": (
        lambda: scene("fermi-pasta-ulam", omega="1/2"),
        lambda p, q: fermi_pasta_ulam(p, q, 0.5),
    ),
    **{
        f"lj {n} {d}-D": (
            lambda n=n, d=d: scene("lennard-jones", particles=n, dimension=d),
            lambda p, q, d=d: lennard_jones(p, q, d),
        )
        for n, d in ((2, 1), (5, 1), (2, 2), (3, 2), (9, 2), (13, 2), (2, 3), (4, 3), (13, 3), (55, 3))
    },
    "lj confined": (
        lambda: scene("lennard-jones", effects=["confinement"], k="1/4"),
        lambda p, q: lennard_jones(p, q, 2, 0.25),
    ),
    "n-body 2-D": (lambda: bodies(SQUARE, G="1/2"), lambda p, q: gravity(p, q, MASSES, 0.5)),
    "n-body 3-D": (lambda: bodies(CUBE), lambda p, q: gravity(p, q, MASSES)),
    "n-body softened": (
        lambda: bodies(CUBE, effects=["softening"], epsilon="1/3"),
        lambda p, q: gravity(p, q, MASSES, epsilon=1 / 3),
    ),
    "n-body figure eight": (lambda: scene("n-body"), lambda p, q: gravity(p, q, [1, 1, 1])),
    "solar system": (
        lambda: scene("outer-solar-system"),
        lambda p, q: gravity(p, q, [float(Fraction(x["mass"])) for x in SOLAR_SYSTEM["bodies"]], SOLAR_SYSTEM["G"]),
    ),
}
LARGE = ("lj 9 2-D", "lj 13 2-D", "lj confined", "lj 13 3-D", "lj 55 3-D", "toda 20")


def near_start(built: Scene) -> np.ndarray:
    """A point at random near the start; momenta are far smaller than positions in the solar system."""
    generator, half = np.random.default_rng(len(built.variables)), built.dimension // 2
    p, q = built.y0[:half], built.y0[half:]
    spread = 0.05 * max(abs(p).max(), 1e-9)
    return np.concatenate([p + spread * generator.uniform(-1, 1, half), q + 0.05 * generator.uniform(-1, 1, half)])


@pytest.mark.few(9)
@pytest.mark.parametrize("name", SYSTEMS)
def test_energies_and_forces_are_those_of_independent_code(name):
    build, independent = SYSTEMS[name]
    built = build()
    y = near_start(built)
    half = len(y) // 2
    energy, force, velocity = independent(y[:half], y[half:])
    field, total = evaluated(built, y)
    # Forces are sums of large terms of opposite sign: what rounding allows depends on the largest.
    np.testing.assert_allclose(field[:half], force, rtol=1e-13, atol=1e-13 * abs(force).max())
    np.testing.assert_allclose(field[half:], velocity, rtol=1e-13)
    assert total == pytest.approx(energy, rel=1e-13, abs=1e-13 * abs(y[:half] @ velocity))
    assert built.is_hamiltonian


@pytest.mark.few(6)
@pytest.mark.parametrize("name", [name for name in SYSTEMS if name not in LARGE])
def test_what_is_written_out_is_the_sum_of_the_terms(name):
    built = SYSTEMS[name][0]()
    y = near_start(built)
    formulas = sympy.lambdify([built.variables], [*built.field, built.hamiltonian])(y)
    field, energy = evaluated(built, y)
    np.testing.assert_allclose(formulas[:-1], field, rtol=1e-12, atol=1e-13 * abs(field).max())
    assert formulas[-1] == pytest.approx(energy, rel=1e-12)


# First integrals

SPATIAL = {f"{kind}_{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz"}
PLANAR = {"momentum_x", "momentum_y", "angular_momentum"}
INTEGRALS = {
    **{f"toda {n}": {"momentum", "trace_of_cube"} for n in (2, 3, 4, 5, 6, 20)},
    "fpu 3": set(),
    "lj 5 1-D": {"momentum_x"},
    "lj 9 2-D": PLANAR,
    "lj 13 3-D": SPATIAL,
    "lj confined": {"angular_momentum"},
    "n-body 2-D": PLANAR,
    "n-body 3-D": SPATIAL,
    "n-body softened": SPATIAL,
    "solar system": SPATIAL,
}


def rate(formula: sympy.Expr, built: Scene, field: np.ndarray, y: np.ndarray) -> float:
    """∇I·f in terms of the largest of its summands."""
    gradient = sympy.lambdify([built.variables], [formula.diff(symbol) for symbol in built.symbols])(y)
    summands = np.array(gradient) * field
    return abs(summands.sum()) / abs(summands).max()


@pytest.mark.few(5)
@pytest.mark.parametrize("name", INTEGRALS)
def test_first_integrals_are_constant_along_the_field(name):
    built = SYSTEMS[name][0]()
    assert set(built.invariants) == INTEGRALS[name]
    y = near_start(built)
    field, _ = evaluated(built, y)
    broken, components = field.copy(), len(built.blocks[0].components)
    broken[:components] *= -1  # the force on the first body
    for formula in built.invariants.values():
        assert rate(formula, built, field, y) < 1e-12
        assert rate(formula, built, broken, y) > 1e-6


def test_a_wrong_sign_in_an_integral_is_caught():
    built = scene("lennard-jones")
    y = near_start(built)
    field, _ = evaluated(built, y)
    wrong = built.invariants["angular_momentum"].xreplace({sympy.Symbol("qx1"): -sympy.Symbol("qx1")})
    assert rate(wrong, built, field, y) > 1e-3


def test_confinement_breaks_the_total_momentum():
    built = scene("lennard-jones", effects=["confinement"])
    y = near_start(built)
    field, _ = evaluated(built, y)
    assert rate(scene("lennard-jones").invariants["momentum_x"], built, field, y) > 1e-6


def test_integrals_are_declared_where_they_can_be_written_out():
    size = particles.FLAT_SITES
    assert scene("lennard-jones", particles=size, dimension=1).invariants
    assert not scene("lennard-jones", particles=size + 1).invariants
    assert len(scene("toda", n=size).invariants) == 2
    assert not scene("toda", n=size + 1).invariants


# Toda


def lax_matrix(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    n = len(p)
    off_diagonal = np.exp((q - np.roll(q, -1)) / 2) / 2
    matrix = np.diag(-p / 2)
    for k in range(n):
        matrix[k, (k + 1) % n] += off_diagonal[k]
        matrix[(k + 1) % n, k] += off_diagonal[k]
    return matrix


@pytest.mark.parametrize(("n", "winding"), [(3, 0.75), (4, 0), (5, 0), (6, 0)])
def test_toda_integrals_are_traces_of_the_lax_matrix(n, winding):
    built = scene("toda", n=n)
    y = near_start(built)
    powers = [np.linalg.matrix_power(lax_matrix(y[:n], y[n:]), k) for k in (1, 2, 3)]
    momentum, cube = sympy.lambdify([built.variables], list(built.invariants.values()))(y)
    assert np.trace(powers[0]) == pytest.approx(-momentum / 2, abs=1e-14)
    assert np.trace(powers[1]) == pytest.approx(evaluated(built, y)[1] / 2)
    assert np.trace(powers[2]) == pytest.approx(cube + winding)


def test_toda_starts_as_in_the_lecture():
    built = scene("toda")
    assert built.start == tuple(map(sympy.Rational, ("-3/2", 1, "1/2", 1, 2, -1)))
    assert list(built.y0) == [*TODA["p0"], *TODA["q0"]]
    assert scene("Toda lattice") == built


@pytest.mark.parametrize("n", [2, 4, 7, 1000])
def test_toda_starts_as_a_wave(n):
    p, q = scene("toda", n=n).y0.reshape(2, n)
    np.testing.assert_allclose(p, np.cos(2 * np.pi * np.arange(1, n + 1) / n), atol=1e-12)
    assert not q.any()


# Fermi–Pasta–Ulam


def test_fermi_pasta_ulam_starts_as_in_hairer_lubich_wanner():
    built = scene("fermi-pasta-ulam")
    p, q = np.array(built.start).reshape(2, 3, 2)
    stiff = [(y**2 + 2500 * x**2) / 2 for y, x in zip(p[:, 1], q[:, 1], strict=True)]
    assert stiff == [1, 0, 0]
    assert (p[0, 0], q[0, 0]) == (1, 1)
    assert not p[1:].any()
    assert not q[1:].any()
    # 1/2 for y_{0,1}, 1 oscillatory, and the springs at the left wall and to the second pair
    assert built.hamiltonian is not None
    energy = built.hamiltonian.xreplace(dict(zip(built.symbols, built.start, strict=True)))
    assert energy == sympy.Rational(3, 2) + (sympy.Rational(49, 50) ** 4 + sympy.Rational(51, 50) ** 4) / 4


def test_fermi_pasta_ulam_is_split_into_a_linear_and_a_nonlinear_part():
    built = scene("fpu", m=4, omega=10)
    assert built.parts == ("linear", "nonlinear")
    for term in built.local_terms:
        degree = sympy.Poly(term.formula, *term.formula.free_symbols).total_degree()
        assert degree == (2 if term.part == "linear" else 4)
    assert {term.sites.kind for term in built.local_terms} == {"each", "chain", "table"}


# Lennard-Jones


@pytest.mark.parametrize(("n", "d", "bonds"), [
    *((n, 1, n - 1) for n in (2, 5)),
    *((n, 2, b) for n, b in ((2, 1), (3, 3), (4, 5), (7, 12), (9, 16), (13, 24), (19, 42))),
    *((n, 3, b) for n, b in ((2, 1), (3, 3), (4, 6), (13, 36), (19, 60), (55, 216))),
])  # fmt: skip
def test_clusters_are_close_packed(n, d, bonds):
    q = 2 ** (1 / 6) * cluster(n, d)
    assert q.shape == (n, d)
    _, r = pairwise(q)
    np.testing.assert_allclose(r.min(axis=1), 2 ** (1 / 6), rtol=1e-13)
    assert np.count_nonzero(np.isclose(r, 2 ** (1 / 6))) == 2 * bonds
    np.testing.assert_allclose(q.mean(axis=0), 0, atol=1e-14)
    radii = np.linalg.norm(q - q[0], axis=1)
    assert (np.diff(radii) > -1e-9).all()


@pytest.mark.parametrize(("d", "shells"), [(2, [1, 6, 6, 6, 12]), (3, [1, 12, 6, 24, 12])])
def test_shells_are_those_of_the_hexagonal_and_the_face_centred_cubic_lattice(d, shells):
    points = cluster(sum(shells), d)
    norms = np.round(((points - points[0]) ** 2).sum(axis=1), 9)
    assert np.unique(norms, return_counts=True)[1].tolist() == shells


@pytest.mark.parametrize("d", [1, 2, 3])
def test_clusters_are_the_nearest_points_of_the_lattice(d):
    """All that a box holds completely."""

    def norm(point):
        return sum(x * x for x in point) + sum(point) ** 2

    points = sorted(product(range(6, -7, -1), repeat=d), key=norm)
    basis = np.linalg.cholesky((np.ones((d, d)) + np.eye(d)) / 2)
    for n in range(2, sum(norm(point) <= 36 for point in points) + 1):
        expected = np.array(points[:n])
        np.testing.assert_array_equal(cluster(n, d), (expected - expected.mean(axis=0)) @ basis)


def test_many_atoms_in_a_line():
    np.testing.assert_allclose(np.sort(cluster(4001, 1)[:, 0]), np.arange(-2000, 2001), atol=1e-9)


@pytest.mark.parametrize("options", [{}, {"particles": 13, "dimension": 3}, {"particles": 2, "dimension": 1}])
def test_clusters_start_at_rest_as_a_whole(options):
    built = scene("lennard-jones", **options)
    d = options.get("dimension", 2)
    p, q = np.array(built.start).reshape(2, -1, d)
    assert not p.sum(axis=0).any()
    assert not q.sum(axis=0).any()
    assert p.all()


@pytest.mark.parametrize(("temperature", "m"), [(0.1, 1), (2, 3)])
def test_momenta_have_the_temperature(temperature, m):
    n, d, seeds = 50, 2, 40
    momenta = [thermal_momenta(n, d, m * temperature, seed) for seed in range(seeds)]
    built = scene("lennard-jones", particles=n, temperature=temperature, m=m, seed=3)
    np.testing.assert_allclose(built.y0[: n * d], momenta[3].ravel(), rtol=0, atol=1e-14)
    energies = [(p**2).sum() / (2 * m) for p in momenta]
    freedom = d * (n - 1)
    deviation = np.sqrt(2 / (freedom * seeds))
    assert 2 * np.mean(energies) / freedom == pytest.approx(temperature, rel=4 * deviation)
    assert np.std(energies) == pytest.approx(temperature * np.sqrt(freedom / 2), rel=0.5)


def test_momenta_depend_on_the_seed_only():
    start = scene("lennard-jones", seed=1).start
    assert scene("lennard-jones", seed=1) == scene("lennard-jones", seed="1")
    assert scene("lennard-jones", seed=2).start != start
    assert not any(scene("lennard-jones", temperature=0).start[:18])


def test_length_scales_the_cluster():
    one, two = scene("lennard-jones", temperature=0), scene("lennard-jones", temperature=0, sigma=2)
    np.testing.assert_allclose(two.y0, 2 * one.y0, rtol=1e-12)
    assert evaluated(two, two.y0)[1] == pytest.approx(evaluated(one, one.y0)[1], rel=1e-12)
    assert scene("lennard-jones", epsilon=3).start == scene("lennard-jones").start


@pytest.mark.parametrize(("n", "d"), [(3, 2), (4, 3)])
def test_small_clusters_start_at_their_minimum(n, d):
    built = scene("lennard-jones", particles=n, dimension=d, temperature=0)
    field, energy = evaluated(built, built.y0)
    np.testing.assert_allclose(field, 0, atol=1e-13)
    assert energy == pytest.approx(-n * (n - 1) / 2, rel=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_a_thousand_atoms_are_two_terms(d):
    built = scene("lennard-jones", particles=1000, dimension=d, effects=["confinement"])
    small = scene("lennard-jones", particles=3, dimension=d, effects=["confinement"])
    assert [term.formula for term in built.local_terms] == [term.formula for term in small.local_terms]
    assert [summand.sites.kind for summand in built.summands] == ["each", "pairs"]
    assert built.dimension == 2000 * d
    assert "field" not in built.__dict__
    assert "hamiltonian" not in built.__dict__


def test_an_effect_that_is_off_leaves_no_trace():
    plain = scene("lennard-jones")
    assert "k" not in plain.parameters
    assert plain.with_effects("confinement").with_effects() == plain
    off, on = scene("n-body"), scene("n-body", effects=["softening"])
    assert "epsilon" not in off.parameters
    assert on.parameters["epsilon"] == sympy.Rational(1, 10)
    assert on.with_parameters(epsilon=0).field == off.field
    assert on.summary == "gravity among 3 bodies, softened"


# Gravity


def solve(built: Scene, time: float, steps: int) -> np.ndarray:
    """The solution after some time, by a Runge–Kutta method of order 8."""
    tableau = method("dop853")
    a, b = [[float(x) for x in row] for row in tableau.A], [float(x) for x in tableau.b]
    masses, half = numbers(built.parameters["m"]), built.dimension // 2
    y, h = built.y0, time / steps
    for _ in range(steps):
        stages: list[np.ndarray] = []
        for row in a:
            at = y + h * sum((c * k for c, k in zip(row, stages, strict=False) if c), np.zeros_like(y))
            _, force, velocity = gravity(at[:half], at[half:], masses)
            stages.append(np.concatenate([force, velocity]))
        y = y + h * sum((c * k for c, k in zip(b, stages, strict=True) if c), np.zeros_like(y))
    return y


def test_the_figure_eight_returns():
    built = scene("n-body")
    assert not any(sum(column) for column in np.array(built.start).reshape(2, 3, 2).transpose(0, 2, 1).reshape(4, 3))
    period = 6.32591398
    after = solve(built, period, 400)
    np.testing.assert_allclose(after, built.y0, atol=2e-7)
    # After a third of the period each body is where another one was.
    third = solve(built, period / 3, 200).reshape(2, 3, 2)
    start = built.y0.reshape(2, 3, 2)
    assert min(abs(third[:, order] - start).max() for order in ([1, 2, 0], [2, 0, 1])) < 1e-7
    assert abs(solve(built, 1.01 * period, 400) - built.y0).max() > 1e-3


def test_momenta_are_masses_times_velocities():
    built = bodies(SQUARE)
    assert list(built.start[:8]) == [sympy.Rational(m) * x for m, row in zip(MASSES, SQUARE, strict=True) for x in row]
    assert list(built.start[8:]) == [x for row in SQUARE for x in row]
    assert built.parameters["G"] == 1
    assert built == scene(
        "n-body", masses=np.array(MASSES), positions=np.array(SQUARE), velocities=[map(str, row) for row in SQUARE]
    )


def test_softened_bodies_may_meet():
    options: dict[str, Any] = {"masses": [1, 1], "positions": [[0, 0], [0, 0]], "velocities": [[1, 0], [0, 1]]}
    assert scene("n-body", effects="softening", **options).dimension == 8
    with pytest.raises(IntegratorError, match="positive, but it was 0 for the sites 1, 2"):
        scene("n-body", **options)


# The outer solar system


def test_the_outer_solar_system_has_the_published_data():
    built = scene("outer-solar-system")
    data = SOLAR_SYSTEM["bodies"]
    exact = [Fraction(body["mass"]) for body in data]
    assert built.parameters["m"] == tuple(sympy.Rational(m.numerator, m.denominator) for m in exact)
    assert float(built.parameters["G"]) == SOLAR_SYSTEM["G"]
    p, q = np.array(built.start).reshape(2, 6, 3)
    v = p / np.array(built.parameters["m"])[:, None]
    for moved, key in ((q, "position"), (v, "velocity")):
        published = np.array([body[key] for body in data])
        np.testing.assert_allclose(np.array(moved - moved[0], dtype=float), published, rtol=1e-15, atol=0)


@pytest.mark.parametrize("effects", [None, ["jupiter"], ["pluto", "saturn"], []])
def test_the_barycentre_of_the_bodies_that_are_on_rests_at_the_origin(effects):
    built = scene("outer-solar-system", effects=effects)
    on = PLANETS if effects is None else effects
    assert built.dimension == 6 * (1 + len(on))
    p, q = np.array(built.start).reshape(2, -1, 3)
    masses = np.array(built.parameters["m"])[:, None]
    assert not p.sum(axis=0).any()
    assert not (masses * q).sum(axis=0).any()


def test_the_energy_of_the_solar_system_is_that_of_the_published_data():
    built = scene("outer-solar-system")
    data = SOLAR_SYSTEM["bodies"]
    m = np.array([float(Fraction(body["mass"])) for body in data])
    q, v = (np.array([body[key] for body in data], dtype=float) for key in ("position", "velocity"))
    v = v - m @ v / m.sum()
    energy = m @ (v**2).sum(axis=1) / 2
    for i, j in combinations(range(6), 2):
        energy -= SOLAR_SYSTEM["G"] * m[i] * m[j] / np.linalg.norm(q[i] - q[j])
    assert evaluated(built, built.y0)[1] == pytest.approx(energy, rel=1e-13)


def test_planets_move_as_in_the_sky():
    """Periods from Kepler's third law, in years; the table's osculating elements are near the mean ones."""
    years = {"jupiter": 11.86, "saturn": 29.46, "uranus": 84.0, "neptune": 164.8, "pluto": 248}
    for planet, expected in years.items():
        built = scene("outer-solar-system", effects=planet)
        assert built.summary == f"the Sun with {planet.title()}"
        m = numbers(built.parameters["m"])
        p, q = built.y0.reshape(2, 2, 3)
        r, v = np.linalg.norm(q[1] - q[0]), p[1] / m[1] - p[0] / m[0]
        mu = float(built.parameters["G"]) * m.sum()
        axis = 1 / (2 / r - v @ v / mu)
        assert 2 * np.pi * np.sqrt(axis**3 / mu) / 365.25 == pytest.approx(expected, rel=0.03)


# The catalogue


def test_effects_are_listed_with_summaries():
    entries = {entry.name: entry for entry in scene_catalogue()}
    assert tuple(entries["outer-solar-system"].effects) == PLANETS
    assert entries["outer-solar-system"].effects["jupiter"] == "Jupiter, of mass 0.000954786104043"
    assert list(entries["n-body"].effects) == ["softening"]
    assert list(entries["lennard-jones"].effects) == ["confinement"]
    assert entries["toda"].effects == {}
    assert all(summary for entry in entries.values() for summary in entry.effects.values())
    assert entries["outer-solar-system"].options == {}
    assert list(entries["n-body"].options) == ["masses", "positions", "velocities"]
    assert all(entries[name].reference for name in ("toda", "fermi-pasta-ulam", "lennard-jones", "n-body"))


def test_the_order_of_effects_does_not_matter():
    some = scene("outer-solar-system", effects=(name for name in ("pluto", "jupiter")))
    assert some == scene("outer-solar-system", effects=["jupiter", "pluto"])
    assert some.summary == "the Sun with Jupiter, Pluto"
    assert scene("outer-solar-system", effects=PLANETS) == scene("outer-solar-system")


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("toda", {"n": 1}, "n must be an integer from 2 to 1000000, but was 1"),
        ("toda", {"n": "3/2"}, "n must be an integer from 2 to 1000000, but was 3/2"),
        ("toda", {"n": None}, "n must be a formula or a number, but was None"),
        ("fpu", {"m": 0}, "m must be an integer from 1 to 500000, but was 0"),
        ("fpu", {"omega": 0}, "omega must be a number from 1e-100 to 1e100, but was 0"),
        ("fpu", {"omega": "w"}, "omega must be a number, but has the unknown name 'w'"),
        ("lennard-jones", {"particles": 1}, "particles must be an integer from 2 to 500000, but was 1"),
        ("lennard-jones", {"dimension": 4}, "dimension must be an integer from 1 to 3, but was 4"),
        ("lennard-jones", {"temperature": -1}, "temperature must be 0 or a number from 1e-100 to 1e100, but was -1"),
        ("lennard-jones", {"temperature": float("nan")}, "temperature must be finite, but was nan"),
        ("lennard-jones", {"seed": -1}, "seed must be an integer from 0 to"),
        ("lennard-jones", {"m": True}, "m must be a formula or a number, but was True"),
        ("lennard-jones", {"sigma": "1e200"}, "sigma must be a number from 1e-100 to 1e100, but was 1e200"),
        ("lennard-jones", {"effects": ["gravity"]}, "there is no effect 'gravity'; the effects are confinement"),
        ("lennard-jones", {"k": 1}, "there is no parameter k unless the effect confinement is on"),
        ("n-body", {"masses": [1, 1]}, "positions must have a row for each of the 2 bodies, but had 3 rows"),
        ("n-body", {"masses": [1, 0, 1]}, r"masses\[2\] must be a number from 1e-100 to 1e100, but was 0"),
        ("n-body", {"masses": 3}, "masses must be a sequence, but was 3"),
        ("n-body", {"masses": [], "positions": [], "velocities": []}, "had rows of none and of none"),
        ("n-body", {"positions": CUBE[:3]}, "but had rows of 3 and of 2"),
        ("n-body", {"positions": [[1, 2], [3], [4, 5]]}, "but had rows of 1 and 2 and of 2"),
        ("n-body", {"positions": [1, 2, 3]}, "row 1 of positions must be a sequence, but was 1"),
        (
            "n-body",
            {"positions": [[0, 0], [1, "x"], [2, 0]]},
            r"positions\[2\]\[2\] must be a number, but has the unknown name 'x'",
        ),
        ("n-body", {"effects": ["drag"]}, "there is no effect 'drag'; the effects are softening"),
        ("n-body", {"epsilon": 1}, "there is no parameter epsilon; the parameters are G, m"),
        ("outer-solar-system", {"effects": ["mars"]}, "there is no effect 'mars'; the effects are jupiter, .*"),
    ],
)
def test_wrong_options_are_refused(name, options, message):
    with pytest.raises(IntegratorError, match=message):
        scene(name, **options)


@pytest.mark.parametrize(
    ("name", "effects", "message"),
    [
        ("n-body", ["softening"], r"there is no effect 'softening'; .* are chosen by scene\(name, effects=\[…\]\)"),
        ("outer-solar-system", ["pluto"], r"there is no effect 'pluto'; .* are chosen by scene\(name, effects=\[…\]\)"),
        ("outer-solar-system", ["mars"], "there is no effect 'mars'"),
        ("n-body", [["softening"]], r"there is no effect \['softening'\]"),
        ("lennard-jones", ["softening"], "there is no effect 'softening'; the effects are confinement"),
    ],
)
def test_effects_that_are_chosen_when_a_scene_is_built(name, effects, message):
    built = scene(name)
    assert built.with_effects() == built
    with pytest.raises(IntegratorError, match=message):
        built.with_effects(*effects)


def test_scenes_of_such_a_name_may_have_such_effects_of_their_own():
    effects = {"softening": Effect(hamiltonian="q^2/2")}
    own = Scene({"p": 1, "q": 1}, hamiltonian="p^2/2", effects=effects, name="n-body")
    assert own.with_effects("softening").active == ("softening",)


def test_effects_that_are_on_by_default():
    found = {entry.name: entry.default_effects for entry in scene_catalogue() if entry.default_effects}
    assert found == {"outer-solar-system": ("jupiter", "saturn", "uranus", "neptune", "pluto")}
