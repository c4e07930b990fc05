"""What is saved comes back as it was, and no file is believed."""

import json
from dataclasses import fields

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.saved import FORMAT, Fields, read_saved, write_saved
from robustpolish.base.versions import __version__
from robustpolish.errors import InvalidInputError
from tests import made_up


def plant():
    return rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def test_each_kind_is_loaded_by_one_name(tmp_path):
    made = {
        "plant": plant(),
        "design": rp.given_controller(plant(), [[0.0]]),
        "sampled": rp.given_controller(plant(), [[0.0]]).discretize(0.1),
        "diagnosis": made_up.diagnosis(),
    }
    for name, result in made.items():
        result.save(tmp_path / f"{name}.json")
        assert type(rp.load(tmp_path / f"{name}.json")) is type(result)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(format=99), "format 99 of robustpolish.*Update robustpolish"),
        (lambda c: c.update(robustpolish="poem"), "a poem"),
    ],
)
def test_what_another_version_wrote_is_refused(tmp_path, change, message):
    path = tmp_path / "plant.json"
    plant().save(path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.load(path)


def test_nothing_is_replaced_by_accident(tmp_path):
    path = tmp_path / "plant.json"
    plant().save(path)
    before = path.read_bytes()
    with pytest.raises(rp.InvalidInputError, match="force=True"):
        rp.air_bearing().save(path)
    assert path.read_bytes() == before
    rp.air_bearing().save(path, force=True)
    assert rp.load(path).nx == 12


def test_a_diagnosis_comes_back(tmp_path):
    told = made_up.diagnosis()
    told.save(tmp_path / "diagnosis.json")
    again = rp.load(tmp_path / "diagnosis.json")
    for field in fields(told):
        one, other = getattr(told, field.name), getattr(again, field.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(other, one)
        else:
            assert other == one, field.name
    assert again.explain() == told.explain()
    assert rp.results.Diagnosis.load(tmp_path / "diagnosis.json").to_dict() == told.to_dict()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(verdict="fine"), "verdict: got 'fine'"),
        (lambda c: c["effects"][0].update(kind="magic"), "magic"),
        (lambda c: c["model"].append("x = "), "TOML"),
        (lambda c: c.update(sites=[]), "missing_force: got shape"),
        (lambda c: c["parameters"]["dof.x.mass"].pop("unit"), "expected the key 'unit'"),
        (lambda c: c["ledger"][1]["nrmse"].update(x="bad"), r"ledger\[1\]: nrmse: x: got 'bad'"),
    ],
)
def test_a_bad_diagnosis_is_refused(tmp_path, change, message):
    path = tmp_path / "diagnosis.json"
    made_up.diagnosis().save(path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.load(path)


def test_a_model_comes_back_from_toml(tmp_path):
    text = made_up.model().to_toml(tmp_path / "slide.toml")
    assert text.startswith(f"# A mechanical model of robustpolish {rp.__version__}")
    assert rp.load(tmp_path / "slide.toml") == made_up.model()


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


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"a": NaN}', "a.json"),
        ("{", "a JSON file of robustpolish"),
        ('{"robustpolish": "poem", "format": NaN}', "NaN is not JSON"),
        ("[" * 100_000, "a JSON file of robustpolish"),
        ("[]", "does not say what it holds"),
        ('{"robustpolish": 3}', "does not say what it holds"),
    ],
)
def test_other_files_are_refused(path, text, told):
    path.write_text(text)
    for read in (read_saved, rp.load):
        with pytest.raises(InvalidInputError, match=told):
            read(path)


def test_another_kind_or_ending_is_refused(tmp_path):
    plant().save(tmp_path / "p.json")
    with pytest.raises(InvalidInputError, match=r"got a plant in p\.json, expected a design"):
        rp.results.Design.load(tmp_path / "p.json")
    with pytest.raises(InvalidInputError, match="No such file"):
        rp.load(tmp_path / "none.json")
    with pytest.raises(InvalidInputError, match=r"\.json"):
        plant().save(tmp_path / "p.pkl")


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
