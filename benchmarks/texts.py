"""Numbers for people: three significant digits."""

from __future__ import annotations

from bseries.advice.predictions.prediction import duration as with_unit


def duration(seconds: float | None) -> str:
    """Seconds, in a unit that suits them, if there are any."""
    return "–" if seconds is None else with_unit(seconds)


def memory(size: float | None) -> str:
    """Bytes as GB."""
    return "" if size is None else f", {size / 1e9:.3g} GB"


def megabytes(size: float) -> str:
    """Bytes as MB."""
    return amount(size / 1e6, "MB")


def times(ratio: float | None) -> str:
    """A ratio."""
    return "–" if ratio is None else f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def amount(value: float, unit: str = "") -> str:
    """A number with its unit, and a power of ten for what is small."""
    if unit == "s":
        return duration(value)
    return f"{value:.3g} {unit}".rstrip()
