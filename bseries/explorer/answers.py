"""What a worker computes for a page: from text to plain data, the last few scenes kept."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from bseries.explorer.flows import MOST_SPAN, SCALES, SPAN, SceneFlows
from bseries.explorer.method_facts import MOST_TREES, method_facts
from bseries.explorer.page import region_of
from bseries.explorer.plots import view_columns
from bseries.explorer.reading import read_integer, read_method, read_positive, read_scene

if TYPE_CHECKING:
    from bseries.explorer.flows import SceneShape
    from bseries.explorer.method_facts import MethodFacts
    from bseries.explorer.reading import Request
    from bseries.explorer.stability_shapes import StabilityShapes

KEPT = 4
"""Scenes with their compiled functions."""


class Frame(NamedTuple):
    """Values of the sliders, and the flow of which the columns are wanted."""

    flow: str
    h: float
    scale: float
    terms: int


def method_answer(request: Request) -> tuple[MethodFacts, StabilityShapes | str]:
    """The method of a request, and its stability region.

    Example:
        >>> from bseries.explorer.reading import Request
        >>> method_answer(Request(method="heun2", order="3"))[0].order
        2
    """
    method = read_method(request.method)
    nodes = read_integer(request.order, "order", 0, MOST_TREES)
    return method_facts(method, nodes or None), region_of(method)


def scene_answer(request: Request) -> SceneShape:
    """The scene of a request."""
    return _flows(request.method, request.scene, request.start, request.span).shape


def frame_answer(request: Request, frame: Frame) -> dict[str, dict[str, Any]]:
    """The columns of the sources of one flow.

    Example:
        >>> from bseries.explorer.reading import Request
        >>> sorted(frame_answer(Request(method="heun2"), Frame("exact", 0.1, 1.0, 3)))
        ['exact_area', 'exact_curve', 'exact_patch']
    """
    flows = _flows(request.method, request.scene, request.start, request.span)
    flow, h, scale, terms = frame
    if not (SCALES[0] <= scale <= SCALES[1] and 1 <= terms <= flows.terms):
        raise SeriesError(
            f"factor and terms must be {SCALES[0]:g} to {SCALES[1]:g} and 1 to {flows.terms}, but were {scale!r:.60} "
            f"and {terms!r:.60}"
        )
    if flow == "orbits":
        return {flow: view_columns(flow, flows.orbits(h))}
    if flow == "modified":
        view = flows.modified(h, scale, terms)
    else:
        view = flows.exact(h, scale) if flow == "exact" else flows.numerical(h, scale)
    return {f"{flow}_{part}": view_columns(f"{flow}_{part}", columns) for part, columns in view.items()}


@lru_cache(KEPT)
def _flows(method: str, scene: str, start: str, span: str) -> SceneFlows:
    return SceneFlows(read_method(method), read_scene(scene, start), read_positive(span, "span", SPAN, MOST_SPAN))
