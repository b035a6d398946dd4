"""Formulas of SymPy as text."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sympy.printing.str import StrPrinter


def formula_text(formula: object) -> str:
    """A number or a formula of SymPy as text.

    The number e is exp(1) in it, as where formulas are read: E, as SymPy writes it, may be a name of the user's.
    """
    return _printer().doprint(formula) if hasattr(formula, "free_symbols") else str(formula)


@cache
def _printer() -> StrPrinter:
    from sympy.printing.str import StrPrinter

    class FormulaPrinter(StrPrinter):
        """SymPy's printer with exp(1) for the number e."""

        def _print_Exp1(self, expr: object) -> str:  # type: ignore[override]
            return "exp(1)"

    return FormulaPrinter()
