"""Exact coefficients. `domains` says what a coefficient domain provides; the other files, from the outside in:

- `operations`: rational results, proved from denominator bounds, bounds on absolute values, and residues;
- `rationals`: integers over one denominator for each number of nodes;
- `recursions`: elementary weights, logarithm, Lie series and substitution over a table of trees;
- `arithmetic`: the numbers that recursions run on: exact ones, floats, residues, bounds;
- `kernels`: the inner loops.
"""
