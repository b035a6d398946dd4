"""Generated functions as LLVM code, without numba's type inference.

Numba works out from Python's bytecode what every name may be, and looks for each operation through the signatures of
all of NumPy: half a millisecond for each, and steps have thousands. What is generated here has few types, which are
known beforehand, so that its syntax tree is enough. All that it calls is numba's: operators, functions of the C
library, compiled functions and intrinsics, each looked up once for the types of its arguments.

Functions that are generated may have numbers, truth values, pointers to doubles and tuples of these; loops over ranges,
``while``, ``if`` and conditional expressions; and calls of one another. They return a double, or nothing.
"""

from pathlib import Path

SOURCES = tuple(sorted(Path(__file__).parent.glob("*.py")))
"""The files on which the code of generated functions depends, besides their own text."""
