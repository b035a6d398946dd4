"""The syntax trees of generated functions: that they are those of the functions, and within what can be lowered."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from textwrap import dedent
from types import CodeType
from typing import Any, NoReturn


def refuse(node: ast.AST, reason: str = "is not lowered") -> NoReturn:
    """Raise NotImplementedError for what generated functions must not have."""
    raise NotImplementedError(f"{ast.unparse(node)!r:.200} {reason}")


def tree_of(function: Any) -> ast.FunctionDef:
    """The syntax tree of a function.

    Raises:
        NotImplementedError: It has what cannot be lowered, or its file is not the one it was loaded from any more.
    """
    tree = ast.parse(dedent(inspect.getsource(function))).body[0]
    if not isinstance(tree, ast.FunctionDef):
        refuse(tree)
    tree.decorator_list = []
    compiled = compile(ast.Module([tree], []), "", "exec").co_consts
    code = next(constant for constant in compiled if isinstance(constant, CodeType))
    if (code.co_code, code.co_names) != (function.__code__.co_code, function.__code__.co_names):
        raise NotImplementedError(
            f"{function.__name__} must be lowered from the file it was loaded from, which changed"
        )
    local = {*function.__code__.co_varnames}
    for node in ast.walk(tree):
        for reason in _reasons(node, local):
            refuse(node, reason)
    return tree


def _reasons(node: ast.AST, local: set[str]) -> Iterator[str]:
    """Why something is not lowered, although its kind is."""
    if isinstance(node, ast.For | ast.While) and node.orelse:
        yield "has an else"
    if isinstance(node, ast.For) and not (isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "range"):
        yield "is over no range"
    if isinstance(node, ast.Call):
        if node.keywords or any(isinstance(x, ast.Starred) for x in node.args):
            yield "has more than positional arguments"
        if not isinstance(node.func, ast.Name) or node.func.id in local:
            yield "calls what is no function of the module"
    if isinstance(node, ast.Compare) and len(node.ops) > 1:
        yield "compares more than two"
