"""Chromium for tests that look at pages: opened, resized, and asked what does not fit."""

import importlib
import os
import shutil
from contextlib import contextmanager

import pytest

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
WIDTHS = (1280, 390)
"""Of a desk and of a phone."""

marks = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # sockets of the driver
    pytest.mark.skipif(
        not (CHROMIUM and DRIVER),
        reason="needs chromium and chromedriver: apt-get install chromium chromium-driver",
    ),
]

# What reaches beyond the window and cannot be scrolled into it, and text that is cut off. Words for
# screen readers are a pixel wide on purpose.
_TOO_WIDE = """
const width = arguments[0], found = [];
const all = (document.querySelector('article') || document.body).querySelectorAll('*');
const scrolls = e => ['auto', 'scroll'].includes(getComputedStyle(e).overflowX);
const text = e => e.textContent.trim().slice(0, 40);
const name = e => `${e.tagName.toLowerCase()}.${e.className} "${text(e)}"`;
if (document.documentElement.scrollWidth > width)
  found.push(`the page, ${document.documentElement.scrollWidth} px`);
for (const e of all) {
  const box = e.getBoundingClientRect(), style = getComputedStyle(e);
  if (box.width <= 1 || box.height <= 1 || style.visibility === 'hidden') continue;
  if (box.right > width + 1 || box.left < -1) {
    let inside = false;
    for (let p = e.parentElement; p && !inside; p = p.parentElement)
      inside = scrolls(p) && p.getBoundingClientRect().right <= width + 1;
    if (!inside) found.push(`${name(e)}, to ${Math.round(box.right)} px`);
  }
  if (['hidden', 'clip'].includes(style.overflowX) && e.scrollWidth > e.clientWidth + 1)
    found.push(`${name(e)}, ${e.scrollWidth} px in ${e.clientWidth}`);
}
return [all.length, found];
"""

# What a reader has to scroll sideways: on a phone wide tables of numbers may ask for it, the rest
# may not.
_SCROLLED = """
const most = arguments[0] < 641 ? 5 : Infinity;
const columns = e => e.querySelector('tr')?.children.length || 0;
return [...document.querySelectorAll('article pre, article .math-block, article table')]
  .filter(e => e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1 && columns(e) < most)
  .map(e => `${e.tagName.toLowerCase()} "${e.textContent.trim().slice(0, 40)}"`);
"""


@contextmanager
def open_browser(profile):
    """Open Chromium without a window; `profile` is a folder of its own."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--no-first-run",
        "--disable-background-networking",
        f"--user-data-dir={profile}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(DRIVER, log_output=os.devnull)
    driver = webdriver.Chrome(options=options, service=service)
    try:
        yield driver
    finally:
        driver.quit()


def show(browser, page, width):
    """Open a page in a window of so many pixels."""
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.get(page.as_uri())


def too_wide(browser, width):
    """Return what of the page does not fit into its window; an empty page is refused."""
    looked_at, found = browser.execute_script(_TOO_WIDE, width)
    assert looked_at > 0, f"{browser.current_url} has no content"
    return found


def scrolled(browser, width):
    """Return the code, formulae and tables of a page that go on beyond their boxes."""
    return browser.execute_script(_SCROLLED, width)


def links_in(browser, selector):
    """Return where the links of a search lead, once it has found all that it will."""
    wait = importlib.import_module("selenium.webdriver.support.ui").WebDriverWait(browser, 20)
    summary = "return document.querySelector('.search-summary')?.textContent || ''"
    wait.until(lambda driver: "finished" in driver.execute_script(summary))
    script = "return [...document.querySelectorAll(arguments[0])].map(link => link.href)"
    return browser.execute_script(script, selector)
