"""Sources as people write them: each method is read with its own claims, and its wrong entry is named with its line."""

from __future__ import annotations

import pytest

import bseries as bs

KUTTA = "A = [[0, 0, 0], [1/2, 0, 0], [-1, 2, 0]]\nb = [1/6, 2/3, 1/6]\n"
STYLES = {
    "a.f90": (
        "subroutine kutta(A, b)\n  ! order 3\n  real(wp), intent(out) :: A(3,3), b(3)\n  A = 0.0_wp\n"
        "  A(2,1) = 0.5_wp\n  A(3,1) = -1.0_wp\n  A(3,2) = 2.0_wp\n"
        "  b = [1.0_wp/6.0_wp, 2.0_wp/3.0_wp, 1.0_wp/6.0_wp]\n"
        "end subroutine\n",
        ("A(3,2) = 2.0_wp", "A(3,2) = 3.0_wp"),
        ("kutta", "2.0_wp", 7),
    ),
    "a.f": (
        "      SUBROUTINE KUTTA(N)\nC     Third-order method\n      DOUBLE PRECISION A21, A31, A32, B1, B2, B3\n"
        "      PARAMETER (A21 = 0.5D0, A31 = -1.0D0, A32 = 2.0D0)\n"
        "      PARAMETER (B1 = 1.0D0/6.0D0, B2 = 2.0D0/3.0D0, B3 = 1.0D0/6.0D0)\n      END\n",
        ("A32 = 2.0D0", "A32 = 3.0D0"),
        ("KUTTA", "2.0D0", 4),
    ),
    "a.m": (
        "function [A, b, c] = kutta()\n% a method of order 3\nA = zeros(3);\nA(2,1) = 1/2;\nA(3,1) = -1;\nA(3,2) = 2;\n"
        "b = [1/6 2/3 1/6];\nc = [0 1/2 1]';\nend\n",
        ("A(3,2) = 2", "A(3,2) = 3"),
        ("kutta", "2", 6),
    ),
    "a.cpp": (
        "class Kutta : public Method {\n  static const int order = 3;\n"
        "  const std::vector<std::vector<double>> A{{0, 0, 0}, {0.5, 0, 0}, {-1, 2, 0}};\n"
        "  const double b[3]{1.0/6, 2.0/3, 1.0/6};\n};\n",
        ("{-1, 2, 0}", "{-1, 3, 0}"),
        ("Kutta", "2", 3),
    ),
    "a.toml": (
        '[kutta]\norder = 3\nA = [[0, 0, 0], ["1/2", 0, 0], [-1, 2, 0]]\nb = ["1/6", "2/3", "1/6"]\n'
        "[heun]\norder = 2\nA = [\n  [0, 0],\n  [1, 0],\n]\nb = [0.5, 0.5]\n",
        ("[1, 0]", "[2, 0]"),
        ("heun", "1", 9),
    ),
    "a.json": (
        '{\n  "name": "kutta",\n  "order": 3,\n  "A": [[0, 0, 0], ["1/2", 0, 0], [-1, 2, 0]],\n'
        '  "b": ["1/6", "2/3", "1/6"]\n}\n',
        ("[-1, 2, 0]", "[-1, 3, 0]"),
        ("kutta", "2", 4),
    ),
}


@pytest.mark.parametrize("name", STYLES)
def test_right_methods_hold_and_a_wrong_entry_is_named(name):
    text, (right, wrong), (method, should_be, line) = STYLES[name]
    found = bs.audit({name: text})
    assert found.holds
    assert not found.unread
    assert all(x.claims for x in found.methods)
    found = bs.audit({name: text.replace(right, wrong)})
    (accused,) = [x for x in found.methods if x.findings]
    assert accused.name == method
    changes = [change for correction in accused.findings[0].corrections for change in correction]
    assert (should_be, line) in [(x["should_be"], x["line"]) for x in changes]


def test_what_the_next_function_makes_is_no_claim_of_this_one():
    """The tables of the first function are returned as they are, and its order is not that of the second one."""
    first = "function heun()\n A = [0 0; 1 0]\n b = [1//2, 1//2]\n return A, b\nend\n"
    second = (
        "function kutta()\n A = [0 0 0; 1//2 0 0; -1 2 0]\n b = [1//6, 2//3, 1//6]\n return RKTableau(A, b, 3)\nend\n"
    )
    heun, kutta = bs.audit({"a.jl": first + second}).methods
    assert (heun.claims, heun.findings) == ({}, ())
    assert kutta.claims == {"order": 3}


def test_huge_claims_fail_at_once():
    found = bs.audit({"a.py": KUTTA}, order=10**10)
    assert [str(x) for x in found.methods[0].findings] == ["order 10000000000, but order 3"]


def test_static_matrices_of_julia_are_by_columns():
    text = "A = SMatrix{3,3}(0, 1//2, -1, 0, 0, 2, 0, 0, 0)\nb = SVector(1//6, 2//3, 1//6)\n"
    assert bs.audit({"a.jl": "# order 3\n" + text}).holds


def test_sizes_that_disagree_are_said_and_the_rest_is_audited():
    text = "double A[3][3] = {{0, 0}, {1, 0}};\ndouble b[2] = {0.5, 0.5};\n"
    found = bs.audit({"a.c": text, "b.py": "# order 3\n" + KUTTA})
    assert found.unread == ("a.c, line 1: A has 3 rows, but there are 2 weights",)
    assert [x.order for x in found.methods] == [3]


def test_names_are_shown_without_control_characters(tmp_path):
    found = bs.audit({"\x1b[2J.py": 'name = "\x1b[31mred\x07"\norder = 3\n' + KUTTA.replace("-1", "1")})
    (method,) = found.methods
    assert method.name == r"\x1b[31mred\x07"
    assert str(found).replace("\n", "").isprintable()


def test_files_that_cannot_be_read_are_named_once(tmp_path):
    (tmp_path / "binary.c").write_bytes(b"\xff\x00\x01")
    (tmp_path / "good.py").write_text("# order 3\n" + KUTTA)
    found = bs.audit(tmp_path)
    (sentence,) = found.unread
    assert sentence.count("binary.c") == 1
    assert [x.order for x in found.methods] == [3]
