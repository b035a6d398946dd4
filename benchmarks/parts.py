"""The sections of the page beside the rows of times, and what is measured for each."""

from __future__ import annotations

from . import advice_cases, algebra_growth, effect_cases, prediction_cases, scene_growth, waiting_cases
from .kinds import Part
from .stepping import figures, studies

PARTS = (
    Part("What a person waits for", waiting_cases.measurements),
    Part("What series cost", studies=(algebra_growth.STUDY, scene_growth.STUDY)),
    Part("Time stepping", figures.measurements, (studies.OVER_C,)),
    Part("Work and precision", studies=(studies.PRECISION,)),
    Part("Choosing a method and a step", advice_cases.measurements),
    Part("What a run will take", prediction_cases.measurements),
    Part("Effects", effect_cases.measurements),
)
"""All sections, in the order of the page."""
