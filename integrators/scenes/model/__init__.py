"""Declarations of scenes: variables, terms, effects, formulas, and the resulting system of equations."""
