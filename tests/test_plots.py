"""The `plot` methods of results: they draw the result's own numbers, on the axes given, and change nothing else."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from contextvars import ContextVar
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import bseries as bs
import integrators
import trees

matplotlib = pytest.importorskip("matplotlib")
from matplotlib import pyplot  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from bseries.picture_files import save_picture  # noqa: E402
from bseries_base.diagrams import COLOURS  # noqa: E402
from bseries_base.plotting import apart_from_pyplot, new_figure, picture  # noqa: E402

COLOUR_WEIGHTS = (0.299, 0.587, 0.114)


@cache
def run() -> Any:
    return bs.integrate("stormer-verlet", "kepler", h=0.05, steps=500, observe="energy")


@cache
def precision() -> Any:
    return bs.work_precision(["rk4", "stormer-verlet"], "pendulum", span=5, errors=(1e-2, 1e-4))


def pendulum_run() -> Any:
    return bs.integrate("rk4", "pendulum", h=0.2, steps=50, y0=[2.5, 0], observe="energy")


def pendulum_hamiltonian() -> Any:
    return bs.modified_hamiltonian("stormer-verlet", "pendulum", 3)


EXAMPLES: dict[str, Callable[[], Any]] = {
    "DriftReport": lambda: bs.energy_drift("rk4", "pendulum", y0=[2.5, 0], h=0.2),
    "EffectCosts": lambda: bs.effect_costs("stormer-verlet", "kepler", h=0.01, effects="oblateness"),
    "EffectReport": lambda: bs.effect_influence("rk4", "kepler", h=0.02, span=6, accept=0.05),
    "EnsembleResult": lambda: bs.ensemble("rk4", "pendulum", h=0.1, steps=20, y0=[[0, 1], [0, 2], [0, 3]], keep=2),
    "ModifiedHamiltonian": lambda: bs.modified_hamiltonian("stormer-verlet", "kepler", 3),
    "PartitionedRungeKutta": lambda: bs.method("lobatto-iiia-iiib3"),
    "Reach": lambda: bs.fields.reach(bs.modified_field("explicit-euler", "riccati", 8), [1.0], 0.25),
    "RungeKutta": lambda: bs.method("gauss3"),
    "ShadowReport": lambda: bs.shadow_energy(run()),
    "Splitting": lambda: bs.method("strang"),
    "StabilityFunction": lambda: bs.stability_function("gauss3"),
    "Trajectory": run,
    "Tree": lambda: bs.Tree("[τ,[τ,[τ]]]"),
    "TreeTable": lambda: bs.TreeTable(4),
    "WorkPrecision": precision,
}
OPTIONS: dict[str, Callable[[], Any]] = {
    "DriftReport": lambda: {"run": pendulum_run()},
    "ModifiedHamiltonian": lambda: {"h": 0.05, "run": run()},
}


@cache
def example(name: str) -> tuple[Any, dict[str, Any]]:
    return EXAMPLES[name](), OPTIONS.get(name, dict)()


def drawn(name: str, ax: Any = None) -> Any:
    result, options = example(name)
    return result.plot(ax, **options)


@cache
def finished(name: str) -> Any:
    """A plot for tests that only look at it."""
    return drawn(name)


def test_all_results_with_a_plot_are_drawn_here():
    rooms = (bs, trees, integrators, bs.stability, bs.fields, bs.hamiltonians, bs.shadow, bs.advice, bs.runs)
    kinds = {name: kind for room in rooms for name in dir(room) if inspect.isclass(kind := getattr(room, name))}
    plotted = {name for name, kind in kinds.items() if hasattr(kind, "plot")}
    others = {name for name in plotted if issubclass(kinds[name], integrators.Method)}
    assert plotted - others == set(EXAMPLES) - others


@pytest.mark.few(5)
@pytest.mark.parametrize("name", EXAMPLES)
def test_plots_use_the_axes_given_and_leave_everything_else_alone(name):
    settings = dict(matplotlib.rcParams)
    ax, beside = Figure().subplots(1, 2)
    assert drawn(name, ax) is ax
    assert ax.has_data() or ax.texts
    assert not beside.has_data()
    assert not beside.texts
    fresh = drawn(name)
    assert fresh.figure is not ax.figure
    assert dict(matplotlib.rcParams) == settings
    assert not pyplot.get_fignums()


ALL_KINDS = {"EffectReport", "StabilityFunction", "Trajectory", "Tree"}
"""Bars, areas, curves and a drawing without axes; `test_axes_have_labels_and_…` says that all are saved in one way."""


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "name", [name if name in ALL_KINDS else pytest.param(name, marks=pytest.mark.slow) for name in EXAMPLES]
)
def test_fonts_in_pdf_are_truetype_and_notebooks_show_the_figure(name, tmp_path):
    axes = drawn(name)
    axes.figure.savefig(tmp_path / "plot.pdf")
    for content in ((tmp_path / "plot.pdf").read_bytes(), picture(axes.figure, "pdf")):
        assert b"/Type3" not in content
        assert name == "Tree" or b"/TrueType" in content or b"/Type0" in content  # a tree has no text
    assert axes._repr_html_().startswith("<figure")


@pytest.mark.few(5)
@pytest.mark.parametrize("name", EXAMPLES)
def test_axes_have_labels_and_the_method_an_example(name):
    axes, result = finished(name), example(name)[0]
    assert type(axes.figure) is type(new_figure((9, 6)))
    if axes.axison:
        assert axes.get_xlabel()
        assert axes.get_ylabel() or [text.get_text() for text in axes.get_yticklabels()]
    documentation = inspect.getdoc(result.plot) or ""
    assert ">>> " in documentation
    assert "ax" in inspect.signature(result.plot).parameters


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_is_no_axes_is_refused(name):
    with pytest.raises(bs.errors, match="ax must be axes of matplotlib or None, but was 'here'"):
        drawn(name, "here")


@pytest.mark.few(5)
@pytest.mark.parametrize("name", EXAMPLES)
def test_labels_are_inside_the_figure(name):
    """In a figure of the width of a page no text is cut off."""
    figure = finished(name).figure
    box = figure.get_tightbbox()
    width, height = figure.get_size_inches()
    assert min(box.x0, box.y0, width - box.x1, height - box.y1) > -0.02


def lines(axes: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): np.array(line.get_data()) for line in axes.lines}


def test_a_trajectory_draws_its_states_and_observations():
    kepler = run()
    assert {name: data[1].tolist() for name, data in lines(kepler.plot()).items()} == {
        name: values.tolist() for name, values in zip(kepler.variables, kepler.y, strict=True)
    }
    (orbit,) = lines(kepler.plot(x="q1", y="q2")).values()
    assert (orbit == kepler.y[2:]).all()
    (error,) = lines(kepler.plot(y="energy", change=True)).values()
    assert (error == [kepler.observed_t, kepler.observed["energy"] - kepler.observed["energy"][0]]).all()
    assert kepler.plot(x="q1", y="q2", points=True).lines[0].get_linestyle() == "None"


def test_observations_at_other_times_than_states():
    seldom = bs.integrate("rk4", "pendulum", h=0.1, steps=20, save_every=10, observe="energy", observe_every=5)
    assert [len(data[0]) for data in lines(seldom.plot(y=["energy"])).values()] == [5]
    with pytest.raises(bs.IntegratorError, match="observe_every must be save_every for a plot of energy and q"):
        seldom.plot(x="q", y="energy")


def test_an_ensemble_draws_means_bands_and_members():
    result = bs.ensemble("rk4", "pendulum", h=0.1, steps=20, y0=[[0, 1], [0, 2], [0, 3]], keep=2)
    axes = result.plot(name="energy")
    found = lines(axes)
    assert (found["mean"][1] == result.mean["energy"]).all()
    assert len(axes.lines) == 3
    low = axes.collections[0].get_paths()[0].vertices[:, 1].min()
    assert low == result.minimum["energy"].min()


def test_reach_and_shadow_draw_the_numbers_of_their_tables():
    reach = bs.fields.reach(bs.modified_field("explicit-euler", "riccati", 8), [1.0], 0.25)
    terms, optimum = lines(reach.plot()).values()
    assert terms.tolist() == [list(reach.powers), list(reach.sizes)]
    assert optimum.ravel().tolist() == [reach.optimal_power, reach.sizes[reach.optimal_power]]
    report = bs.shadow_energy(bs.integrate("stormer-verlet", "pendulum", h=0.1, steps=3000))
    found = lines(report.plot(orders=[2, 6]))
    assert list(found) == ["order 2: energy", "order 6"]
    largest = {name: np.nanmax(data[1]) for name, data in found.items()}
    for row in report.rows[:3:2]:  # half of the range is between half of the largest distance and all of it
        name = "order 2: energy" if row.order == 2 else f"order {row.order}"
        assert 0.99 * row.deviation <= largest[name] <= 2.01 * row.deviation


def test_drift_draws_the_run_and_its_prediction():
    asymmetric, start = bs.scene("pendulum", effects=["asymmetry"]), {"y0": [2.5, 0], "h": 0.2}
    measured = bs.integrate("simplified-takahashi-imada", asymmetric, steps=500, observe="energy", **start)
    report = bs.energy_drift("simplified-takahashi-imada", asymmetric, **start)
    found = lines(report.plot(run=measured))
    assert (found["measured"][1] == measured.observed["energy"] - measured.observed["energy"][0]).all()
    assert found["predicted"][1][-1] == pytest.approx(report.slope() * 100)


def test_drift_draws_the_range_that_the_modified_hamiltonian_predicts():
    """That of −h²H₃ along the run, and nothing at 0; scaled to another step size by its power."""
    report = bs.energy_drift("stormer-verlet", "kepler", h=0.02, steps=5000)
    for h in (0.02, 0.01):
        measured = bs.integrate("stormer-verlet", "kepler", h=h, steps=2000, observe="energy", observe_every=1)
        axes = report.plot(run=measured)
        run, low, high = axes.lines
        assert [line.get_label() for line in (run, low)] == ["measured", "range of $-h^{2} H_{3}$"]
        term = -(h**2) * bs.modified_hamiltonian("stormer-verlet", "kepler", 3).terms(measured.y)[2]
        for line, end in ((low, min(term - term[0])), (high, max(term - term[0]))):
            assert line.get_ydata()[0] == pytest.approx(end, rel=0.02, abs=1e-6)
        assert "bounded, amplitude" in axes.get_title("left").replace("\n", " ")


def test_a_modified_hamiltonian_of_more_than_two_variables_is_drawn_along_a_run():
    H = bs.modified_hamiltonian("stormer-verlet", "kepler", 5)
    measured = bs.integrate(H.method, H.scene, h=0.05, steps=500)
    axes = H.plot(h=0.05, run=measured)
    found = lines(axes)
    assert list(found) == ["$H$", r"$\widetilde{H}$ to $h^{2}$", r"$\widetilde{H}$ to $h^{4}$"]
    values = H(measured.y, 0.05)
    assert found[r"$\widetilde{H}$ to $h^{4}$"][1] == pytest.approx(abs(values - values[0])[1:])
    assert axes.get_title("left").replace("\n", " ").endswith("errors along a run")
    assert not axes.collections
    with pytest.raises(bs.SeriesError, match="run must be left out with x, y or window, as there are more than two"):
        H.plot(h=0.05, run=measured, x="q2")


def test_a_slice_says_where_it_is():
    H = bs.modified_hamiltonian("stormer-verlet", "kepler", 3)
    axes = H.plot(h=0.05, window=(-2, 2, -2, 2), x="q2", y="p1")
    assert axes.get_title("left").replace("\n", " ").replace("\xa0", " ").endswith("slice at p2 = 2, q1 = 0.4")


def test_the_region_of_stability_has_its_known_border():
    """The border of rk4 crosses the axes at −2.785 and ±2.828i."""
    paths = bs.stability_function("rk4").plot().collections[-1].get_paths()
    points = np.concatenate([path.vertices for path in paths])
    on_real = points[np.abs(points[:, 1]) < 0.02]
    assert on_real[:, 0].min() == pytest.approx(-2.785, abs=0.01)
    assert abs(points[:, 1]).max() > 2.82


def test_the_order_star_has_as_many_fingers_as_the_order_plus_one():
    """Around 0, R(z) exp(−z) − 1 ≈ −C z^(p+1): p + 1 sectors are shaded (Wanner, Hairer, Nørsett 1978)."""
    for name, order in (("rk4", 4), ("gauss2", 4), ("radau-iia3", 5)):
        R = bs.stability_function(name)
        circle = 0.3 * np.exp(2j * np.pi * (np.arange(720) + 0.5) / 720)
        outside = np.abs(R(circle)) > np.abs(np.exp(circle))
        assert np.count_nonzero(outside & ~np.roll(outside, 1)) == order + 1
        axes = R.plot(order_star=True, window=(-0.5, 0.5, -0.5, 0.5))
        shaded = axes.collections[0].get_paths()
        assert all(any(path.contains_point((z.real, z.imag)) for path in shaded) for z in circle[outside][::7])


def test_the_modified_hamiltonian_is_constant_along_its_level_curves():
    H = bs.modified_hamiltonian("symplectic-euler-p", "pendulum", 3)
    axes = H.plot(h=0.3, window=(-2, 2, -2, 2))
    for path in axes.collections[0].get_paths():
        for q, p in path.vertices[:: max(1, len(path.vertices) // 9)]:
            level = H([p, q], 0.3)
            assert min(abs(level - float(other)) for other in axes.collections[0].levels) < 1e-2


def test_work_precision_names_every_method_beside_the_panel():
    found = precision()
    axes = found.plot()
    legend = axes.get_legend()
    assert {text.get_text() for text in legend.get_texts()} == {"rk4", "stormer-verlet"}
    assert {line.get_linestyle() for line in legend.get_lines()} == {"None"}
    axes.figure.draw_without_rendering()
    assert legend.get_window_extent().x0 > axes.get_window_extent().x1
    for curve, line in zip(found.curves, axes.lines, strict=True):
        assert set(zip(*line.get_data(), strict=True)) <= set(curve.front(found.measures[0]))


def test_work_precision_against_evaluations_of_f():
    """Four for each step of rk4, and one for each of leapfrog, which keeps the last one; none are known of gauss2."""
    found = bs.work_precision(["rk4", "leapfrog", "gauss2"], "pendulum", span=5, errors=(1e-2, 1e-4))
    axes = found.plot(measure="solution", against="evaluations")
    assert axes.get_ylabel() == "evaluations of f"
    curves = lines(axes)
    assert set(curves) == {"rk4", "leapfrog"}
    for curve, each in zip(found.curves, (4, 1), strict=False):
        runs = {row.errors.solution: float(each * row.steps) for row in curve.rows}
        drawn_points = dict(zip(*curves[curve.candidate.name].tolist(), strict=True))
        assert drawn_points.items() <= runs.items()
    table = found.to_table().records.rows  # pyright: ignore[reportOptionalMemberAccess]
    assert {row["method"]: row["evaluations"] and row["evaluations"] // row["steps"] for row in table} == {
        "rk4": 4, "leapfrog": 1, "gauss2": None,
    }  # fmt: skip
    with pytest.raises(bs.IntegratorError, match="against must be one of seconds, evaluations, but was 'x'"):
        found.plot(against="x")


def test_effects_draw_bars_of_the_times_measured():
    costs = EXAMPLES["EffectCosts"]()
    widths = [bar.get_width() for bar in costs.plot().patches]
    assert widths == pytest.approx([row.step.seconds * 1e9 for row in costs])


def test_tableaux_have_all_entries_and_trees_all_nodes():
    texts = [text.get_text() for text in bs.method("lobatto-iiia-iiib3").plot().texts]
    assert {"p", "q", r"$\dfrac{5}{24}$"} <= set(texts)
    assert len(texts) == 2 + 2 * (3 * 4 + 4)
    assert len(bs.Tree("[τ,[τ]]").plot().collections[1].get_offsets()) == 4  # pyright: ignore[reportArgumentType]
    assert "flow of" in bs.method("strang").plot().texts[0].get_text()


def test_neighbouring_curves_differ_in_grey():
    greys = [
        sum(w * x for w, x in zip(COLOUR_WEIGHTS, matplotlib.colors.to_rgb(colour), strict=True)) for colour in COLOURS
    ]
    assert all(abs(a - b) > 0.12 for a, b in pairwise(greys))


@pytest.mark.parametrize(
    ("plot", "sentence"),
    [
        (lambda: run().plot(x="z"), "x and y must be of t, p1, p2, q1, q2, energy, but one was 'z'"),
        (lambda: run().plot(y=["p1", 3]), "x and y must be of .*, but one was 3"),
        (lambda: run().plot(y=3), "y must be"),
        (lambda: example("ShadowReport")[0].plot(orders=3), "orders must be"),
        (lambda: pendulum_hamiltonian().plot(h=0.1, run=3), "run must have the variables p, q, but was 3"),
        (
            lambda: bs.modified_hamiltonian("strang", "lotka-volterra", 2).plot(h=0.1, window=(-2, -1, -2, -1)),
            "window must have points where H~ is finite, but was",
        ),
        (lambda: pendulum_hamiltonian().plot(h="x", window=(0, 1, 0, 1)), "h must be"),
        (lambda: bs.stability_function("sdirk2").plot(), "coefficients must be numbers before poles are found"),
        (lambda: bs.stability_function("rk4").plot(window=(1, 0, 0, 1)), "window must be four numbers, left < right"),
        (lambda: bs.stability_function("rk4").plot(window=3), "window must be four numbers, left < right"),
        (lambda: pendulum_hamiltonian().plot(h=0.1), "window must be given, as in"),
        (lambda: pendulum_hamiltonian().plot(h=0.1, window=(0, 1, 0, 1), x="z"), "x and y must be of p, q"),
        (lambda: pendulum_hamiltonian().plot(h=0.1, run=run()), "run must have the variables p, q, but was <Traj"),
        (lambda: example("DriftReport")[0].plot(run=3), "run must be a trajectory that observes the energy, but was 3"),
        (lambda: example("ShadowReport")[0].plot(orders=[3]), "orders must be of 2, 4, .*, but one was 3"),
        (lambda: example("EnsembleResult")[0].plot(name="x"), "name must be one of energy, but was 'x'"),
        (lambda: precision().plot(measure="x"), "measure must be one of solution, energy, but was 'x'"),
    ],
)
def test_bad_arguments_get_one_sentence(plot, sentence):
    with pytest.raises(bs.errors, match=sentence):
        plot()


def test_pictures_are_written_whole_or_not_at_all(tmp_path, monkeypatch):
    figure = bs.Tree("[τ]").plot().figure
    monkeypatch.setattr(type(figure), "savefig", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        save_picture(tmp_path / "tree.png", figure)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def with_pyplot(monkeypatch):
    """What users have: plots share pyplot's current axes, which tests otherwise are kept from."""
    monkeypatch.setattr("bseries_base.plotting._apart", ContextVar("apart", default=False))
    yield pyplot
    pyplot.close("all")


def test_without_axes_plots_are_on_the_current_ones_of_pyplot(with_pyplot, tmp_path):
    axes = run().plot(y="q1")
    assert pyplot.gca() is axes
    assert pyplot.gcf().get_size_inches() == pytest.approx([12 / 2.54, 7.5 / 2.54])
    assert axes._repr_html_() is None  # pyplot shows the figure
    pyplot.savefig(tmp_path / "q.png")
    assert (tmp_path / "q.png").read_bytes() != picture(new_figure((12, 7.5)), "png")
    pyplot.close("all")
    _, (left, right) = pyplot.subplots(1, 2)
    pyplot.sca(left)
    assert run().plot(y="q1") is left
    pyplot.plot([0, 1], [0, 1])
    assert len(left.lines) == 2
    assert run().plot(right, y="q2") is right
    with apart_from_pyplot():
        assert run().plot() is not left
    assert len(left.lines) == 2
    assert pyplot.get_fignums() == [1]


LINES = ("DriftReport", "EnsembleResult", "Reach", "ShadowReport", "Trajectory")


@pytest.mark.parametrize("name", LINES)
def test_properties_of_lines_reach_matplotlib(name):
    result, options = example(name)
    usual = result.plot(**options)
    axes = result.plot(color="red", lw=3, alpha=0.5, **options)
    red = [line for line in axes.lines if line.get_color() == "red"]
    assert red
    assert all((line.get_linewidth(), line.get_alpha()) == (3, 0.5) for line in red)
    assert [line.get_label() for line in axes.lines] == [line.get_label() for line in usual.lines]
    assert not [line for line in usual.lines if line.get_color() == "red"]


@pytest.mark.few(4)
@pytest.mark.parametrize("name", EXAMPLES)
def test_figures_can_be_pickled(name):
    figure = drawn(name).figure
    again = pickle.loads(pickle.dumps(figure))
    assert type(again) is type(figure)
    assert type(again.axes[0]) is type(figure.axes[0])
    assert picture(again, "png") == picture(figure, "png")
