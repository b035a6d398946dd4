"""Figures of the lecture and beyond it: one file each, found by `bseries.figures.registry`."""
