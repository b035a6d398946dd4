"""Formulas of SymPy as text."""

from __future__ import annotations

from functools import cache
from typing import Any


def formula_text(formula: Any) -> str:
    """A number or a formula of SymPy as text.

    The number e is exp(1) in it, as where formulas are read: E, as SymPy writes it, may be a name of the user's.
    """
    return _printer().doprint(formula) if hasattr(formula, "free_symbols") else str(formula)


@cache
def _printer() -> Any:
    from sympy.printing.str import StrPrinter

    class FormulaPrinter(StrPrinter):
        """SymPy's printer with exp(1) for the number e."""

        def _print_Exp1(self, expr: object) -> Any:
            return "exp(1)"

    return FormulaPrinter()
