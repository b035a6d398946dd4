"""Exact numbers and formulas: the safe parser, exact arithmetic, tableau entries, polynomials."""
