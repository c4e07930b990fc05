"""One JSON file per result: whole, exact, and not believed."""

import json

import numpy as np
import pytest

from robustpolish.base.saved import FORMAT, Fields, plain, read_saved, write_saved
from robustpolish.base.versions import __version__
from robustpolish.errors import InvalidInputError

CONTENT = {
    "third": 1 / 3, "big": np.inf, "unknown": np.nan, "matrix": np.array([[1.0, -np.inf]]),
    "none_of_three": np.zeros((0, 3)), "names": ("a", "b"), "whole": np.int64(3), "true": True,
    "table": {"x": 1.5, "y": np.float64(2.5)}, "tables": [{"n": 1}, {"n": 2}],
}  # fmt: skip


@pytest.fixture
def path(tmp_path):
    write_saved(tmp_path / "a.json", "poem", CONTENT)
    return tmp_path / "a.json"


def test_everything_comes_back_to_the_last_bit(path):
    fields = read_saved(path, "poem")
    assert fields.kind == "poem"
    assert fields.number("third") == 1 / 3
    assert fields.number("big") == np.inf
    assert np.isnan(fields.number("unknown"))
    np.testing.assert_array_equal(fields.array("matrix", 1, None), [[1.0, -np.inf]])
    assert fields.array("none_of_three", 0, 3).shape == (0, 3)
    assert fields.texts("names") == ("a", "b")
    assert fields.whole("whole") == 3
    assert fields.truth("true") is True
    assert fields.numbers("table") == {"x": 1.5, "y": 2.5}
    assert [table.whole("n") for table in fields.tables("tables")] == [1, 2]
    assert "third" in fields
    assert "fourth" not in fields


def test_the_file_is_strict_json_with_its_head(path):
    head = json.loads(path.read_text(), parse_constant=pytest.fail)
    found = head["robustpolish"], head["format"], head["version"]
    assert found == ("poem", FORMAT, __version__)


def test_nothing_is_replaced_by_accident(path):
    before = path.read_bytes()
    with pytest.raises(InvalidInputError, match="force"):
        write_saved(path, "poem", {})
    assert path.read_bytes() == before
    write_saved(path, "novel", {}, force=True)
    assert read_saved(path).kind == "novel"


def test_another_kind_or_a_newer_format_is_refused(path):
    with pytest.raises(InvalidInputError, match=r"path: got a poem in a\.json, expected a design"):
        read_saved(path, "design")
    path.write_text(path.read_text().replace(f'"format": {FORMAT}', '"format": 99'))
    with pytest.raises(InvalidInputError, match="Update robustpolish"):
        read_saved(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "a JSON file of robustpolish"),
        ('{"robustpolish": "poem", "format": NaN}', "NaN is not JSON"),
        ("[" * 100_000, "a JSON file of robustpolish"),
        ("[]", "does not say what it holds"),
        ('{"robustpolish": 3}', "does not say what it holds"),
    ],
)
def test_other_files_are_refused(path, text, told):
    path.write_text(text)
    with pytest.raises(InvalidInputError, match=told):
        read_saved(path)


FIELDS = Fields(
    {"text": "a", "number": 1.5, "truth": False, "list": [1, "inf"], "table": {"x": "1"}}, "a.json"
)


@pytest.mark.parametrize(
    ("access", "told"),
    [
        (lambda f: f.raw("missing"), "a.json: got a table without it, expected the key 'missing'"),
        (lambda f: f.number("text"), "a.json: text: got 'a', expected a number"),
        (lambda f: f.number("truth"), "truth: got False, expected a number"),
        (lambda f: f.whole("number"), "number: got 1.5, expected a whole number"),
        (lambda f: f.whole("truth"), "truth: got False, expected a whole number"),
        (lambda f: f.truth("number"), "number: got 1.5, expected true or false"),
        (lambda f: f.text("number"), "number: got 1.5, expected a text"),
        (lambda f: f.text("text", ("b", "c")), "text: got 'a', expected one of b, c"),
        (lambda f: f.texts("list"), "expected a list of texts"),
        (lambda f: f.items("text"), "text: got 'a', expected a list"),
        (lambda f: f.table("list"), "expected a table"),
        (lambda f: f.tables("list"), "a.json: list[0]: got 1, expected a table"),
        (lambda f: f.numbers("table"), "a.json: table: x: got '1', expected a number"),
        (lambda f: f.array("list", 3), "list: got shape (2,), expected numbers of shape (3,)"),
        (lambda f: f.array("truth"), "truth: got False, expected numbers of shape ()"),
    ],
)
def test_what_is_damaged_is_named(access, told):
    with pytest.raises(InvalidInputError) as caught:
        access(FIELDS)
    assert told in str(caught.value)


def test_plain_values():
    assert plain({1: np.array([np.nan, 1.0]), "a": (np.True_, -np.inf)}) == {
        "1": ["nan", 1.0],
        "a": [True, "-inf"],
    }
