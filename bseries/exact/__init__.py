"""Exact coefficients. `domains` says what a coefficient domain provides; the other files, from the outside in:

- `rationals`: integers over one denominator for each number of nodes, and operations on them, proved from bounds on
  denominators and absolute values, and residues;
- `powers` and `lie`: series of methods without cuts, and Lie derivatives for all others;
- `denominators`, `bounds` and `stage_sizes`: what proofs need, by number of nodes;
- `recursions`: elementary weights, logarithm, Lie series and substitution over a table of trees;
- `arithmetic`: the numbers that recursions run on: exact ones, floats, residues, bounds;
- `kernels`: the inner loops.
"""
