"""Generated functions as LLVM code, without numba's type inference.

Numba works out from Python's bytecode what every name may be, and looks for each operation through the signatures of
all of NumPy: half a millisecond for each, and steps have thousands. What is generated here has few types, which are
known beforehand, so that its syntax tree is enough. All that it calls is numba's: operators, functions of the C
library, compiled functions and intrinsics, each looked up once for the types of its arguments.

Generated functions may have numbers, truth values, pointers to doubles, arrays and tuples; loops over ranges,
``while``, ``if`` and conditional expressions; and calls of one another. Those that others call return a double, or
nothing; the first one may return whatever its signature says. Arrays of different names do not overlap: loops over
their entries are written in vectors.
"""

from pathlib import Path

WIDTH = 8
"""Entries of a vector; a processor that has no such long ones takes several."""
MOST_PERMUTED = 128
"""Entries of a loop that is written in vectors although they lie apart, or are looked up in a table."""
SOURCES = tuple(sorted(Path(__file__).parent.glob("*.py")))
"""The files on which the code of generated functions depends, besides their own text."""
