"""Every method of the catalogue against its source's claims, and the ways to name one."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction

import order_oracle as oracle
import pytest
import sympy

from integrators import IntegratorError, PartitionedRungeKutta, RungeKutta
from integrators.core.catalogues import declared_entries, spelling
from integrators.methods.catalogue.registry import KINDS, MethodEntry, catalogue, method

ENTRIES = catalogue()
FIXED = [entry for entry in ENTRIES if not entry.is_family and entry.is_tableau]
PAIR_KINDS = ("partitioned", "implicit-explicit")
SINGLE = [entry for entry in FIXED if entry.kind not in PAIR_KINDS]
PAIRS = [entry for entry in FIXED if entry.kind in PAIR_KINDS]
# General position: no further order condition holds by accident.
VALUES = {"alpha": "3/7", "gamma": "2/7", "c2": "3/5", "c3": "6/7"}
FIFTY_DIGITS = 50


def number(entry) -> Fraction:
    """An entry as a Fraction; algebraic numbers to many digits more than the tolerance."""
    if isinstance(entry, (int, Fraction)):
        return Fraction(entry)
    return Fraction(str(sympy.N(entry, FIFTY_DIGITS + 20)))


def numbers(tableau: RungeKutta, weights=None) -> tuple:
    return (
        tuple(tuple(map(number, row)) for row in tableau.A),
        tuple(map(number, tableau.b if weights is None else weights)),
    )


def tolerance(tableau: RungeKutta) -> Fraction:
    """What rounding can leave: three digits less than published, 50 digits for square roots, else nothing."""
    if tableau.digits:
        return Fraction(1, 10 ** (tableau.digits - 3))
    rational = all(isinstance(entry, (int, Fraction)) for row in (*tableau.A, tableau.b) for entry in row)
    return Fraction(0) if rational else Fraction(1, 10**FIFTY_DIGITS)


def build(entry: MethodEntry):
    return method(entry.name, **{key: VALUES[key] for key in entry.parameters})


def named(entries) -> dict:
    return {"argvalues": entries, "ids": [entry.name for entry in entries]}


@pytest.mark.parametrize("entry", **named(SINGLE))
def test_claimed_order_holds_and_the_next_fails(entry: MethodEntry) -> None:
    tableau = build(entry)
    assert len(tableau.b) == entry.stages
    assert oracle.order_of(oracle.Tableau(numbers(tableau)), tolerance=tolerance(tableau)) == entry.order


@pytest.mark.parametrize("entry", **named(PAIRS))
def test_order_of_pairs_from_all_two_coloured_trees(entry: MethodEntry) -> None:
    pair = build(entry)
    assert pair.names == (("p", "q") if entry.kind == "partitioned" else ("L", "N"))
    parts = [numbers(part) for part in pair.partitions]
    assert (
        oracle.order_of(oracle.Tableau(*parts), colours=2, tolerance=max(map(tolerance, pair.partitions)))
        == entry.order
    )


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("lobatto-iiia-iiib2", 2),
        ("lobatto-iiia-iiib3", 4),
        ("lobatto-iiib-iiia3", 4),
        ("gauss-gauss1", 2),
        ("gauss-gauss2", 4),
    ],
)
def test_order_of_pairs_of_families(name: str, order: int) -> None:
    algebras = [part.algebra for part in method(name).partitions]
    assert algebras[0].polynomial == algebras[1].polynomial
    pair = oracle.Quotient(algebras[0].polynomial, *((a.A, a.b) for a in algebras))
    assert oracle.order_of(pair, colours=2) == order


EMBEDDED = {
    "merson4": [3],
    "bogacki-shampine32": [2],
    "fehlberg45": [5],
    "cash-karp45": [4],
    "dormand-prince54": [4],
    "verner65": [5],
    "tsit5": [4],
    "dormand-prince87": [7],
    "dop853": [5, 3],
}


@pytest.mark.parametrize("name", EMBEDDED)
def test_embedded_weights_have_their_order(name: str) -> None:
    tableau = method(name)
    found = [
        oracle.order_of(oracle.Tableau(numbers(tableau, weights)), tolerance=tolerance(tableau))
        for weights in tableau.embedded
    ]
    assert found == EMBEDDED[name]


DECIMAL_FORMS = [
    *("carpenter-kennedy54", "berland64", "toulorge-desmet84", "niegemann124"),
    *("kennedy43", "kennedy54", "calvo64", "parsani53", "ssprk54"),
]


def test_every_pair_keeps_its_embedded_weights() -> None:
    pairs = {entry.name for entry in ENTRIES if entry.kind == "embedded pair"}
    decimals = {entry.name for entry in SINGLE if build(entry).digits}
    assert pairs == set(EMBEDDED)
    published = {"tsit5", "dormand-prince87", "dop853", "pep526", "wso-dirk643"}
    assert decimals == published.union(DECIMAL_FORMS)
    assert not any(build(entry).embedded for entry in SINGLE if entry.name not in pairs)


def test_tsit5_embedded_weights_differ_by_what_the_paper_prints() -> None:
    # Table 1 prints the differences as if they were the weights, the last one with the wrong sign.
    printed = "0.001780011052226 0.000816434459657 -0.007880878010262 0.144711007173263 -0.582357165452555"
    differences = [Fraction(value) for value in [*printed.split(), "0.458082105929187", "-1/66"]]
    tableau = method("tsit5")
    for b, embedded, difference in zip(tableau.b, tableau.embedded[0], differences, strict=True):
        assert abs(b - embedded - difference) < Fraction(2, 10**15)


# Nodes as printed in the sources, the independent check of each row of A.
NODES = {
    "ralston4": "0 2/5 7/8-3*sqrt(5)/16 1",
    "nystrom5": "0 1/3 2/5 1 2/3 4/5",
    "ssprk104": "0 1/6 1/3 1/2 2/3 1/3 1/2 2/3 5/6 1",
    "merson4": "0 1/3 1/3 1/2 1",
    "bogacki-shampine32": "0 1/2 3/4 1",
    "fehlberg45": "0 1/4 3/8 12/13 1 1/2",
    "cash-karp45": "0 1/5 3/10 3/5 1 7/8",
    "dormand-prince54": "0 1/5 3/10 4/5 8/9 1 1",
    "verner65": "0 1/6 4/15 2/3 5/6 1 1/15 1",
    "tsit5": "0 0.161 0.327 0.9 0.9800255409045097 1 1",
    "dop853": "0 0.0526001519587677318785587544488 0.0789002279381515978178381316732 0.118350341907227396726757197510 "
    "0.281649658092772603273242802490 1/3 1/4 4/13 127/195 3/5 6/7 1",
    "crouzeix3": "1/2+sqrt(3)/6 1/2-sqrt(3)/6",
    "crouzeix4": "1/2+cos(pi/18)/sqrt(3) 1/2 1/2-cos(pi/18)/sqrt(3)",
    "qin-zhang": "1/4 3/4",
}


@pytest.mark.parametrize("name", NODES)
def test_nodes_are_the_printed_ones_and_the_row_sums(name: str) -> None:
    tableau = method(name)
    printed = [number(sympy.sympify(node, rational=True)) for node in NODES[name].split()]
    bound = tolerance(tableau) + Fraction(1, 10**FIFTY_DIGITS)
    for node, given, row in zip(printed, tableau.c, numbers(tableau)[0], strict=True):
        assert abs(node - number(given)) <= bound
        assert abs(node - sum(row)) <= bound


def test_verlet_is_the_lobatto_pair_with_two_stages() -> None:
    middle, ends = ((Fraction(1, 2), 0), (Fraction(1, 2), 0)), ((0, 0), (Fraction(1, 2), Fraction(1, 2)))
    kdk, dkd = method("stormer-verlet-kdk").partitions, method("stormer-verlet-dkd").partitions
    assert [part.A for part in kdk] == [middle, ends]
    assert [part.A for part in dkd] == [ends, middle]
    for name, verlet in (("lobatto-iiia-iiib2", kdk), ("lobatto-iiib-iiia2", dkd)):
        assert [part.A for part in method(name).partitions] == [part.A for part in verlet]


@pytest.mark.parametrize(
    ("name", "step"),
    [
        # One step of H = p²/2 + q²/2, so p' = −q and q' = p, from (p, q) with step h.
        ("symplectic-euler-p", lambda p, q, h: (p - h * q, q + h * (p - h * q))),
        ("symplectic-euler-q", lambda p, q, h: (p - h * (q + h * p), q + h * p)),
        ("UTU", lambda p, q, h: kick(*drift(*kick(p, q, h / 2), h), h / 2)),
        ("TUT", lambda p, q, h: drift(*kick(*drift(p, q, h / 2), h), h / 2)),
    ],
)
def test_one_step_of_the_oscillator(name: str, step) -> None:
    p, q, h = Fraction(3, 5), Fraction(-2, 7), Fraction(1, 3)
    tables = [numbers(part) for part in method(name).partitions]
    stages = len(tables[0][1])
    # The slopes u = −Q and v = P of the stages P = p + h A u, Q = q + h Â v solve a linear system.
    u, v = sympy.symbols(f"u:{stages}"), sympy.symbols(f"v:{stages}")
    (a, b), (a_hat, b_hat) = tables
    equations = [u[i] + q + h * sum(a_hat[i][j] * v[j] for j in range(stages)) for i in range(stages)]
    equations += [v[i] - p - h * sum(a[i][j] * u[j] for j in range(stages)) for i in range(stages)]
    slopes = sympy.solve(equations, [*u, *v])
    after = (
        p + h * sum(w * slopes[s] for w, s in zip(b, u, strict=True)),
        q + h * sum(w * slopes[s] for w, s in zip(b_hat, v, strict=True)),
    )
    assert after == tuple(map(sympy.Rational, step(p, q, h)))


def kick(p: Fraction, q: Fraction, h: Fraction) -> tuple[Fraction, Fraction]:
    return p - h * q, q


def drift(p: Fraction, q: Fraction, h: Fraction) -> tuple[Fraction, Fraction]:
    return p, q + h * p


def test_parametric_families_contain_the_named_methods() -> None:
    assert method("sdirk2", gamma="1/4").A == method("qin-zhang").A
    assert method("sdirk2", gamma="1/2 + sqrt(3)/6").A == method("crouzeix3").A
    assert method("sdirk2-general", gamma="1/4", c2="3/4").A == method("qin-zhang").A
    for name, alpha in (("explicit-midpoint", "1/2"), ("heun2", 1), ("ralston2", Fraction(2, 3))):
        found = method("explicit2", alpha=alpha)
        assert (found.A, found.b) == (method(name).A, method(name).b)
    for name, c2, c3 in (("kutta3", "1/2", 1), ("heun3", "1/3", "2/3"), ("ralston3", "1/2", "3/4")):
        found = method("explicit3", c2=c2, c3=c3)
        assert (found.A, found.b) == (method(name).A, method(name).b)


@pytest.mark.parametrize("gamma", ["1/2 + sqrt(3)/6", "1/2 - sqrt(3)/6"])
def test_sdirk2_reaches_order_three(gamma: str) -> None:
    tableau = method("sdirk2", gamma=gamma)
    assert oracle.order_of(oracle.Tableau(numbers(tableau)), tolerance=tolerance(tableau)) == 3


@pytest.mark.parametrize("entry", **named([entry for entry in ENTRIES if entry.parameters]))
def test_parameters_not_given_stay_symbols(entry: MethodEntry) -> None:
    tableau = method(entry.name)
    assert set(tableau.parameters) == set(entry.parameters)
    some, *others = entry.parameters
    partly = method(entry.name, **{some: VALUES[some]})
    assert set(partly.parameters) == set(others)


SYMPLECTIC = {"implicit-midpoint", "qin-zhang"}
SYMMETRIC = {"implicit-midpoint", "trapezoidal", "qin-zhang", "kahan"}


@pytest.mark.parametrize("entry", **named(SINGLE))
def test_structure_where_theory_decides(entry: MethodEntry) -> None:
    a, b = numbers(build(entry))
    stages, bound = range(len(b)), tolerance(build(entry)) * 1000
    symplectic = all(abs(b[i] * a[i][j] + b[j] * a[j][i] - b[i] * b[j]) <= bound for i in stages for j in stages)
    symmetric = all(abs(a[-1 - i][-1 - j] + a[i][j] - b[j]) <= bound for i in stages for j in stages)
    assert symplectic is build(entry).is_symplectic is (entry.name in SYMPLECTIC)
    assert symmetric is build(entry).is_symmetric is (entry.name in SYMMETRIC)


@pytest.mark.parametrize(
    ("name", "symplectic", "symmetric"),
    [
        ("symplectic-euler-p", True, False),
        ("symplectic-euler-q", True, False),
        ("stormer-verlet-kdk", True, True),
        ("stormer-verlet-dkd", True, True),
        ("lobatto-iiia-iiib4", True, True),
        ("lobatto-iiib-iiia3", True, True),
        ("gauss-gauss3", True, True),
    ],
)
def test_structure_of_pairs(name: str, symplectic: bool, symmetric: bool) -> None:
    pair = method(name)
    assert pair.is_symplectic is symplectic
    assert pair.is_symmetric is symmetric


def test_rows_add_up_to_the_nodes_unless_theory_says_otherwise() -> None:
    names = [f"{e.name}{stages}" for e in ENTRIES if e.is_family for stages in range(e.least_stages, 5)]
    names += [entry.name for entry in ENTRIES if not entry.is_family]
    # C(1) fails for these: Radau IA satisfies C(s−1) only, Lobatto IIIB and IIIE C(s−2).
    assert {name for name in names if method(name).issues} == {
        "radau-ia1",
        "lobatto-iiib2",
        "lobatto-iiie2",
        "lobatto-iiia-iiib2",
        "lobatto-iiib-iiia2",
    }


def test_a_new_file_of_a_catalogue_is_found(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "methods_of_a_test"
    folder.mkdir()
    for name, text in {"__init__": "", "b": "METHODS = (3,)", "a": "METHODS = [1, 2]", "helper": "x = 4"}.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert declared_entries(folder.name, "METHODS") == [1, 2, 3]


def test_entries_are_complete_and_unambiguous() -> None:
    names = [spelling(name) for entry in ENTRIES for name in (entry.name, *entry.aliases)]
    assert len(names) == len(set(names))
    for entry in ENTRIES:
        assert entry.reference
        assert entry.description
        assert entry.kind in KINDS
        assert isinstance(entry.order, str) is entry.is_family


@pytest.mark.parametrize("entry", **named(ENTRIES))
def test_built_methods_carry_name_and_source(entry: MethodEntry) -> None:
    name = f"{entry.name}3" if entry.is_family else entry.name
    built = method(name)
    assert isinstance(built, PartitionedRungeKutta if entry.kind in PAIR_KINDS else RungeKutta) is entry.is_tableau
    assert built.name == name
    assert built.reference == entry.reference


@pytest.mark.parametrize(
    ("spelling", "name"),
    [
        ("RK4", "rk4"),
        ("Dormand_Prince54", "dormand-prince54"),
        ("dormandprince54", "dormand-prince54"),
        ("heun", "heun2"),
        ("velocity-verlet", "stormer-verlet-kdk"),
        ("velocity_verlet", "stormer-verlet-kdk"),
        ("leapfrog", "stormer-verlet-kdk"),
        ("UTU", "stormer-verlet-kdk"),
        ("utu", "stormer-verlet-kdk"),
        ("stormer-verlet", "stormer-verlet-kdk"),
        ("Störmer–Verlet", "stormer-verlet-kdk"),
        ("position-verlet", "stormer-verlet-dkd"),
        ("TUT", "stormer-verlet-dkd"),
        ("forward-euler", "explicit-euler"),
        ("backward-euler", "implicit-euler"),
        ("crank-nicolson", "trapezoidal"),
        ("dopri5", "dormand-prince54"),
        ("dverk", "verner65"),
        ("Gauss-3", "gauss3"),
        ("gauss_legendre3", "gauss3"),
        ("lobattoIIIA-IIIB3", "lobatto-iiia-iiib3"),
        ("lobattoiiia2", "lobatto-iiia2"),
        ("RadauIIA3", "radau-iia3"),
    ],
)
def test_spellings_and_aliases(spelling: str, name: str) -> None:
    assert method(spelling) is method(name)
    assert method(spelling).name == name


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("rk5", "^name must be a method of the catalogue, but was 'rk5'; the nearest are .*RK45"),
        ("dormand-prnce54", "the nearest are dormand-prince54"),
        ("midpoint", "the nearest are explicit-midpoint, implicit-midpoint$"),
        ("euler", "the nearest are explicit-euler, .*symplectic-euler-p"),
        ("hein", "the nearest are heun,"),
        ("gaus3", r"the nearest are gauss\{s\}"),
        ("lobatto-iiif3", r"the nearest are lobatto-iii"),
        ("qqqqqqqq", "but was 'qqqqqqqq'$"),
        ("", "but was ''$"),
        ("rk4\n", r"but was 'rk4\\n'; the nearest are rk4"),
        ("x" * 10_000, "but was 'x{59}$"),
        ("gauss³", "name must be a method"),
        ("gauss", "^gauss needs a number of stages, for example gauss3$"),
        ("Lobatto_IIIA", "^lobatto-iiia needs a number of stages, for example lobatto-iiia3$"),
        ("bdf", "^bdf needs a number of steps, for example bdf3$"),
        ("ab51", "^number of steps of ab must be from 1 to 50, but was 51$"),
        ("gauss0", "^number of stages of gauss must be from 1 to 50, but was 0$"),
        ("lobatto-iiia1", "^number of stages of lobatto-iiia must be from 2 to 50, but was 1$"),
        ("gauss51", "must be from 1 to 50, but was 51$"),
        ("gauss1000", "must be from 1 to 50, but was 1000$"),
        ("gauss" + "9" * 10_000, "must be from 1 to 50, but was 9{60}$"),
    ],
)
def test_misses(name: str, message: str) -> None:
    with pytest.raises(IntegratorError, match=message) as caught:
        method(name)
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize("name", [None, 4, ["rk4"], b"rk4"])
def test_a_name_is_text(name: object) -> None:
    with pytest.raises(IntegratorError, match="name must be the name of a method, but was"):
        method(name)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("rk4", {"gamma": 1}, "parameters of rk4 cannot be given, it has none, but 'gamma' was given"),
        ("gauss3", {"stages": 4}, "parameters of gauss cannot be given"),
        ("sdirk2", {"gama": 1}, "parameters of sdirk2 must be one of gamma, but 'gama' was given"),
        ("explicit3", {"alpha": 1}, "must be one of c2, c3, but 'alpha'"),
        ("explicit2", {"alpha": 0}, "parameter alpha of explicit2 must not be 0"),
        ("explicit2", {"alpha": "1/2 - 1/2"}, "parameter alpha of explicit2 must not be 0"),
        ("explicit3", {"c2": "1/2", "c3": "1/2"}, "c2 and c3 of explicit3 must differ"),
        ("explicit3", {"c2": "2/3"}, "c2 and c3 of explicit3 must differ"),
        ("sdirk2-general", {"gamma": "1/2", "c2": "1/2"}, "gamma and c2 of sdirk2-general must differ"),
        ("sdirk2-general", {"gamma": "sqrt(3 + 2*sqrt(2))", "c2": "1 + sqrt(2)"}, "must differ"),
        ("sdirk2", {"gamma": "__import__('os')"}, "gamma"),
        ("sdirk2", {"gamma": "x"}, "gamma"),
        ("sdirk2", {"gamma": ""}, "gamma"),
        ("sdirk2", {"gamma": float("nan")}, "gamma"),
        ("sdirk2", {"gamma": [1]}, "gamma"),
        ("sdirk2", {"gamma": None}, "gamma"),
        ("sdirk2", {"gamma": True}, "gamma"),
    ],
)
def test_wrong_parameters(name: str, parameters: dict, message: str) -> None:
    with pytest.raises(IntegratorError, match=message):
        method(name, **parameters)


def test_listing_and_rational_methods_need_no_heavy_import() -> None:
    code = (
        "import sys; from integrators import catalogue, method; catalogue();"
        "method('rk4'); method('gauss3'); method('stormer-verlet'); method('sdirk2', gamma='1/4');"
        "print(sorted({'numpy', 'sympy', 'networkx', 'numba'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
