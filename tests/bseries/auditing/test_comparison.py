"""Two sources of the same methods side by side."""

from __future__ import annotations

import json

import jsonschema

import bseries as bs
from bseries.auditing import compare

OURS = "def rk_mine():\n    A = [[0, 0], [2/3, 0]]\n    b = [1/4, 3/4]\n    c = [0, 2/3]\n"
THEIRS = "function RKMine()\nA = [0 0; 0.6666666666666666 0]\nb = [1//4, 3//4]\nc = [0, 2//3]\nend\n"


def test_the_same_doubles_are_the_same_in_any_language():
    found = compare({"a.py": OURS}, {"b.jl": THEIRS})
    assert (found.methods, found.differences) == (("rk_mine",), ())


def test_entries_that_differ_have_ulps_and_digits():
    found = compare({"a.py": OURS}, {"b.jl": THEIRS.replace("0.6666666666666666", "0.6666666666666667")})
    (last,) = found.differences
    assert (last.entry, last.first, last.second, last.digits) == ("A[2,1]", "2/3", "0.6666666666666667", 15)
    assert last.ulps == 1
    (far,) = compare({"a.py": OURS}, {"b.jl": THEIRS.replace("3//4", "-3//4")}).differences
    assert (far.entry, far.digits) == ("b[2]", 0)
    data = json.loads(json.dumps(found.to_dict()))
    jsonschema.validate(data, bs.json_schema("tableau-comparison"))
    assert "A[2,1]" in str(found)


def test_other_sizes_and_other_names():
    larger = OURS.replace("[[0, 0], [2/3, 0]]", "[[0, 0, 0], [2/3, 0, 0], [0, 1, 0]]").replace("3/4]", "3/4, 0]")
    found = compare({"a.py": OURS}, {"b.py": larger.replace("c = [0, 2/3]", "c = [0, 2/3, 1]")})
    assert [(x.entry, x.first, x.second) for x in found.differences][:2] == [
        ("size of A", "4", "9"),
        ("size of b", "2", "3"),
    ]
    assert compare({"a.py": OURS}, {"b.py": OURS.replace("mine", "other")}).methods == ()
