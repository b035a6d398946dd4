"""Syntax trees of Python, by one thread at a time.

Python 3.11 counts the depth of syntax trees in one place for all threads, and two that switch meanwhile end in a
SystemError (python/cpython#106905).
"""

from __future__ import annotations

import ast
from types import CodeType
from typing import Any

from bseries_base.forks import SYNTAX


def syntax_tree(source: str, mode: str = "exec") -> Any:
    """The syntax tree of a source, as by `ast.parse`."""
    with SYNTAX:
        return ast.parse(source, mode=mode)


def compiled_tree(tree: ast.Module) -> CodeType:
    """The code of a syntax tree."""
    with SYNTAX:
        return compile(tree, "", "exec")
