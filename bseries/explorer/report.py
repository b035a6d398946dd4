"""One file with everything that a page shows: sliders choose among frames computed beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from bseries.explorer.flows import SPAN, SceneFlows, View
from bseries.explorer.method_facts import method_facts, region_of
from bseries.explorer.plots import FILL, FLOWS, ScenePlots, flow_numbers, page_parts, template
from bseries.explorer.reading import checked_method, checked_scene
from bseries_base.extras import optional_module
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene

STEPS, SCALES = 12, (0.5, 1.5, 0.5)
"""Step sizes and starts of the frames; their product with the numbers of terms decides the size of the file."""

CHOOSE = f"""{FILL}
const ih = Math.round((h.value - h.start) / h.step), is = Math.round((scale.value - scale.start) / scale.step)
const frame = {{orbits: ih, exact: ih * scales + is, modified: (ih * scales + is) * terms.end + terms.value - 1}}
frame.numerical = frame.exact
for (const flow in frame) fill(flow, grids[flow].data.numbers, frame[flow] * sizes[flow])
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
    if not roots:  # Bokeh embeds something, or nothing at all
        return template().render(variables)
    document = optional_module("bokeh.document", "report").Document()
    if flows is not None and plots is not None:
        document.js_on_event("document_ready", _add_frames(plots, flows, progress))
    for root in roots.values():
        document.add_root(root)
    return embed.file_html(document, resources, variables["title"], template=template(), template_variables=variables)


def _add_frames(plots: ScenePlots, flows: SceneFlows, progress: Callable[[int, int], object] | None) -> Any:
    """Compute all frames, and let the sliders choose among them; what shows the frame of the sliders."""
    models = optional_module("bokeh.models", "report")
    scales = np.arange(SCALES[0], SCALES[1] + SCALES[2] / 2, SCALES[2])
    grids: dict[str, list[np.ndarray]] = {flow: [] for flow in FLOWS}
    for i in range(STEPS):
        h = float(plots.h.start + i * plots.h.step)
        grids["orbits"].append(flow_numbers("orbits", {"orbits": flows.orbits(h)}))
        for j, scale in enumerate(map(float, scales)):
            for flow, views in _views(flows, h, scale):
                grids[flow].append(flow_numbers(flow, views))
            if progress is not None:
                progress(i * len(scales) + j + 1, STEPS * len(scales))
    choose = models.CustomJS(
        args={
            **plots.fill,
            "h": plots.h,
            "scale": plots.scale,
            "terms": plots.terms,
            "scales": len(scales),
            "sizes": {flow: len(frames[0]) for flow, frames in grids.items()},
            "grids": {
                flow: models.ColumnDataSource({"numbers": np.concatenate(frames)}) for flow, frames in grids.items()
            },
        },
        code=CHOOSE,
    )
    for slider in (plots.h, plots.scale, plots.terms):
        slider.js_on_change("value", choose)
    return choose


def _views(flows: SceneFlows, h: float, scale: float) -> Iterator[tuple[str, View]]:
    yield "numerical", flows.numerical(h, scale)
    yield "exact", flows.exact(h, scale)
    for terms in range(1, flows.terms + 1):
        yield "modified", flows.modified(h, scale, terms)
