"""Pages in a browser: no errors, no network, keyboard, narrow screens, sliders, table."""

from __future__ import annotations

import pytest

import bseries as bs
from bseries.explorer.report import report_html

pytest.importorskip("bokeh")

ROWS = "[...document.querySelectorAll('#terms tbody tr')]"
SHOWN = f"{ROWS}.filter(row => row.offsetParent).length"
MODEL = "Bokeh.documents[0].get_model_by_name"
VIEW = "(name => [...Bokeh.index.roots].find(view => view.model.name === name))"
CURVE = f"Array.from({MODEL}('orbit').renderers[2].data_source.data.x).slice(1, 9)"
DRAWN = f"""window.Bokeh && Bokeh.documents.length && {MODEL}('orbits') &&
    ['orbit', 'error', 'energy', 'patch', 'area', 'orbits'].every(
        name => {MODEL}(name).renderers.every(r => r.data_source.get_length() > 5))"""
STEP = f"""new Promise(done => {{
    const waited = new Set(NAMES), begun = performance.now()
    for (const view of Bokeh.index.roots) {{
        if (!waited.has(view.model.name)) continue
        const sources = new Set(view.model.renderers.map(r => r.data_source))
        let isNew = false
        for (const source of sources) source.connect(source.properties.data.change, () => {{ isNew = true }})
        view.repainted.connect(() => {{
            if (isNew) waited.delete(view.model.name)
            if (!waited.size) done(performance.now() - begun)
        }})
    }}
    const s = {MODEL}('SLIDER')
    s.value = VALUE
}})"""
"""Milliseconds until pictures have been drawn with new data, after a slider has moved."""
MOVES = {
    "h": "s.value > s.start ? s.start : s.start + s.step",
    "scale": "s.value < 1 ? 1 : 1 - s.step",
    "terms": "s.value === 5 ? 6 : 5",  # the first that rk4 has
}
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
    opened = browser.new_page()
    opened.goto(source if request.param == "file" else f"{source}?method=rk4&scene=pendulum&order=5")
    opened.wait_for(DRAWN, 120)
    yield opened
    problems = [*opened.errors, *(asked for asked in opened.requests if not asked.startswith((source, "data:")))]
    opened.close()
    assert not problems


def test_the_table_is_sorted_and_filtered_by_keyboard(page):
    assert page.evaluate(SHOWN) == 17
    page.evaluate("[...document.querySelectorAll('#terms th button')].find(b => b.textContent === 'weight').focus()")
    page.press("Enter")
    weights = page.evaluate(f"{ROWS}.map(row => Number(row.cells[4].dataset.value))")
    assert weights == sorted(float(weight) for weight in bs.modified_equation("rk4", 5).weights())
    page.press("Enter")
    assert page.evaluate("document.querySelectorAll('#terms th[aria-sort=descending]').length") == 1
    page.evaluate("document.getElementById('nonzero').focus()")
    page.press("Space")
    assert page.evaluate(SHOWN) == 10
    page.fill("#filter", "1/480")
    found = page.evaluate(SHOWN)
    assert found == sum("1/480" in str(b) for b in bs.modified_equation("rk4", 5).weights())
    assert page.evaluate("document.getElementById('count').textContent") == f"{found} of 17 trees"


def test_latex_is_copied(page):
    page.evaluate("navigator.clipboard.writeText = async text => { window.written = text }")
    page.click("button[data-copy=series-latex]")
    page.wait_for("document.getElementById('copied').textContent === 'Copied.'")
    assert page.evaluate("window.written") == bs.modified_equation("rk4", 5).to_latex()


def test_everything_is_reached_by_keyboard(page):
    page.evaluate("document.body.focus()")
    inside = """(() => { let e = document.activeElement
        while (e?.shadowRoot?.activeElement) e = e.shadowRoot.activeElement
        return [e.tagName, e.id, e.className, e.textContent.slice(0, 20)].join(" ") })()"""
    reached = []
    for _ in range(40):
        page.press("Tab")
        reached.append(page.evaluate(inside))
    assert sum("noUi-handle" in name for name in reached) >= 3
    for wanted in ("filter", "nonzero", "weight", "Sweep h", "Copy LaTeX", "Copy JSON"):
        assert any(wanted in name for name in reached), (wanted, reached)


def test_a_slider_moves_the_pictures_by_keyboard(page):
    before = page.evaluate(CURVE)
    page.evaluate(
        "[...Bokeh.index.roots].find(v => v.model.name === 'h').shadow_el.querySelector('.noUi-handle').focus()"
    )
    page.press("ArrowRight")
    page.wait_for(f"{CURVE}.some((x, k) => x !== {before}[k])", 30)


def step(page, slider: str, names: list[str]) -> float:
    return page.evaluate(STEP.replace("NAMES", str(names)).replace("SLIDER", slider).replace("VALUE", MOVES[slider]))


@pytest.mark.parametrize("slider", list(MOVES))
def test_pictures_follow_a_slider(page, slider):
    """Those of many orbits depend on the step size only."""
    names = ["orbit", "error", "energy", "patch", "area"] + (["orbits"] if slider == "h" else [])
    assert min(step(page, slider, names) for _ in range(3)) < 100 * SLOWEST


def test_the_sweep_moves_h(page):
    value = f"{MODEL}('h').value"
    before = page.evaluate(value)
    toggle = f"{VIEW}('sweep').shadow_el.querySelector('button').click()"
    page.evaluate(toggle)
    page.wait_for(f"{value} !== {before}", 10)
    page.evaluate(toggle)


def test_first_paint(page):
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    assert paint < 2_000 * SLOWEST


def test_narrow_screens_need_no_sideways_scrolling(page):
    page.resize(390, 800)
    page.wait_for("innerWidth === 390")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_bad_tableau_is_a_sentence_in_the_browser(browser, address):
    page = browser.new_page()
    page.goto(address)
    page.fill("#method", "1 2 3\n4 5")
    page.click("button[type=submit]")
    page.wait_for("document.querySelector('[role=alert]')")
    assert "method must be a tableau" in page.evaluate("document.querySelector('[role=alert]').textContent")
    page.close()


def test_a_page_that_is_left_while_it_computes(browser, address):
    """The server goes on: another page is drawn, and followed by its slider."""
    left = browser.new_page()
    left.goto(f"{address}?method=gauss2&scene=pendulum&order=5")
    left.close()
    page = browser.new_page()
    page.goto(f"{address}?method=rk4&scene=pendulum&order=5")
    page.wait_for(DRAWN, 120)
    assert step(page, "scale", ["orbit", "error"]) > 0
    assert not page.errors
    page.close()
