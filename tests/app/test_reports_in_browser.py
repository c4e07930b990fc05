"""Reports in a browser: no error, all visible, sortable, legible on a desk and on a phone."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.app.documents import brush_design_report, diagnosis_report
from robustpolish.app.html import render_html
from robustpolish.machines.simulation import simulate_model as simulate
from tests import browser as chromium
from tests import made_up

pytestmark = chromium.marks
WIDTHS = chromium.WIDTHS


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with chromium.open_browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


def diagnosis():
    told, time = made_up.diagnosis(), np.arange(4000) / 2e3
    push = 30 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", push, {"units": "N"})}, {"time": time})
    data["x"] = ("time", simulate(told.model, data).outputs[:, 0], {"units": "m"})
    held = [rp.compare(model, data) for model in (made_up.model(), told.model)]
    return diagnosis_report(told, *held)


@pytest.fixture(scope="module")
def pages(tmp_path_factory, buildable_job):
    folder = tmp_path_factory.mktemp("pages")
    reports = {
        "design": brush_design_report(buildable_job),
        "diagnosis": diagnosis(),
    }
    for name, report in reports.items():
        (folder / f"{name}.html").write_text(render_html(report, "1.2.3"), encoding="utf-8")
    return folder


@pytest.fixture(params=["design", "diagnosis"])
def show(request, pages, browser):
    def at(width):
        chromium.show(browser, pages / f"{request.param}.html", width)
        return browser

    return at


@pytest.mark.parametrize("width", WIDTHS)
def test_all_is_visible_legible_and_without_errors(show, width):
    browser = show(width)
    assert browser.get_log("browser") == []
    assert chromium.too_wide(browser, width) == []
    tops = browser.execute_script(
        "return ['h1', '.verdict', 'h2', 'figure svg'].map("
        "s => document.querySelector(s).getBoundingClientRect().top)"
    )
    assert tops == sorted(tops)
    assert tops[1] < 250
    box = browser.execute_script(
        "const r = document.querySelector('figure svg').getBoundingClientRect();"
        "return [r.left, r.right, r.height]"
    )
    assert 0 <= box[0] < box[1] <= width
    assert box[2] > 150
    lines = browser.execute_script(
        "return document.querySelectorAll('figure svg path, figure svg image').length"
    )
    assert lines > 10
    page = browser.execute_script(
        "return [...document.querySelectorAll('p, li, td, th, caption, figcaption')]"
        ".map(e => parseFloat(getComputedStyle(e).fontSize))"
    )
    assert min(page) >= 14
    drawn = browser.execute_script(
        "return [...document.querySelectorAll('figure svg text')].map(e =>"
        " parseFloat(getComputedStyle(e).fontSize) * e.getScreenCTM().a || 0).filter(x => x > 0)"
    )
    # Letters that are turned have no horizontal scale and are left out; the rest is the same size.
    assert len(drawn) > 10
    assert np.median(drawn) >= 9.5
    browser.execute_script("document.querySelector('figure button').click()")
    grown = browser.execute_script(
        "const s = document.querySelector('dialog[open] svg').getBoundingClientRect();"
        "return [s.width * s.height, s.width]"
    )
    own = browser.execute_script(
        "const s = document.querySelector('figure svg').getBoundingClientRect();"
        "return s.width * s.height"
    )
    assert grown[0] > 1.5 * own
    assert grown[1] <= width
    browser.execute_script("document.querySelector('dialog').click()")
    assert browser.execute_script("return document.querySelector('dialog[open]')") is None


def test_tables_sort_by_numbers_and_back(show):
    browser = show(1280)
    order = browser.execute_script(
        """
        const found = [];
        for (const table of document.querySelectorAll("table")) {
          [...table.tHead.rows[0].cells].forEach((head, i) => {
            const column = () => [...table.tBodies[0].rows].map(r => r.cells[i].dataset.value);
            head.click(); const up = column(), said = head.getAttribute("aria-sort");
            head.click(); found.push([up, column(), said, head.getAttribute("aria-sort")]);
          });
        }
        return found;
        """
    )
    sorted_numbers = 0
    for up, down, first, second in order:
        assert (first, second) == ("ascending", "descending")
        assert down == up[::-1]
        try:
            numbers = [float(value) for value in up]
        except ValueError:
            continue
        finite = [x for x in numbers if np.isfinite(x)]
        assert finite == sorted(finite)
        sorted_numbers += len(finite) > 2
    assert sorted_numbers >= 2


def test_it_prints_on_few_pages(show):
    browser = show(1280)
    document = browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert len(document["data"]) > 20_000
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    hidden = browser.execute_script(
        "return getComputedStyle(document.querySelector('dialog')).display"
    )
    rule = browser.execute_script(
        "return getComputedStyle(document.querySelector('figure')).breakInside"
    )
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert (hidden, rule) == ("none", "avoid")


# WCAG's contrast of every piece of text against what it stands on; figures are white everywhere.
_CONTRASTS = """
const lit = c => {
  const [r, g, b] = c.match(/[\\d.]+/g).map(Number).map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const below = e => {
  const c = getComputedStyle(e).backgroundColor;
  return c === 'rgba(0, 0, 0, 0)' && e.parentElement ? below(e.parentElement) : c;
};
return [...document.querySelectorAll('h1, h2, p, li, th, td, caption, figcaption')].map(e => {
  const [x, y] = [lit(getComputedStyle(e).color), lit(below(e))];
  return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05);
}).concat(lit(below(document.body)));
"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_legible_in_the_light_and_in_the_dark(show, scheme):
    browser = show(1280)
    theme = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", theme)
    *contrasts, paper = browser.execute_script(_CONTRASTS)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert len(contrasts) > 20
    assert min(contrasts) >= 4.5  # what WCAG asks of text of normal size
    assert (paper < 0.1) == (scheme == "dark")


def test_the_keyboard_does_all_that_a_mouse_does(show):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    browser = show(1280)
    head = browser.find_element(By.CSS_SELECTOR, "th")
    for key, sorting in ((Keys.SPACE, "ascending"), (Keys.ENTER, "descending")):
        head.send_keys(key)
        assert head.get_attribute("aria-sort") == sorting
    browser.find_element(By.CSS_SELECTOR, "figure button").send_keys(Keys.ENTER)
    assert browser.find_elements(By.CSS_SELECTOR, "dialog[open]")
    browser.switch_to.active_element.send_keys(Keys.ESCAPE)
    assert not browser.find_elements(By.CSS_SELECTOR, "dialog[open]")
    # and the tabulator gets to all of it, in the order of the page, with a mark that is seen
    stops = browser.execute_script(
        "return [...document.querySelectorAll('figure button, th')].map(e => e.tabIndex)"
    )
    assert set(stops) == {0}
    browser.find_element(By.TAG_NAME, "body").send_keys(Keys.TAB)
    outline = browser.execute_script("return getComputedStyle(document.activeElement).outlineStyle")
    assert outline == "solid"
