"""Exact coefficients: domains, integers over common denominators, residues, bounds, and their kernels."""
