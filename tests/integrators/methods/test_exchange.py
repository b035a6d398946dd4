"""Tableaus written for other packages and read back, as text and as objects of these packages."""

from __future__ import annotations

import warnings
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from integrators import IntegratorError, RungeKutta, TableauWarning, catalogue, method
from integrators.methods import export_tableau, import_tableau
from integrators.methods.exchange.tableaus import FORMATS
from integrators.runs.scipy_solvers import scipy_solver

pytestmark = pytest.mark.minimum

VALUES = {"alpha": "3/7", "gamma": "2/7", "c2": "3/5", "c3": "6/7"}
KINDS = ("explicit", "embedded pair", "diagonally implicit", "implicit")
HOLD_NO_PAIRS = ("rungekutta.jl",)
KEEP_ROOTS = ("nodepy",)
KEEP_NODES = ("sundials", "petsc", "rungekutta.jl", "sciml")


def tableaus():
    """Every tableau of the catalogue, families with several numbers of stages."""
    for entry in catalogue():
        if entry.kind in KINDS:
            for stages in (entry.least_stages, 3, 5) if entry.is_family else [""]:
                yield method(f"{entry.name}{stages}", **{name: VALUES[name] for name in entry.parameters})


def fits(tableau, format):
    """Whether a package has a form for a method."""
    in_turn = tableau.is_explicit or tableau.is_diagonally_implicit
    return {
        "nodepy": not tableau.issues,
        "diffrax": in_turn and tableau.stages > 1 and not tableau.issues,
        "scipy": tableau.is_explicit and bool(tableau.embedded),
        "sundials": in_turn,
        "petsc": in_turn,
    }.get(format, True)


def is_rounded(tableau, format):
    """Whether fractions of integers beyond those of doubles, which C has not, are written as doubles."""
    entries = (x for row in rows(tableau) for x in row if isinstance(x, Fraction))
    return format in ("sundials", "petsc") and any(x.denominator > 2**53 and 10**100 % x.denominator for x in entries)


def rows(tableau):
    return [*tableau.A, tableau.b, tableau.c]


def read(source, *arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TableauWarning)
        return import_tableau(source, *arguments, **options)


@pytest.mark.parametrize("format", FORMATS)
def test_every_tableau_of_the_catalogue_is_read_back(format):
    count = 0
    for tableau in tableaus():
        if not fits(tableau, format):
            with pytest.raises(IntegratorError, match="method must be"):
                export_tableau(tableau, format)
            continue
        count += 1
        text = export_tableau(tableau, format)
        assert tableau.name in text.splitlines()[0]
        found = read(text)
        assert found == read(text, format)
        roots = format in KEEP_ROOTS and tableau.stages <= 3
        if (tableau.domain in ("QQ", "decimal") and not is_rounded(tableau, format)) or roots:
            assert [*map(list, rows(found)[:-1])] == [*map(list, rows(tableau)[:-1])]
            assert found.c == (tableau.row_sums if format == "nodepy" else tableau.c)  # nodepy has no nodes
            kept = () if format in HOLD_NO_PAIRS else tableau.embedded[:1]
            np.testing.assert_array_equal(found.to_float().embedded, [list(map(float, row)) for row in kept])
        else:
            doubles, their = found.to_float(), tableau.to_float()
            assert (found.domain, found.digits) == ("decimal", 16)
            assert (doubles.A, doubles.b) == (their.A, their.b)
            difference = np.abs(np.subtract(doubles.c, their.c))
            assert (difference <= np.maximum(2e-16, np.spacing(their.c))).all()  # a sum of doubles, and a rounded sum
            assert format not in KEEP_NODES or doubles.c == their.c
    assert count >= (8 if format == "scipy" else 26)


@pytest.mark.parametrize("format", ["nodepy", "diffrax", "scipy", "sundials", "petsc", "sciml"])
def test_exact_pairs_are_equal_when_read_back(format):
    for entry in catalogue():
        pair = method(entry.name) if entry.kind == "embedded pair" else None
        if pair is not None and pair.domain == "QQ":
            assert read(export_tableau(entry.name, format)) == pair


def test_what_has_no_place_is_said_in_the_first_line():
    assert "first of 2 rows" in export_tableau("dop853", "sundials").splitlines()[0]
    assert "no place" in export_tableau("tsit5", "rungekutta.jl").splitlines()[0]
    assert "Roots are rounded" in export_tableau("crouzeix3", "petsc").splitlines()[0]
    assert "Roots" not in export_tableau("crouzeix3", "nodepy")
    assert "order is 13 or more" in export_tableau("gauss7", "rungekutta.jl").splitlines()[0]
    assert 'Symbol("gauss6"), 12,' in export_tableau("gauss6", "rungekutta.jl")
    assert "estimated as zero" in export_tableau("rk4", "diffrax").splitlines()[0]


def test_names_cannot_leave_their_place():
    for format in FORMATS:
        for name in ('x"); evil(); evil()  # $(evil()) */', "x\\", "class", "2 π", "none", "π", ""):
            tableau = RungeKutta([[0, 0], ["1/2", 0]], [0, 1], embedded=[1, 0], name=name)
            text = export_tableau(tableau, format)
            assert not any(line.lstrip().startswith("evil") for line in text.splitlines())
            assert read(text, format).A == tableau.A
            if format in ("nodepy", "diffrax", "scipy"):
                compile(text, "text", "exec")
    assert '\\"); evil()' in export_tableau(RungeKutta([[0]], [1], name='"); evil()'), "petsc")
    assert "\\$(evil())" in export_tableau(RungeKutta([[0]], [1], name="$(evil())"), "rungekutta.jl")


def test_names_of_methods_are_read():
    assert import_tableau(export_tableau("dormand-prince54", "nodepy")).name == "dormand-prince54"
    assert import_tableau(export_tableau("dormand-prince54", "scipy")).name == "DormandPrince54"
    assert import_tableau(export_tableau("rk4", "petsc"), name="mine").name == "mine"


@pytest.mark.parametrize(
    ("method", "format", "message"),
    [
        ("stormer-verlet", "nodepy", "must be a RungeKutta, but was <Part.*each part of a partitioned method is one"),
        ("strang", "petsc", "must be a RungeKutta, but was <Splitting"),
        ("sdirk2", "petsc", "parameters must have values for a tableau, but gamma had none"),
        ("gauss2", "sundials", "must be explicit or diagonally implicit for SUNDIALS, but was gauss2"),
        ("lobatto-iiib2", "nodepy", "nodes that are the row sums, for nodepy"),
        ("rk4", "scipy", "must be explicit, with embedded weights, for SciPy, but was rk4"),
        ("rk4", "matlab", "format must be one of nodepy, .*, sciml, but was 'matlab'"),
        ("rk4", 3, "format must be one of"),
    ],
)
def test_what_cannot_be_written_is_refused(method, format, message):
    with pytest.raises(IntegratorError, match=message):
        export_tableau(method, format)


# Text as these packages write it: Bogacki and Shampine's pair, and Heun's method.

SUNDIALS_PRINTS = """  A = 
       0.000000000000000e+00   0.000000000000000e+00   0.000000000000000e+00   0.000000000000000e+00  
       5.000000000000000e-01   0.000000000000000e+00   0.000000000000000e+00   0.000000000000000e+00  
       0.000000000000000e+00   7.500000000000000e-01   0.000000000000000e+00   0.000000000000000e+00  
       2.222222222222222e-01   3.333333333333333e-01   4.444444444444444e-01   0.000000000000000e+00  
  c =  0.000000000000000e+00   5.000000000000000e-01   7.500000000000000e-01   1.000000000000000e+00  
  b =  2.222222222222222e-01   3.333333333333333e-01   4.444444444444444e-01   0.000000000000000e+00  
  d =  2.916666666666667e-01   2.500000000000000e-01   3.333333333333333e-01   1.250000000000000e-01  
"""  # noqa: W291
SCIML = """function pair(T::Type = Float64)
    A = [
        0 0 0 0
        1 // 2 0 0 0
        0 3 // 4 0 0
        2 // 9 1 // 3 4 // 9 0
    ]
    c = [0; 1 // 2; 3 // 4; 1]
    α = [2 // 9; 1 // 3; 4 // 9; 0]
    αEEst = [7 // 24; 1 // 4; 1 // 3; 1 // 8] #= the "embedded" weights =#
    A = map(T, A)
    α = map(T, α)
    c = map(T, c)
    αEEst = map(T, αEEst)
    return ExplicitRKTableau(A, c, α, 3, αEEst = αEEst, adaptiveorder = 2)
end
"""
PETSC = """
  {
    const PetscReal A[4][4] = {{0, 0, 0, 0}, {RC(1.0)/RC(2.0), 0, 0, 0}, {0, RC(3.0)/RC(4.0), 0, 0},
                               {RC(2.0)/RC(9.0), RC(1.0)/RC(3.0), RC(4.0)/RC(9.0), 0}}, /* A */
      b[4] = {RC(2.0)/RC(9.0), RC(1.0)/RC(3.0), RC(4.0)/RC(9.0), 0},
      bembed[4] = {RC(7.0)/RC(24.0), RC(1.0)/RC(4.0), RC(1.0)/RC(3.0), RC(1.0)/RC(8.0)};
    PetscCall(TSRKRegister(TSRK3BS, 3, 4, &A[0][0], b, NULL, bembed, 0, NULL));
  }
"""
DIFFRAX = '''
_bosh3_tableau = ButcherTableau(
    a_lower=(np.array([1 / 2]), np.array([0.0, 3 / 4]), np.array([2 / 9, 1 / 3, 4 / 9])),
    b_sol=np.array([2 / 9, 1 / 3, 4 / 9, 0.0]),
    b_error=np.array([2 / 9 - 7 / 24, 1 / 3 - 1 / 4, 4 / 9 - 1 / 3, -1 / 8]),
    c=np.array([1 / 2, 3 / 4, 1.0]),
)
class Bosh3(AbstractERK):
    """c = the nodes."""
    tableau: ClassVar[ButcherTableau] = _bosh3_tableau
'''
NODEPY = """
A = np.array([[0, 0, 0, 0], [sympy.Rational(1, 2), 0, 0, 0], [0, Rational(3, 4), 0, 0],
              [Rational(2,9), 1/Rational(3), Rational(4,9), 0]])
b = np.array([Rational(2,9), 1/3, 4/9, 0])
bhat = [Rational(7, 24), 1/4, Rational(1, 3), 1/8]
RK['BS3'] = ExplicitRungeKuttaPair(A, b, bhat)
"""


@pytest.mark.parametrize("text", [SCIML, PETSC, DIFFRAX, NODEPY], ids=["sciml", "petsc", "diffrax", "nodepy"])
def test_text_in_the_style_of_the_packages_is_read_exactly(text):
    assert import_tableau(text) == method("bogacki-shampine32")


def test_what_sundials_prints_is_read_with_its_digits():
    found = import_tableau(SUNDIALS_PRINTS)
    assert (found.domain, found.digits, found.issues) == ("decimal", 16, ())
    assert found.b[0] == Fraction("0.2222222222222222")
    assert import_tableau(SUNDIALS_PRINTS, fractions=True) == method("bogacki-shampine32")


def test_arrays_of_julia_are_read():
    table = "# 2 2 Float64\n0.0\t0.0\t0.0\n1.0\t1.0\t0.0\n0.0\t0.5\t0.5\n"
    code = "a = @big [[ 0     0    ]\n          [ 1     0    ]]\nb = @big [ 1//2 , 1//2 ]\nc = [0; 1]\n"
    found = import_tableau(code + "Tableau{T}(:Heun2, 2, a, b, c)")
    assert import_tableau(table) == found == method("heun2")
    assert found.name == "Heun2"
    roots = read("a = [1/3 -1//12; -√3/2^2 √(9)]; b = [1 - 2/3 (1 + 1) / 3]; c = Float64[0, 1]", "rungekutta.jl")
    assert roots == RungeKutta([["1/3", "-1/12"], ["-sqrt(3)/4", 3]], ["1/3", "2/3"], [0, 1], warn=False)


def test_paths_are_read(tmp_path):
    path = tmp_path / "rk4.c"
    path.write_text(export_tableau("rk4", "sundials"))
    assert import_tableau(path) == method("rk4")


def test_decimals_of_text_are_exact_unless_they_are_long():
    short = "A = np.array([[0, 0], [0.4, 0]]); b = np.array([-0.25, 1.25])"
    found = read(short, "nodepy")
    assert (found.domain, found.b) == ("QQ", (Fraction(-1, 4), Fraction(5, 4)))
    long = read(short.replace("0.4", "0.30000000000000004"), "nodepy")
    assert (long.domain, long.digits) == ("decimal", 16)
    longer = read(short.replace("0.4", "0.3333333333333333333333333333"), "nodepy")
    assert (longer.digits, longer.A[1][0]) == (28, Fraction("0.3333333333333333333333333333"))


def test_inconsistent_tableaus_are_read_with_a_warning():
    with pytest.warns(TableauWarning, match="weights b sum to 2"):
        import_tableau("A = [[0]]; b = [2]", "nodepy")


PLACES = {
    "__import__('os').system('x')": "array of numbers",
    "[[open('/etc/passwd')]]": "array of numbers",
    "np.array(eval('1'))": "array of numbers",
    "[[x.y]]": "but has 'x.y'",
    "[[x]]": "but has 'x'",
    "[[lambda: 0]]": "but has 'lambda: 0'",
    "[[1 for x in y]]": "array of numbers",
    "[[1]][0]": "array of numbers",
    "[[0]]*10": "array of numbers",
    "[[True]]": "but has 'True'",
    "[[1j]]": "but has '1j'",
    "[['1']]": "array of numbers",
    "{1: 2}": "array of numbers",
    "[[nan]]": "but has 'nan'",
    "[[float('nan')]]": "array of numbers",
    "[[1/0]]": "divides by zero",
    "[[sqrt(-1)]]": "even root of a negative number",
    "[[10**10**10]]": "more than 4000 digits",
    "[[2**(10**9)]]": "more than 4000 digits",
    "[[1e999999999]]": "more than 4000 digits",
    "[[1e-999999999]]": "more than 4000 digits",
    "[[" + "9" * 5000 + "]]": "array of numbers",
    "[" * 5000 + "]" * 5000: "at most 20 nested brackets",
    "[[" + "-" * 100_000 + "1]]": "entries of at most 200 parts",
    "[[" + "(" * 90_000 + "1" + ")" * 90_000 + "]]": "at most 20 nested brackets",
    "[[" + "1+" * 90_000 + "1]]": "entries of at most 200 parts",
    "[[" + "not " * 90_000 + "1]]": "array of numbers",
    "[[f" + "()" * 90_000 + "]]": "array of numbers",
    "[" + "0," * 200_000 + "]": "at most 100,000 entries",
    "A": "text must assign A, but did not",
    "[[1,": "array of numbers",
    "[[1, 2]]": "must be square",
    "[[1], [2]]": "must be square",
    "[1, [2]]": "must be a sequence",
    "[]": "A must have",
    "[[]]": "must be square",
    "[[1]]; A = [[2]]": "A must be assigned once",
    "[[1]]\nA[0] = 3": "A must be assigned once",
}


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place[:20])
def test_malformed_and_malicious_text_is_refused_in_one_sentence(place):
    with pytest.raises(IntegratorError, match=PLACES[place]) as caught:
        import_tableau(f"A = {place}\nb = [1]", "nodepy")
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_long_text_is_refused():
    for text in ("A=(" * 300_000, "A[" * 400_000, "[" * 900_000, "A = [" + "(" * 900_000):
        with pytest.raises(IntegratorError):
            import_tableau(text, "sciml")


def test_unknown_text_is_refused():
    with pytest.raises(IntegratorError, match="at most 1,000,000 characters, but has 2,000,000"):
        import_tableau("x" * 2_000_000)
    with pytest.raises(IntegratorError, match=r"format must be given, one of .*, as the text has marks of none"):
        import_tableau("A = [[1]]")
    with pytest.raises(IntegratorError, match="marks of sundials and petsc"):
        import_tableau("sunrealtype A[] = {0}; PetscReal b[] = {1};")
    with pytest.raises(IntegratorError, match="a_lower must have rows of 1 to 1 entries, as b_sol has 2"):
        import_tableau(DIFFRAX.replace("2 / 9, 1 / 3, 4 / 9, 0.0", "1, 0"))
    with pytest.raises(IntegratorError, match="must be a matrix and rows"):
        import_tableau("a = 0; b = [1]; c = 0\na_lower = 3; b_sol = 1; c1 = 0", "diffrax")


PLAIN = {
    "Python": "A = [[0, 0], [1/2, 0]]; b = [0, 1]",
    "Python with nodes": "A = [[0, 0],\n     [1/2, 0]]\nb = [0, 1]\nc = [0, 1/2]",
    "NumPy": "import numpy as np\nA = np.array([[0, 0], [0.5, 0]])\nb = np.array([0, 1])",
    "Julia": "A = [0 0; 1//2 0]; b = [0, 1]",
    "C": "double A[2][2] = {{0.0, 0.0}, {0.5, 0.0}}; double b[2] = {0.0, 1.0};",
    "a class of torchdiffeq's name": "class _ButcherTableau:\n    A = [[0, 0], [0.5, 0]]\n    b = [0, 1]",
}


@pytest.mark.parametrize("text", PLAIN.values(), ids=PLAIN)
def test_plain_assignments_need_no_format(text):
    assert import_tableau(text) == method("explicit-midpoint")


def test_names_that_only_end_like_a_mark_are_none():
    with pytest.raises(IntegratorError, match="as the text has marks of none"):
        import_tableau("tableau = _ButcherTableau(alpha=[1/2], beta=[[1/2]], c_sol=[0, 1])")


def test_embedded_weights_that_do_not_sum_to_one_are_an_issue():
    cash_karp: Any = method("cash-karp45")
    misprinted = [Fraction(2525, 27648), *cash_karp.embedded[0][1:]]  # for 2825
    with pytest.warns(TableauWarning, match="embedded weights sum to .*, not 1: they have order 0"):
        wrong = RungeKutta(cash_karp.A, cash_karp.b, embedded=misprinted)
    assert (len(wrong.issues), cash_karp.issues) == (1, ())
    two = RungeKutta(cash_karp.A, cash_karp.b, embedded=[cash_karp.b, misprinted], warn=False)
    assert two.issues[0].startswith("row 2 of embedded weights sums to")


@pytest.mark.parametrize(
    ("name", "rest"),
    [
        ("tsit5", [Fraction(9, 10), Fraction("0.9800255409045097"), 1, 1]),
        ("dop853", [Fraction(3, 5), Fraction("0.857142857142857142857142857142"), 1]),
    ],
)
def test_nodes_of_decimals_are_those_printed(name, rest):
    tableau: Any = method(name)
    assert list(tableau.c[-len(rest) :]) == rest
    assert tableau.issues == ()
    assert "0.899999" not in export_tableau("tsit5", "diffrax")


def test_long_decimals_beyond_doubles_have_no_fraction_behind_them():
    found = read("A = [[0." + "3" * 400 + "]]; b = [1" + "0" * 400 + ".5]", fractions=True)
    assert (found.digits, found.A[0][0].denominator) == (400, 10**400)


def test_misspelt_arrays_are_named():
    with pytest.raises(IntegratorError, match="text must assign α, but did not"):
        import_tableau(SCIML.replace("α", "β"))


def test_objects_that_are_no_tableaus_are_refused():
    for wrong in (3, None, [1], object, method("strang")):
        with pytest.raises(IntegratorError, match="source must be text or an object of nodepy or diffrax"):
            import_tableau(wrong)


class TestScipy:
    """Classes of SciPy."""

    integrate = pytest.importorskip("scipy.integrate")

    @pytest.mark.parametrize(("name", "own"), [("bogacki-shampine32", "RK23"), ("dormand-prince54", "RK45")])
    def test_fractions_behind_doubles_are_found_on_request(self, name, own):
        found = import_tableau(getattr(self.integrate, own), fractions=True)
        assert (found, found.domain, found.name) == (method(name), "QQ", own)
        decimals = import_tableau(getattr(self.integrate, own))
        assert (decimals.domain, decimals.digits) == ("decimal", 16)
        np.testing.assert_allclose(decimals.to_float().embedded, method(name).to_float().embedded, rtol=1e-13)

    def test_decimals_are_kept_with_their_digits(self):
        found, known = import_tableau(self.integrate.DOP853, fractions=True), method("dop853")
        assert (found.domain, found.digits, found.issues) == ("decimal", 16, ())
        assert [float(x) for x in found.b] == self.integrate.DOP853.B.tolist()
        solver = scipy_solver(found)
        assert (solver.order, solver.error_estimator_order) == (8, 7)
        for ours, theirs in zip((*known.A, *known.embedded), (*found.A, *found.embedded), strict=True):
            np.testing.assert_allclose(list(map(float, ours)), list(map(float, theirs)), rtol=1e-15, atol=1e-15)

    def test_radau_and_our_own_solvers_are_recognised(self):
        assert import_tableau(self.integrate.Radau) == method("radau-iia3")
        assert import_tableau(scipy_solver(method("verner65"))) is method("verner65")

    def test_one_changed_double_is_no_fraction_any_more(self):
        class Nudged(self.integrate.RK45):
            B = np.nextafter(self.integrate.RK45.B, 1)

        found = import_tableau(Nudged, fractions=True)
        assert (found.domain, found.digits) == ("decimal", 16)
        assert found.b[0] == Fraction(repr(float(Nudged.B[0])))

    def test_fractions_with_other_nodes_are_not_trusted(self):
        class Shifted(self.integrate.RK23):
            C = np.array([0, 1 / 2, 2 / 3])

        found = read(Shifted, fractions=True)
        assert found.digits == 16
        assert found.issues

    @pytest.mark.parametrize("wrong", ["BDF", "LSODA", "OdeSolver"])
    def test_classes_without_a_tableau_are_refused(self, wrong):
        with pytest.raises(IntegratorError, match=f"such as RK45, but was <class .*{wrong}"):
            import_tableau(getattr(self.integrate, wrong))

    def test_misshapen_classes_are_refused(self):
        class Short(self.integrate.RK45):
            E = self.integrate.RK45.E[:-1]

        class Wide(self.integrate.RK45):
            A = np.ones((6, 9))

        class Infinite(self.integrate.RK45):
            B = np.full(6, np.inf)

        for wrong, message in ((Short, "E must have 7 entries"), (Wide, "A must be square"), (Infinite, "finite")):
            with pytest.raises(IntegratorError, match=message):
                import_tableau(wrong)

    @pytest.mark.parametrize("name", ["fehlberg45", "bogacki-shampine32", "tsit5", "dop853"])
    def test_exported_classes_take_the_steps_of_our_own_solvers(self, name):
        def field(t, y):
            return [y[1], -np.sin(y[0]) + 0.1 * np.cos(t)]

        names: dict = {}
        exec(export_tableau(name, "scipy"), names)
        solver = next(value for key, value in names.items() if isinstance(value, type) and key != "RK45")
        theirs, ours = (
            self.integrate.solve_ivp(field, (0, 3), [1, 0], chosen, max_step=0.1, first_step=0.1, rtol=1e-3, atol=1e-3)
            for chosen in (solver, scipy_solver(name))
        )
        np.testing.assert_allclose(theirs.t, ours.t, rtol=1e-14)
        np.testing.assert_allclose(theirs.y, ours.y, rtol=1e-12)
        dense = self.integrate.solve_ivp(field, (0, 1), [1, 0], solver, max_step=0.01, dense_output=True)
        finer = self.integrate.solve_ivp(field, (0, 1), [1, 0], "DOP853", t_eval=[0.505], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(dense.sol(0.505), finer.y[:, 0], rtol=0, atol=1e-8)


def their_objects(format, namespace):
    """The tableau that exported text makes."""
    if format == "nodepy":
        return namespace["method"]
    return next(value for value in namespace.values() if hasattr(value, "a_lower"))


@pytest.mark.parametrize("format", ["nodepy", "diffrax"])
def test_exported_text_makes_objects_that_are_read_back(format):
    pytest.importorskip(format)
    for tableau in tableaus():
        if fits(tableau, format):
            names: dict = {}
            exec(export_tableau(tableau, format), names)
            found = import_tableau(their_objects(format, names), fractions=tableau.domain == "QQ")
            if tableau.domain == "QQ":
                assert (found.A, found.b, found.c) == (tableau.A, tableau.b, tableau.c)
                assert found.embedded == tableau.embedded
            # The nodes of nodepy are sums of doubles.
            for ours, theirs in zip(rows(tableau.to_float())[:-1], rows(found.to_float())[:-1], strict=True):
                np.testing.assert_allclose(theirs, ours, rtol=0, atol=2e-16)


def test_methods_of_nodepy_are_read_and_ours_have_their_orders():
    rk = pytest.importorskip("nodepy.runge_kutta_method")
    assert import_tableau(rk.loadRKM("DP5")) == method("dormand-prince54")
    assert import_tableau(rk.loadRKM("BS3")) == method("bogacki-shampine32")
    assert import_tableau(rk.loadRKM("GL2")).A == method("gauss2").A
    for name, order in (("rk4", 4), ("nystrom5", 5), ("gauss2", 4)):
        names: dict = {}
        exec(export_tableau(name, "nodepy"), names)
        assert names["method"].order() == order


def test_solvers_of_diffrax_are_read():
    diffrax = pytest.importorskip("diffrax")
    found = import_tableau(diffrax.Bosh3())
    assert found.name == "custom"
    np.testing.assert_allclose(found.to_float().b, method("bogacki-shampine32").to_float().b, rtol=1e-15)
    assert import_tableau(diffrax.Kvaerno3.tableau).is_diagonally_implicit


ROUNDED = """
const PetscReal A[2][2] = {{0.292893218813452, 0}, {0.707106781186548, 0.292893218813452}};
const PetscReal b[2] = {0.707106781186548, 0.292893218813452};
TSDIRKRegister("name", 2, 2, &A[0][0], b, NULL, NULL, 1, b);
"""


def test_rounded_decimals_of_less_than_sixteen_digits_are_recognised():
    """As doubles they have order 2, exactly order 1."""
    found = import_tableau(ROUNDED, "petsc")
    assert (found.digits, found.domain, found.issues) == (15, "decimal", ())
    assert import_tableau(ROUNDED, "petsc", digits=12).digits == 12
    exact = import_tableau(ROUNDED.replace("0.292893218813452", "0.25").replace("0.707106781186548", "0.75"), "petsc")
    assert exact.digits is None
    rk4 = import_tableau(export_tableau("rk4", "petsc"), digits=5)
    assert rk4 == method("rk4").with_digits(5)
    with pytest.raises(IntegratorError, match="digits must be an integer"):
        import_tableau(ROUNDED, "petsc", digits=0)
