"""Records and models that do not belong together end in a verdict or a message."""

import json
from dataclasses import replace

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.identification.diagnose import diagnose
from robustpolish.machines.mechanical.parts import Spring
from tests.hidden_effects.cases import Case, model_of, one, records

CASE = Case(
    "odd", one(0.005), [("quadratic_damping", ("x", "ground"), [4.0])], drive=20.0, samples=1500,
    seed=3,
)  # fmt: skip


@pytest.fixture(scope="module")
def data():
    return records(CASE)[0][0]


def checked(model, data):
    found = diagnose(model, data)
    json.dumps(found.to_dict(), allow_nan=False)
    assert found.explain()
    return found


def test_a_record_in_the_wrong_unit_is_refused(data):
    with pytest.raises(InvalidInputError, match="units"):
        diagnose(model_of(CASE), data.assign(x=1e-9 * data["x"]))


def test_a_very_short_record_has_a_verdict(data):
    assert checked(model_of(CASE), data.isel(time=slice(0, 64))).verdict == "adequate"


def test_a_sensor_the_wrong_way_round_is_one_gain(data):
    found = checked(model_of(CASE), data.assign(x=-data["x"]))
    assert [e.kind for e in found.effects] == ["input_gain", "quadratic_damping"]
    gain = found.effects[0].parameters["gain"]
    assert gain.value == pytest.approx(-1, abs=0.05)


def test_stiffness_ten_times_too_large_is_mended(data):
    model = replace(model_of(CASE), springs=(Spring(("x", "ground"), 30000.0),))
    found = checked(model, data)
    assert [e.kind for e in found.effects] == ["quadratic_damping"]
    values = found.model.parameters
    assert values["spring[0].stiffness"] / values["dof.x.mass"] == pytest.approx(3000, rel=0.02)


def test_a_late_clock_changes_nothing(data):
    later = data.assign_coords(time=data["time"] + 1e6)
    one, other = (checked(model_of(CASE), d).effects[0] for d in (data, later))
    assert one.kind == other.kind == "quadratic_damping"
    size = other.parameters["coefficient"].value
    assert size == pytest.approx(one.parameters["coefficient"].value, rel=1e-3)


def test_a_late_input_is_found():
    late = Case("late", one(), [("input_delay", ("F_x",), [0.005])], drive=10.0, samples=3000)
    found = diagnose(model_of(late), records(late)[0][0])
    assert [e.kind for e in found.model.effects] == ["input_delay"]
    assert found.effects[0].parameters["delay"].value == pytest.approx(0.005, rel=0.01)


def test_noise_free_records_are_no_trouble():
    quiet = replace(CASE, noise_db=200.0)
    found = checked(model_of(quiet), records(quiet)[0][0])
    assert [e.kind for e in found.effects] == ["quadratic_damping"]
    assert np.isfinite(found.effects[0].parameters["coefficient"].stderr)


@pytest.mark.long
def test_a_hold_that_shows_only_beside_an_effect_is_no_delay():
    """As long as a cubic spring is missing, what inputs do between samples is nothing to see."""
    case = Case(
        "held", one(), [("cubic_stiffness", ("x", "ground"), [2e6])], seed=44, drive=20.0,
        samples=5000, noise_db=54.0, colour=0.9, excitation="sweep", held=True,
    )  # fmt: skip
    found = diagnose(model_of(case), records(case)[0][0])
    assert [effect.kind for effect in found.effects] == ["cubic_stiffness"]
    held = [e for e in found.model.effects if e.kind == "input_hold"]
    assert [e.values["order"] for e in held] == [0.0]
