r"""What the engine computes for the text: ``{{name}}`` stands for the result of a function in `COMPUTED`.

Nothing in a source is evaluated. Results are TeX, to stand between dollars, or tables and numbers in Markdown.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from math import factorial
from typing import TYPE_CHECKING, Any

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.figures.lennard_jones_drift import LECTURE, SIMPLIFIED
from bseries.figures.lennard_jones_drift import start as equilibrated
from bseries.figures.registry import compute, figure_file
from bseries_base.errors import not_one_of
from bseries_base.numbers import latex_number

if TYPE_CHECKING:
    import sympy


PLACE = re.compile(r"\{\{([a-z0-9-]+)\}\}")

TREES, METHODS = 4, ("explicit-euler", "implicit-midpoint", "rk4")
"""Largest number of nodes, and methods, in the table of trees."""
LINEAR = ("explicit-euler", "implicit-midpoint", "heun2", "rk4")
"""Methods in the table of convergence radii."""
H_PENDULUM, START_PENDULUM = 0.2, (2.5, 0.0)
"""The step size and the start of figure 7."""
FINE, TURNS = 200, 500
"""Points per turn and turns of the exact pendulum for a mean over time."""
H_ATOMS, STEPS_ATOMS, SEEDS_ATOMS = 0.01, 200_000, 4
"""Step size, length and number of the trajectories of atoms for means over time."""
FEWER: dict[str, dict[str, Any]] = {"lennard-jones-drift": {"members": 128}}
"""Options of figures that would take minutes."""


@cache
def figure_data(name: str) -> Any:
    """The data of a figure, computed once: the text quotes some of its numbers."""
    return compute(figure_file(name), FEWER.get(name, {}))


def places(text: str) -> list[str]:
    """The names of what is to be computed for a text.

    Example:
        >>> places("$$ {{riccati-explicit-euler}} $$")
        ['riccati-explicit-euler']
    """
    return PLACE.findall(text)


def filled(text: str, values: Mapping[str, str]) -> str:
    """A text with values in the place of their names.

    Example:
        >>> filled("{{a}} and {{b}}", {"a": "1", "b": "2"})
        '1 and 2'
    """
    return PLACE.sub(lambda found: values[found[1]], text)


def computed(name: str) -> str:
    """The result of the function of a name.

    Example:
        >>> print(computed("takahashi-imada-integral"))
        \\frac{6 \\pi}{5}
    """
    if name not in COMPUTED:
        raise SeriesError(not_one_of(COMPUTED, "a place in a text", name))
    return COMPUTED[name]()


def _field(method: str, scene: str, order: int) -> str:
    """A modified equation, truncated, as lines of a formula that may have a number."""
    return bs.modified_field(method, scene, order).to_latex().strip().replace("{align*}", "{aligned}")


def _invariant() -> str:
    """The second term of the first integral of symplectic Euler on Lotka–Volterra's equations."""
    field = bs.modified_field("symplectic-euler-p", "lotka-volterra", 2)
    return latex_number(bs.modified_invariant(field).terms[1].expand())


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown: the first column at the left, the others at the right."""
    lines = [headings, [":--", *["--:"] * (len(headings) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _trees() -> str:
    """Trees with their elementary differentials and their weights in modified equations."""
    series = {method: bs.modified_equation(method, TREES) for method in METHODS}
    first = next(iter(series.values()))
    rows = (
        [f"`{tree}`", f"${tree.differential('latex')}$", str(tree.order), str(tree.symmetry)]
        + [f"${b[tree] / tree.symmetry}$" for b in series.values()]
        for tree in first
    )
    return _table(("tree $τ$", "$F(τ)$", r"$\lvert τ\rvert$", "$σ(τ)$", *METHODS), rows)


def _radii() -> str:
    """The coefficients of (9) and its radius of convergence."""
    rows = []
    for method in LINEAR:
        tall = bs.modified_equation(method, 5, max_children=1)
        radius = bs.fields.convergence_radius(method).radius
        rows.append([method, *(f"${c}$" for c in tall.coefficients()[1:]), f"{radius:.5g}"])
    return _table(("method", "$b_2$", "$b_3$", "$b_4$", "$b_5$", r"radius of $h\lambda$"), rows)


def _brackets() -> str:
    """The modified Hamiltonian of Störmer–Verlet, kick–drift–kick, in brackets, two in a line."""
    found = bs.hamiltonians.bracket_hamiltonian("stormer-verlet", 5, quadratic_kinetic=True)
    lines = [rf"\widetilde H = {{}}& {found.term_latex(0)}"]
    for power in (2, 4):
        terms = re.split(" (?=[+-] )", found.term_latex(power))
        opening = rf"{{}} + h^{power} \Big("
        for k in range(0, len(terms), 2):
            lines.append(f"& {opening} {' '.join(terms[k : k + 2])}")
            opening = r"\qquad {}"
        lines[-1] += r"\Big)"
    return _lines([*lines, r"& {} + \mathcal{O}(h^6)"])


def _lines(lines: Iterable[str]) -> str:
    """An aligned formula of several lines."""
    return "\n".join([r"\begin{aligned}", " \\\\\n".join(lines), r"\end{aligned}"])


@cache
def _any_potential() -> tuple[tuple[sympy.Symbol, ...], bs.Scene]:
    """The derivatives of any potential U as symbols, and p²/2 + U(q) as a scene, by its Taylor polynomial at q = 0."""
    import sympy

    names = [f"u{k}" for k in range(1, 6)]
    taylor = " + ".join(f"{name}*q^{k}/{factorial(k)}" for k, name in enumerate(names, 1))
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian=f"p^2/2 + {taylor}", parameters={name: name for name in names})
    return tuple(map(sympy.Symbol, names)), scene


def _at_any_point(formula: Any) -> str:
    """A formula at q = 0 in TeX, where derivatives of U have their names, sorted by their products."""
    import sympy

    symbols, _ = _any_potential()
    named = {symbol: sympy.Symbol(f"U_{{{'q' * k}}}") for k, symbol in enumerate(symbols, 1)}
    letters = (sympy.Symbol("p"), *named.values())
    terms = sympy.Poly(formula.subs("q", 0).subs(named), *letters).as_dict().items()
    return sympy.latex(
        sum(sympy.factor(c) * sympy.prod(map(sympy.Pow, letters, powers)) for powers, c in terms)  # pyright: ignore
    )


def _takahashi_imada(*, simplified: bool) -> bs.methods.TakahashiImada:
    """The method (13) or (14), for any α."""
    return bs.methods.TakahashiImada("alpha", simplified=simplified, parameters=["alpha"])


def _any_term(power: int, method: str = "") -> str:
    """A term of the modified Hamiltonian of the Takahashi–Imada method (13), or another, for any potential."""
    made = bs.method(method) if method else _takahashi_imada(simplified=False)
    return _at_any_point(bs.modified_hamiltonian(made, _any_potential()[1], power + 1).symbolic(power))


def _defect() -> str:
    """What the simplified method adds to p' at h⁴: (17)."""
    fields = (bs.modified_field(_takahashi_imada(simplified=kind), _any_potential()[1], 5) for kind in (True, False))
    simplified, true = (field.symbolic(4)[0] for field in fields)
    return _at_any_point(simplified - true)


def _asymmetric_pendulum() -> bs.Scene:
    return bs.scene("pendulum", effects=["asymmetry"])


def _scientific(value: float, digits: int = 3) -> str:
    """A number in TeX, such as 3.08 · 10^{-6}, and as 0.308 or 3.08 if it is neither large nor small."""
    if 0.1 <= abs(value) < 100:
        return f"{value:.{digits}g}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return rf"{mantissa}\cdot10^{{{int(exponent)}}}"


@cache
def _pendulum_drift() -> Any:
    """The drift on the asymmetric pendulum, as figure 7 has it."""
    return bs.energy_drift(SIMPLIFIED, _asymmetric_pendulum(), y0=list(START_PENDULUM), h=H_PENDULUM)


def _pendulum_time_mean() -> str:
    """The left-hand side of (19): the mean of the rate along the exact solution, over many turns."""
    import numpy as np

    report = _pendulum_drift()
    h = report.orbit.period / FINE
    run = bs.integrate("gauss4", _asymmetric_pendulum(), h=h, steps=FINE * TURNS, y0=list(START_PENDULUM))
    rate = bs.Scene({"p": 1, "q": 1}, field={"p": report.rate, "q": "0"})
    values = bs.modified_field("explicit-euler", rate, 1)(run.y[:, :-1], 0.0)[0]
    return _scientific(float(np.mean(values)) * H_PENDULUM**report.power, 5)


@cache
def atom_drifts() -> list[Any]:
    """Statistics of the rate (18), in units of h⁴, along trajectories of nine atoms in disorder."""
    import numpy as np

    atoms: Any = bs.scene("lennard-jones")
    draw, found = bs.runs.thermal_momenta(atoms, 1), []
    for seed in range(SEEDS_ATOMS):
        y0 = equilibrated(atoms, draw, H_ATOMS, np.random.default_rng(seed))
        report = bs.energy_drift(SIMPLIFIED, atoms, h=H_ATOMS, y0=y0, steps=STEPS_ATOMS)
        found.append(dict(report.statistics)[4])
    return found


def _atom_means() -> str:
    """The left-hand side of (19) for atoms: means over time with their standard errors, and diffusion constants."""
    rows = [
        [
            str(k), f"{s.time:,.0f}",
            rf"${s.mean:.2f} \pm {s.error:.2f}$", rf"${s.diffusion:.0f} \pm {s.diffusion_error:.0f}$",
        ]
        for k, s in enumerate(atom_drifts(), 1)
    ]  # fmt: skip
    return _table(("start", "length in time", r"mean of $F/h^4$", "$D/h^8$"), rows)


_atoms = partial(figure_data, "lennard-jones-drift")


def _predicted_deviation() -> str:
    """σ at the end of figure 8 by the diffusion of the rate, h⁴ √(2Dt), with the mean of D over the starts."""
    data, found = _atoms(), atom_drifts()
    diffusion = sum(s.diffusion for s in found) / len(found)
    return _scientific(data.h**4 * (2 * diffusion * data.t[-1]) ** 0.5, 2)


def _any_hamiltonian() -> tuple[sympy.Expr, list[sympy.Symbol], list[sympy.Symbol]]:
    """H(p, q) for any function H, with p and q."""
    import sympy

    p, q = sympy.symbols("p q")
    return sympy.Function("H")(p, q), [p], [q]


def _partial_derivatives(formula: Any, name: str = "H") -> str:
    """A formula in TeX with subscripts for derivatives of H, which has a name."""
    import sympy

    named: dict[Any, Any] = {
        d: sympy.Symbol(f"{name}_{{{''.join(str(v) * int(n) for v, n in d.variable_count)}}}")
        for d in formula.atoms(sympy.Derivative)
    }
    return sympy.latex(formula.subs(named).subs(_any_hamiltonian()[0], sympy.Symbol(name)))


def _symplectic_euler() -> str:
    """(25), from the generating function S = h H of symplectic Euler."""
    import sympy

    function, momenta, positions = _any_hamiltonian()
    step = sympy.Symbol("h")
    terms = bs.hamiltonians.generating_hamiltonian(step * function, momenta, positions, 3, h=step)
    first, second, third = (_partial_derivatives(sympy.factor(term)) for term in terms)
    return rf"{first} + h \left({second}\right) + h^2 \left({third}\right)"


def _exact_generating_function() -> str:
    """The terms of (24): the generating function of the exact flow."""
    function, momenta, positions = _any_hamiltonian()
    terms = bs.hamiltonians.exact_generating_function(function, momenta, positions, 3).terms
    name = r"\widetilde{H}"
    return _lines(rf"\widetilde S_{k} &= {_partial_derivatives(term, name)}" for k, term in enumerate(terms, 1))


def _large_steps() -> str:
    """Largest changes of H + h²H₃ along the orbits of figure 6."""
    data = figure_data("large-steps")
    rows = [
        [f"{h:g}", *(f"${_scientific(abs(orbit - orbit[0]).max(), 2)}$" for orbit in energies)]
        for h, energies in zip(data.h, data.energies, strict=True)
    ]
    return _table(("$h$", *(f"orbit {k}" for k in range(1, data.energies.shape[1] + 1))), rows)


COMPUTED: dict[str, Callable[[], str]] = {
    "riccati-explicit-euler": partial(_field, "explicit-euler", "riccati", 6),
    "riccati-implicit-midpoint": partial(_field, "implicit-midpoint", "riccati", 9),
    "riccati-rk4": partial(_field, "rk4", "riccati", 9),
    "lotka-volterra-explicit-euler": partial(_field, "explicit-euler", "lotka-volterra", 2),
    "lotka-volterra-symplectic-euler": partial(_field, "symplectic-euler-p", "lotka-volterra", 2),
    "lotka-volterra-invariant": _invariant,
    "trees": _trees,
    "linear-radii": _radii,
    "pendulum-midpoint": lambda: bs.modified_hamiltonian("implicit-midpoint", "pendulum", 3).to_latex(),
    "large-steps": _large_steps,
    "stormer-verlet-brackets": _brackets,
    "stormer-verlet-h3": partial(_any_term, 2, "stormer-verlet"),
    "stormer-verlet-h5": partial(_any_term, 4, "stormer-verlet"),
    "takahashi-imada-h3": partial(_any_term, 2),
    "takahashi-imada-h5": partial(_any_term, 4),
    "takahashi-imada-defect": _defect,
    "takahashi-imada-integral": lambda: latex_number(bs.hamiltonians.takahashi_imada_integral(_asymmetric_pendulum())),
    "pendulum-time-mean": _pendulum_time_mean,
    "pendulum-space-mean": lambda: _scientific(_pendulum_drift().slope(), 5),
    "atom-means": _atom_means,
    "figure-8-members": lambda: str(_atoms().members),
    "figure-8-deviation": lambda: _scientific(_atoms().deviation[-1]),
    "figure-8-predicted": _predicted_deviation,
    "figure-8-mean": (lambda: rf"{_scientific(_atoms().mean[-1])} \pm {_scientific(_atoms().standard_error[-1], 2)}"),
    # The standard error of the lecture's μ by its own σ; and the step for which our σ, of order h⁴, would be the same.
    "figure-8-lecture-error": lambda: _scientific(LECTURE[2] / LECTURE[0] ** 0.5, 2),
    "figure-8-step": lambda: f"{_atoms().h * (LECTURE[2] / _atoms().deviation[-1]) ** 0.25:.4f}",
    "exact-generating-function": _exact_generating_function,
    "symplectic-euler-any": _symplectic_euler,
}
"""What a text may ask for, by name."""
