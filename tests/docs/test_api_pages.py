"""Nothing public is missing from the API reference."""

import importlib.util
import inspect
import sys
from pathlib import Path

import pytest

import robustpolish

EXTENSIONS = Path(__file__).parents[2] / "docs" / "extensions"


@pytest.fixture(scope="module")
def api_pages():
    spec = importlib.util.spec_from_file_location("api_pages", EXTENSIONS / "api_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.modules.pop("api_pages", None)


def test_every_public_name_is_listed_as_it_is_used(api_pages):
    text = "\n".join(api_pages.pages().values()).split()
    missing = [
        name
        for name in robustpolish.__all__
        if not inspect.ismodule(getattr(robustpolish, name)) and f"robustpolish.{name}" not in text
    ]
    assert missing == []


def test_the_index_names_every_page(api_pages):
    index = (EXTENSIONS.parent / "api.md").read_text(encoding="utf-8")
    assert all(f"api/{name.removesuffix('.rst')}\n" in index for name in api_pages.pages())
