"""Modified Hamiltonians of splitting methods by the Baker–Campbell–Hausdorff series.

One step of a splitting method is a product of exponentials of Lie derivatives, whose logarithm is a sum of brackets of
the parts. On words the modified equation is this logarithm; it is then expressed in a basis of brackets. With {A,B} =
A_q·B_p − A_p·B_q the field of {A,B} is X_A' X_B − X_B' X_A, the bracket of `lie_algebra`, so that words from the root
to the leaf need no signs: the root belongs to the last flow.

Other methods, such as force-gradient and partitioned Runge–Kutta methods, use the trees of separable systems or of
Nyström systems. Their modified equation is tested for being a sum of brackets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import series
from bseries.algebra.series import Series
from bseries.algebra.stages import auxiliary_colors, check_method, is_chain
from bseries.analysis.order import field_elements, field_of, trusted
from bseries.analysis.structure import SEPARABLE, failing
from bseries.exact.domains import exact_number
from bseries.exceptions import SeriesError
from bseries.hamiltonians.brackets.bracket_series import BRACES, COMMUTATORS, BracketSeries
from bseries.hamiltonians.brackets.lie_algebra import LieAlgebra, Number, RingElement, lie_algebra
from bseries.hamiltonians.brackets.lyndon_basis import MOST_LETTERS, bch_terms
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.splitting import Splitting
from integrators.methods.programs.builder import read_parts
from integrators.methods.programs.program import Method
from trees.counting import check_order, normal_limits
from trees.lyndon_words import count_lyndon_words
from trees.table import tree_table
from trees.words import Words

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient


FieldElements: TypeAlias = tuple[list[RingElement], Number, Callable[[RingElement], "Coefficient"]]
"""See `field_elements`."""


def bracket_hamiltonian(
    method: Method | BSeries | str, order: int | None = None, *, quadratic_kinetic: bool | str | None = None
) -> BracketSeries:
    """The modified Hamiltonian of a splitting method as a sum of nested brackets, for all Hamiltonians.

    For methods in two blocks p and q the Hamiltonian is H = T(p) + U(q); for other splittings the parts keep their
    names. On Poisson systems the brackets are those of the system.

    Args:
        method: A splitting method, or a composition of such methods; a partitioned Runge–Kutta or force-gradient
            method that is one for separable Hamiltonians; or a series on coloured trees.
        order: Largest number of letters N, with the powers h^0 … h^(N−1); by default the order of a series.
        quadratic_kinetic: Whether T is quadratic in the momenta, with constant coefficients, and the other parts do not
            depend on them; brackets that then vanish are left out. The name of a part selects it as T; True selects T
            of T and U, or the first of two other parts, as in `modified_field`. By default it is true for methods made
            for such systems.

    Raises:
        SeriesError: The method has no parts, its modified equation is not a sum of brackets (the message names the
            first violating tree), or an argument is invalid.

    Example:
        >>> import bseries as bs
        >>> print(bs.hamiltonians.bracket_hamiltonian(bs.method("stormer-verlet"), 5, quadratic_kinetic=True))
        modified Hamiltonian of stormer-verlet-kdk
        h^0   T + U
        h^2   1/12 {T,{T,U}} - 1/24 {U,{U,T}}
        h^4   -1/720 {T,{T,{T,{T,U}}}} + 1/360 {U,{T,{T,{T,U}}}} - 1/480 {U,{U,{T,{T,U}}}} + 1/120 {T,{T,{U,{U,T}}}}

    References:
        HLW, sections III.4.2 and IX.9; E. Hairer, lecture on long-time behaviour, example 6;
        R. I. McLachlan, B. Ryland, J. Math. Phys. 44 (2003) 3071–3087, doi:10.1063/1.1576904.
    """
    method = as_method(method)
    if isinstance(method, BSeries):
        if quadratic_kinetic is not None:
            raise SeriesError(f"quadratic_kinetic must be None for a series, but was {quadratic_kinetic!r:.60}")
        label = method.label or "a series"
        check_parts(method.names, label)
        return _in_brackets(field_of(method, order), method.names, label)
    check_parts(check_method(method).names, method.name)
    if quadratic_kinetic is None:
        kinetic = kinetic_of(method.max_children, len(method.names))
    else:
        kinetic = read_kinetic(quadratic_kinetic, method.names)
    return in_brackets(method, order, kinetic)


def bch(
    order: int, names: Sequence[str] = ("A", "B"), *, symmetric: bool = False, basis: str = "nested"
) -> BracketSeries:
    """The Baker–Campbell–Hausdorff series log(exp A exp B) in commutators.

    Args:
        order: Largest number of letters: about 12 for two letters, and 20 in the Lyndon basis.
        names: Two or more letters; log(exp A exp B exp C) for three.
        symmetric: Whether to compute log(exp(A/2) exp B exp(A/2)), or log(exp(A/2) exp(B/2) exp C …) for more letters.
        basis: ``nested`` for right-nested commutators; ``lyndon`` for the brackets of Lyndon words in two letters: the
            word uv with its longest proper Lyndon suffix v stands for [P_u, P_v].

    Raises:
        SeriesError: The order is too large, or the basis is unknown or not available for so many letters.
        IntegratorError: `names` are not at least two different names.
        TreeError: The order is not a whole number ≥ 1.

    Example:
        >>> import bseries as bs
        >>> print(bs.bch(4))
        log(exp A exp B)
        h^0   A + B
        h^1   1/2 [A,B]
        h^2   1/12 [A,[A,B]] + 1/12 [B,[B,A]]
        h^3   -1/24 [B,[A,[A,B]]]
        >>> print(bs.bch(4, basis="lyndon").term_text(3))
        1/24 [A,[[A,B],B]]

    References:
        HLW, sections III.4.2 (formula (4.11)) and III.4.3 (symmetric); F. Casas, A. Murua, J. Math. Phys. 50 (2009)
        033513, doi:10.1063/1.3078418, and H. Hofstätter, arXiv:2102.06570 (Lyndon basis).
    """
    *others, last = read_parts(names)
    if symmetric:
        there = [(name, "1/2") for name in others]
        flows = [*there, (last, "1"), *there[::-1]]
    else:
        flows = [(last, "1"), *((name, "1") for name in reversed(others))]  # the last factor acts first
    factors = (f"exp {name}" if x == "1" else f"exp({name}/2)" for name, x in reversed(flows))
    label = f"log({' '.join(factors)})"
    if basis == "nested":
        return in_brackets(Splitting(flows, parts=names, name=label), order, None, fences=COMMUTATORS)
    if basis != "lyndon" or len(names) != 2:
        raise SeriesError(f"basis must be nested, or lyndon for two letters, but was {basis!r:.60} for {len(names)}")
    if check_order(order) > MOST_LETTERS:
        raise SeriesError(f"order must be at most {MOST_LETTERS} in the Lyndon basis, but was {order}")
    terms = bch_terms(order, names, symmetric=symmetric)
    return BracketSeries(names, terms, label=label, fences=COMMUTATORS, basis=basis)


def in_brackets(method: Method, order: int | None, kinetic: int | None, *, fences: str = BRACES) -> BracketSeries:
    """The modified Hamiltonian of a method, with the quadratic part `kinetic`.

    Its trees distinguish the brackets of the parts: words, or those of separable or Nyström systems.
    """
    if order is None:
        raise SeriesError("order must be given for a method, but was None")
    if auxiliary_colors(method):
        raise SeriesError(f"method must treat parts of the field, but {method.name} has an auxiliary matrix as a part")
    colors = len(method.names)
    brackets = sum(count_lyndon_words(min(check_order(order), 40), colors))
    if brackets > MOST_BRACKETS:
        raise SeriesError(f"order must be smaller: there are {brackets} brackets to order {order}")
    own = method.max_children
    if kinetic is not None:
        # One quadratic part T(p), and other parts that depend on q.
        bounds = [
            [*(int(other != kinetic) for other in range(colors)), 1]
            if color == kinetic
            else [*(None if other == kinetic else 0 for other in range(colors)), None]
            for color in range(colors)
        ]
    elif is_chain(method):
        words = series(trusted(method), Words(order, colors))
        return _in_brackets(words.log(), method.names, method.name, fences=fences)
    elif own is not None:
        raise SeriesError(f"quadratic_kinetic must not be False for {method.name}, which is made for quadratic T")
    elif colors == 2:
        bounds = SEPARABLE
    else:
        raise SeriesError(f"method must be made of flows where it has {colors} parts, but {method.name} is not")
    field = field_of(series(trusted(method), tree_table(order, colors, bounds)), None)
    return _in_brackets(field, method.names, method.name, kinetic, fences=fences)


def check_parts(names: Sequence[str], label: str) -> None:
    """Check that a method has several parts."""
    if len(names) < 2:
        raise SeriesError(f"method must treat parts of the field differently, but {label} has one part only")


def _in_brackets(
    field: Series, names: Sequence[str], label: str, kinetic: int | None = None, *, fences: str = BRACES
) -> BracketSeries:
    """A field as a sum of brackets."""
    parts = shown_names(names)
    letters = sorted(range(len(parts)), key=lambda color: (parts[color] != "T", color))
    algebra = lie_algebra(field.basis, tuple(letters))
    elements = field_elements(field)
    changes = None if field.uncertainty is None else field.uncertainty.changes.T.tolist()
    terms, errors = [], {}
    for degree in range(1, field.order + 1):
        term, error = _coordinates(algebra, degree, elements, changes, names, label)
        brackets = [tuple(parts[letters[x]] for x in word) for word in algebra.brackets(degree)]
        terms.append(dict(zip(brackets, term, strict=True)))
        errors.update(zip(brackets, error, strict=True))
    return BracketSeries(
        [parts[color] for color in letters],
        terms,
        kinetic=None if kinetic is None else parts[kinetic],
        label=label,
        domain=field.domain,
        digits=field.digits,
        errors=errors,
        fences=fences,
    )


def _coordinates(
    algebra: LieAlgebra, degree: int, elements: FieldElements, changes: list[list[float]] | None,
    names: Sequence[str], label: str,
) -> tuple[list[Coefficient], list[float]]:  # fmt: skip
    """The coordinates of the term of a degree, 0 within the uncertainty, and their uncertainties.

    `changes` are those of the field with each entry of a method in decimals; the coordinates depend linearly on it.
    """
    values, number, public = elements
    coordinates, rest = algebra.coordinates(degree, values, number)
    trees, moved = sorted(rest), [algebra.coordinates(degree, values, float) for values in changes or ()]
    bounds = [sum(abs(other.get(tree, 0.0)) for _, other in moved) for tree in trees]
    violated = next(failing([rest[tree] for tree in trees], None if changes is None else bounds), None)
    if violated is not None:
        tree = algebra.basis.text(algebra.basis[trees[violated]], names)
        raise SeriesError(
            f"method must have a modified equation in brackets of its parts, as splitting methods have, but {label} "
            f"has none: at h^{degree - 1} the tree {tree} breaks it"
        )
    errors = [sum((abs(other[k]) for other, _ in moved), start=0.0) for k in range(len(coordinates))]
    nonzero = set(failing(coordinates, None if changes is None else errors))
    return [exact_number(public(x) if k in nonzero else 0) for k, x in enumerate(coordinates)], errors


MOST_BRACKETS = 800  # largest number of brackets, which takes one or two minutes: two parts to order 12

HAMILTONIAN_NAMES = {"p": "U", "q": "T"}  # the flow of U(q) changes momenta, and that of T(p) positions


def kinetic_of(bounds: Sequence[Sequence[int | None]] | None, colors: int) -> int | None:
    """The part T if the bounds on children are those of fields with quadratic T; None otherwise."""
    limits = normal_limits(colors, bounds)
    for color, row in enumerate(limits):
        others = [other for other in range(colors) if other != color]
        depends_on_others = any(limits[one][other] for one in others for other in others)
        if row[color] == 0 and min(sum(row[:-1]), row[-1]) == 1 and not depends_on_others:
            return color
    return None


def read_kinetic(given: bool | str, names: Sequence[str]) -> int | None:
    """Read the option `quadratic_kinetic`; returns the colour of T or None."""
    shown = shown_names(names)
    if given is True and len(names) == 2:
        return next((names.index(name) for name in ("q", "a") if name in names), 0)
    if isinstance(given, str) and given in shown:
        return shown.index(given)
    if given is False:
        return None
    raise SeriesError(
        f"quadratic_kinetic must be {'' if len(names) > 2 else 'True, '}False or one of {', '.join(shown)}, "
        f"but was {given!r:.60}"
    )


def shown_names(names: Sequence[str]) -> list[str]:
    """The names of the parts of a Hamiltonian, by colour."""
    return [HAMILTONIAN_NAMES[name] for name in names] if set(names) == set(HAMILTONIAN_NAMES) else list(names)
