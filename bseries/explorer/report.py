"""One file with everything that a page shows: sliders choose among frames computed beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from bseries.explorer.flows import SPAN, SceneFlows
from bseries.explorer.method_facts import method_facts, region_of
from bseries.explorer.plots import COLUMNS, ScenePlots, page_parts, template, view_columns
from bseries.explorer.reading import checked_method, checked_scene
from foundation.extras import optional_module
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene

STEPS, SCALES = 12, (0.5, 1.5, 0.5)
"""Step sizes and starts of the frames; their product with the numbers of terms decides the size of the file."""

CHOOSE = """
const ih = Math.round((h.value - h.start) / h.step), is = Math.round((scale.value - scale.start) / scale.step)
const frame = {exact: ih * scales + is, orbits: ih, modified: (ih * scales + is) * terms.end + terms.value - 1}
frame.numerical = frame.exact
sources.forEach((source, k) => {
    const place = frame[kinds[k]], data = {}
    for (const name in grids[k].data) {
        const column = grids[k].data[name], size = column.length / counts[k]
        data[name] = column.slice(place * size, (place + 1) * size)
    }
    source.data = data
})
"""
"""Takes the frame of the sliders' values out of each grid."""


def report_html(
    method: Method,
    scene: Scene | None = None,
    *,
    nodes: int | None = None,
    span: float = SPAN,
    progress: Callable[[int, int], object] | None = None,
) -> str:
    """A method, and its flows on a scene, as one HTML file that needs no network.

    Args:
        method: The method.
        scene: The scene, with a start; None for the method alone.
        nodes: The largest number of nodes of trees; by default as many as there are about a hundred trees of.
        span: The length of time.
        progress: Called with the frames done and all frames.

    Raises:
        SeriesError: The method or the scene is too large, or has symbols where numbers are needed.
        IntegratorError: The method does not fit the scene.
        MissingPackage: Bokeh is not installed.

    Example:
        >>> import bseries as bs
        >>> page = report_html(bs.method("heun2"))
        >>> page.startswith("<!DOCTYPE html>"), "heun2: order 2" in page
        (True, True)
    """
    embed = optional_module("bokeh.embed", "report")
    resources = optional_module("bokeh.resources", "report").INLINE
    facts, region = method_facts(checked_method(method), nodes), region_of(method)
    flows = None if scene is None else SceneFlows(method, checked_scene(scene), span)
    variables, roots, plots = page_parts(facts, region, flows and flows.shape, STEPS, SCALES)
    if flows is not None and plots is not None:
        _add_frames(plots, flows, progress)
    if not roots:  # Bokeh embeds something, or nothing at all
        return template().render(variables)
    return embed.file_html(
        list(roots.values()), resources, variables["title"], template=template(), template_variables=variables
    )


def _add_frames(plots: ScenePlots, flows: SceneFlows, progress: Callable[[int, int], object] | None) -> None:
    """Compute all frames, and let the sliders choose among them."""
    models = optional_module("bokeh.models", "report")
    scales = np.arange(SCALES[0], SCALES[1] + SCALES[2] / 2, SCALES[2])
    grids: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    counts = {"numerical": STEPS * len(scales), "exact": STEPS * len(scales), "orbits": STEPS}
    counts["modified"] = counts["exact"] * flows.terms
    for i in range(STEPS):
        h = float(plots.h.start + i * plots.h.step)
        grids["orbits"].append(flows.orbits(h))
        for j, scale in enumerate(map(float, scales)):
            for flow, views in _views(flows, h, scale):
                for part, columns in views.items():
                    grids[f"{flow}_{part}"].append(columns)
            if progress is not None:
                progress(i * len(scales) + j + 1, STEPS * len(scales))
    sources, kinds = [plots.sources[name] for name in grids], [name.partition("_")[0] for name in grids]
    columns = [_joined(name, frames) for name, frames in grids.items()]
    choose = models.CustomJS(
        args={
            "h": plots.h,
            "scale": plots.scale,
            "terms": plots.terms,
            "scales": len(scales),
            "sources": sources,
            "kinds": kinds,
            "counts": [counts[kind] for kind in kinds],
            "grids": [models.ColumnDataSource(joined) for joined in columns],
        },
        code=CHOOSE,
    )
    for slider in (plots.h, plots.scale, plots.terms):
        slider.js_on_change("value", choose)
    h, scale = round((plots.h.value - plots.h.start) / plots.h.step), list(scales).index(plots.scale.value)
    place = {"numerical": h * len(scales) + scale, "orbits": h}
    place |= {"exact": place["numerical"], "modified": place["numerical"] * flows.terms + int(plots.terms.value) - 1}
    for source, kind, (name, frames) in zip(sources, kinds, grids.items(), strict=True):
        source.data = view_columns(name, frames[place[kind]])


def _views(flows: SceneFlows, h: float, scale: float) -> Iterator[tuple[str, Any]]:
    yield "numerical", flows.numerical(h, scale)
    yield "exact", flows.exact(h, scale)
    for terms in range(1, flows.terms + 1):
        yield "modified", flows.modified(h, scale, terms)


def _joined(name: str, frames: list[Any]) -> dict[str, Any]:
    """The columns of all frames, one after the other."""
    shown = [view_columns(name, columns) for columns in frames]
    return {key: np.concatenate([columns[key] for columns in shown]) for key in COLUMNS[name]}
