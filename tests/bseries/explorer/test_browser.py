"""Pages in a browser: no errors, no network, keyboard, narrow screens, sliders, table."""

from __future__ import annotations

import pytest

import bseries as bs
from bseries.explorer.report import report_html

pytest.importorskip("bokeh")
pytestmark = pytest.mark.slow

PICTURES = ["orbit", "error", "energy", "patch", "area", "orbits"]
MODEL = "Bokeh.documents[0].get_model_by_name"
CURVE = f"{MODEL}('orbit').renderers[0].data_source.data.x"
DRAWN = f"""names => window.Bokeh && Bokeh.documents.length && {MODEL}('orbits') &&
    names.every(name => {MODEL}(name).renderers.every(r => r.name === 'legend' || r.data_source.get_length() > 5))"""
FOCUS = """() => {
    let e = document.activeElement
    while (e?.shadowRoot?.activeElement) e = e.shadowRoot.activeElement
    return [e.tagName, e.id, e.className, e.textContent.slice(0, 20)].join(" ")
}"""
MOVE = f"""([name, pictures]) => new Promise((done, fail) => {{
    const waited = new Set(pictures), begun = performance.now()
    for (const view of Bokeh.index.roots) {{
        if (!waited.has(view.model.name)) continue
        let isNew = false
        for (const {{data_source}} of view.model.renderers)
            data_source.connect(data_source.properties.data.change, () => {{ isNew = true }})
        view.repainted.connect(() => {{
            if (isNew) waited.delete(view.model.name)
            if (!waited.size) done(performance.now() - begun)
        }})
    }}
    const slider = {MODEL}(name)
    slider.value = {{
        h: slider.value === slider.end / 4 ? slider.end / 2 : slider.end / 4,
        scale: slider.value < 1 ? 1 : 1 - slider.step,
        terms: slider.value === slider.end ? slider.end - 1 : slider.end,  // both change rk4
    }}[name]
    setTimeout(() => fail(new Error(`not drawn: ${{[...waited]}}`)), 60_000)
}})"""
"""Milliseconds until pictures have been drawn with new data, after a slider has moved so far that all data change."""
SLOWEST = 10.0
"""Times the wanted ones, for a machine that others use too."""


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_html(bs.method("rk4"), bs.scene("pendulum"), nodes=5), encoding="utf-8")
    return path.as_uri()


def opened(browser, address: str, problems: list[str]):
    """A page wide enough for a desk, which must have no errors and ask nobody else."""
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    asked = (address.partition("?")[0], "data:")
    page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda request: None if request.url.startswith(asked) else problems.append(request.url))
    page.goto(address, timeout=60_000)
    return page


@pytest.fixture(params=["file", "server"])
def page(request, browser):
    """The page of rk4 on the pendulum, once all of it is drawn."""
    source = request.getfixturevalue("file" if request.param == "file" else "address")
    problems: list[str] = []
    page = opened(
        browser, source if request.param == "file" else f"{source}?method=rk4&scene=pendulum&order=5", problems
    )
    page.wait_for_function(DRAWN, arg=PICTURES, timeout=120_000)
    yield page
    page.close()
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


def test_everything_is_reached_by_keyboard(page):
    reached = []
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.append(page.evaluate(FOCUS))
    assert sum("noUi-handle" in name for name in reached) >= 3
    for wanted in ("filter", "nonzero", "weight", "Sweep h", "Copy LaTeX", "Copy JSON"):
        assert any(wanted in name for name in reached), (wanted, reached)


def test_a_slider_moves_the_pictures_by_keyboard(page):
    before = page.evaluate(f"Array.from({CURVE})")
    page.locator(".noUi-handle").first.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"before => Array.from({CURVE}).some((x, k) => x !== before[k])", arg=before, timeout=30_000)


@pytest.mark.parametrize("slider", ["h", "scale", "terms"])
def test_pictures_follow_a_slider(page, slider):
    """Those of many orbits depend on the step size only."""
    pictures = PICTURES if slider == "h" else PICTURES[:-1]
    assert min(page.evaluate(MOVE, [slider, pictures]) for _ in range(3)) < 100 * SLOWEST


def test_the_sweep_moves_h(page):
    value = f"{MODEL}('h').value"
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


def test_a_page_that_is_left_while_it_computes(browser, address):
    """The server goes on: another page is drawn, and followed by its slider."""
    left = browser.new_page()
    left.goto(f"{address}?method=gauss2&scene=pendulum&order=5", timeout=60_000)
    left.close()
    problems: list[str] = []
    page = opened(browser, f"{address}?method=rk4&scene=pendulum&order=5", problems)
    page.wait_for_function(DRAWN, arg=PICTURES, timeout=120_000)
    assert page.evaluate(MOVE, ["scale", PICTURES[:-1]]) > 0
    page.close()
    assert not problems
