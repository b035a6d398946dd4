"""Forty methods written as source text with one wrong entry, read and audited: the entry is found."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import cache

import pytest
import sympy

import bseries as bs

FAMILIES = ("gauss", "radau-ia", "radau-iia", "lobatto-iiia", "lobatto-iiib", "lobatto-iiic", "lobatto-iiid")


@cache
def rational_methods():
    """The tableaus of the catalogue and of its families, roots as decimals with 20 digits."""
    found = {}
    names = [entry.name for entry in bs.catalogue() if entry.name not in FAMILIES]
    names += [f"{family}{stages}" for family in FAMILIES for stages in (2, 3, 4)]
    for name in names:
        try:
            method = bs.method(name)
        except bs.errors:  # no method with so many stages
            continue
        if not isinstance(method, bs.RungeKutta) or method.parameters or not 2 <= method.stages <= 13:
            continue
        if method.domain == "algebraic":
            A, b, c = (
                [[Fraction(str(sympy.N(x, 20))) for x in r] for r in y] for y in (method.A, [method.b], [method.c])
            )
            method = bs.RungeKutta(A, b[0], c[0], digits=19, warn=False)
        if order_of(method) > 1:
            found[name] = method
    return found


def order_of(method):
    rounded = bs.analysis.rounded_order(method)
    return max(bs.order_of(method), rounded.order if rounded else 0)


def text_of(x, style, *, decimal):
    if decimal:
        return str(sympy.Rational(x).evalf(35)).rstrip("0") if x else "0"
    if x.denominator == 1:
        return str(x.numerator)
    return {"py": "{}/{}", "jl": "{}//{}", "def": "RCONST({}.0)/RCONST({}.0)"}[style].format(x.numerator, x.denominator)


def source_of(style, A, b, c, order):
    """A method in the style of NumPy, of SciML, or of SUNDIALS."""
    stages, rows = len(b), [*A, b, c]
    if style == "py":
        lines = [", ".join(row) for row in rows]
        return f"# a method of order {order}\nA = [[{'], ['.join(lines[:-2])}]]\nb = [{lines[-2]}]\nc = [{lines[-1]}]\n"
    head, first, end = {
        "jl": (f"function constructMine(T)\nA = zeros(T, {stages}, {stages})\nb = zeros(T, {stages})\n", 1, "end"),
        "def": (f"TABLE(MINE, {{ ARKodeButcherTable B = ARKodeButcherTable_Alloc({stages}, SUNFALSE);\n", 0, "})"),
    }[style]
    last = f"return ExplicitRKTableau(A, c, b, {order})\n" if style == "jl" else f"B->q = {order};\nreturn B;\n"
    cells = [(f"A[{i + first}, {j + first}]", x) for i, row in enumerate(A) for j, x in enumerate(row)]
    cells += [(f"{name}[{j + first}]", x) for name, row in (("b", b), ("c", c)) for j, x in enumerate(row)]
    head += f"c = zeros(T, {stages})\n" if style == "jl" else ""
    places = [(cell if style == "jl" else f"B->{cell.replace(', ', '][')}", x) for cell, x in cells if x != "0"]
    return head + "".join(f"{place} = {x};\n" for place, x in places) + last + end + "\n"


@pytest.mark.slow
@pytest.mark.parametrize("style", ["py", "jl", "def"])
def test_wrong_entries_in_source_text_are_found(style):
    missed, tried = [], 0
    assert len(rational_methods()) >= 40
    for name, method in rational_methods().items():
        rng, order = random.Random(f"{name} {style}"), order_of(method)
        rows = [
            [text_of(Fraction(x), style, decimal=bool(method.digits)) for x in row] for row in (*method.A, method.b)
        ]
        nodes = [text_of(Fraction(x), style, decimal=bool(method.digits)) for x in method.c]
        (right,) = bs.audit({f"m.{style}": source_of(style, rows[:-1], rows[-1], nodes, order)}).methods
        assert (right.findings, right.claims) == ((), {"order": order}), name
        for _ in range(2):
            i, j = rng.choice([(i, j) for i, row in enumerate(rows) for j, x in enumerate(row) if x != "0"])
            was = rows[i][j]
            digit = rng.choice([k for k, x in enumerate(was) if x.isdigit()][:6])
            new = rng.choice(["0", was[1:] if was[0] == "-" else f"-{was}", f"{was[:digit]}7{was[digit + 1 :]}"])
            changed = [list(row) for row in rows]
            changed[i][j] = new
            (found,) = bs.audit({f"m.{style}": source_of(style, changed[:-1], changed[-1], nodes, order)}).methods
            entry = f"b[{j + 1}]" if i == method.stages else f"a[{i + 1},{j + 1}]"
            named = {change[0]["entry"] for x in found.findings for change in x.corrections}
            tried += bool(found.findings)
            if found.findings and entry not in named:
                missed.append((name, entry, was, new))
    assert tried >= 60
    assert len(missed) <= 0.05 * tried, missed
