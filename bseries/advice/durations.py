"""Durations as text."""

UNITS = ((1e-9, "ns"), (1e-6, "µs"), (1e-3, "ms"), (1.0, "s"))


def duration(seconds: float, digits: int = 3) -> str:
    """A duration as text, in a suitable unit.

    Example:
        >>> [duration(x) for x in (4.567e-5, 0.0123, 9.999, 61.2, 8000.0)]
        ['45.7 µs', '12.3 ms', '10 s', '61.2 s', '2 h 13 min']
    """
    if seconds >= 600:
        minutes = round(seconds / 60)
        return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
    size, unit = next((u for u in UNITS if seconds < 999.5 * u[0]), UNITS[-1])  # 999.5 is rounded to 1000
    return f"{seconds / size:.{digits if seconds < 100 * size else 3}g} {unit}"
