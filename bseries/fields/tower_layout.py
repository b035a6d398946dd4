"""Where the kernels of towers find what they read: the tables in `ints` and `numbers`, and their columns.

`ints` begins with some counts and with where each table begins; `bseries.fields.towers` writes it.
"""

from __future__ import annotations

EACH, CHAIN, RING, PAIRS, TABLE = range(5)

COUNTS = ("order", "terms", "locals", "jets", "towers", "fields", "dimension")
"""The first entries of `ints`: sizes, and where in the workspace local variables, jets and towers begin."""
TABLES = {
    "term": 21,
    "site": 4,
    "argument": 7,
    "datum": 2,
    "tape": 7,
    "product": 3,
    "raised": 1,
    "level": 1,
    "contraction": 8,
    "direction": 1,
    "use": 3,
    "child_level": 1,
    "child": 1,
    "output": 5,
}
"""The tables in `ints`, whose beginnings follow the counts, and the width of their rows.

argument: role, offset, stride, 1 if a difference, role, offset, stride · datum: role, first number · tape: operation,
result, operands, first product, end, first factor · product: α, β, γ with x^α = x^β x^γ, by |α| · raised: x^α x_l ·
level, child_level: by order, where contractions and children begin · contraction: left, own, size, child, first
direction, end, first use, end · use: 0 or 1 + the child, first output, end · output: monomial, role, offset, stride,
0 if negative.
"""
NUMBERS = ("datum_value", "constant", "factor", "factorial", "weight")
"""The tables in `numbers`; where they begin follows in `ints`."""

ORDER, TERMS, LOCALS, JETS, TOWERS, FIELDS, DIMENSION = range(len(COUNTS))
(
    TERM, SITE, ARGUMENT_ROWS, DATUM_ROWS, TAPE, PRODUCT, RAISED, LEVEL, CONTRACTION, DIRECTION, USE,
    CHILD_LEVEL, CHILD, OUTPUT,
) = range(len(COUNTS), len(COUNTS) + len(TABLES))  # fmt: skip
DATUM_VALUE, NUMBER, FACTOR, FACTORIAL, WEIGHT = range(
    len(COUNTS) + len(TABLES), len(COUNTS) + len(TABLES) + len(NUMBERS)
)
# The columns of a term: its sites; its ranges in other tables; the jet of its formula, and where the tables of that
# jet's shape begin; the groups of its towers alone, and with the fields of children.
(
    T_KIND, T_COUNT, T_SITE, T_ROWS, T_ARGUMENT, T_ARGUMENT_END, T_DATUM, T_DATUM_END, T_TAPE, T_TAPE_END, T_RESULT,
    T_DEGREE, T_SIZE, T_RAISED, T_FACTORIAL, T_SLOTS, T_GROUPS, T_OUTPUT, T_OUTPUT_END, T_LEVEL, T_CHILD,
) = range(TABLES["term"])  # fmt: skip
