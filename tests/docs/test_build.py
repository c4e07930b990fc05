"""The documentation builds without a warning, and fits desks and phones.

The notebooks have tests of their own and are not executed here.
"""

import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlencode

import pytest

from tests import browser as chromium

ROOT = Path(__file__).parents[2]
SEARCHED = {
    "mixed sensitivity": "how_to_choose_a_method.html",
    "margin": "api/loops.html",
    "delay": "14_a_classical_design.html",
    "friction": "effects/index.html",
    "noise": "04_output_feedback.html",
    "uncertain": "api/robust.html",
}
"""What people look for, and how the address of one of the first ten results has to end."""
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("html")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-D", "nb_execution_mode=off"]
    told = subprocess.run(
        [*command, "-b", "html", str(ROOT / "docs"), str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    return told, folder


def test_the_pages_build_without_a_warning(built):
    told, folder = built
    assert told.returncode == 0, told.stderr
    assert (folder / "notebooks" / "01_the_machine.html").exists()
    page = (folder / "theory_certificates.html").read_text(encoding="utf-8")
    assert "<math" in page
    assert "succ" not in page.split("<article")[1].split("</article>")[0]


def test_formulae_hold_no_command_that_nobody_understood(built):
    _, folder = built
    formulae = {
        page.name: re.findall(r"<math.*?</math>", page.read_text(encoding="utf-8"), re.DOTALL)
        for page in folder.glob("theory_*.html")
    }
    assert sum(map(len, formulae.values())) > 100
    assert [(page, f) for page, found in formulae.items() for f in found if "\\" in f] == []


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with chromium.open_browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


class TestInABrowser:
    pytestmark = chromium.marks

    @pytest.mark.parametrize(("words", "page"), SEARCHED.items(), ids=SEARCHED)
    def test_the_search_finds(self, built, browser, words, page):
        _, folder = built
        browser.get((folder / "search.html").as_uri() + "?" + urlencode({"q": words}))
        found = chromium.links_in(browser, "ul.search li > a")
        assert any(link.endswith(page) for link in found[:10]), found[:10]

    @pytest.mark.parametrize("width", chromium.WIDTHS)
    def test_nothing_is_wider_than_its_page(self, built, browser, width):
        _, folder = built
        pages = [p for p in sorted(folder.rglob("*.html")) if "_static" not in p.parts]
        assert len(pages) > 100
        found = {}
        for page in pages:
            chromium.show(browser, page, width)
            wide = chromium.too_wide(browser, width) + chromium.scrolled(browser, width)
            if wide:
                found[str(page.relative_to(folder))] = wide[:3]
        assert found == {}
