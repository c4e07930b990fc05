"""Diagnoses of machines whose missing effect is known."""

import json
import re
from dataclasses import replace
from functools import lru_cache
from importlib import import_module

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.signal import butter, lfilter, sosfilt

import robustpolish as rp
from robustpolish.identification.policy import POLICY
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.oscillators import PLACE, oscillator
from tests.identification.oscillators import record as oscillator_record

CUBIC = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=4000, seed=1)


@pytest.fixture(scope="module")
def cubic():
    (data, _), (unseen, noise) = records(CUBIC)
    model = model_of(replace(CUBIC, wrong={"mass": 0.03, "stiffness": 0.1}))
    return rp.diagnose(model, data), unseen, noise


def test_names_the_missing_spring(cubic):
    diagnosis = cubic[0]
    assert diagnosis.verdict == "missing_effect"
    assert [(e.kind, e.at) for e in diagnosis.effects] == [("cubic_stiffness", PLACE)]
    found = diagnosis.effects[0].parameters["stiffness"]
    mass = diagnosis.parameters["dof.x.mass"].value
    assert found.value / mass == pytest.approx(4e6, rel=0.02)
    assert 0 < found.stderr < 0.05 * found.value
    assert found.unit == "N/m^3"


def test_the_error_falls_to_the_noise(cubic):
    diagnosis = cubic[0]
    steps = [entry.step for entry in diagnosis.ledger.entries]
    assert steps == ["base", "refit", "cubic_stiffness at x, ground"]
    errors = [entry.nrmse["x"] for entry in diagnosis.ledger.entries]
    assert errors[0] > errors[1] > 5 * errors[2]
    assert errors[2] == pytest.approx(10 ** (-30 / 20), rel=0.05)
    assert diagnosis.noise_floor["x"] == pytest.approx(errors[2], rel=0.1)


def test_the_effect_extrapolates(cubic):
    diagnosis, unseen, noise = cubic
    assert rp.compare(diagnosis.model, unseen).outputs["x"].rmse < 1.1 * noise["x"]


def test_json_is_what_programs_rely_on(cubic):
    content = json.loads(json.dumps(cubic[0].to_dict(), allow_nan=False))
    assert content["effects"][0]["at"] == ["x", "ground"]
    assert set(content["effects"][0]["parameters"]["stiffness"]) == {"value", "stderr", "unit"}
    assert content["candidates"][0]["nrmse_held_out"] < 0.1
    assert content["ledger"][0]["step"] == "base"
    assert set(content["noise_floor"]) == {"x"}


def test_it_explains_itself(cubic):
    text = cubic[0].explain()
    for part in ("Cubic stiffness at x, ground", "Check:", "noise floor", "N/m^3"):
        assert part in text


def test_models_and_maps_of_steps_come_back_from_files(cubic, tmp_path):
    found = cubic[0]
    found.save(tmp_path / "found.json")
    again = rp.load(tmp_path / "found.json")
    assert [e.model for e in again.ledger.entries] == [e.model for e in found.ledger.entries]
    assert again.ledger.entries[-1].model == found.model
    assert again.notes == found.notes
    assert len(found.maps) == len(again.maps) > 0
    for before, after in zip(found.maps, again.maps, strict=True):
        assert (before.at, before.size, before.follows) == (after.at, after.size, after.follows)
        np.testing.assert_array_equal(before.surface["force"], after.surface["force"])
        assert before.unit == after.unit == "N"
        assert after.surface["velocity"].attrs == {"units": "m/s"}


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_nothing_is_named_where_nothing_is_missing(colour):
    case = Case("nothing", one(), drive=10.0, samples=4000, seed=2, colour=colour, noise_db=20)
    (data, _), _ = records(case)
    assert rp.diagnose(model_of(case), data).verdict == "adequate"
    wrong = model_of(replace(case, wrong={"stiffness": 0.15, "damping": 0.5}))
    diagnosis = rp.diagnose(wrong, data)
    assert diagnosis.verdict == "parameters"
    assert not diagnosis.effects
    assert diagnosis.model.parameters["spring[0].stiffness"] == pytest.approx(3000, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("held", [False, True])
def test_a_drift_is_learned_where_no_effect_explains_it(held):
    case = Case(
        "drift", one(), [("drifting_stiffness", PLACE, [800.0, 8.0])], drive=10.0, samples=4000,
        seed=3, held=held,
    )  # fmt: skip
    (data, _), _ = records(case)
    diagnosis = rp.diagnose(model_of(case), data)
    assert diagnosis.verdict == "unknown_law"
    (law,) = diagnosis.laws
    assert law.quantity == "stiffness"
    assert law.formula().numbers["a1"] == pytest.approx(100.0, rel=0.02)
    assert diagnosis.missing_force.shape == (1, 4000)


def friction_and_spring():
    effects = [("quadratic_damping", PLACE, [30.0]), ("cubic_stiffness", PLACE, [4e6])]
    case = Case("two", one(), effects, drive=8.0, samples=1500, seed=1)
    return model_of(case), records(case)[0][0]


def test_an_interrupted_search_gives_what_it_has_found(tmp_path):
    """Ctrl-C at any moment: the best so far is a whole result, which files hold."""

    def interrupt(text):
        if text.startswith("found"):
            raise KeyboardInterrupt

    model, data = friction_and_spring()
    found = rp.diagnose(model, data, progress=interrupt)
    assert found.status == "stopped"
    assert {e.kind for e in found.effects} <= {"quadratic_damping", "cubic_stiffness"}
    assert found.effects
    assert found.ledger.entries[-1].nrmse["x"] < found.ledger.entries[0].nrmse["x"]
    found.save(tmp_path / "found.json")
    again = rp.results.Diagnosis.load(tmp_path / "found.json")
    assert (again.status, again.effects) == (found.status, found.effects)


def test_a_time_limit_ends_the_search():
    model, data = friction_and_spring()
    found = rp.diagnose(model, data, time_limit=1e-6)
    assert (found.status, found.effects) == ("stopped", ())
    assert rp.diagnose(model, data, time_limit=1e6).status == "complete"


def test_the_last_line_of_the_ledger_is_what_a_comparison_says():
    model, data = friction_and_spring()
    found = rp.diagnose(model, data)
    again = rp.MechanicalModel.from_toml(found.model.to_toml())
    told = rp.compare(again, data).outputs["x"].nrmse
    assert found.ledger.entries[-1].nrmse["x"] == told


def test_no_more_effects_are_added_than_are_asked_for():
    model, data = friction_and_spring()
    assert not rp.diagnose(model, data, max_effects=0).effects
    assert not rp.diagnose(model, data, good_enough=2.0).effects
    with pytest.raises(rp.InvalidInputError, match="good_enough"):
        rp.diagnose(model, data, good_enough={"y": 1.0})


def test_a_search_that_comes_to_its_limit_of_work_ends_with_what_it_has_and_says_so(monkeypatch):
    """The effects need more work; with it nothing is said of a limit."""
    model, data = friction_and_spring()
    whole = rp.diagnose(model, data)
    little = replace(POLICY, work=1e3)
    monkeypatch.setattr(import_module("robustpolish.identification.diagnose"), "POLICY", little)
    ended, again = (rp.diagnose(model, data) for _ in range(2))
    assert not ended.effects
    assert [reason for reason in ended.reasons if "limit of work" in reason]
    assert ended.to_dict() == again.to_dict()
    assert {e.kind for e in whole.effects} == {"quadratic_damping", "cubic_stiffness"}
    assert not [reason for reason in whole.reasons if "limit of work" in reason]


@pytest.mark.parametrize(
    ("kind", "number", "name"),
    [("input_saturation", 12.0, "limit"), ("input_dead_zone", 1.5, "width")],
)
def test_names_what_an_actuator_makes_of_its_commands(kind, number, name):
    case = Case(kind, one(), [(kind, ("F_x",), [number])], drive=8.0, samples=4000, seed=1)
    (data, _), _ = records(case)
    model = model_of(replace(case, wrong={"mass": 0.03, "stiffness": 0.1}))
    diagnosis = rp.diagnose(model, data)
    assert [(e.kind, e.at) for e in diagnosis.effects] == [(kind, ("F_x",))]
    found = diagnosis.effects[0].parameters[name]
    assert found.value == pytest.approx(number, rel=0.02)
    assert 0 < found.stderr < 0.05 * found.value
    assert found.unit == "N"


def test_a_kind_whose_numbers_are_left_open_gives_way_to_a_simpler_one():
    """A real damper: its loops have a force and a stiffness, but hardly a shape of their own."""
    record = rp.datasets.mr_damper().isel(time=slice(0, 940))
    motion = [rp.Input("x", PLACE, "displacement"), rp.Input("v", PLACE, "velocity")]
    model = rp.MechanicalModel(
        [rp.Dof("x", 0.0)], [rp.Spring(PLACE, 100.0)], [rp.Damper(PLACE, 1500.0)], motion,
        [rp.Output("F", PLACE, "force")],
    )  # fmt: skip
    found = rp.diagnose(model, record)
    (effect,) = found.effects
    assert all(value.stderr < 0.5 * abs(value.value) for value in effect.parameters.values())
    assert {pair.first.kind for pair in found.indistinguishable} == {effect.kind}
    assert effect.kind == "dahl_friction"
    # LuGre's law whose static force is its sliding one is Dahl's
    alike = {pair.second.kind for pair in found.indistinguishable}
    assert alike == {"bouc_wen_hysteresis", "lugre_friction"}


# Odd records and models.

CASE = Case(
    "odd", one(0.005), [("quadratic_damping", ("x", "ground"), [4.0])], drive=20.0, samples=1500,
    seed=3,
)  # fmt: skip


@pytest.fixture(scope="module")
def data():
    return records(CASE)[0][0]


def checked(model, data):
    found = rp.diagnose(model, data)
    json.dumps(found.to_dict(), allow_nan=False)
    assert found.explain()
    return found


def test_a_record_in_the_wrong_unit_is_refused(data):
    with pytest.raises(rp.InvalidInputError, match="units"):
        rp.diagnose(model_of(CASE), data.assign(x=1e-9 * data["x"]))


def test_a_very_short_record_has_a_verdict(data):
    assert checked(model_of(CASE), data.isel(time=slice(0, 64))).verdict == "adequate"


def test_a_sensor_the_wrong_way_round_is_one_gain(data):
    found = checked(model_of(CASE), data.assign(x=-data["x"]))
    assert [e.kind for e in found.effects] == ["input_gain", "quadratic_damping"]
    gain = found.effects[0].parameters["gain"]
    assert gain.value == pytest.approx(-1, abs=0.05)


def test_stiffness_ten_times_too_large_is_mended(data):
    model = replace(model_of(CASE), springs=(rp.Spring(("x", "ground"), 30000.0),))
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
    found = rp.diagnose(model_of(late), records(late)[0][0])
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
    found = rp.diagnose(model_of(case), records(case)[0][0])
    assert [effect.kind for effect in found.effects] == ["cubic_stiffness"]
    held = [e for e in found.model.effects if e.kind == "input_hold"]
    assert [e.values["order"] for e in held] == [0.0]


# Several records: a machine with a cubic spring and dry friction under different blows.

TRUE = {"stiffness": 8e3, "force": 0.05}
NOISE = 1e-4
RATE = 200.0


def blow(size, samples, seed):
    """By an integrator that is not the package's, with coloured noise."""
    time = np.arange(samples) / RATE
    force = size * np.exp(-(((time - 0.2) / 0.01) ** 2))

    def rhs(t, s):
        held = 400 * s[0] + TRUE["stiffness"] * s[0] ** 3 + TRUE["force"] * np.tanh(s[1] / 1e-3)
        return [s[1], np.interp(t, time, force) - 0.8 * s[1] - held]

    x = solve_ivp(rhs, (0, time[-1]), (0, 0), t_eval=time, rtol=1e-8, atol=1e-11, max_step=2e-3)
    white = np.random.default_rng(seed).standard_normal(samples + 200)
    noise = 0.6 * NOISE * lfilter([1.0], [1.0, -0.8], white)[200:]
    return xr.Dataset({"F": ("time", force), "x": ("time", x.y[0] + noise)}, {"time": time})


@pytest.fixture(scope="module")
def blows():
    return {"small": blow(10, 1500, 1), "large": blow(120, 300, 2), "again": blow(120, 300, 3)}


def machine():
    return oscillator(damping=0.8)


def test_together_they_determine_what_each_leaves_open(blows):
    model = machine().with_effect("cubic_stiffness", PLACE)
    model = model.with_effect("coulomb_friction", PLACE)
    small, large = (rp.refit(model, blows[name]) for name in ("small", "large"))
    both = rp.refit(model, [blows["small"], blows["large"]])
    spring, friction = "effect[0].stiffness", "effect[1].force"
    assert spring in small.undetermined
    assert both.undetermined == ()
    for key, value in {spring: TRUE["stiffness"], friction: TRUE["force"]}.items():
        assert both.model.parameters[key] == pytest.approx(value, rel=0.03)
        assert both.stderr[key] < 0.02 * value
    assert large.stderr[friction] > 10 * both.stderr[friction]


def test_a_refit_tells_the_error_of_each_as_a_comparison_does(blows):
    given = {name: blows[name] for name in ("small", "large")}
    fitted = rp.refit(machine(), given)
    held = rp.compare(fitted.model, given).records
    assert list(fitted.records) == ["small", "large"]
    for name, errors in fitted.records.items():
        assert errors.outputs["x"].rmse == pytest.approx(held[name].outputs["x"].rmse, rel=1e-9)
        assert fitted.to_dict()["records"][name]["fit_percent"] == errors.fit_percent
    shown = repr(fitted)
    assert "Record by record" in shown
    assert any(line.split()[:2] == ["large", "x"] for line in shown.splitlines())
    alone = rp.refit(machine(), blows["small"])
    assert list(alone.records) == ["record 1"]
    assert "Record by record" not in repr(alone)


@pytest.mark.long
def test_they_name_both_effects_and_the_noise(blows, tmp_path):
    diagnosis = rp.diagnose(machine(), blows)
    assert diagnosis.verdict == "missing_effect"
    found = {effect.kind: effect.parameters for effect in diagnosis.effects}
    assert set(found) == {"cubic_stiffness", "coulomb_friction"}
    assert found["cubic_stiffness"]["stiffness"].value == pytest.approx(8e3, rel=0.03)
    assert found["coulomb_friction"]["force"].value == pytest.approx(0.05, rel=0.03)
    size = np.std(np.concatenate([data["x"].values for data in blows.values()]))
    assert NOISE / 1.5 < diagnosis.noise_floor["x"] * size < 1.5 * NOISE
    reasons = " ".join(diagnosis.reasons)
    assert "large and again repeat each other" in reasons
    assert re.search(r"Held out to judge: (large|again), blocks of small\.", reasons)
    assert diagnosis.time.size == diagnosis.missing_force.shape[1] == 2100
    assert diagnosis.plot_missing_force().get_xlabel().startswith("time")
    diagnosis.save(tmp_path / "blows.json")
    again = rp.load(tmp_path / "blows.json")
    assert again.reasons == diagnosis.reasons
    np.testing.assert_array_equal(again.time, diagnosis.time)


@pytest.mark.parametrize("call", [rp.diagnose, rp.refit])
def test_refused(call, blows):
    given = [blows["small"], blows["small"].isel(time=slice(0, 50))]
    with pytest.raises(rp.InvalidInputError, match="50 samples in 'record 2', expected at least"):
        call(machine(), given)
    with pytest.raises(rp.InvalidInputError, match="no record at all"):
        call(machine(), [])


# The air bearing: the parts that the thesis added, found in simulated records.


OUTPUTS = ("x_m", "x", "y_m", "y", "z_m", "z")
FORCES = ["F_x", "F_y", "F_z", "F_p"]
K_A, C_Z = "spring[4].stiffness", "damper[4].damping"


def record(plant, seed=0, decibel=40.0):
    """0.25 s at 40 kHz under brush and shaker, with sensor noise."""
    rng = np.random.default_rng(seed)
    forces = rp.polishing.simulate_brush(duration=0.25, sample_rate=40e3)[FORCES]
    samples = forces.sizes["time"]
    for name in FORCES:
        shaken = forces[name].values + 3.0 * rng.standard_normal(samples)
        forces[name] = ("time", shaken, {"units": "N"})
    response = rp.simulate(plant, forces)
    for name in OUTPUTS:
        clean = response[name].values
        noise = rng.standard_normal(samples) * clean.std() * 10 ** (-decibel / 20)
        forces[name] = ("time", clean + noise, {"units": "m"})
    return forces


def check_learnt(diagnosis, fall):
    """The verdict is one of parameters, and an error `fall` times the noise falls to the noise."""
    assert diagnosis.verdict == "parameters"
    assert not diagnosis.effects
    base, refit = diagnosis.ledger.entries
    for name in OUTPUTS:
        assert refit.nrmse[name] == pytest.approx(0.01, rel=0.1)
    assert max(base.nrmse.values()) > fall * 0.01


def within(diagnosis, key, truth, share):
    found = diagnosis.parameters[key]
    assert found.value == pytest.approx(truth, rel=share)
    assert abs(found.value - truth) < 5 * found.stderr


@pytest.mark.long
def test_the_damped_machine_against_the_undamped_model():
    """Data of (8.46) against (8.45): the coefficients of table 9.1 are found."""
    truth = rp.polishing.air_bearing_model(dissipation=0.001).parameters
    model = rp.polishing.air_bearing_model(dissipation=0.0)
    diagnosis = rp.diagnose(model, record(rp.air_bearing()))
    check_learnt(diagnosis, 5)
    within(diagnosis, "damper[0].damping", truth["damper[0].damping"], 0.1)  # c_A
    within(diagnosis, "damper[1].damping", truth["damper[1].damping"], 0.3)  # c_D
    within(diagnosis, "damper[5].damping", truth["damper[5].damping"], 0.1)  # c_R


@pytest.mark.long
def test_the_missing_holder_spring():
    model = rp.polishing.air_bearing_model().with_parameters({K_A: 0.0})
    diagnosis = rp.diagnose(model, record(rp.air_bearing()))
    check_learnt(diagnosis, 20)
    within(diagnosis, K_A, 1e9, 0.02)


@pytest.mark.long
def test_the_missing_damping_of_the_work():
    """c_Z, absent from (10.38); of a size that data can show, unlike that of table 9.1."""
    without = rp.polishing.air_bearing_model().with_parameters({C_Z: 0.0})
    working = without.with_parameters({C_Z: 2.0})
    diagnosis = rp.diagnose(without, record(working.linearize()))
    check_learnt(diagnosis, 2)
    within(diagnosis, C_Z, 2.0, 0.05)
    plant = diagnosis.model.linearize(measured="state")
    design = rp.state_feedback(plant, control_weight=1e-7)
    assert design.certificate.valid
    check = rp.simulation.check_robustness(
        design, diagnosis, plant_of=lambda model: model.linearize(measured="state"), samples=50
    )
    assert check.share_stable == 1.0
    assert check.worst < 1.5 * design.certificate.achieved


@pytest.mark.long
def test_output_feedback_takes_the_learnt_plant():
    """From the model to a plant with price and noise, and back to Monte Carlo."""
    model = rp.polishing.air_bearing_model()
    design = rp.output_feedback(
        model.linearize(), control_weight=1e-7, measurement_noise=1e-9, time_limit=20.0
    )
    assert design.certificate.valid
    errors = {key: 0.01 * value for key, value in model.parameters.items() if "gain" not in key}
    check = rp.simulation.check_robustness(design, model, standard_errors=errors, samples=30)
    assert check.samples == 30
    assert check.share_stable == 1.0
    assert check.least_share_stable == pytest.approx(0.05 ** (1 / 30))
    assert check.worst < 1.05 * design.certificate.achieved


DATA = oscillator_record(start=(0.05, 0.0), noise=0.01)


@pytest.mark.parametrize("factor", [1.0, 1000.0])
def test_a_diagnosis_says_it_in_words_and_in_plain_data(factor):
    data = DATA.assign(x=("time", factor * DATA["x"].values, {"units": "m"}))
    found = rp.diagnose(oscillator(), data, progress=str)
    times = [note for note in found.notes if "times as large" in note]
    assert len(times) == (factor != 1.0)
    assert found.to_dict()["notes"] == list(found.notes)
    for note in found.notes:
        assert found.explain().count(note) == 1
        assert repr(found).count(note) == 1
    if factor == 1.0:
        assert found.notes == ()
        assert "Look at the record" not in found.explain()
        assert found.verdict == "adequate"
        assert found.maps[0].follows < 0.1  # what is left is noise, and mapped all the same


# Records of 500,000 samples.

HIGH_RATE = 50e3
JOINT = ("a", "b")


def rubbing_masses(quantity="displacement", friction=3.0, wrong=1.0):
    """Two masses with modes at 23.8 and 52.2 Hz, which rub on each other."""
    places = [("a", "ground"), ("a", "b")]
    model = rp.MechanicalModel(
        [rp.Dof("a", 2.0), rp.Dof("b", 1.0)],
        [rp.Spring(places[0], 8e4 * wrong), rp.Spring(places[1], 6e4 * wrong)],
        [rp.Damper(places[0], 8.0), rp.Damper(places[1], 4.0)],
        [rp.Input("F", ("a", "ground"))],
        [rp.Output(f"y_{name}", (name, "ground"), quantity) for name in "ab"],
    )
    return model.with_effect("coulomb_friction", JOINT, {"force": friction}) if friction else model


@lru_cache
def long_record(samples, quantity="displacement", top=100.0, noise=0.01, friction=3.0):
    """A smooth random force of `top` Hz, or a white one, at 50 kHz."""
    random = np.random.default_rng(0)
    time = np.arange(samples) / HIGH_RATE
    force = random.standard_normal(samples)
    if top:
        force = sosfilt(butter(4, top, fs=HIGH_RATE, output="sos"), force)
    data = xr.Dataset({"F": ("time", 60 * force / np.std(force), {"units": "N"})}, {"time": time})
    model = rubbing_masses(quantity, friction)
    run = rp.simulation.simulate_model(model, data)
    for name, y in zip(model.output_names, run.outputs.T, strict=True):
        data[name] = ("time", y + noise * np.std(y) * random.standard_normal(samples))
    return data, run.states


@pytest.mark.long
@pytest.mark.parametrize(("top", "rough"), [(100.0, 0.01), (None, 0.03)])
def test_half_a_million_samples_are_diagnosed(top, rough):
    """In less than two minutes on two idle cores; here only what comes out is held."""
    data, _ = long_record(500_000, top=top)
    found = rp.diagnose(rubbing_masses(friction=0.0, wrong=1.05), data)
    assert [(e.kind, e.at) for e in found.effects] == [("coulomb_friction", JOINT)]
    assert found.effects[0].parameters["force"].value == pytest.approx(3.0, rel=rough)
    assert found.model.parameters["spring[1].stiffness"] == pytest.approx(6e4, rel=rough)
    assert len(found.notes) == 1


@pytest.mark.long
def test_half_a_million_samples_are_fitted():
    data, _ = long_record(500_000)
    fitted = rp.refit(rubbing_masses(friction=2.0, wrong=1.05), data)
    assert fitted.model.parameters["effect[0].force"] == pytest.approx(3.0, rel=0.01)
    assert "decimated from 50000" in fitted.notes[0]
