"""The file: complete, without network, and within its size."""

from __future__ import annotations

import re

import pytest

import bseries as bs
from bseries.explorer.report import report_html
from integrators import RungeKutta
from integrators.methods.kinds.files import loads_method

pytestmark = pytest.mark.minimum

pytest.importorskip("bokeh")

MOST_BYTES = 5_000_000


def test_a_report_on_a_scene(tmp_path):
    done = []
    page = report_html(bs.method("symplectic-euler-p"), bs.scene("pendulum"), progress=lambda *at: done.append(at))
    assert len(page.encode()) < MOST_BYTES
    assert done[-1] == (36, 36)
    assert page.count('data-zero="0"') == sum(
        b != 0 for b in bs.modified_equation("symplectic-euler-p", 4).coefficients()
    )
    assert not re.findall(r'(?:src|href)="(?!data:|\./)', page.partition("<script>")[0])


def test_a_report_on_a_method_alone_and_without_region():
    page = report_html(bs.method("strang"), nodes=2)
    assert "There is no stability region of strang" in page
    assert "symplectic" in page
    assert "bokeh" not in page.lower()
    assert "Order star" in report_html(bs.method("gauss2"), nodes=2)


def test_names_are_text_not_markup():
    """A tableau's name and remarks come from files."""
    name = "<img src=x onerror=alert(1)></pre><!--<script>"
    page = report_html(RungeKutta([[0]], [1], name=name), nodes=2)
    assert "<img" not in page
    assert "<!--<script>" not in page
    with pytest.raises(bs.errors):
        loads_method('{"partitions": {"<b>": {"A": [[0]], "b": [1]}, "q": {"A": [[0]], "b": [1]}}}', "json")
