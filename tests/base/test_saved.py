"""What is saved comes back as it was, and no file is believed."""

import json
from dataclasses import fields

import numpy as np
import pytest

import robustpolish as rp
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
        (lambda c: c.update(verdict="fine"), "verdict: got 'fine'"),
        (lambda c: c["effects"][0].update(kind="magic"), "magic"),
        (lambda c: c["model"].append("x = "), "TOML"),
        (lambda c: c.update(sites=[]), "missing_force: got shape"),
        (lambda c: c["parameters"]["dof.x.mass"].pop("unit"), "expected the key 'unit'"),
        (lambda c: c["ledger"][1]["nrmse"].update(x="bad"), r"ledger\[1\]: nrmse: x: got 'bad'"),
    ],
)
def test_what_another_version_wrote_and_a_bad_diagnosis_are_refused(tmp_path, change, message):
    path = made_up.edited(made_up.diagnosis(), tmp_path / "diagnosis.json", change)
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
    json.loads((tmp_path / "diagnosis.json").read_text(), parse_constant=pytest.fail)
    again = rp.load(tmp_path / "diagnosis.json")
    for field in fields(told):
        one, other = getattr(told, field.name), getattr(again, field.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(other, one)
        else:
            assert other == one, field.name
    assert again.explain() == told.explain()
    assert rp.results.Diagnosis.load(tmp_path / "diagnosis.json").to_dict() == told.to_dict()


def test_a_model_comes_back_from_toml(tmp_path):
    text = made_up.model().to_toml(tmp_path / "slide.toml")
    assert text.startswith(f"# A mechanical model of robustpolish {rp.__version__}")
    assert rp.load(tmp_path / "slide.toml") == made_up.model()


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
def test_other_files_are_refused(tmp_path, text, told):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.load(path)


def test_another_kind_or_ending_is_refused(tmp_path):
    plant().save(tmp_path / "p.json")
    with pytest.raises(rp.InvalidInputError, match=r"got a plant in p\.json, expected a design"):
        rp.results.Design.load(tmp_path / "p.json")
    with pytest.raises(rp.InvalidInputError, match="No such file"):
        rp.load(tmp_path / "none.json")
    with pytest.raises(rp.InvalidInputError, match=r"\.json"):
        plant().save(tmp_path / "p.pkl")
