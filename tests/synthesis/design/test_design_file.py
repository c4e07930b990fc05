"""A design comes back as it was, certified anew, and no file is believed."""

import copy
import dataclasses
import json

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.saved import read_saved, write_saved
from robustpolish.synthesis.design import design_content, design_from


def plant(dt=0.0):
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
        return rp.mixed_output_feedback(plant(), pole_region=rp.HalfPlane(-0.1), time_limit=1.0)
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
    again = rp.results.Design.load(path)
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


@pytest.fixture(scope="module")
def regulator():
    return rp.state_feedback(plant(), control_weight=0.1)


@pytest.fixture(scope="module")
def written(regulator, tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "design.json"
    regulator.save(path)
    return json.loads(path.read_text())


@pytest.fixture
def changed(written, tmp_path):
    """Return a function that changes the content of a good file and gives its path."""

    def path_of(change):
        content, path = copy.deepcopy(written), tmp_path / "design.json"
        change(content)
        path.write_text(json.dumps(content))
        return path

    return path_of


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
    ],
)
def test_a_file_is_not_believed(changed, change, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.results.Design.load(changed(change))


def test_details_of_every_kind_come_back(regulator, tmp_path):
    details = {
        "gain": np.array([[1.0, 2.0], [3.0, np.inf]]),
        "poles": np.array([-1.0 + 2.0j, -3.0]),
        "pole": np.complex128(-1.0 + 0.5j),
        "steps": [1, 2.5, "three", None, True],
        "inner": {"regions": (rp.Disk(-2.0, 1.5), rp.Sector(0.5, -1.0)), "limit": -np.inf},
        "element": rp.results.PassiveElement("damper", ("x", "ground"), 30.0, "N s/m"),
        "filter": control.StateSpace([[-1.0]], [[2.0]], [[3.0]], [[4.0]], name="filter"),
    }
    path = tmp_path / "design.json"
    unknown = {"function": len, "list of such": [len], "words": np.array(["a"])}
    told = dataclasses.replace(regulator, details={**details, **unknown}, history=(details,))
    write_saved(path, "design", design_content(told))
    design = design_from(read_saved(path, "design"))
    assert set(design.history[0]) == set(details)
    again = design.details
    assert set(again) == set(details)
    for name in ("gain", "poles", "pole"):
        np.testing.assert_array_equal(again[name], details[name])
    assert type(again["pole"]) is complex
    assert again["steps"] == (1, 2.5, "three", None, True)
    assert dict(again["inner"]) == details["inner"]
    assert again["element"] == details["element"]
    same_system(again["filter"], details["filter"])


def test_a_lower_bound_lies_below_the_norm(changed):
    path = changed(lambda c: c.update(lower_bound=2 * c["achieved"]))
    with pytest.raises(
        rp.InvalidInputError, match=r"lower_bound: got .* expected at most the norm"
    ):
        rp.results.Design.load(path)
    # Files of older versions have none.
    assert rp.results.Design.load(changed(lambda c: c.pop("lower_bound"))).lower_bound is None
