"""What is saved comes back as it was, and no file is believed."""

import json
from dataclasses import fields

import numpy as np
import pytest

import robustpolish as rp
from tests import made_up


def plant(dt=0):
    return rp.GeneralizedPlant.from_matrices(
        [[0.9, 0.1], [0.0, 0.5]],
        [[1.0, 0.0], [0.0, 1.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 1 / 3]],
        D12=[[0.0], [1.0]],
        D21=[[0.0, 1.0]],
        dt=dt,
        states=["a", "b"],
        units={"a": "m"},
    )


@pytest.fixture(scope="module", params=["dynamic", "static", "region", "passive", "discrete"])
def design(request):
    if request.param == "dynamic":
        return rp.output_feedback(plant())
    if request.param == "discrete":
        return rp.output_feedback(plant(dt=0.01), norm="h2")
    if request.param == "static":
        return rp.state_feedback(plant(), control_weight=0.1)
    if request.param == "region":
        return rp.mixed_output_feedback(plant(), pole_region=rp.HalfPlane(-0.1), time_limit=5.0)
    places = [("x", "ground")]
    return rp.passive_feedback(
        rp.air_bearing(actuation="force"), places, places,
        stiffness_bound=1e6, damping_bound=1e3, time_limit=5.0,
    )  # fmt: skip


def same_system(one, other):
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.dt == other.dt
    assert one.state_labels == other.state_labels
    assert one.input_labels == other.input_labels
    assert one.output_labels == other.output_labels


def test_a_design_comes_back(design, tmp_path):
    path = tmp_path / "design.json"
    design.save(path)
    again = rp.load(path)
    same_system(again.plant.system, design.plant.system)
    same_system(again.controller, design.controller)
    same_system(again.closed_loop, design.plant.closed_loop(design.controller))
    assert again.plant.units == design.plant.units
    for name in ("norm", "status", "message", "method", "backend", "elapsed"):
        assert getattr(again, name) == getattr(design, name)
    assert again.certificate.valid
    assert again.certificate.achieved == pytest.approx(design.certificate.achieved, rel=1e-6)
    assert len(again.history) == len(design.history)
    for key in ("elements", "pole_regions", "parts", "claim"):
        assert again.details.get(key) == design.details.get(key)
    content = json.loads(path.read_text())
    assert content["version"] == rp.__version__
    assert [item.name for item in tmp_path.iterdir()] == ["design.json"]


def changed(tmp_path, change):
    path = tmp_path / "design.json"
    rp.state_feedback(plant(), control_weight=0.1).save(path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    return path


def weaken(content):
    content["controller"]["D"] = [[0.5 * k for k in row] for row in content["controller"]["D"]]


def destabilise(content):
    content["controller"]["D"] = [[-k for k in row] for row in content["controller"]["D"]]


def flatter(content):
    content["achieved"] *= 0.5
    content["claimed"] = None


def narrow(content):
    content["details"]["pole_regions"] = [{"region": ["HalfPlane", -1e6]}]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (weaken, "design.json"),
        (destabilise, "without a valid certificate: the loop is unstable"),
        (flatter, "achieved: got a norm of"),
        (narrow, "a closed-loop pole outside HalfPlane"),
        (lambda c: c.pop("plant"), "expected the key 'plant'"),
        (lambda c: c["plant"]["system"].update(A=[[1.0]]), r"plant: system: A: got shape \(1, 1\)"),
        (lambda c: c["plant"]["system"].update(A="x"), "system: A: got 'x'"),
        (lambda c: c["plant"].update(controls=1.5), "controls: got 1.5, expected a whole number"),
        (lambda c: c.update(norm="h3"), "norm: got 'h3', expected one of hinf, h2"),
        (lambda c: c.update(status=7), "status: got 7"),
        (lambda c: c.update(history={}), "history: got {}, expected a list"),
        (lambda c: c.update(elapsed=None), "elapsed: got None, expected a number"),
        (lambda c: c["details"].update(a={"nonsense": 1}), "a known kind of detail"),
        (lambda c: c["details"].update(a={"element": []}), "a description of element"),
        (lambda c: c.update(format=99), "format 99 of robustpolish"),
        (lambda c: c.update(robustpolish="poem"), "a poem"),
        (lambda c: c.pop("robustpolish"), "does not say what it holds"),
    ],
)
def test_a_file_is_not_believed(tmp_path, change, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.load(changed(tmp_path, change))


def test_what_is_no_file_of_ours_is_refused(tmp_path):
    for name, text in (("a.json", "{"), ("b.json", "[1]"), ("c.json", '{"a": NaN}')):
        (tmp_path / name).write_text(text)
        with pytest.raises(rp.InvalidInputError, match=name):
            rp.load(tmp_path / name)
    with pytest.raises(rp.InvalidInputError, match="No such file"):
        rp.load(tmp_path / "none.json")
    with pytest.raises(rp.InvalidInputError, match=r"got a plant in p\.json, expected a design"):
        plant().save(tmp_path / "p.json")
        rp.Design.load(tmp_path / "p.json")
    with pytest.raises(rp.InvalidInputError, match=r"\.json"):
        plant().save(tmp_path / "p.pkl")


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
    assert rp.Diagnosis.load(tmp_path / "diagnosis.json").to_dict() == told.to_dict()


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
