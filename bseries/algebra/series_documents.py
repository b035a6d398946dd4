"""Series read from the JSON documents that `BSeries.to_dict` and the command write."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from math import isfinite
from sys import float_info
from typing import IO, Any

from bseries.algebra.bseries import BSeries, class_on
from bseries.algebra.presentation import KINDS
from bseries.algebra.uncertainty import of_errors
from bseries.exact.domains import make_values
from bseries.exact.number_fields import MOST_COEFFICIENT
from bseries.exceptions import SeriesError
from bseries_base.errors import shorten, shown
from integrators.core.arguments import check_digits, check_label
from integrators.core.text_files import MOST_DIGITS, errors_from, parse_json, read_text
from integrators.exact.arithmetic import MOST_DEGREE
from integrators.exact.expressions import ELEMENTARY, ROOTS, parse_expression
from trees.basis import Basis
from trees.counting import check_size, count_trees
from trees.notation import check_names
from trees.table import tree_table
from trees.words import Words

MOST_BYTES = 200_000_000
MOST_TREES = 5_000_000
KEYS = ("method", "order", "domain", "colors", "empty", "terms")
RATIONAL = re.compile(rf"-?\d{{1,{MOST_DIGITS}}}(?:/0*[1-9]\d{{0,{MOST_DIGITS - 1}}})?", re.ASCII)
MOST_ROOTS = 4
ROOT = re.compile(r"CRootOf\(([^(),]{1,2000}), (\d{1,3})\)", re.ASCII)
FLOAT = re.compile(r"-?\d{1,400}(?:\.\d{1,400})?(?:e[-+]?\d{1,4})?", re.ASCII)


def load_series(source: str | os.PathLike[str] | IO[Any]) -> BSeries:
    """Read a series from the JSON that it was written to.

    Args:
        source: A path, an open file, or the text itself, which begins with ``{``: what `BSeries.to_dict` gives, or the
            command with ``--format json`` for ``series``, ``modified`` or ``modifying``.

    Returns:
        The series that was written, on rooted trees or, as a `Series`, on words: equal coefficients and, for methods
        published as decimals, equal digits and uncertainties. Terms left out by ``nonzero`` are zero.

    Raises:
        SeriesError: The document is no series, lacks terms or has some twice, or has coefficients that are no formulas
            of numbers, roots, elementary functions and symbols. Decimals are refused if terms were left out, since
            these are known to be zero up to rounding only.
        IntegratorError: The file cannot be read, or is not JSON.

    Example:
        >>> import bseries as bs
        >>> import json
        >>> text = json.dumps(bs.modified_equation("sdirk2", 4).to_dict())
        >>> bs.load_series(text) == bs.modified_equation("sdirk2", 4)
        True
    """
    if isinstance(source, str) and source.lstrip().startswith("{"):
        text, label = source, "text"
    else:
        text, label = read_text(source, MOST_BYTES)
    with errors_from(label):
        data = parse_json(text)
    if not isinstance(data, dict) or data.get("schema") != 1 or data.get("kind") not in KINDS:
        kinds = ", ".join(KINDS)
        found = shown(data.get("kind")) if isinstance(data, dict) else shown(data)
        raise SeriesError(f"document must have schema 1 and the kind {kinds}, but had {found}")
    for key in KEYS:
        if key not in data:
            raise SeriesError(f"document must have the key {key}, but had {shorten(', '.join(data))}")
    return _read(data)


def _read(data: Mapping[str, Any]) -> Any:
    """The series of a document that has all keys."""
    colors, terms, digits, domain = data["colors"], data["terms"], data.get("digits"), data["domain"]
    check_digits(digits)
    if not isinstance(colors, list) or not isinstance(terms, list) or not all(isinstance(x, dict) for x in terms):
        raise SeriesError(f"colors and terms must be lists, the latter of objects, but colors were {shown(colors)}")
    if not isinstance(domain, str) or not isinstance(data["method"], str):
        raise SeriesError(f"domain and method must be text, but were {shown(domain)} and {shown(data['method'])}")
    check_label(data["method"], "method")
    names, nonzero = check_names(colors), data.get("nonzero") is True
    if nonzero and digits is not None:
        raise SeriesError("terms must all be there for a method in decimals, but nonzero left some out")
    basis = _basis_of(data, len(names), len(terms), nonzero=nonzero)
    what, count = basis.what[:-1], len(basis)
    values: list[Any] = [0.0 if domain == "RR" else 0] * count
    errors, known = [0.0] * count, set()
    for term in terms:
        text = term.get(what, "")
        if not isinstance(text, str):
            raise SeriesError(f"{what} must be text, but was {shown(text)}")
        at = basis.index(basis.read(text, names if len(names) > 1 else None))
        if at in known:
            raise SeriesError(f"terms must have each {what} once, but had {shorten(text)} twice")
        known.add(at)
        values[at] = _number(
            term.get("coefficient" if digits is None else "exact"), domain, f"coefficient of {shorten(text)}"
        )
        error = term.get("error", 0)
        if not isinstance(error, int | Decimal) or not 0 <= error <= float_info.max:
            raise SeriesError(f"error of {shorten(text)} must be a number, 0 or more, but was {shown(error)}")
        errors[at] = float(error)
    stored = make_values(basis, values)
    if (stored.name in ("QQ", "RR") or domain in ("QQ", "RR")) and stored.name != domain:
        raise SeriesError(f"domain must be that of the coefficients, {stored.name}, but was {shorten(domain)!r}")
    return class_on(basis)(
        basis,
        stored,
        _number(data["empty"], None, "empty"),
        names=names,
        label=data["method"],
        kind=data["kind"],
        digits=digits,
        uncertainty=of_errors(errors) if any("error" in term for term in terms) else None,
    )


def _basis_of(data: Mapping[str, Any], colors: int, terms: int, *, nonzero: bool) -> Basis[Any]:
    """The basis of a document; the number of its terms is checked before the basis is made."""
    if "basis" in data and data["basis"] != "words":
        raise SeriesError(f"basis must be words, or left out for trees, but was {shown(data['basis'])}")
    is_on_words = "basis" in data
    if is_on_words:
        count = sum(colors**n for n in range(1, check_size(data["order"], colors)[0] + 1))
    else:
        count = sum(count_trees(data["order"], colors, data.get("max_children")))
    if (count != terms and not nonzero) or not terms <= count <= MOST_TREES:
        what = "words" if is_on_words else "trees"
        raise SeriesError(f"terms must be those of all {count:,} {what} up to the order, but were {terms:,}")
    return Words(data["order"], colors) if is_on_words else tree_table(data["order"], colors, data.get("max_children"))


def _number(text: Any, domain: str | None, argument: str) -> Any:
    """A number from its text, in a domain or in the narrowest."""
    if isinstance(text, str):
        if domain != "RR" and RATIONAL.fullmatch(text):
            return Fraction(text)
        if domain in ("RR", None) and FLOAT.fullmatch(text) and isfinite(float(text)):
            return float(text)
        if domain not in ("QQ", "RR"):
            return _formula(text, argument)
    place = "" if domain is None else f" in {shorten(domain)}"
    raise SeriesError(f"{argument} must be the text of a number{place}, but was {shown(text)}")


def _formula(text: str, argument: str) -> Any:
    """A formula of symbols and of numbers, also of roots of polynomials as SymPy writes them."""
    import sympy

    roots: dict[str, Any] = {}

    def named(match: re.Match[str]) -> str:
        if match[0] not in roots:
            if len(roots) == MOST_ROOTS:
                raise SeriesError(f"{argument} must have at most {MOST_ROOTS} roots of polynomials, but has more")
            roots[match[0]] = _root(match, argument)
        return f"root_{list(roots).index(match[0])}_of_polynomial"

    plain = ROOT.sub(named, text)
    names = set(re.findall(r"[^\W\d]\w*", plain)) - {*ROOTS, *ELEMENTARY, "pi"}
    return parse_expression(plain, names=sorted(names), argument=argument).xreplace(
        {sympy.Symbol(f"root_{k}_of_polynomial"): root for k, root in enumerate(roots.values())}
    )


def _root(match: re.Match[str], argument: str) -> Any:
    """A real irrational root of a polynomial, from SymPy's text."""
    import sympy
    from sympy.polys.polyerrors import BasePolynomialError

    polynomial, root = parse_expression(match[1], names=["x"], functions=(), argument=argument), None
    try:
        form = sympy.Poly(polynomial, sympy.Symbol("x"), domain="ZZ")
        small = max(abs(int(a)).bit_length() for a in form.all_coeffs()) <= MOST_COEFFICIENT
        if form.degree() <= MOST_DEGREE and small:
            root = sympy.CRootOf(form, int(match[2]))
    except (BasePolynomialError, IndexError, NotImplementedError):
        pass
    if not isinstance(root, sympy.CRootOf) or not root.is_real:
        what = f"real roots of integer polynomials up to degree {MOST_DEGREE}, with small coefficients, only"
        raise SeriesError(f"{argument} must have {what}, but had {shown(match[0])}")
    return root
