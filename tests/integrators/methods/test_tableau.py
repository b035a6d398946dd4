"""Runge–Kutta methods as data: what entries may be, what is refused, and what a tableau alone decides."""

import copy
import math
import pickle
import subprocess
import sys
import warnings
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import sympy

from integrators import IntegratorError, PartitionedRungeKutta, RungeKutta, TableauWarning

pytestmark = pytest.mark.minimum

HALF = Fraction(1, 2)
ROOT3 = sympy.sqrt(3)
GAMMA = sympy.Symbol("gamma")
RK4 = ([[0, 0, 0, 0], ["1/2", 0, 0, 0], [0, "1/2", 0, 0], [0, 0, 1, 0]], ["1/6", "1/3", "1/3", "1/6"])
MIDPOINT = ([["1/2"]], [1])
TRAPEZOIDAL = ([[0, 0], ["1/2", "1/2"]], ["1/2", "1/2"])
GAUSS2 = ([["1/4", "1/4 - sqrt(3)/6"], ["1/4 + sqrt(3)/6", "1/4"]], ["1/2", "1/2"])
KICK = ([["1/2", 0], ["1/2", 0]], ["1/2", "1/2"])
DRIFT = ([[0, 0], ["1/2", "1/2"]], ["1/2", "1/2"])


def test_rational_data_is_fractions():
    rk4 = RungeKutta(*RK4, name="rk4", reference="Kutta 1901")
    assert rk4.A[1] == (HALF, 0, 0, 0)
    assert rk4.c == (0, HALF, HALF, 1)
    assert {type(v) for row in (*rk4.A, rk4.b, rk4.c) for v in row} == {Fraction}
    assert (rk4.stages, rk4.name, rk4.reference, rk4.domain) == (4, "rk4", "Kutta 1901", "QQ")
    assert (rk4.names, rk4.partitions, rk4.embedded, rk4.digits, rk4.algebra) == (("",), (rk4,), (), None, None)
    assert (rk4.parameters, rk4.issues, rk4.row_sums) == ((), (), rk4.c)


@pytest.mark.parametrize(
    "half",
    [HALF, "1/2", "0.5", Decimal("0.5"), sympy.Rational(1, 2), sympy.sqrt(sympy.Rational(1, 4)), "2^-1"],
    ids=repr,
)
def test_ways_to_write_one_half(half):
    method = RungeKutta([[half]], [np.int64(1)])
    assert method == RungeKutta([[HALF]], [1])
    assert type(method.A[0][0]) is Fraction


@pytest.mark.parametrize(
    "array",
    [np.array([[0, 0], [1, 0]]), np.array([[0, 0], [1, 0]], dtype=object), sympy.Matrix([[0, 0], [1, 0]])],
    ids=["int array", "object array", "matrix"],
)
def test_arrays_and_matrices(array):
    assert RungeKutta(array, [HALF, HALF]) == RungeKutta([[0, 0], [1, 0]], ["1/2", "1/2"])


def test_decimals_are_exact():
    assert RungeKutta([["0.1"]], [Decimal(1)]).A[0][0] == Fraction(1, 10)
    assert RungeKutta([[Decimal("1e-30")]], [1]).A[0][0] == Fraction(1, 10**30)


@pytest.mark.parametrize("value", [0.5, np.float32(0.5), np.float64(0.5), np.longdouble(0.5), sympy.Float(0.5)])
def test_one_float_makes_all_of_them_floats(value):
    method = RungeKutta([[0, 0], [value, 0]], ["1/3", 2 * ROOT3 / 3 - 0], warn=False)
    assert method.domain == "float"
    assert {type(v) for row in (*method.A, method.b, method.c) for v in row} == {float}
    assert method.b == (1 / 3, 2 * math.sqrt(3) / 3)


def test_floats_and_fractions_of_equal_value_are_different_methods():
    assert RungeKutta([[0.5]], [1]) != RungeKutta([[HALF]], [1])


def test_algebraic_entries():
    gauss = RungeKutta(*GAUSS2)
    assert gauss.domain == "algebraic"
    assert gauss.A[0][1] == sympy.Rational(1, 4) - ROOT3 / 6
    assert gauss.c == (HALF - ROOT3 / 6, HALF + ROOT3 / 6)
    assert gauss.b == (HALF, HALF)
    assert type(gauss.A[0][0]) is Fraction


def test_symbols():
    declared = RungeKutta([["gamma", 0], ["1 - 2*gamma", "gamma"]], ["1/2", "1/2"], parameters=["gamma"])
    real = sympy.Symbol("gamma", real=True)
    assert declared == RungeKutta([[real, 0], [1 - 2 * real, real]], [HALF, HALF])
    assert (declared.domain, declared.parameters, declared.c) == ("symbolic", ("gamma",), (GAMMA, 1 - GAMMA))
    assert declared.is_diagonally_implicit
    assert not declared.is_explicit
    assert not declared.is_symplectic


def test_substitute():
    family = RungeKutta([["gamma", 0], ["c2 - gamma", "gamma"]], ["b", "1 - b"], parameters=["b", "c2", "gamma"])
    assert family.parameters == ("b", "c2", "gamma")
    partly = family.substitute({"c2": "1 - gamma", "b": HALF})
    assert partly == RungeKutta([["g", 0], ["1 - 2*g", "g"]], ["1/2", "1/2"], parameters=["g"]).substitute(
        {"g": sympy.Symbol("gamma")}
    )
    assert partly.substitute({"gamma": "1/4"}) == RungeKutta([["1/4", 0], ["1/2", "1/4"]], ["1/2", "1/2"])
    crouzeix = partly.substitute({"gamma": "1/2 + sqrt(3)/6"})
    assert crouzeix == RungeKutta([["1/2+sqrt(3)/6", 0], ["-sqrt(3)/3", "1/2+sqrt(3)/6"]], ["1/2", "1/2"])
    assert partly.substitute({"gamma": 0.25}).domain == "float"
    assert family.substitute({}) is family


def test_substitution_errors():
    family = RungeKutta([["1/gamma"]], [1], parameters=["gamma"])
    with pytest.raises(IntegratorError, match="values must be for the parameters gamma, but one was for 'beta'"):
        family.substitute({"beta": 1})
    with pytest.raises(IntegratorError, match=r"A\[1\]\[1\] must be a finite number, but was zoo"):
        family.substitute({"gamma": 0})
    root = RungeKutta([["sqrt(gamma)"]], [1], parameters=["gamma"])
    with pytest.raises(IntegratorError, match="must be real, but was I"):
        root.substitute({"gamma": -1})
    with pytest.raises(IntegratorError, match="of which there are none"):
        RungeKutta(*MIDPOINT).substitute({"gamma": 1})
    with pytest.raises(IntegratorError, match="must have values before rounding, but gamma had none"):
        root.to_float()


def test_to_float():
    rounded = RungeKutta(*GAUSS2, name="gauss2").to_float()
    off_diagonal = [float((sympy.Rational(1, 4) + sign * ROOT3 / 6).evalf(30)) for sign in (-1, 1)]
    assert (
        (0.25, off_diagonal[0]),
        (off_diagonal[1], 0.25),
    ) == rounded.A
    assert (rounded.name, rounded.domain, rounded.issues) == ("gauss2", "float", ())
    assert rounded.is_symplectic
    assert rounded.is_symmetric
    assert not RungeKutta(*TRAPEZOIDAL).to_float().is_symplectic


BAD = {
    "A must be square, but row 2 has 3 entries and row 1 has 2": ([[0, 0], [1, 2, 3]], [1, 0]),
    "A must be square, but has 2 rows of 3 entries": ([[0, 0, 0], [1, 2, 3]], [1, 0]),
    "A must be square, but has 1 row of 2 entries": ([[0, 1]], [1]),
    "A must have at least one row, but was empty": ([], []),
    "A must have at most 1000 rows, but has 1001": ([[0]] * 1001, [1]),
    "row 2 of A must be a sequence, but was 5": ([[0, 0], 5], [1]),
    "A must be a sequence, but was '0,0;1/2,0'": ("0,0;1/2,0", [0, 1]),
    "row 1 of A must be a sequence, but was '00'": (["00", "10"], [0, 1]),
    "A must be a sequence, but was None": (None, [1]),
    "A must be a sequence, but was {0: 1}": ({0: 1}, [1]),
    "b must have as many entries as A has rows, 1, but has 2": ([[0]], [1, 0]),
    "c must have as many entries as A has rows, 1, but has 0": ([[0]], [1], []),
    r"A\[1\]\[1\] must be a finite number, but was nan": ([[float("nan")]], [1]),
    r"b\[1\] must be a finite number, but was inf": ([[0]], [np.inf]),
    r"b\[1\] must be a finite number, but was -inf": ([[0]], [np.float32(-np.inf)]),
    r"c\[1\] must be a formula, but 'NaN' is not finite": ([[0]], [1], [Decimal("nan")]),
    r"A\[1\]\[1\] must be a finite number, but was oo": ([[sympy.oo]], [1]),
    r"A\[1\]\[1\] must be a real number or a formula, but was True": ([[True]], [1]),
    r"A\[1\]\[1\] must be a real number or a formula, but was (np.)?False": ([[np.bool_(0)]], [1]),
    r"A\[1\]\[1\] must be a real number or a formula, but was 1j": ([[1j]], [1]),
    r"A\[1\]\[1\] must be a real number or a formula, but was None": ([[None]], [1]),
    r"b\[1\] must be a real number or a formula, but was \[1\]": ([[0]], [[1]]),
    r"A\[1\]\[1\] must be real, but was I": ([[sympy.I]], [1]),
    r"symbols of A\[1\]\[1\] must be letters, .* but one was 'a b'": ([[sympy.Symbol("a b")]], [1]),
    r"A\[1\]\[1\] must be a formula, but 'CRootOf": ([[sympy.CRootOf(sympy.Symbol("x") ** 5 - 3, 0)]], [1]),
    r"A\[1\]\[1\] must be a formula, but 'pi' has pi outside a cosine": ([[sympy.pi]], [1]),
    r"A\[1\]\[1\] must be a formula, but 'cos\(1\)' has a cosine, sine or tangent of": ([[sympy.cos(1)]], [1]),
    r"A\[1\]\[1\] must not mix floats and symbols": ([[0.5 * GAMMA]], [1]),
    "A, b and c must not mix floats and symbols": ([[GAMMA]], [1.0]),
    r"A\[1\]\[1\] must fit in a double or be text": ([[np.longdouble(1) / 3]], [1]),
    r"A\[1\]\[1\] must fit in a double or be text, but was 0.1000": ([[sympy.Float("0.1", 50)]], [1]),
    "sums of entries must be finite": ([[1e308, 1e308], [0, 0]], [1, 0]),
    r"A\[1\]\[1\] must be of reasonable size, but has a number of more than 4000 digits": ([[10**5000]], [1]),
    r"A\[1\]\[1\] must be a formula, but '1/\(' ends": ([["1/("]], [1]),
    r"A\[1\]\[1\] must be a formula, but '1E-999999999' has a number of more": ([[Decimal("1e-999999999")]], [1]),
}  # fmt: skip


@pytest.mark.parametrize(("message", "arguments"), BAD.items(), ids=range(len(BAD)))
def test_refused(message, arguments):
    with pytest.raises(IntegratorError, match=message) as caught:
        RungeKutta(*arguments)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"digits": 0}, "digits must be an integer from 1 to 1000, but was 0"),
        ({"digits": True}, "digits must be an integer"),
        ({"digits": 16, "embedded": ["sqrt(2)"]}, "digits must be left out for a tableau with roots or symbols"),
        ({"name": 3}, "name must be text, but was 3"),
        ({"reference": b"x"}, "reference must be text"),
        ({"parameters": "gamma"}, "parameters must be a sequence of names"),
        ({"parameters": ["sqrt"]}, "parameters must be letters"),
        ({"embedded": [1, 2]}, "embedded must have as many entries as A has rows, 1, but has 2"),
        ({"embedded": [[1], ["x"]]}, r"embedded\[2\]\[1\] must be a formula"),
        ({"embedded": 5}, "embedded must be a sequence, but was 5"),
    ],
)
def test_refused_keywords(keywords, message):
    with pytest.raises(IntegratorError, match=message):
        RungeKutta(*MIDPOINT, **keywords)


def test_embedded_rows():
    assert RungeKutta(*TRAPEZOIDAL, embedded=[1, 0]).embedded == ((1, 0),)
    assert RungeKutta(*TRAPEZOIDAL, embedded=np.array([[1, 0], [0, 1]])).embedded == ((1, 0), (0, 1))
    assert RungeKutta(*TRAPEZOIDAL, embedded=[]).embedded == ()


def test_warnings_name_the_row():
    with pytest.warns(TableauWarning) as caught:
        method = RungeKutta([[0, 0], ["1/3", 0]], ["1/2", "1/3"], c=[0, "1/2"])
    assert [str(w.message) for w in caught] == list(method.issues)
    assert method.issues == (
        "row 2 of A sums to 1/3, but c[2] is 1/2",
        "weights b sum to 5/6, not 1: the method is inconsistent",
    )
    assert {w.filename for w in caught} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert RungeKutta([[1]], [2], c=[3], warn=False).issues


def test_issues_respect_digits_and_rounding():
    third = ([["0.333333"]], ["0.999999"])
    assert len(RungeKutta(*third, c=["1/3"], warn=False).issues) == 2
    assert RungeKutta(*third, c=["1/3"], digits=5).issues == ()
    assert len(RungeKutta(*third, c=["1/3"], digits=6, warn=False).issues) == 1  # half a unit is 5e-7, and 1 is at 1e-6
    assert len(RungeKutta(*third, c=["1/3"], digits=9, warn=False).issues) == 2
    assert RungeKutta([[0.1 + 0.2]], [0.7 + 0.2 + 0.1], c=[0.3]).issues == ()
    with pytest.warns(TableauWarning, match=r"row 1 of A sums to 0\.3"):
        RungeKutta([[0.300001]], [1.0], c=[0.3])
    assert RungeKutta([["sqrt(2)*sqrt(3+2*sqrt(2))"]], [1], c=["2 + sqrt(2)"]).issues == ()
    with pytest.warns(TableauWarning, match="weights b sum to gamma, not 1"):
        RungeKutta([["1/2"]], ["gamma"], parameters=["gamma"])


@pytest.mark.parametrize(
    ("weights", "advised"), [(["0.3334", "0.6665"], True), ([0.3334, 0.6665], True), (["1/3", "1/2"], False)]
)
def test_weights_that_nearly_sum_to_one_may_be_rounded(weights, advised):
    (issue,) = RungeKutta([[0, 0], [1, 0]], weights, warn=False).issues
    assert ("rounded decimals, write them as text and give digits" in issue) is advised
    if advised:
        assert RungeKutta([[0, 0], [1, 0]], ["0.3334", "0.6665"], digits=3).issues == ()


def test_value_semantics():
    method = RungeKutta(*GAUSS2, name="gauss2")
    for other in (RungeKutta(*GAUSS2), copy.copy(method), copy.deepcopy(method), pickle.loads(pickle.dumps(method))):
        assert other == method
        assert hash(other) == hash(method)
    different = [RungeKutta(*GAUSS2, embedded=[1, 0]), RungeKutta(*TRAPEZOIDAL), "gauss2"]
    assert all(method != other for other in different)
    assert RungeKutta(*MIDPOINT, digits=5) != RungeKutta(*MIDPOINT)
    for name in ("A", "name", "anything"):
        with pytest.raises(AttributeError, match="RungeKutta is immutable"):
            setattr(method, name, 1)
    with pytest.raises(AttributeError, match="immutable"):
        del method.name


def test_hashes_agree_across_processes():
    """The hash of text differs from process to process, so a stored one must not travel."""
    method = RungeKutta(*RK4)
    hash(method)
    code = f"""
import pickle, sys
from integrators import RungeKutta
sys.exit(hash(pickle.loads({pickle.dumps(method)!r})) != hash(RungeKutta(*{RK4!r})))
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_from_algebra_wants_an_algebra():
    with pytest.raises(IntegratorError, match="algebra must be a StageAlgebra, but was 5"):
        RungeKutta.from_algebra(5)  # type: ignore[arg-type]


STRUCTURE = {
    "explicit euler": (([[0]], [1]), True, False, False, False),
    "implicit euler": (([[1]], [1]), False, True, False, False),
    "rk4": (RK4, True, False, False, False),
    "midpoint": (MIDPOINT, False, True, True, True),
    "trapezoidal": (TRAPEZOIDAL, False, True, False, True),
    "gauss2": (GAUSS2, False, False, True, True),
    "gauss2, stages exchanged": (
        ([["1/4", "1/4 + sqrt(3)/6"], ["1/4 - sqrt(3)/6", "1/4"]], ["1/2", "1/2"]), False, False, True, True,
    ),
    "gauss2 with a wrong sign": (
        ([["1/4", "1/4 + sqrt(3)/6"], ["1/4 + sqrt(3)/6", "1/4"]], ["1/2", "1/2"]), False, False, False, False,
    ),
    "qin-zhang": (([["1/4", 0], ["1/2", "1/4"]], ["1/2", "1/2"]), False, True, True, True),
    "symplectic, not symmetric": (([["1/6", 0], ["1/3", "1/3"]], ["1/3", "2/3"]), False, True, True, False),
    "three midpoint steps, stages 2, 3, 1": (
        ([["1/6", 0, "1/3"], ["1/3", "1/6", "1/3"], [0, 0, "1/6"]], ["1/3", "1/3", "1/3"]), False, False, True, True,
    ),
    "diagonal symplectic family": (
        ([["g/2", 0], ["g", "(1-g)/2"]], ["g", "1-g"]), False, True, True, False,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("tableau", "explicit", "dirk", "symplectic", "symmetric"), STRUCTURE.values(), ids=STRUCTURE)
def test_structure(tableau, explicit, dirk, symplectic, symmetric):
    method = RungeKutta(*tableau, parameters=["g"], warn=False)
    assert (method.is_explicit, method.is_diagonally_implicit) == (explicit, dirk)
    assert (method.is_symplectic, method.is_symmetric) == (symplectic, symmetric)


def test_entries_beyond_doubles_stay_exact_until_they_are_rounded():
    large = RungeKutta([["1e309"]], [1], ["1e309"])
    assert (large.domain, large.is_symmetric, large.is_symplectic) == ("QQ", False, False)
    assert RungeKutta([["1e309", 0], [0, "1-1e309"]], [1, 0], warn=False).is_symmetric is False
    with pytest.raises(
        IntegratorError, match="numbers must be in the range of doubles to be rounded, but one was 1000"
    ):
        large.to_float()


def test_structure_within_digits():
    digits = ([["0.25", "-0.0386751346"], ["0.5386751346", "0.25"]], ["0.5", "0.5"])
    assert RungeKutta(*digits, digits=9).is_symplectic
    assert RungeKutta(*digits, digits=9).is_symmetric
    wrong = ([["0.25", "-0.0386751"], ["0.5386752", "0.25"]], ["0.5", "0.5"])
    assert not RungeKutta(*wrong).is_symplectic
    assert not RungeKutta(*wrong, digits=12).is_symplectic


def verlet(**keywords):
    return PartitionedRungeKutta({"p": RungeKutta(*KICK), "q": RungeKutta(*DRIFT)}, **keywords)


def test_partitioned_data():
    method = verlet(name="stormer-verlet", reference="HLW 2003")
    assert (method.names, method.stages, method.domain) == (("p", "q"), 2, "QQ")
    assert method.partitions == (RungeKutta(*KICK), RungeKutta(*DRIFT))
    assert (method.name, method.reference, method.parameters, method.issues) == ("stormer-verlet", "HLW 2003", (), ())
    assert (method.algebra, method.embedded, method.digits) == (None, (), None)
    mapping = {"p": {"A": KICK[0], "b": KICK[1]}, "q": {"A": DRIFT[0], "b": DRIFT[1], "c": [0, 1]}}
    assert PartitionedRungeKutta(mapping) == method
    assert hash(PartitionedRungeKutta(mapping)) == hash(method)
    exchanged = PartitionedRungeKutta({"q": mapping["q"], "p": mapping["p"]})
    assert (exchanged, exchanged.names) == (method, ("p", "q"))
    additive = PartitionedRungeKutta({"slow": mapping["q"], "fast": mapping["p"]})
    assert additive.names == ("slow", "fast")
    assert pickle.loads(pickle.dumps(method)) == method
    assert method.to_float().domain == "float"


EULER = {"explicit": ([[0]], [1]), "implicit": ([[1]], [1])}
PAIRS = {
    "verlet": (KICK, DRIFT, (False, True, True, True)),
    "symplectic euler": (EULER["implicit"], EULER["explicit"], (False, True, True, False)),
    "explicit euler twice": (EULER["explicit"], EULER["explicit"], (True, True, False, False)),
    "implicit euler twice": (EULER["implicit"], EULER["implicit"], (False, False, False, False)),
    "midpoint twice": (MIDPOINT, MIDPOINT, (False, False, True, True)),
    "trapezoidal twice": (TRAPEZOIDAL, TRAPEZOIDAL, (False, False, False, True)),
    "kick twice": (KICK, KICK, (False, False, False, True)),
    "weights differ": (([[1, 0], [1, 0]], [1, 0]), ([[0, 0], [0, 0]], [0, 1]), (False, True, False, False)),
}


@pytest.mark.parametrize(("p", "q", "expected"), PAIRS.values(), ids=PAIRS)
def test_partitioned_structure(p, q, expected):
    method = PartitionedRungeKutta({"p": RungeKutta(*p), "q": RungeKutta(*q)})
    found = (method.is_explicit, method.is_explicit_if_separable, method.is_symplectic, method.is_symmetric)
    assert found == expected


def test_three_parts():
    parts = {"a": RungeKutta(*MIDPOINT), "b": RungeKutta(*MIDPOINT), "c": RungeKutta([["g"]], [1], parameters=["g"])}
    method = PartitionedRungeKutta(parts)
    assert (method.parameters, method.domain, method.is_symplectic) == (("g",), "symbolic", False)
    fixed = method.substitute({"g": "1/2"})
    assert (fixed.parameters, fixed.is_symplectic, fixed.is_symmetric) == ((), True, True)
    with pytest.raises(IntegratorError, match="parameters g, but one was for 'x'"):
        method.substitute({"x": 1})


def test_partitioned_warnings_name_the_part():
    with pytest.warns(TableauWarning, match="partition q: weights b sum to 2, not 1") as caught:
        method = PartitionedRungeKutta({"p": RungeKutta(*MIDPOINT), "q": {"A": [[1]], "b": [2]}})
    assert len(caught) == len(method.issues) == 1
    inconsistent = RungeKutta([[1]], [2], warn=False)
    assert len(PartitionedRungeKutta({"p": inconsistent, "q": inconsistent}).issues) == 2


@pytest.mark.parametrize(
    ("partitions", "message"),
    [
        ({"p": MIDPOINT}, "partitions must map two or more names to tableaux"),
        ([MIDPOINT, MIDPOINT], "partitions must map two or more names"),
        ({"p": MIDPOINT, "t": MIDPOINT}, "names of partitions must .* but one was 't'"),
        ({"p": MIDPOINT, "τ": MIDPOINT}, "names of partitions must .* but one was 'τ'"),
        ({"p": MIDPOINT, "2": MIDPOINT}, "names of partitions must"),
        ({"p": MIDPOINT, "_a": MIDPOINT}, "names of partitions must"),
        ({"p": MIDPOINT, 1: MIDPOINT}, "names of partitions must"),
        ({"p": MIDPOINT, "q": DRIFT}, "same number of stages, but p has 1 and q has 2"),
        ({"p": MIDPOINT, "q": 5}, "partition q must be a RungeKutta or have A, b"),
        ({"p": MIDPOINT, "q": {"A": [[1]]}}, "partition q must be a RungeKutta or have A, b"),
        ({"p": MIDPOINT, "q": {"A": [[1, 2]], "b": [1]}}, "partition q: A must be square"),
        (
            {"p": {"A": [["g"]], "b": [1]}, "q": {"A": [[0.5]], "b": [1]}},
            "must not mix floats and symbols, but p is symbolic, q is float",
        ),
    ],
)
def test_bad_partitions(partitions, message):
    if isinstance(partitions, dict):
        partitions = {k: RungeKutta(*v) if isinstance(v, tuple) else v for k, v in partitions.items()}
    with pytest.raises(IntegratorError, match=message):
        PartitionedRungeKutta(partitions, parameters=["g"])


def test_text():
    assert str(RungeKutta(*TRAPEZOIDAL, embedded=[1, 0])).splitlines() == [
        "0 │ 0    0",
        "1 │ 1/2  1/2",
        "──┼─────────",
        "  │ 1/2  1/2",
        "  │ 1    0",
    ]
    assert repr(RungeKutta(*RK4, name="rk4")) == "<RungeKutta rk4: 4 stages>"
    assert repr(verlet(name="verlet")) == "<PartitionedRungeKutta verlet: p, q, 2 stages>"
    assert "q:\n0 │ 0" in str(verlet())
    html = RungeKutta(*GAUSS2)._repr_html_()
    assert html.count("<tr>") == 3
    assert html.count("<td") == 9
    assert "sqrt(3)/6" in html
    assert verlet()._repr_html_().count("<table") == 2


def test_rational_methods_need_no_numpy_and_no_sympy():
    code = f"""
import sys
from integrators import PartitionedRungeKutta, RungeKutta
m = RungeKutta(*{RK4!r})
m.is_explicit, m.is_symplectic, m.is_symmetric, m.domain, m.to_float(), str(m)
PartitionedRungeKutta({{"p": RungeKutta(*{KICK!r}), "q": RungeKutta(*{DRIFT!r})}}).is_symplectic
sys.exit("sympy" in sys.modules or "numpy" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
