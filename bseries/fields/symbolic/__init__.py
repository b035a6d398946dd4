"""Symbolic elementary differentials: polynomials in generators closed under differentiation."""
