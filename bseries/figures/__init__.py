"""The figures of the lecture, and some beyond it: a file each, found by `bseries.figures.registry`."""
