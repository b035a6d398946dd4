"""Pages in a browser: no errors, no network, keyboard, narrow screens, sliders, table."""

from __future__ import annotations

import pytest

import bseries as bs
from bseries.explorer.report import report_html

pytest.importorskip("bokeh")

CURVE = "Bokeh.documents[0].get_model_by_name('orbit').renderers[0].data_source.data.x"
SLOWEST = 10.0
"""Times the wanted ones, for a machine that others use too."""


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_html(bs.method("rk4"), bs.scene("pendulum"), nodes=5), encoding="utf-8")
    return path.as_uri()


@pytest.fixture(params=["file", "server"])
def page(request, browser):
    """A page wide enough for a desk, which must have no errors and ask nobody else."""
    source = request.getfixturevalue("file" if request.param == "file" else "address")
    address = source if request.param == "file" else f"{source}?method=rk4&scene=pendulum&order=5"
    opened = browser.new_page(viewport={"width": 1280, "height": 900})
    problems: list[str] = []
    opened.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    opened.on("pageerror", lambda error: problems.append(str(error)))
    opened.on("request", lambda asked: None if asked.url.startswith((source, "data:")) else problems.append(asked.url))
    opened.goto(address, timeout=60_000)
    opened.wait_for_selector("#terms", timeout=120_000)
    opened.wait_for_function(f"window.Bokeh && Bokeh.documents.length && {CURVE}.length > 9", timeout=120_000)
    yield opened
    opened.close()
    assert not problems


def shown(page):
    return page.locator("#terms tbody tr:visible").count()


def test_the_table_is_sorted_and_filtered_by_keyboard(page):
    assert shown(page) == 17
    page.locator("#terms th button", has_text="weight").focus()
    page.keyboard.press("Enter")
    weights = page.locator("#terms tbody tr").evaluate_all("rows => rows.map(r => Number(r.cells[4].dataset.value))")
    assert weights == sorted(float(weight) for weight in bs.modified_equation("rk4", 5).weights())
    page.keyboard.press("Enter")
    assert page.locator("#terms th[aria-sort=descending]").count() == 1
    page.locator("#nonzero").focus()
    page.keyboard.press("Space")
    assert shown(page) == 10
    page.locator("#filter").fill("1/480")
    assert shown(page) == sum("1/480" in str(b) for b in bs.modified_equation("rk4", 5).weights())
    assert page.locator("#count").text_content() == f"{shown(page)} of 17 trees"


def test_latex_is_copied(page):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.locator("button[data-copy=series-latex]").click()
    page.wait_for_function("document.getElementById('copied').textContent === 'Copied.'")
    assert page.evaluate("navigator.clipboard.readText()") == bs.modified_equation("rk4", 5).to_latex()


def test_a_slider_moves_the_pictures_by_keyboard(page):
    before = page.evaluate(f"Array.from({CURVE})")
    page.locator(".noUi-handle").first.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"before => Array.from({CURVE}).some((x, k) => x !== before[k])", arg=before, timeout=30_000)


def test_the_sweep_moves_h(page):
    value = "Bokeh.documents[0].get_model_by_name('h').value"
    before = page.evaluate(value)
    button = page.locator("button", has_text="Sweep h")
    button.click()
    page.wait_for_function(f"{value} !== {before}", timeout=10_000)
    button.click()


def test_first_paint(page):
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    assert paint < 2_000 * SLOWEST


def test_narrow_screens_need_no_sideways_scrolling(page):
    page.set_viewport_size({"width": 390, "height": 800})
    page.wait_for_timeout(500)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_bad_tableau_is_a_sentence_in_the_browser(browser, address):
    page = browser.new_page()
    page.goto(address, timeout=60_000)
    page.locator("#method").fill("1 2 3\n4 5")
    page.locator("button[type=submit]").click()
    page.wait_for_selector("[role=alert]", timeout=60_000)
    assert "method must be a tableau" in page.locator("[role=alert]").text_content()
    page.close()
