"""The page of a method and a scene: its template, and its pictures with the data that a move of a slider replaces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries_base.extras import optional_module
from bseries_base.plotting import BLACK, BLUE, GREY, ORANGE, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from bokeh.model import Model
    from bokeh.models import ColumnDataSource, Div, Slider, Toggle
    from bokeh.plotting import figure as Figure
    from jinja2 import Template

    from bseries.explorer.flows import SceneShape, View
    from bseries.explorer.method_facts import MethodFacts, StabilityShapes

HEIGHT = 300
COLOURS = {"exact": BLACK, "modified": VERMILION, "numerical": BLUE}
DASHES = {"exact": "solid", "modified": "dashed", "numerical": "dotted"}
COLUMNS = {
    "numerical_curve": ("t", "x", "y", "energy"),
    "exact_curve": ("t", "x", "y", "error"),
    "modified_curve": ("t", "x", "y", "error", "energy"),
    **{f"{flow}_patch": ("x", "y") for flow in COLOURS},
    **{f"{flow}_area": ("t", "area") for flow in COLOURS},
    "orbits": ("x", "y"),
}
"""The columns of each source."""
FLOWS = (*COLOURS, "orbits")
"""What sources are of: the beginnings of their names."""


class ScenePlots(NamedTuple):
    """Pictures of a scene, the sliders h, scale and terms, and the button `sweep` that moves h through its range."""

    fill: dict[str, Any]  # what `FILL` needs
    news: ColumnDataSource  # numbers that the page is told, see `TELL`
    figures: dict[str, Figure]  # the pictures, by the names under which a page has them
    h: Slider
    scale: Slider
    terms: Slider
    sweep: Toggle
    sentence: Div  # a line of text for what cannot be shown

    @property
    def roots(self) -> dict[str, Model]:
        """Everything that a page has, by name."""
        controls = {"h": self.h, "scale": self.scale, "terms": self.terms, "sweep": self.sweep}
        return {**self.figures, **controls, "sentence": self.sentence, "news": self.news}


def stability_plots(shapes: StabilityShapes) -> dict[str, Figure]:
    """The stability region and the order star."""
    models = optional_module("bokeh.models", "explore")
    titles = {"region": "Stability region: |R(z)| ≤ 1", "star": "Order star: |R(z)| > |exp(z)|"}
    below, above = [-100.0, 0.0], [0.0, 100.0]
    found = {}
    for name, values, levels in (("region", shapes.growth, below), ("star", shapes.star, above)):
        found[name] = picture = _figure(titles[name], "Re z", "Im z")
        radius = float(shapes.axis[-1])
        picture.x_range.update(start=-radius, end=radius)
        picture.y_range.update(start=-radius, end=radius)
        picture.update(sizing_mode="scale_width", aspect_ratio=1.0, max_width=400)
        picture.contour(shapes.axis, shapes.axis, values, levels=levels, fill_color=[ORANGE], line_color=[BLACK] * 2)
        for dimension in ("width", "height"):
            picture.add_layout(models.Span(location=0, dimension=dimension, line_color=GREY))
        if shapes.poles:
            real, imaginary = [z.real for z in shapes.poles], [z.imag for z in shapes.poles]
            picture.scatter(
                real, imaginary, marker="x", size=9, line_width=2, color=VERMILION, legend_label="pole of R"
            )
            _legend_above(picture)
    return found


def scene_plots(scene: SceneShape, steps: int, scales: tuple[float, float, float]) -> ScenePlots:
    """The pictures of a scene, still without data, and sliders for the number `steps` of step sizes.

    `scales` are the least and the largest factor of the start, and the distance between two.
    """
    models = optional_module("bokeh.models", "explore")
    # Only the page knows the data of sources and the ranges that follow from them: nothing of it goes back to a server.
    sources = {
        name: models.ColumnDataSource({key: [] for key in keys}, syncable=False) for name, keys in COLUMNS.items()
    }
    fill = {
        "sources": list(sources.values()),
        "flows": [name.partition("_")[0] for name in COLUMNS],
        "columns": [list(keys) for keys in COLUMNS.values()],
        "lengths": [scene.lengths[name.split("_")[-1]] for name in COLUMNS],
    }
    news = models.ColumnDataSource(syncable=False)
    news.js_on_change("data", models.CustomJS(args={**fill, "news": news}, code=TELL))
    least = scene.largest / steps
    wide = {"sizing_mode": "stretch_width", "margin": (4, 16, 4, 16)}
    h = models.Slider(
        title="step size h", start=least, end=scene.largest, step=least, value=least * max(1, steps // 8),
        format="0.0000", **wide,
    )  # fmt: skip
    scale = models.Slider(
        title="factor of the start", start=scales[0], end=scales[1], step=scales[2], value=1.0, format="0.00", **wide
    )
    terms = models.Slider(
        title="terms of the modified equation", start=1, end=scene.terms, step=1, value=min(3, scene.terms), **wide
    )
    sweep = models.Toggle(label="Sweep h", width=120, margin=(4, 16, 4, 16))
    sweep.js_on_change("active", models.CustomJS(args={"h": h, "sweep": sweep}, code=SWEEP))
    sentence = models.Div(text="", disable_math=True, sizing_mode="stretch_width")
    figures = dict(_figures(scene, sources))
    for picture in figures.values():
        _legend_of_copies(picture)
        _legend_above(picture)
    return ScenePlots(fill, news, figures, h, scale, terms, sweep, sentence)


SWEEP = """
if (!sweep.active) { clearInterval(window.bseriesSweep); return }
window.bseriesSweep = setInterval(() => {
    const next = h.value + Math.max(h.step, (h.end - h.start) / 60)
    h.value = next > h.end * 1.000001 ? h.start : Math.min(next, h.end)
}, 200)
"""
"""Moves the slider of h five times a second."""


FILL = """
const fill = (flow, numbers, place) => {
    sources.forEach((source, k) => {
        if (flows[k] !== flow) return
        const data = {}
        for (const name of columns[k]) data[name] = numbers.slice(place, place += lengths[k])
        source.data = data
    })
    return place
}
"""
"""Takes the columns of all sources of a flow, one after the other, out of numbers from a place on."""
TELL = f"""{FILL}
for (const names in news.data) {{
    let place = 0
    for (const flow of names.split(" ")) place = fill(flow, news.data[names], place)
}}
"""
"""Shows the flows that the only column of `news` has the numbers of; they are in its name."""


def flow_numbers(flow: str, views: View) -> np.ndarray:
    """The columns of all sources of a flow, one after the other, in single precision.

    Of energies it is the sizes, which are drawn in logarithmic scale.
    """
    import numpy as np

    numbers = []
    for name, keys in COLUMNS.items():
        if name.partition("_")[0] == flow:
            part = name.removeprefix(f"{flow}_")
            for key in keys:
                column = np.asarray(views[part][key])
                numbers.append(np.where(column != 0, abs(column), np.nan) if key == "energy" else column)
    return np.concatenate(numbers).astype(np.float32)


def _figures(scene: SceneShape, sources: dict[str, ColumnDataSource]) -> Iterator[tuple[str, Figure]]:
    curves = {name: sources[f"{name}_curve"] for name in COLOURS}
    x, y = scene.axes
    orbit = _figure("Solutions", x, y)
    for name, source in curves.items():
        orbit.line("x", "y", source=source, legend_label=name, line_width=2, **_style(name))
    orbit.scatter("x", "y", source=curves["numerical"], size=3, color=BLUE)
    yield "orbit", orbit
    error = _figure("Error of the numerical solution", "t", "distance", y_axis_type="log")
    for name in ("exact", "modified"):
        error.line("t", "error", source=curves[name], legend_label=f"from {name}", line_width=2, **_style(name))
    yield "error", error
    if scene.energy_terms:
        energy = _figure("Energy error of the numerical solution", "t", "error", y_axis_type="log")
        for name, label in (("numerical", "of H"), ("modified", "of H̃")):
            energy.line("t", "energy", source=curves[name], legend_label=label, line_width=2, **_style(name))
        yield "energy", energy
    if scene.patch_axes is not None:
        patch = _figure("A patch of initial values, carried along", *scene.patch_axes)
        for name in COLOURS:
            patch.patch(
                "x", "y", source=sources[f"{name}_patch"], legend_label=name, fill_color=COLOURS[name], fill_alpha=0.15,
                line_color=COLOURS[name], line_dash=DASHES[name], line_width=1.5,
            )  # fmt: skip
        yield "patch", patch
    if scene.area:
        area = _figure("Area of the patch, relative to its start", "t", "area")
        for name in COLOURS:
            source = sources[f"{name}_area"]
            area.line("t", "area", source=source, legend_label=name, line_width=2, **_style(name))
            area.scatter("t", "area", source=source, size=5, color=COLOURS[name])
        yield "area", area
    title = "Many orbits" if scene.section is None else f"Many orbits at {scene.section} = 0"
    orbits = _figure(title, *scene.orbit_axes)
    orbits.scatter("x", "y", source=sources["orbits"], size=2, color=BLUE, line_color=None)
    yield "orbits", orbits


def _style(name: str) -> dict[str, Any]:
    return {"line_color": COLOURS[name], "line_dash": DASHES[name]}


def _legend_of_copies(picture: Any) -> None:
    """Let the legend show copies of lines and patches whose data never change.

    Bokeh builds a legend anew for each source whose data change, and shows nothing for a source without a point.
    """
    for legend in picture.legend:
        for item in legend.items:
            (shown,) = item.renderers
            nowhere = type(shown.data_source)({key: [float("nan")] for key in shown.data_source.data})
            item.renderers = [picture.add_glyph(nowhere, shown.glyph, name="legend")]


def _legend_above(picture: Figure) -> None:
    """Move the legend out of the way of the curves."""
    for legend in list(picture.legend):
        legend.update(
            orientation="horizontal", border_line_color=None, label_text_font_size="12px", padding=0, margin=0
        )
        picture.center.remove(legend)
        picture.add_layout(legend, "above")


def _figure(title: str, x: str, y: str, **options: Any) -> Figure:
    """An empty picture that is as wide as its place on the page."""
    plotting = optional_module("bokeh.plotting", "explore")
    picture = plotting.figure(
        title=title, x_axis_label=x, y_axis_label=y, height=HEIGHT, sizing_mode="stretch_width",
        tools="pan,wheel_zoom,box_zoom,reset,save", active_scroll=None, **options,
    )  # fmt: skip
    picture.x_range.syncable = picture.y_range.syncable = False
    picture.axis.minor_tick_line_color = None
    for axis in picture.axis:
        axis.ticker.desired_num_ticks = 4
    picture.toolbar.logo = None
    picture.toolbar.autohide = True
    return picture


@cache
def template() -> Template:
    """The template of pages, in which text is escaped."""
    jinja2 = optional_module("jinja2", "explore")
    text = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    return jinja2.Environment(autoescape=True).from_string(text)


def method_variables(facts: MethodFacts, region: StabilityShapes | str) -> dict[str, object]:
    """What the template says about a method."""
    title = f"{facts.name}: order {facts.order}"
    if isinstance(region, str):
        return {"title": title, "facts": facts, "stability_sentence": region}
    return {"title": title, "facts": facts, "stability_formula": region.formula}


def scene_variables(scene: SceneShape, pictures: Sequence[str]) -> dict[str, object]:
    """What the template says about a scene."""
    notes = [f"Start: {scene.start}. Times to {scene.span:g}."]
    if not scene.energy_terms:
        notes.append("The scene has no Hamiltonian, so no energy is shown.")
    elif scene.energy_terms == 1:
        notes.append("The method has no modified Hamiltonian on this scene: H̃ is shown for one term only, as H.")
    elif scene.energy_terms < scene.terms:
        notes.append(f"The modified Hamiltonian ends: H̃ is shown for up to {scene.energy_terms} terms.")
    if scene.patch_axes is not None:
        area = f"The area of a patch is {scene.area}. " if scene.area else ""
        notes.append(f"{area}A patch is left out where the points on its boundary do not resolve it.")
    notes.append(
        "The modified equation is a truncated asymptotic series: more terms help for small h only, and where h "
        "sweeps into chaos none do."
    )
    return {"scene": scene.title, "pictures": list(pictures), "scene_notes": notes}


def page_parts(
    facts: MethodFacts,
    region: StabilityShapes | str,
    scene: SceneShape | None,
    steps: int,
    scales: tuple[float, float, float],
) -> tuple[dict[str, object], dict[str, Model], ScenePlots | None]:
    """What the template says of a method and a scene, all that is drawn by name, and the pictures of the scene."""
    roots: dict[str, Model] = {}
    variables, plots = method_variables(facts, region), None
    if not isinstance(region, str):
        roots |= stability_plots(region)
    if scene is not None:
        plots = scene_plots(scene, steps, scales)
        variables |= scene_variables(scene, list(plots.figures))
        roots |= plots.roots
    for name, root in roots.items():
        root.name = name
    return variables, roots, plots
