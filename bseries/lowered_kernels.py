"""Kernels that are compiled together with what calls them.

Numba compiles each function by itself, and optimises it again within each of its callers; a kernel of many small
functions takes a third of the time as one piece.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

from integrators.lowering.units import lowered
from trees.compiled import Kernel


class LoweredKernel(Kernel):
    """A kernel that returns nothing; its callees are lowered kernels as well (see `integrators.lowering`)."""

    @cached_property
    def compiled(self) -> Any:
        """An intrinsic, for kernels that numba compiles."""
        return lowered()(self.py_func)
