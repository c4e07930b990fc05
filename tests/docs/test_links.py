"""Links between the texts of the repository lead somewhere."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def _load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_links_lead_somewhere():
    links = _load(ROOT / "docs" / "list_links.py")
    assert len(links.texts()) > 10
    assert links.broken() == []


def test_a_broken_link_is_found(tmp_path):
    links = _load(ROOT / "docs" / "list_links.py")
    page = ROOT / "docs" / "index.md"
    assert not links.leads_somewhere(page, "no_such_page.md")
    assert not links.leads_somewhere(page, "notebooks/99_missing.md")
    assert links.leads_somewhere(page, "notebooks/01_the_machine.md#answer")
