"""Tableaus written for other packages and read from them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from fractions import Fraction
from functools import partial
from typing import Any

from bseries_base.errors import shorten, shown
from bseries_base.extras import loaded_module
from integrators.core.arguments import as_lists
from integrators.core.errors import IntegratorError
from integrators.core.text_files import read_text
from integrators.methods.catalogue.registry import as_method
from integrators.methods.catalogue.registry import method as named_method
from integrators.methods.exchange.assignments import read_arrays
from integrators.methods.exchange.formats import FORMATS, Arrays, Entries, Format, plain_format
from integrators.methods.exchange.numbers import Number
from integrators.methods.exchange.reading import read_tableaus
from integrators.methods.programs.program import MAX_STAGES, Method
from integrators.methods.tableaux.runge_kutta import RungeKutta, emit
from integrators.methods.tableaux.weights import order_of_weights

OBJECTS = {"diffrax": ("a_lower", "b_sol"), "scipy": ("A", "B", "C"), "nodepy": ("A", "b")}
"""Attributes that tell the objects of packages."""
MOST_CHARACTERS = 1_000_000
LEAST_ROUNDED = 10
"""Decimals with fewer digits are exact: as doubles they satisfy order conditions to 9 digits."""


def export_tableau(method: Method | str, format: str) -> str:
    """The text of a tableau for another package.

    Fractions are written as such, for C and Python as quotients, which these round to doubles. Roots are rounded to
    doubles, of 17 digits at most, except for nodepy, and decimals keep their digits.

    Args:
        method: A Runge–Kutta method without parameters.
        format: ``nodepy`` (arrays of SymPy numbers and their method), ``diffrax`` (a `ButcherTableau`), ``scipy`` (a
            solver class for `solve_ivp`), ``sundials`` (a function that returns an `ARKodeButcherTable`), ``petsc``
            (arrays and their registration), ``rungekutta.jl`` (a `Tableau`) or ``sciml`` (an `ExplicitRKTableau`).

    Returns:
        Source text, from which `import_tableau` reads the method. Its first line says what had no place in it.

    Raises:
        IntegratorError: The method has parameters or no tableau, or the package has no form for methods of its kind.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.export_tableau("explicit-midpoint", "sciml"), end="")
        # explicit-midpoint, a tableau for SciML.
        import DiffEqBase
        <BLANKLINE>
        A = Float64[
            0 0
            1//2 0
        ]
        c = Float64[0, 1//2]
        α = Float64[0, 1]
        explicit_midpoint_tableau = DiffEqBase.ExplicitRKTableau(A, c, α, 2)
    """
    found = as_method(method)
    if not isinstance(found, RungeKutta):
        hint = "; each part of a partitioned method is one" if hasattr(found, "partitions") else ""
        raise IntegratorError(f"method must be a RungeKutta, but was {shown(found)}{hint}")
    if found.parameters:
        raise IntegratorError(f"parameters must have values for a tableau, but {', '.join(found.parameters)} had none")
    return _format(format).write(found)


def import_tableau(
    source: object, format: str | None = None, name: str | None = None, *, fractions: bool = False,
    digits: int | None = None,
) -> RungeKutta:  # fmt: skip
    """The method of a tableau in the text or the objects of another package.

    Text is read and never evaluated. Decimals in it are exact; the tableau has `digits` if some have 16 or more, or
    if decimals of at least 10 digits satisfy order conditions as doubles that they violate exactly.
    Doubles in objects become their shortest decimals, with 16 digits, unless they are integers or binary fractions.

    Args:
        source: Text or a path to it: assignments of the arrays, as `export_tableau` and these packages write them, what
            `ARKodeButcherTable_Write` prints, a file of RungeKutta.jl, or any source with one tableau in it. Or an
            object: a method of nodepy; a `ButcherTableau` or a solver of diffrax; a class of SciPy, such as ``RK45`` or
            one from `scipy_solver`.
        format: The format, as for `export_tableau`; by default recognised. Assignments of A, b, c and bhat without a
            package around them need none.
        name: The name of the method; by default that in the source, or ``custom``.
        fractions: Whether doubles and long decimals become the fractions behind them: each the nearest with a
            denominator of at most 10^6, if it rounds to the same double. This needs all entries to be such fractions,
            and row sums and order conditions that then hold exactly; else the decimals stay.
        digits: The number of correct significant digits of decimals; by default that of the longest.

    Returns:
        The method, with its embedded weights. SciPy's ``Radau`` is the exact ``radau-iia3``; its error estimate is not
        a row of weights. A `TableauWarning` is emitted for each of its issues.

    Raises:
        IntegratorError: The source has no such tableau, or something else than numbers in it.

    Example:
        >>> import bseries as bs
        >>> text = "A = [0 0; 2//3 0]; c = [0, 2//3]; α = [1//4, 3//4]; ExplicitRKTableau(A, c, α, 2)"
        >>> bs.methods.import_tableau(text).b
        (Fraction(1, 4), Fraction(3, 4))
        >>> from scipy.integrate import RK45
        >>> exact = bs.methods.import_tableau(RK45, fractions=True)
        >>> bs.methods.import_tableau(RK45).digits, exact == bs.method("dormand-prince54")
        (16, True)
    """
    if isinstance(source, os.PathLike):
        source = read_text(source, MOST_CHARACTERS)[0]
    if isinstance(source, str):
        form, arrays, title = _of_text(source, format)
    else:
        known = _known(source)
        if known is not None:
            return known if digits is None else known.with_digits(digits)
        form, arrays, title = _of_object(source, format)
    build = partial(_built, form, arrays, name or title)
    entries = Entries(fractions=False)
    method = build(entries)
    if digits is not None:
        method = method.with_digits(digits)
    elif (
        method.domain == "QQ" and entries.longest >= LEAST_ROUNDED and _orders(method, object) != _orders(method, float)
    ):
        method = method.with_digits(entries.longest)
    if fractions and method.digits is not None:
        exact = build(Entries(fractions=True))
        method = exact if _is_confirmed(exact, method) else method
    emit(method.issues)
    return method


def _format(name: object) -> Format:
    if not isinstance(name, str) or name.lower() not in FORMATS:
        raise IntegratorError(f"format must be one of {', '.join(FORMATS)}, but was {shown(name)}")
    return FORMATS[name.lower()]


def _of_text(text: str, format: str | None) -> tuple[Format, Mapping[str, Any], str | None]:
    """The format of a text, the arrays in it, and the name of its method."""
    if len(text) > MOST_CHARACTERS:
        raise IntegratorError(f"text must have at most {MOST_CHARACTERS:,} characters, but has {len(text):,}")
    fits = [name for name, form in FORMATS.items() if format is None and re.search(form.marks, text, re.MULTILINE)]
    if format is not None:
        form = _format(format)
    elif len(fits) == 1:
        form = FORMATS[fits[0]]
    elif not fits and all(re.search(rf"(?<![\w.>]){name}\b[^=\n;,]{{0,100}}=(?!=)", text) for name in ("A", "b")):
        form = plain_format(text)
    elif not fits and read_tableaus(text).records:
        return _of_record(text)
    else:
        what = f"of {' and '.join(fits)}" if fits else "of none"
        raise IntegratorError(f"format must be given, one of {', '.join(FORMATS)}, as the text has marks {what}")
    title = re.search(form.title, text)
    arrays = read_arrays(form.prepare(text), form.names, form.language)
    if not arrays and format is None and len(read_tableaus(text, form.language).records):
        return _of_record(text, form.language)
    return form, arrays, title and title[1]


def _of_record(text: str, language: str | None = None) -> tuple[Format, Mapping[str, Any], str | None]:
    """The arrays of the only tableau among the assignments of a text."""
    records = [record for record in read_tableaus(text, language).records if record.kind == "runge-kutta"]
    if len(records) != 1:
        names = shorten(", ".join(record.name for record in records))
        raise IntegratorError(f"text must have one tableau, but has {len(records)}: {names}")
    tables = records[0].tables
    arrays = {name: tables[name] for name in ("A", "b", "c") if name in tables}
    if "embedded" in tables:
        arrays["bhat"] = tables["embedded"][0]
    return plain_format(text), arrays, records[0].name


def _known(source: object) -> RungeKutta | None:
    """The method of a class from `scipy_solver`, or of SciPy's ``Radau``, which has no tableau of its own."""
    integrate = loaded_module("scipy.integrate")
    if integrate is not None and source is integrate.Radau:
        radau: Any = named_method("radau-iia3")
        return radau
    known = getattr(source, "method", None)
    return known if isinstance(known, RungeKutta) else None


def _of_object(source: Any, format: str | None) -> tuple[Format, Mapping[str, Any], str | None]:
    """The format of an object, its arrays, and the name of its method."""
    tableau = getattr(source, "tableau", source)
    fits = (name for name, attributes in OBJECTS.items() if all(hasattr(tableau, key) for key in attributes))
    found = next(fits, None)
    if found is None or (format is not None and _format(format) is not FORMATS[found]):
        what = f"text or an object of {format or 'nodepy or diffrax, or a Runge–Kutta class of SciPy, such as RK45'}"
        raise IntegratorError(f"source must be {what}, but was {shown(source)}")
    form = FORMATS[found]
    values = {key: getattr(tableau, key, None) for key in form.names}
    if hasattr(tableau, "E5"):  # DOP853 has two rows, with the other sign
        values["E"] = [[-x for x in row] for row in (tableau.E5, tableau.E3)]
    title = getattr(source, "__name__", None) or getattr(source, "name", None)
    return form, {key: value for key, value in values.items() if value is not None}, title


def _built(form: Format, arrays: Mapping[str, object], name: str | None, entries: Entries) -> RungeKutta:
    """The method of arrays."""
    _tableau(form, {key: _zeros(values) for key, values in arrays.items()})  # shapes first: entries take long to read
    A, b, c, embedded = _tableau(form, {key: entries.read(values, key) for key, values in arrays.items()})
    return RungeKutta(A, b, c, embedded=embedded, name=name, digits=entries.digits, warn=False)


def _zeros(values: Any) -> Any:
    """Nested lists of zeros in place of values."""
    values = as_lists(values)
    is_array = isinstance(values, list | tuple) and not isinstance(values, Number)
    return [_zeros(value) for value in values] if is_array else Fraction(0)


def _tableau(form: Format, arrays: Mapping[str, object]) -> Arrays:
    """Stage matrix, weights, nodes and embedded weights from arrays; refused if their shapes do not fit."""
    try:
        A, b, c, embedded = form.tableau(arrays)
    except KeyError as error:
        raise IntegratorError(f"text must assign {error.args[0]}, but did not") from None
    except TypeError:
        sizes = ((key, f"of {len(x)}" if isinstance(x, list) else "a number") for key, x in arrays.items())
        shapes = ", ".join(f"{key} {size}" for key, size in sizes)
        raise IntegratorError(
            f"{', '.join(arrays)} must be a matrix and rows of one length, but were {shapes}"
        ) from None
    if len(A) > MAX_STAGES or len(b) > MAX_STAGES:
        raise IntegratorError(f"A must have at most {MAX_STAGES} rows, but has {max(len(A), len(b))}")
    return A, b, c, embedded


def _is_confirmed(exact: RungeKutta, decimals: RungeKutta) -> bool:
    """Whether all entries are fractions whose row sums are the nodes and that have the orders of the decimals."""
    if exact.digits is not None or exact.issues or exact.row_sums != exact.c:
        return False
    return _orders(exact, object) == _orders(decimals, float)


def _orders(method: RungeKutta, kind: Any) -> list[int]:
    """The order of a method, and to which its rows of embedded weights agree with it, exactly or in doubles."""
    import numpy as np

    shown = method.to_float() if kind is float else method
    A, b, *rows = (np.array(values, dtype=kind) for values in (shown.A, shown.b, *shown.embedded))
    return [order_of_weights(A, b), *(order_of_weights(A, row - b, 0) for row in rows)]
