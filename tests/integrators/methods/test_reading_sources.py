"""Methods in source text of many languages, against matrices made by hand."""

from __future__ import annotations

from fractions import Fraction as F

import pytest

from integrators import IntegratorError
from integrators.exact.entries import read_entry
from integrators.methods import import_tableau
from integrators.methods.exchange.reading import read_tableaus

HALF = F(1, 2)
A, B, C = [[0, 0, 0], [HALF, 0, 0], [-1, 2, 0]], [F(1, 6), F(2, 3), F(1, 6)], [0, HALF, 1]
"""Kutta's method of order 3."""

STYLES = {
    "C by index": ("c", """
        static Table kutta(void) {
          Table T = Table_Alloc(3, TRUE);
          T->q = 3;
          T->A[1][0] = SUN_RCONST(0.5); T->A[2][0] = -ONE; T->A[2][1] = RCONST(2.0);
          T->b[0] = ONE/SUN_RCONST(6.0); T->b[1] = TWO/SUN_RCONST(3.0); T->b[2] = T->b[0];
          T->c[1] = ONE/TWO; T->c[2] = ONE;
          return T;
        }"""),
    "C macro around a block": ("c", """
        TABLE(KUTTA_3_3, { /* Kutta */
          Table B = Table_Alloc(3, FALSE);
          B->A[1][0] = RC(0.5); B->A[2][0] = RC(-1.0); B->A[2][1] = RC(2.0);
          B->b[0] = 1./6; B->b[1] = 2./3; B->b[2] = 1./6; B->c[1] = .5; B->c[2] = 1.;
        })"""),
    "C arrays": ("c", """
        #define third RC(0.5) / RC(1.5)
        const double A[3][3] = {{0}, {0.5}, {-1.0, 2.0L}}, /* the matrix */
          b[3] = {third / 2.0f, 2.0 * (third), (double)1 / 6.}, c[] = {0, .5e0, 10e-1};"""),
    "C++ with designated initialisers": ("c", """
        constexpr Tableau kutta{.A = {{0, 0, 0}, {0.5, 0, 0}, {-1, 2, 0}}, .b = {1.0 / 6, 2.0 / 3, 1.0 / 6},
                                .c = {0, 0.5, 1}};"""),
    "Julia in a matrix": ("julia", """
        function kutta(::Type{T} = Float64) where {T}
            a21 = T(1 // 2)
            A = T[
                0 0 0
                a21 0 0
                -1 2 0
            ]
            b = [1 // 6; 2 // 3; 1 //
                6]
            c = @big [0, 1/2, 1]
            A = map(T, A)
            return ExplicitRKTableau(A, c, b, 3)
        end"""),
    "Julia by index": ("julia", """
        function kutta(T)
            A = zeros(T, 3, 3); b = zeros(T, 3); c = zeros(T, 3)
            A[2, 1] = convert(T, 1 // 2)
            A[3, 1] = -one(T); A[3, 2] = parse(BigFloat, "2.0")
            b[1] = convert(T, BigInt(1) // BigInt(6)); b[2] = 1 - 2b[1]; b[3] = b[1]
            c[2] = big".5"
            c[3] = 1
        end"""),
    "Julia by name, without the first node": ("julia", """
        function KuttaCache(T, T2)
            a21 = convert(T, 0.5); a31 = convert(T, -1); a32 = convert(T, 2)
            b1 = T(1 // 6); b2 = T(2 // 3); b3 = T(1 // 6)
            c1 = T2(0.5); c2 = one(T2)
            return KuttaCache(a21, a31, a32, b1, b2, b3, c1, c2)
        end"""),
    "Fortran by name": ("fortran", """
        subroutine kutta
          real(wp), parameter :: a21 = 0.5_wp, a31 = -1.d0, a32 = 2.0D+0 ! the matrix
          real(wp), parameter :: b1 = 1.0_wp/ &
                                      6.0_wp
          real(wp), parameter :: b2 = 2.0_wp/3.0_wp, b3 = b1
          real(wp), parameter :: c2 = 0.5_wp, c3 = 1.0_wp
        end subroutine kutta"""),
    "Fortran arrays": ("fortran", """
        program kutta
          real(8), parameter :: a(3,3) = reshape((/ 0d0, 0.5d0, -1d0, 0d0, 0d0, 2d0, 0d0, 0d0, 0d0 /), (/ 3, 3 /))
          real(8), parameter :: b(3) = [1d0/6d0, 2d0/3d0, 1d0/6d0]
          data c /0.0d0, 0.5d0, 1.0d0/
        end program"""),
    "Fortran by index": ("fortran", """
        subroutine kutta(a, b, c)
          a(2,1) = 0.5d0; a(3,1) = -1d0; a(3,2) = 2d0
          b(1) = 1d0/6; b(2) = 2d0/3; b(3) = b(1)
          c(1) = 0; c(2) = .5; c(3) = 1
        end subroutine"""),
    "Fortran as steps": ("fortran", """
        module procedure kutta
          real(wp), parameter :: a21 = 1.0_wp/2.0_wp, a32 = 2.0_wp, w = 1.0_wp/6.0_wp
          associate (f1 => me%work(:,1), f2 => me%work(:,2), f3 => me%work(:,3), end => t + h)
          call me%f(t, x, f1)
          call me%f(t + a21*h, x + h*a21*f1, f2)
          call me%f(end, x + h*(-f1 + a32*f2), f3)
          xf = x + h*(w*f1 + 4.0_wp*w*f2 + w*f3)
          end associate
        end procedure kutta"""),
    "NumPy": ("python", """
        import numpy as np
        third = Fraction(1, 3)
        kutta = Tableau(
            a_lower=(np.array([1 / 2]), np.array([-1.0, 2.0])),
            b_sol=np.array([third / 2, 2 * third, 1 - 5 / 6]),  # weights
            c=np.array([0.5, 1.0]),
        )"""),
    "NumPy by index": ("python", """
        def kutta():
            A = np.zeros((3, 3)); b = np.zeros(3); c = np.zeros(3)
            A[1, 0] = .5
            A[2, :2] = [-1, 2]
            b[:] = np.array([1, 4, 1]) / 6
            c[1], c[2] = 0, 0
            c[1] = A[1, 0]
            c[2] = 2 * c[1]
        """),
    "Python dictionary": ("python", """
        KUTTA = {"A": [[0, 0, 0], [1/2, 0, 0], [-1, 2, 0]], 'b': [1/6, 2/3, 1/6], 'c': [0, 1/2, 1]}"""),
    "JSON": ("python", """
        {"methods": [{"name": "kutta", "A": [["0", "0", "0"], ["1/2", "0", "0"], ["-1", "2", "0"]],
          "b": ["1/6", "2/3", "1/6"], "c": ["0", "0.5", "1"]}]}"""),
    "TOML": ("python", """
        [kutta]
        A = [["0", "0", "0"], ["1/2", "0", "0"], ["-1", "2", "0"]]
        b = ["1/6", "2/3", "1/6"]
        c = [0, 0.5, 1]"""),
    "MATLAB": ("matlab", """
        function [A, b, c] = kutta()
        A = [0 0 0; 1/2 0 0
             -1 2 0];   % the matrix
        b = [1, 4 ... weights
             1]/6; c = [0; .5; 1];
        end"""),
    "Mathematica": ("mathematica", """
        kuttaA = {{0, 0, 0}, {1/2, 0, 0}, {-1, 2, 0}}; (* the matrix *)
        kuttab = {Rational[1, 6], 2/3, 1/6}; kuttac = {0, 5*^-1, 1};"""),
}  # fmt: skip


def numbers(array):
    return [numbers(x) if isinstance(x, list) else read_entry(x.value, "entry") for x in array]


def only(text, language=None):
    found = read_tableaus(text, language)
    assert len(found.records) == 1, found
    return found.records[0]


@pytest.mark.parametrize("style", STYLES)
def test_one_method_in_every_style(style):
    language, text = STYLES[style]
    record = only(text, language)
    assert record.kind == "runge-kutta"
    assert [numbers(record.tables[name]) for name in "Abc"] == [A, B, C]


@pytest.mark.parametrize(
    "style", ["C by index", "C macro around a block", "Julia by index", "Julia by name, without the first node"]
)
def test_sources_with_one_method_are_imported(style):
    found = import_tableau(STYLES[style][1])
    assert [[*map(list, found.A)], list(found.b), list(found.c)] == [A, B, C]


def test_sources_with_several_methods_are_not_imported():
    text = "xA = [[0, 0], [1, 0]]; xb = [0, 1]; yA = [[0, 0], [1/2, 0]]; yb = [0, 1]"
    with pytest.raises(IntegratorError, match="text must have one tableau, but has 2"):
        import_tableau(text)


def test_entries_keep_their_text_and_their_line():
    record = only(STYLES["Julia by index"][1], "julia")
    entry = record.tables["A"][1][0]
    assert (entry.text, entry.line, entry.digits) == ("convert(T, 1 // 2)", 4, 0)
    assert record.tables["c"][1].digits == 1
    steps = only(STYLES["Fortran as steps"][1], "fortran")
    assert (steps.tables["A"][1][0].text, steps.tables["A"][1][0].line) == ("1.0_wp/2.0_wp", 3)


def test_what_is_claimed_nearby_is_kept():
    text = STYLES["C macro around a block"][1]
    assert only(STYLES["C by index"][1], "c").claims["q"] == "3"
    assert "Kutta" in only(text, "c").claims["comment"]
    assert only(text, "c").name == "KUTTA_3_3"
    assert "ExplicitRKTableau" in only(STYLES["Julia in a matrix"][1], "julia").claims["call"]


def test_roots_are_exact():
    record = only("g = 1 - 1/sqrt(2); A = [g 0; 1-g g]; b = [1-g, g]; c = [g, 1]; n = √3", "julia")
    import sympy

    assert numbers(record.tables["A"])[0][0] == 1 - sympy.sqrt(2) / 2
    assert numbers(only("A = [[sqrt(4)/4]]; b = [cos(0) + 1 - 5^0]", "julia").tables["A"]) == [[HALF]]


def test_several_methods_of_one_file_stay_apart():
    text = """
    A = np.array([[0, 0], [1/2, 0]]); b = np.array([0, 1])
    RK['mid'] = Method(A, b, name='Midpoint')
    A = np.array([[0, 0], [1, 0]]); b = np.array([1/2, 1/2])
    RK['heun'] = Method(A, b, name='Heun')
    """
    found = read_tableaus(text, "python").records
    assert [numbers(record.tables["A"])[1][0] for record in found] == [HALF, 1]
    assert [record.claims.get("name") for record in found] == ["Midpoint", "Heun"]


def test_additive_embedded_and_other_kinds():
    pair = only("xA = [[0, 0], [0, 1]]; xb = [0, 1]; xA_hat = [[0, 0], [1, 0]]; xb_hat = [1, 0]", "python")
    assert pair.kind == "additive"
    assert numbers(pair.tables["A_explicit"]) == [[0, 0], [1, 0]]
    embedded = only("A = [[0, 0], [1, 0]]; b = [1/2, 1/2]; bhat = [1, 0]; btilde = [1/2, -1/2]", "python")
    assert numbers(embedded.tables["embedded"]) == [[1, 0]]
    assert numbers(embedded.tables["error"]) == [[HALF, -HALF]]
    fsal = only("a21 = 1//2; a31 = 0; a32 = 1//1; btilde1 = 1; btilde2 = -1; btilde3 = 0; c1 = 1//2; c2 = 1", "julia")
    assert numbers(fsal.tables["b"]) == [0, 1, 0]
    assert numbers(fsal.tables["c"]) == [0, HALF, 1]
    assert only("a = [[0, 0], [1/8, 0]]; b = [1/2, 0]; bp = [0, 1]; c = [0, 1/2]", "python").kind == "nystrom"
    rosenbrock = only("A = [0 0; 1 0]; Gamma = [1 0; -2 1]; b = [1/2, 1/2]", "julia")
    assert rosenbrock.kind == "rosenbrock"
    assert numbers(rosenbrock.tables["Gamma"]) == [[1, 0], [-2, 1]]
    assert only("alpha = [[0, 0], [1, 0], [1/2, 1/2]]; beta = [[0, 0], [1, 0], [0, 1/2]]", "python").kind == "shu-osher"
    assert only("A = [0, -5/9, -153/128]; B = [1/3, 15/16, 8/15]", "python").kind == "2n"
    assert only("a1 = 1//1; a2 = 0; b1 = 1//2; b2 = 1//2", "julia").kind == "splitting"


def test_faults_are_said_with_their_line_and_the_rest_is_read():
    text = """
    void wrong(void) { double A[2][2] = {{0, 0}, {unknown, 0}}; double b[2] = {0.5, 0.5}; }
    void large(void) { double A[2][2] = {{0, 0}, {1, 0}, {1, 1}}; double b[2] = {0.5, 0.5}; }
    void whole(void) { double A[2][2] = {{0, 0}, {1/2, 0}}; double b[2] = {0.5, 0.5}; }
    void right(void) { double A[2][2] = {{0, 0}, {1, 0}}; double b[2] = {0.5, 0.5}; }
    """
    found = read_tableaus(text, "c", "file.c")
    assert [record.name for record in found.records] == ["right"]
    assert found.unread == (
        "file.c, line 2: A has 'unknown'",
        "file.c, line 3: A has 3 entries, but is declared with 2",
        "file.c, line 4: A must have quotients with decimal points, since the language rounds 1/2",
    )


def test_a_diagonal_that_is_left_out_is_said():
    found = read_tableaus("γ = 1//4; a21 = 1//2; b1 = 1//2; b2 = 1//2; c1 = 1//4; c2 = 3//4", "julia")
    assert (found.records, found.unread) == ((), ("text, line 1: a has no diagonal, although there is γ",))


def test_no_value_is_made_up_when_a_part_of_it_is_unknown():
    for entry in ("Rational(1, n)", "x[0]", "f(2)", "1 if y else 2", "[1, 2][0]", "float('nan')", "1//2", "2 * n"):
        found = read_tableaus(f"A = [[0, 0], [{entry}, 0]]; b = [1/2, 1/2]", "python")
        assert not found.records, entry
        assert len(found.unread) == 1
    cyclic = read_tableaus("p = q + 1; q = p + 1; A = [[0, 0], [p, 0]]; b = [1/2, 1/2]", "python")
    assert not cyclic.records
    assert read_tableaus("#define s 1.0 + 2.0\ndouble A[1][1] = {{3.0*s}}, b[1] = {1.0};", "c").records == ()


HOSTILE = [
    "A = " + "[" * 20_000, "{" * 20_000 + "}" * 20_000, "a = (" * 20_000, "x" * 50_000, "A[1][" * 20_000, '"' * 20_001,
    "/*" * 20_000, "a=b=" * 20_000, "f(" * 20_000 + ")" * 20_000, "A = [[" + "-" * 20_000 + "1]]",
    "\n".join(["a1 = 1"] * 20_000),
    "A = [[1e999999999]]; b = [9**9**9]", "a999999999 = 1; b1 = 1; a21 = 1", "A[99999999][0] = 1; b[0] = 1",
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
@pytest.mark.parametrize("language", ["c", "julia", "python", "fortran", "matlab", "mathematica"])
def test_hostile_text_ends_in_no_method(text, language):
    assert read_tableaus(text, language, "file").records == ()


BROKEN = {
    "9**9**9": "has a power of more than", "1e999999999": "has a number of more than", "1/0": "divides by zero",
    "-" * 20_000 + "1": "must have at most", "(" * 900 + "1" + ")" * 900: "must have at most",
    "unknown": "has 'unknown'",
}  # fmt: skip


@pytest.mark.parametrize("entry", BROKEN, ids=range(len(BROKEN)))
def test_a_hostile_entry_is_said_with_its_line_and_what_follows_is_read(entry):
    good = "def second():\n    A = [[0, 0], [1, 0]]\n    b = [0.5, 0.5]\n    c = [0, 1]\n"
    found = read_tableaus(
        f"def first():\n    A = [[0, 0], [{entry}, 0]]\n    b = [1, 0]\n\n{good}", "python", "file.py"
    )
    assert [(record.name, record.line) for record in found.records] == [("second", 6)]
    assert len(found.unread) == 1
    assert found.unread[0].startswith(f"file.py, line 2: A {BROKEN[entry]}")


def wrong(table, kind, i):
    """The table with one wrong entry, the i-th that is not 0; another one stays."""
    rows = [list(row) for row in table]
    places = [(j, k) for j, row in enumerate(rows) for k, x in enumerate(row) if x]
    j, k = places[i % len(places)]
    x, other = rows[j][k], (k + 1) % len(rows[j])
    if kind == "transposed":
        rows[j][k], rows[j][other] = rows[j][other], x
    else:
        rows[j][k] = {"sign": -x, "digit": x + F(3, x.denominator), "dropped": F(0)}[kind]
    return rows


@pytest.mark.parametrize("kind", ["sign", "digit", "dropped", "transposed"])
@pytest.mark.parametrize("role", ["A", "b", "c", "embedded"])
@pytest.mark.parametrize("i", range(3))
def test_a_wrong_entry_is_read_as_it_is_written(kind, role, i):
    """No table changes its role because its row sums are wrong; nodes that are moved keep their rows."""
    tables = {"A": [[F(x) for x in row] for row in A], "b": [B], "c": [[F(x) for x in C]],
              "embedded": [[F(1, 4), F(1, 2), F(1, 4)]]}  # fmt: skip
    tables[role] = wrong(tables[role], kind, i)
    a, (b,), (c,), (e,) = (tables[key] for key in ("A", "b", "c", "embedded"))
    names = "".join(f"a{i + 1}{j + 1} = T({x.numerator} // {x.denominator})\n"
                    for i, row in enumerate(a) for j, x in enumerate(row) if x)  # fmt: skip
    for letter, row in (("b", b), ("c", c), ("bhat", e)):
        names += "".join(f"{letter}{i + 1} = T({x.numerator} // {x.denominator})\n" for i, x in enumerate(row))
    rows = [f"[{', '.join(map(str, row))}]" for row in (*a, b, c, e)]
    arrays = f"A = [{', '.join(rows[:3])}]; b = {rows[3]}; c = {rows[4]}; b_hat = {rows[5]}"
    for text, language in ((f"function f(T)\n{names}end", "julia"), (arrays, "python")):
        found = only(text, language)
        read = {key: numbers(table) for key, table in found.tables.items()}
        assert read == {"A": a, "b": b, "c": c, "embedded": [e]}


@pytest.mark.parametrize(("text", "sentence"), [
    ("γ = 1//4; a11 = γ; a21 = 1//2; b1 = 1//2; b2 = 1//2; c1 = 1//4; c2 = 3//4",
     "a has γ on a part of its diagonal only"),
    ("a = 1//2; α = 1//4", "a has no nodes, and weights of sum 0.25"),
    ("A = [0 0; 1 0]; b = [1, -1]", "A has no nodes, and weights of sum 0"),
])  # fmt: skip
def test_what_is_no_method_is_said(text, sentence):
    found = read_tableaus(text, "julia")
    assert (found.records, found.unread) == ((), (f"text, line 1: {sentence}",))


def test_binary_files_and_unknown_languages_are_refused(tmp_path):
    path = tmp_path / "table.c"
    path.write_bytes(b"\x7fELF\0\1")
    with pytest.raises(IntegratorError, match="must be text, but was binary"):
        read_tableaus(path)
    with pytest.raises(IntegratorError, match="language must be one of c, julia"):
        read_tableaus("A = 1", "cobol")


@pytest.mark.parametrize("style", STYLES)
def test_languages_are_recognised_by_suffix(style, tmp_path):
    language, text = STYLES[style]
    suffixes = {"c": "c", "julia": "jl", "python": "py", "fortran": "f90", "matlab": "m", "mathematica": "wl"}
    path = tmp_path / f"file.{suffixes[language]}"
    path.write_text(text)
    record = only(path)
    assert (numbers(record.tables["A"]), record.source) == (A, str(path))


@pytest.mark.parametrize(
    "text",
    [
        "def heun():\n    # second-order\n{}",
        "# second-order\ndef heun():\n{}",
        'def heun():\n    """second-order"""\n{}',
        'class Heun(Base):\n\n    """second-order"""\n\n{}',
        "\n\n# second-order\ndef heun():\n{}",
    ],
)
def test_what_is_said_before_a_block_and_at_its_beginning_belongs_to_its_method(text):
    tables = "    A = [[0, 0], [1, 0]]\n    b = [1/2, 1/2]\n"
    (record,) = read_tableaus(text.format(tables), name="mine.py").records
    assert "second-order" in record.claims["comment"]
    later = f"def f():\n    x = 1\n    # second-order\n    return x\n\ndef heun():\n{tables}"
    assert "comment" not in read_tableaus(later, name="mine.py").records[0].claims


def test_the_order_that_a_class_returns_is_that_of_its_tableau():
    text = """
_mine_tableau = ButcherTableau(a_lower=([1 / 2],), b_sol=[0, 1], b_error=[-1, 1], c=[1 / 2])
_other_tableau = ButcherTableau(a_lower=([1],), b_sol=[1 / 2, 1 / 2], b_error=[1 / 2, -1 / 2], c=[1])


class Base:
    def order(self, terms):
        return 9


class Mine(AbstractERK):
    tableau: ClassVar[ButcherTableau] = _mine_tableau

    def order(self, terms):
        del terms
        return 2
"""
    found = {record.name: record.claims for record in read_tableaus(text, "python").records}
    assert found["_mine_tableau"]["order"] == "2"
    assert "order" not in found["_other_tableau"]
