"""What is said of records of a machine, and what is not said of good ones."""

import numpy as np
import pytest

from robustpolish.identification.compare import compare
from robustpolish.identification.sanity import sanity_warnings
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.hidden_effects.cases import model_of, records
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.drawn import drawn_cases
from tests.identification.oscillators import oscillator, record

RECORD = record(start=(0.05, 0.0), noise=0.01)


def changed(data, **columns):
    return data.assign(
        {name: ("time", values, data[name].attrs) for name, values in columns.items()}
    )


X, F = RECORD["x"].values, RECORD["F"].values
LIMIT = 0.7 * np.abs(X).max()
FROZEN = X.copy()
FASTEST = int(np.argmax(np.abs(np.diff(X[100:3000])))) + 100
FROZEN[FASTEST - 4 : FASTEST + 12] = FROZEN[FASTEST - 4]

WRONG = {
    "mm": (changed(RECORD, x=1e3 * X), "x is .* times as large .* mm read as m"),
    "kN": (changed(RECORD, F=1e-3 * F), "x is .* times as large"),
    "sign": (changed(RECORD, x=-X), "x moves against the model"),
    "input's sign": (changed(RECORD, F=-F), "x moves against the model"),
    "clipped": (changed(RECORD, x=np.clip(X, -LIMIT, LIMIT)), "x sticks at its extremes"),
    "dropout": (changed(RECORD, x=FROZEN), "x stands still for 16 samples"),
    "noise": (changed(RECORD, x=np.random.default_rng(0).standard_normal(X.size)), "no motion"),
    "mean": (changed(RECORD, x=X + 10 * np.std(X)), "the mean of x is"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_comparison_says_what_looks_wrong(case):
    data, message = WRONG[case]
    comparison = compare(oscillator(), data)
    said = sanity_warnings(comparison.model, comparison.data, comparison.simulated)
    assert len(said) == 1
    assert set(said) <= set(comparison.notes)
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(said[0])


def test_nothing_is_said_of_a_good_record_or_a_wrong_model():
    for model in (oscillator(), oscillator(stiffness=700.0), oscillator(damping=20.0)):
        found = compare(model, RECORD)
        assert sanity_warnings(model, found.data, found.simulated) == ()


@pytest.mark.parametrize("stiffness", [0.0, 4.0, 40.0, 4000.0, 40_000.0])
def test_a_spring_that_is_missing_or_far_off_is_no_wrong_sign(stiffness):
    model = oscillator(stiffness=stiffness) if stiffness else oscillator(springs=[])
    assert [s for s in sanity_warnings(model, RECORD) if "against" in s or "exchanged" in s] == []
    assert [s for s in sanity_warnings(model, RECORD) if "times as large" in s] == []


def test_exchanged_sensors():
    ground = "ground"
    model = MechanicalModel(
        [Dof("a", 1.0), Dof("b", 2.0)],
        [Spring(("a", ground), 800.0), Spring(("a", "b"), 400.0), Spring(("b", ground), 100.0)],
        [Damper(("a", ground), 2.0), Damper(("a", "b"), 2.0)],
        [Input("F", ("a", ground))],
        [Output("xa", ("a", ground)), Output("xb", ("b", ground))],
    )
    data = compare(model, RECORD.assign(xa=RECORD["x"], xb=RECORD["x"])).simulated
    data = data.assign(F=RECORD["F"])
    assert sanity_warnings(model, data) == ()
    swapped = data.rename(xa="xb", xb="xa")
    (said,) = sanity_warnings(model, swapped)
    assert said.startswith("xa and xb look exchanged")


def test_a_fit_that_moved_by_decades():
    fitted = oscillator(stiffness=4e8)
    (said,) = sanity_warnings(oscillator(), RECORD, fitted=fitted)
    assert "spring[0].stiffness from 400 to 4e+08, by 6.0 decades, as milliseconds" in said


@pytest.mark.parametrize("cases", [all_cases, lambda: drawn_cases(2026)], ids=["hidden", "drawn"])
def test_no_false_alarm_on_machines_with_missing_effects(cases):
    said = {}
    for case in cases()[::3]:
        (data, _), _ = records(case)
        found = sanity_warnings(model_of(case), data)
        if found:
            said[case.name] = found
    assert said == {}


@pytest.mark.shared
@pytest.mark.parametrize("part", ["train", "test"])
def test_no_false_alarm_on_measured_machines(shared, part):
    folders = sorted((shared / "data/real").iterdir())
    assert folders
    for folder in folders:
        model = MechanicalModel.from_toml(folder / "model.toml")
        found = compare(model, folder / f"{part}.csv")
        assert sanity_warnings(model, found.data, found.simulated) == (), folder.name
