"""Lowering: from the syntax tree of generated functions to LLVM code, without numba's type inference.

Numba's type inference takes half a millisecond for each operation, of which steps have thousands. Generated functions
have few types, all known in advance, so that their syntax tree suffices. Operators, functions of the C library,
compiled functions and intrinsics are numba's, each looked up once for the types of its arguments.

Functions may contain numbers, truth values, pointers to numbers, arrays and tuples; loops over ranges, ``while``,
``if`` and conditional expressions; and calls of one another. Called functions return a double, an integer if they are
annotated so, or nothing; the outermost one returns the type in its signature. Arrays with different names must not
overlap, so that loops over their entries can be vectorised.
"""

from pathlib import Path

WIDTH = 8
"""SIMD lanes of a vector in LLVM code; processors with shorter vectors use several."""
MOST_PERMUTED = 128
"""Longest loop over scattered or indexed entries that is vectorised."""
SOURCES = tuple(sorted(Path(__file__).parent.glob("*.py")))
"""The files on which the code of generated functions depends, besides their text."""
