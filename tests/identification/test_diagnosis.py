"""Results of diagnoses and refits: words, plain data, pictures, files, steps."""

import json
from dataclasses import fields, replace

import lmfit
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.identification.diagnosis import headline
from robustpolish.identification.findings import (
    FoundEffect,
    IndistinguishablePair,
    RankedCandidate,
    Value,
)
from tests import made_up
from tests.identification.oscillators import PLACE, oscillator, record


def test_it_shows_what_was_found_and_how_the_error_fell():
    shown = repr(made_up.diagnosis())
    rows = [line.split() for line in shown.splitlines()]
    assert shown.startswith("The model lacked: Coulomb friction at x, ground.")
    assert ["coulomb_friction", "x,", "ground", "force", "3.100", "0.020", "N"] in rows
    assert ["refit", "0.31"] in rows
    assert "The effects explain 99 % of the error above the noise." in shown
    assert "Added effects" not in repr(replace(made_up.diagnosis(), effects=()))


def test_it_draws_how_the_error_fell():
    assert made_up.diagnosis().plot(output="x").get_ylabel() == "relative error of x"
    with pytest.raises(rp.InvalidInputError, match="output"):
        made_up.diagnosis().plot(output="F")


def test_it_draws_what_is_still_missing_over_time():
    found = made_up.diagnosis()
    ax = found.plot_missing_force()
    (line,) = ax.lines
    np.testing.assert_allclose(np.asarray(line.get_ydata()), found.missing_force[0])
    assert "N]" in ax.get_ylabel()
    turning = replace(found.model, dofs=(rp.Dof("x", 2.0, rotational=True),))
    assert "N m]" in replace(found, model=turning).plot_missing_force().get_ylabel()


def test_an_existing_file_is_not_replaced_unasked(tmp_path):
    found, path = made_up.diagnosis(), tmp_path / "slide.json"
    found.save(path)
    with pytest.raises(rp.InvalidInputError, match="exist"):
        found.save(path)
    replace(found, verdict="unexplained").save(path, force=True)
    assert rp.results.Diagnosis.load(path).verdict == "unexplained"


def test_the_effects_are_the_headline():
    found = made_up.diagnosis()
    assert headline(found) == "The model lacked: Coulomb friction at x, ground."
    gain = FoundEffect("input_gain", ("F",), {"gain": Value(1.2, 0.01, "1")})
    both = replace(found, effects=(*found.effects, gain))
    assert headline(both).startswith("The model lacked: Coulomb friction at x, ground and ")
    assert headline(both).endswith(f"{rp.effects.lookup('input_gain').title} at F.")
    part = replace(found, verdict="partly_explained")
    assert headline(part) == f"{headline(found)} And something else is missing."


def test_the_headline_says_that_far_more_than_noise_is_left():
    found = made_up.diagnosis()
    loud, quiet = (
        replace(found, ledger=rp.results.Ledger(noise_floor={"x": floor}).add("base", {"x": 0.5}))
        for floor in (0.1, 0.3)
    )
    assert headline(loud) == f"{headline(quiet)} Far more than noise is left."
    part = replace(loud, verdict="partly_explained")
    assert headline(part) == f"{headline(quiet)} And something else is missing."


VERDICTS = {
    "adequate": "is noise",
    "parameters": "numbers were wrong",
    "unexplained": "no effect of the catalogue",
    "missing_effect": "lacks a physical effect",
    "partly_explained": "a part of the error is left",
}


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_is_a_sentence(verdict):
    found = replace(made_up.diagnosis(), verdict=verdict, effects=())
    assert VERDICTS[verdict] in headline(found)


def test_it_says_what_was_found_why_and_what_to_check():
    text = " ".join(made_up.diagnosis().explain().split())  # lines are folded
    kind = rp.effects.lookup("coulomb_friction")
    for part in (
        "The effects explain 99 % of the error above the noise.",
        "1. Coulomb friction at x, ground",
        "force = 3.100 +- 0.020 N",
        kind.looks_like,
        *(f"Check: {check}" for check in kind.checks),
        *(f"See {reference}" for reference in kind.references),
        "refit: x 0.31",
        "coulomb_friction: x 0.0123",
        "noise floor: x 0.01",
        "coulomb_friction at x, ground and stribeck_friction at x, ground. Move slowly",
    ):
        assert part in text
    assert "not reproducible" not in text
    assert "not reproducible" in replace(made_up.diagnosis(), reproducible=False).explain()


def test_what_is_not_known_is_null():
    told = json.loads(json.dumps(made_up.diagnosis().to_dict(), allow_nan=False))
    assert told["parameters"]["spring[0].stiffness"]["stderr"] is None
    assert [c["nrmse_held_out"] for c in told["candidates"]] == [0.02, None]
    assert told["candidates"][1]["remark"] == "not sensible"
    number = {"value": 3.1, "stderr": 0.02, "unit": "N"}
    (effect,) = told["effects"]
    assert effect == {
        "kind": "coulomb_friction", "at": ["x", "ground"], "parameters": {"force": number}
    }  # fmt: skip
    alike = [place["kind"] for place in told["indistinguishable"][0]]
    assert alike == ["coulomb_friction", "stribeck_friction"]
    assert told["free_run_reproducible"] is True
    found = made_up.diagnosis()
    diverged = replace(found, ledger=found.ledger.add("wild", {"x": np.inf}))
    assert diverged.to_dict()["ledger"][-1] == {"step": "wild", "nrmse": {"x": None}}


FIFTH = "k5*q**5 with k5 = "


def test_the_words_tell_the_law_and_no_coefficients():
    told = made_up.unknown_law()
    assert headline(told) == (
        "The model lacked a force that no catalogue describes: Coulomb friction at x, ground and "
        "Learned law over displacement at x, ground."
    )
    text = told.explain()
    assert FIFTH in text
    assert "It hardens" in text
    assert "force = 3.100 +- 0.020 N" in text
    assert "c3 = " not in text
    assert "c3" not in str(told)
    assert "largest force" in str(told)


def test_plain_data_hold_the_law():
    content = json.loads(json.dumps(made_up.unknown_law().to_dict(), allow_nan=False))
    assert content["verdict"] == "unknown_law"
    (law,) = content["laws"]
    assert law["kind"] == "learned_stiffness_9"
    assert law["formula"].startswith(FIFTH)
    assert made_up.diagnosis().to_dict()["laws"] == []


ERRORS = {"dof.x.mass": 0.1, "spring[0].stiffness": 6e4, "damper[0].damping": np.inf}
UNITS = dict(zip(ERRORS, ("kg", "N/m", "N s/m"), strict=True))


def refitted(model=None):
    keys = list(ERRORS)
    covariance = xr.DataArray(np.diag([0.01, 36e8, np.inf]), {"parameter": keys, "other": keys})
    return rp.results.Refit(
        model=model or made_up.model(),
        parameters=lmfit.Parameters(),
        units=UNITS,
        nrmse={"x": 0.0125},
        undetermined=("spring[0].stiffness", "damper[0].damping"),
        stderr=ERRORS,
        covariance=covariance,
    )


def test_it_shows_values_errors_and_what_the_data_leave_open():
    rows = [line.split() for line in repr(refitted()).splitlines()]
    assert rows[0] == ["Refit"]
    assert ["dof.x.mass", "2.00", "0.10", "kg", "yes"] in rows
    assert ["spring[0].stiffness", "8.0e+04", "6.0e+04", "N/m", "no"] in rows
    assert any(row[0] == "damper[0].damping" and row[-1] == "no" for row in rows)
    assert ["x", "0.0125"] in rows


def test_it_draws_errors_relative_to_their_values():
    """0.1 of 2 kg and 6e4 of 8e4 N/m; what is not known at all, or is nought, has no bar."""
    ax = refitted().plot()
    widths = sorted(bar.get_width() for bar in ax.patches if np.isfinite(bar.get_width()))
    np.testing.assert_allclose([w for w in widths if w][:2], [5.0, 75.0])
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert "dof.x.mass = 2 kg" in labels
    nought = refitted(made_up.model().with_parameters({"damper[0].damping": 0.0}))
    assert nought.plot().get_xlabel() == "relative standard error [%]"


KEYS = ["dof.x.mass", "spring[0].stiffness", "effect[0].force"]


def told():
    """A diagnosis with a covariance; one of its numbers is not seen by the data."""
    matrix = np.diag([1e-4, np.inf, 4e-4])
    matrix[0, 2] = matrix[2, 0] = 1e-5 / 3
    covariance = xr.DataArray(matrix, {"parameter": KEYS, "other": KEYS}, ("parameter", "other"))
    return replace(made_up.diagnosis(), covariance=covariance, reproducible=False)


def test_older_files_are_read(tmp_path):
    path = made_up.edited(told(), tmp_path / "slide.json", lambda c: c.pop("covariance"))
    assert rp.results.Diagnosis.load(path).covariance is None


def test_a_damaged_covariance_is_refused(tmp_path):
    path = tmp_path / "slide.json"
    made_up.edited(told(), path, lambda content: content["covariance"]["values"].pop())
    with pytest.raises(rp.InvalidInputError, match="values"):
        rp.results.Diagnosis.load(path)


def test_a_loaded_diagnosis_says_how_uncertain_a_design_is(tmp_path):
    def plant_of(model):
        return model.without_effects().linearize(measured="state")

    before = replace(told(), covariance=told().covariance.copy(data=np.diag([1e-4, 1e4, 4e-4])))
    before.save(tmp_path / "slide.json")
    after = rp.load(tmp_path / "slide.json")
    design = rp.state_feedback(plant_of(before.model), control_weight=1e-3)
    one, other = (
        rp.simulation.check_robustness(design, found, plant_of=plant_of, samples=5)
        for found in (before, after)
    )
    assert one.keys == other.keys == tuple(KEYS)
    np.testing.assert_array_equal(other.norms, one.norms)
    assert np.std(one.norms) > 0


def told_of_its_own():
    """A diagnosis that found, tried and confused effects that only its formulas tell."""
    law = rp.effects.own_kind({"formula": "f = -k*q**5", "units": {"k": "N/m^5"}})
    drag = rp.effects.own_kind(
        {
            "formula": "f = -c*v**3", "units": {"c": "N s^3/m^3"}, "name": "drag",
            "bounds": {"c": [0.0, np.inf]},
        }
    )  # fmt: skip
    effect = rp.effects.Effect.of(law, made_up.PLACE, {"k": 3.0})
    found = FoundEffect(effect.kind, effect.at, {"k": Value(3.0, 0.1, "N/m^5")}, effect.own)
    tried = [
        RankedCandidate(law.kind, effect.at, 0.02, 812.5, 1, {"k": 3.0}, "", effect.own),
        RankedCandidate("drag", effect.at, np.inf, 9.1, 1, {"c": 1.0}, "screened only", drag),
    ]
    confusion = IndistinguishablePair(
        effect, rp.effects.Effect.of(drag, made_up.PLACE, {"c": 1.0}), "Move slowly."
    )
    return replace(
        made_up.diagnosis(),
        model=made_up.model().with_effect(law, made_up.PLACE, {"k": 3.0}),
        effects=(found,),
        candidates=(*made_up.diagnosis().candidates, *tried),
        indistinguishable=(confusion,),
    )


@pytest.mark.parametrize("make", [told, made_up.unknown_law, told_of_its_own])
def test_everything_comes_back(make, tmp_path):
    before, catalogue = make(), list(rp.effects.kinds())
    before.save(tmp_path / "slide.json")
    after = rp.results.Diagnosis.load(tmp_path / "slide.json")
    assert isinstance(after, rp.results.Diagnosis)
    for field in fields(before):
        one, other = getattr(before, field.name), getattr(after, field.name)
        if isinstance(one, xr.DataArray):
            xr.testing.assert_identical(other, one)
        elif isinstance(one, np.ndarray):
            np.testing.assert_array_equal(other, one)
        else:
            assert other == one, field.name
    assert after.explain() == before.explain()
    assert after.to_dict() == before.to_dict()
    assert repr(after) == repr(before)
    assert [law.describe() for law in after.laws] == [law.describe() for law in before.laws]
    after.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "slide.json").read_bytes()
    assert list(rp.effects.kinds()) == catalogue  # effects of one's own are offered to nobody


def test_effects_of_ones_own_are_told_by_their_formula():
    assert "f = -k*q**5 at x, ground" in told_of_its_own().explain()


@pytest.mark.parametrize("damage", ["f = -k*q^5", 3, None, "f = __import__('os')"])
def test_a_damaged_effect_of_ones_own_is_refused(tmp_path, damage):
    def change(content):
        content["candidates"][2]["own"]["formula"] = damage

    path = made_up.edited(told_of_its_own(), tmp_path / "own.json", change)
    with pytest.raises(rp.InvalidInputError, match="formula"):
        rp.load(path)


CUBIC = 2e4
DATA = record(cubic=CUBIC, start=(0.05, 0.0), noise=0.01)
MODELS = (
    oscillator(stiffness=380.0),
    oscillator(),
    oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": CUBIC}),
)


def diagnosis(models=MODELS, **changes):
    found = made_up.diagnosis()
    steps = ("base", "refit", "cubic_stiffness")
    ledger = rp.results.Ledger(noise_floor={"x": 0.01})
    for step, model in zip(steps, models, strict=True):
        ledger = ledger.add(step, {"x": 0.1}, model)
    return replace(found, model=MODELS[-1], ledger=ledger, **changes)


@pytest.fixture(scope="module")
def runs():
    return rp.identification.step_runs(diagnosis(), DATA)


def test_every_step_has_the_run_before_and_after_it(runs):
    assert [run.step for run in runs] == ["base", "refit", "cubic_stiffness"]
    assert runs[0].before is None
    assert runs[1].before is runs[0].after
    assert [run.after.model for run in runs] == list(MODELS)
    last = runs[-1]
    assert last.after.outputs["x"].nrmse == pytest.approx(0.01, rel=0.05)
    assert last.before.outputs["x"].nrmse > 0.1
    assert {run.after.method for run in runs} == {"free run"}


def test_the_stretch_is_where_the_step_did_most(runs):
    stretch = runs[-1].stretch()
    lasts = stretch.stop - stretch.start
    gain = (runs[-1].before.residual["x"] ** 2 - runs[-1].after.residual["x"] ** 2).cumsum()
    inside = float(gain.sel(time=stretch)[-1] - gain.sel(time=stretch)[0])
    shifted = gain.values[round(lasts * 500) :] - gain.values[: -round(lasts * 500)]
    assert inside == pytest.approx(shifted.max(), rel=0.02)
    # eight swings of the strongest line, near the mode at 3.2 Hz or the decay's first amplitude
    assert lasts == pytest.approx(8 / 3.2, rel=0.25)


def test_the_panels_show_measured_before_after_and_what_is_left(runs):
    run = runs[-1]
    stretch = run.stretch()
    above, below, whole = run.plot_panels().axes
    labels = [str(line.get_label()) for line in above.lines]
    assert labels == ["measured", "before", "after"]
    np.testing.assert_allclose(
        np.asarray(above.lines[0].get_ydata()), DATA["x"].sel(time=stretch).values
    )
    left = {str(line.get_label()): np.asarray(line.get_ydata()) for line in below.lines}
    np.testing.assert_allclose(
        left["after"], run.after.residual["x"].sel(time=stretch).values, atol=1e-12
    )
    assert left["before"].std() > 5 * left["after"].std()
    assert len(whole.lines[0].get_xdata()) > len(below.lines[0].get_xdata())
    first = runs[0].plot_panels().axes[0]
    assert [str(line.get_label()) for line in first.lines] == ["measured", "after"]
    assert run.plot().get_xlabel() == "time [s]"
    assert "cubic_stiffness, free run" in repr(run)
    with pytest.raises(rp.InvalidInputError, match="output"):
        run.plot_panels(output="F")


def test_a_model_whose_long_runs_judge_nothing_runs_in_windows():
    found = rp.identification.step_runs(diagnosis(reproducible=False), DATA)
    assert {run.after.method for run in found} == {"windows"}
    assert found[0].after.span == pytest.approx(4000 // 25 / 500)


def test_steps_of_older_files_have_no_model_and_are_left_out():
    old = diagnosis(models=(None, None, MODELS[-1]))
    (only,) = rp.identification.step_runs(old, DATA)
    assert (only.step, only.before) == ("cubic_stiffness", None)
