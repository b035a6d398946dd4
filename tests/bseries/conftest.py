"""Fixtures of the series tests: both executions of the kernels, random exact series, and a browser."""

import math
import random
import shutil
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import pytest

import trees.table
from bseries import BSeries
from bseries_base.lowering import flat_kernels


@pytest.fixture(params=["compiled", "interpreted"])
def execution(request, monkeypatch):
    """Run everything in machine code, or in the interpreter."""
    monkeypatch.setattr(flat_kernels, "FEW_PRODUCTS", -1 if request.param == "compiled" else math.inf)
    trees.table.kept_table.cache_clear()
    yield request.param
    trees.table.kept_table.cache_clear()


@pytest.fixture
def random_series():
    """random_series(order, seed, empty=1, colors=1): small fractions of both signs, some zero."""

    def make(order, seed, empty=1, colors=1):
        source = random.Random(seed)

        def rule(tree):
            return Fraction(source.randint(-5, 5), source.choice([1, 2, 3, 4, 5, 7]))

        return BSeries.from_rule(rule, order, empty=empty, colors=colors)

    return make


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, driven by Playwright, which keeps an event loop running as long."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("there is no Chromium")
    from playwright.sync_api import sync_playwright  # a quarter of a second, for few tests

    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=program)
        yield started
        started.close()
