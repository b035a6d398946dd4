"""Modified Hamiltonians of any functions, such as p²/2 + U(q), T(p) + U(q) and H(p, q), in terms of their derivatives.

A modified Hamiltonian at a point depends on the derivatives of the functions there. So each function is replaced by its
Taylor polynomial at that point, with symbols as coefficients, and these get the names of the derivatives.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import product
from math import factorial, prod
from typing import TYPE_CHECKING, NamedTuple

from bseries.exceptions import SeriesError
from bseries.hamiltonians.modified_hamiltonian import EnergyFormulas, ModifiedHamiltonian, modified_hamiltonian
from bseries_base.errors import shown
from integrators import parse_hamiltonian
from integrators.exact.expressions import FUNCTIONS, MAX_LENGTH, ROOTS
from integrators.methods.catalogue.registry import as_method
from trees.counting import check_order
from trees.formulas import derivative

if TYPE_CHECKING:
    from bseries.fields.scene_trees import Parts
    from integrators import Method

CALL = re.compile(r"\b([^\W\d_][^\W_]*)\s*\(([\w\s,]*)\)")
"""A function of names; its own name has no underscore, which would begin the subscripts of its derivatives."""


class NamedFunction(NamedTuple):
    """A function without a formula, and its variables."""

    name: str
    variables: tuple[str, ...]

    def derivatives(self, order: int) -> Iterator[tuple[str, str, tuple[int, ...]]]:
        """Each derivative up to an order: a name for formulas, the name it is written with, how often each variable."""
        for times in product(range(order + 1), repeat=len(self.variables)):
            n = sum(times)
            if n > order:
                continue
            if len(self.variables) == 1:
                written = self.name + derivative(n)
            else:
                subscripts = "".join(x * k for x, k in zip(self.variables, times, strict=True))
                written = f"{self.name}_{subscripts}" if n else self.name
            yield "_".join([self.name, *map(str, times), "derivative"]), written, times

    def taylor(self, order: int) -> str:
        """Its Taylor polynomial at the point `<variable>_point`, as text."""
        terms = []
        for symbol, _, times in self.derivatives(order):
            powers = [f"({x} - {x}_point)^{k}" for x, k in zip(self.variables, times, strict=True) if k]
            terms.append("*".join([f"{symbol}/{prod(map(factorial, times))}", *powers]))
        return f"({' + '.join(terms)})"


def named_functions(text: str) -> dict[str, NamedFunction]:
    """The functions in a formula that have a name only, by name.

    Raises:
        SeriesError: A function has different variables in two places.
    """
    found: dict[str, NamedFunction] = {}
    for name, inside in CALL.findall(text):
        if name in (*FUNCTIONS, *ROOTS) or not inside.strip():
            continue
        function = NamedFunction(name, tuple(x.strip() for x in inside.split(",")))
        if not all(map(str.isidentifier, function.variables)) or len({*function.variables}) < len(function.variables):
            raise SeriesError(f"hamiltonian must have functions of different variables, but has {name}({inside:.40})")
        if found.setdefault(name, function) != function:
            raise SeriesError(f"hamiltonian must have {name} of the same variables everywhere, but did not")
    return found


def named_hamiltonian(
    method: Method | str,
    text: str,
    order: int,
    *,
    parts: Parts | None = None,
    blocks: str | Mapping[str, object] | None = None,
    parameters: Mapping[str, object] | None = None,
) -> ModifiedHamiltonian:
    """The modified Hamiltonian of a symplectic method for any functions, in terms of their derivatives.

    Args:
        method: A method that is symplectic for all Hamiltonians, or for all separable ones.
        text: The Hamiltonian, with functions of variables that are only named, as in ``p^2/2 + U(q)``.
        order: The number of terms N, with the powers h^0 … h^(N−1).
        parts: As for `modified_hamiltonian`.
        blocks, parameters: As for `parse_hamiltonian`.

    Returns:
        A `ModifiedHamiltonian` of formulas. Derivatives are written U', U'', U^(4), and H_ppq for several variables. It
        has no values, as there are none of the functions.

    Raises:
        SeriesError: The text has no such functions, or the method is not symplectic.
        IntegratorError: The text is no formula.

    Example:
        >>> import bseries as bs
        >>> found = bs.hamiltonians.named_hamiltonian("stormer-verlet", "p^2/2 + U(q)", 3)
        >>> found.symbolic(0), found.symbolic(2)
        (U + p**2/2, -U'**2/24 + U''*p**2/12)
        >>> bs.hamiltonians.named_hamiltonian("symplectic-euler-p", "H(p,q)", 2).symbolic(1)
        -H_p*H_q/2

    References:
        HLW, example IX.3.4 (symplectic Euler) and section IX.3 (Störmer–Verlet).
    """
    import sympy

    method, order = as_method(method), check_order(order)
    if not isinstance(text, str) or len(text) > MAX_LENGTH:
        raise SeriesError(f"text must be a formula of at most {MAX_LENGTH:,} characters, but was {shown(text)}")
    functions = named_functions(text)
    if not functions:
        raise SeriesError(f"text must have functions that are only named, as p^2/2 + U(q) has, but was {shown(text)}")
    if re.search(r"_(point|derivative)\b", text):
        raise SeriesError(f"text must have no names that end in _point or _derivative, but was {shown(text)}")
    derivatives = [x for function in functions.values() for x in function.derivatives(order)]
    variables = sorted({x for function in functions.values() for x in function.variables})
    symbols = [*(symbol for symbol, _, _ in derivatives), *(f"{x}_point" for x in variables)]
    replaced = CALL.sub(lambda call: functions[call[1]].taylor(order) if call[1] in functions else call[0], text)
    values = dict(parameters or {}) | {name: name for name in symbols}
    scene = parse_hamiltonian(replaced, blocks, values, name=text)
    found = modified_hamiltonian(method, scene, order, parts=parts, route="trees")
    at_point = {sympy.Symbol(x): sympy.Symbol(f"{x}_point") for x in variables}
    names = {sympy.Symbol(symbol): sympy.Symbol(written) for symbol, written, _ in derivatives}
    names |= {point: x for x, point in at_point.items()}
    terms = [sympy.expand(found.symbolic(k).xreplace(at_point)).xreplace(names) for k in range(order)]
    return ModifiedHamiltonian(method, scene, order, parts, found.route, EnergyFormulas(scene.symbols, tuple(terms)))
