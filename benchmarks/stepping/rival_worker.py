"""Runs in the virtual environment of the other packages, and knows nothing of this one but `problems.py` beside it.

`python rival_worker.py` reads {"package": …, "problem": {…}, "budget": seconds} from its input, and prints the
package's version and its curves: a list of (error, CPU seconds, setting) for each method.
"""
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import json
import sys

import numpy as np
from problems import Problem, first_after, measure, step_counts, tolerances

LEAPFROG = {f"leapfrog, order {order}": order for order in (2, 4, 6, 8)}
SPLITTINGS = {
    "WHFast": {"integrator": "whfast"},
    "WHFast, corrector 17": {"integrator": "whfast", "corrector": 17},
    "WHFast, corrector 17, lazy kernel": {"integrator": "whfast", "corrector": 17, "kernel": "lazy"},
    "SABA(10,6,4)": {"integrator": "saba", "type": "10_6_4"},
}
"""rebound's methods for planets about a star that outweighs them; a Kepler orbit alone they solve exactly."""
SCIPY = {"RK45": (7, 12), "DOP853": (4, 13), "LSODA": (6, 13), "Radau": (4, 10)}
"""SciPy's methods, with the decimals of their first and last relative tolerance: a rougher one loses the orbit."""
MAX_STEPS = 1_000_000
"""Where a rough tolerance lets bodies collide, a run ends."""


def rebound_curves(problem, budget):
    """Leapfrogs of fixed steps, IAS15, and on planets the methods for planets."""
    import rebound

    fixed = {name: {"integrator": "leapfrog", "order": order} for name, order in LEAPFROG.items()}
    if len(problem.masses) > 1:
        fixed |= SPLITTINGS

    def fixed_step(options):
        def run(steps):
            def start():
                sim = simulation(problem, **options)
                sim.dt = problem.span / steps
                return sim

            def work():
                sim = start()
                return lambda: (sim.steps(steps), sim.synchronize())

            sim, done, q, v = start(), 0, [], []
            for n in problem.looks(steps):
                sim.steps(n - done)
                look(problem, sim, q, v)
                done = n
            return problem.energy_error(q, v), work

        return run

    def ias15(epsilon):
        def start():
            return simulation(problem, "ias15", epsilon=epsilon)

        def work():
            sim = start()
            return lambda: sim.integrate(problem.span, exact_finish_time=0)

        sim, q, v = start(), [], []
        for t in problem.instants():
            sim.integrate(t, exact_finish_time=0)
            look(problem, sim, q, v)
        return problem.energy_error(q, v), work

    curves = {name: measure(step_counts(problem), fixed_step(options), budget) for name, options in fixed.items()}
    return rebound.__version__, curves | {"IAS15": measure(tolerances(1, 11), ias15, budget)}


def simulation(problem, integrator, **options):
    """A simulation at its start: a fixed centre is a body that feels nothing of the other, which has no mass."""
    import rebound

    sim = rebound.Simulation()
    sim.G = problem.gravity
    masses = problem.masses
    if len(masses) == 1:
        sim.add(m=1 / problem.gravity)
        sim.N_active = 1
        masses = [0.0]
    for m, (x, y, z), (vx, vy, vz) in zip(
        masses, rows_of(problem, problem.positions), rows_of(problem, problem.velocities), strict=True
    ):
        sim.add(m=m, x=x, y=y, z=z, vx=vx, vy=vy, vz=vz)
    sim.integrator = integrator
    if integrator in ("whfast", "saba"):
        options |= {"safe_mode": 0, "keep_unsynchronized": 1}  # steps are merged, and looking changes nothing
    for option, value in options.items():
        setattr(sim.integrator, option, value)
    return sim


def look(problem, sim, positions, velocities):
    """Append the state of the problem's bodies."""
    sim.synchronize()
    q, v = np.empty((2, sim.N, 3))
    sim.serialize_particle_data(xyz=q, vxvyvz=v)
    bodies, dimension = len(problem.masses), len(problem.positions) // len(problem.masses)
    positions.append(q[-bodies:, :dimension].ravel())
    velocities.append(v[-bodies:, :dimension].ravel())


def rows_of(problem, values):
    """A row of three numbers for each body."""
    rows = np.reshape(values, (len(problem.masses), -1))
    return np.pad(rows, ((0, 0), (0, 3 - rows.shape[1]))).tolist()


def heyoka_curves(problem, budget):
    """Taylor series of adaptive order and step, compiled."""
    import heyoka

    bodies, size = len(problem.masses), len(problem.positions)
    if bodies == 1:
        (x, y), (u, v) = heyoka.make_vars("x", "y"), heyoka.make_vars("u", "v")
        w = (x**2 + y**2) ** -1.5
        system = [(x, u), (y, v), (u, -x * w), (v, -y * w)]
    else:
        system = heyoka.model.nbody(bodies, masses=problem.masses, Gconst=problem.gravity)
    q, v = (np.reshape(values, (bodies, -1)) for values in (problem.positions, problem.velocities))
    start = np.hstack([q, v]).ravel()  # body after body: positions, velocities

    def run(tolerance):
        stepper = heyoka.taylor_adaptive(system, start.tolist(), tol=tolerance)

        def restart():
            stepper.time = 0.0
            stepper.state[:] = start

        def work():
            restart()
            return lambda: stepper.propagate_until(problem.span, max_steps=MAX_STEPS)

        times, states = [], []

        def note(current):
            times.append(current.time)
            states.append(current.state.copy())
            return True

        stepper.propagate_until(problem.span, callback=note, max_steps=MAX_STEPS)
        seen = np.array(states)[first_after(problem, np.array(times))].reshape(-1, bodies, 2, size // bodies)
        return problem.energy_error(seen[:, :, 0].reshape(-1, size), seen[:, :, 1].reshape(-1, size)), work

    return heyoka.__version__, {"Taylor": measure(tolerances(3, 16), run, budget)}


def scipy_curves(problem, budget):
    """The methods of `solve_ivp`, with a compiled field."""
    import scipy
    from scipy.integrate import solve_ivp

    field, size = compiled_field(problem), len(problem.positions)
    start = np.array([*problem.positions, *problem.velocities])
    scale = np.repeat([np.abs(start[:size]).max(), np.abs(start[size:]).max()], size)
    field(0.0, start)

    def tolerated(method):
        def run(tolerance):
            def solve():
                return solve_ivp(field, (0, problem.span), start, method, rtol=tolerance, atol=tolerance * scale)

            solution = solve()
            if not solution.success:
                return float("inf"), solve
            seen = solution.y.T[1:][first_after(problem, solution.t[1:])]
            return problem.energy_error(seen[:, :size], seen[:, size:]), lambda: solve

        return run

    curves = {method: measure(tolerances(*decimals), tolerated(method), budget) for method, decimals in SCIPY.items()}
    return scipy.__version__, curves


def compiled_field(problem):
    """(q, v)′ as a function of t and (q, v), compiled."""
    import numba

    size, bodies = len(problem.positions), len(problem.masses)
    dimension, gm = size // bodies, problem.gravity * np.array(problem.masses)

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def centre(t, y):
        f = np.empty(2 * size)
        r2 = 0.0
        for k in range(size):
            f[k] = y[size + k]
            r2 += y[k] * y[k]
        w = -1.0 / (r2 * np.sqrt(r2))
        for k in range(size):
            f[size + k] = w * y[k]
        return f

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def gravity(t, y):
        f = np.zeros(2 * size)
        for k in range(size):
            f[k] = y[size + k]
        for i in range(bodies):
            for j in range(i + 1, bodies):
                r2 = 0.0
                for k in range(dimension):
                    r2 += (y[dimension * i + k] - y[dimension * j + k]) ** 2
                w = 1.0 / (r2 * np.sqrt(r2))
                for k in range(dimension):
                    d = w * (y[dimension * i + k] - y[dimension * j + k])
                    f[size + dimension * i + k] -= gm[j] * d
                    f[size + dimension * j + k] += gm[i] * d
        return f

    return centre if bodies == 1 else gravity


if __name__ == "__main__":
    task = json.load(sys.stdin)
    package = {"rebound": rebound_curves, "heyoka": heyoka_curves, "scipy": scipy_curves}[task["package"]]
    version, curves = package(Problem(**task["problem"]), task["budget"])
    print(json.dumps({"version": version, "curves": curves}))
