"""Refits: the true numbers, their standard errors, what they say of a record."""

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.identification.sanity import sanity_warnings
from robustpolish.linear.response import linear_response
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.drawn import drawn_cases
from tests.identification.drawn_machines import drawn, mistaken
from tests.identification.oscillators import PLACE, of_rig, oscillator, record, rig

CUBIC = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=4000, seed=1)


def test_refit_finds_values_of_an_effect_without_any():
    (data, _), _ = records(CUBIC)
    fitted = rp.refit(model_of(CUBIC).with_effect("cubic_stiffness", PLACE), data)
    value = fitted.model.parameters["effect[0].stiffness"]
    assert value == pytest.approx(4e6, rel=0.03)
    assert abs(value - 4e6) < 5 * fitted.stderr["effect[0].stiffness"]
    assert fitted.parameters["effect_0__stiffness"].stderr == fitted.stderr["effect[0].stiffness"]


@pytest.mark.parametrize("stiffness", [15.0, 22.0, 25.0, 40.0])
def test_a_free_decay_gives_its_frequency(stiffness):
    model = oscillator(stiffness, 0.4, inputs=[])
    time = np.arange(2000) * 0.01
    decay = np.exp(-0.2 * time) * np.cos(np.sqrt(25 - 0.04) * time)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"x": ("time", decay + noise)}, coords={"time": time})
    fitted = rp.refit(model, data)
    found = fitted.model.parameters
    assert found["dof.x.mass"] == 1.0  # a decay shows ratios only
    assert found["spring[0].stiffness"] == pytest.approx(25, rel=1e-3)
    assert found["damper[0].damping"] == pytest.approx(0.4, rel=0.01)
    assert fitted.nrmse["x"] * np.std(decay + noise) == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize("share", [0.03, 0.1, 10.0])
@pytest.mark.parametrize("quantity", ["acceleration", "displacement"])
def test_a_spring_that_is_wrong_by_a_factor_of_ten_or_thirty_is_found(share, quantity):
    def machine(stiffness):
        return oscillator(stiffness, 4.0, outputs=[rp.Output("x", PLACE, quantity)])

    time, rng = np.arange(1500) * 0.002, np.random.default_rng(0)
    force = rng.standard_normal(time.size)
    y = linear_response(machine(1.6e5).state_space(), time, force[:, None]).outputs[:, 0]
    noise = 0.01 * np.std(y) * rng.standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force), "x": ("time", y + noise)}, coords={"time": time})
    fitted = rp.refit(machine(share * 1.6e5), data)
    found = fitted.model.parameters
    assert found["spring[0].stiffness"] / found["dof.x.mass"] == pytest.approx(1.6e5, rel=1e-3)
    assert fitted.nrmse["x"] == pytest.approx(0.01, rel=0.05)


def test_values_and_errors_are_those_of_a_regression():
    data = of_rig(3000, noise=2.0)
    X = np.column_stack([data["x"], data["v"]])
    expected = np.linalg.lstsq(X, data["f"].values, rcond=None)[0]
    errors = 2.0 * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    fitted = rp.refit(rig(50.0, 4.0), data)
    for key, value, error in zip(fitted.units, expected, errors, strict=True):
        assert fitted.model.parameters[key] == pytest.approx(value, rel=1e-3)
        assert fitted.stderr[key] == pytest.approx(error, rel=0.15)
    assert fitted.units == {"spring[0].stiffness": "N/m", "damper[0].damping": "N s/m"}
    assert fitted.undetermined == ()
    np.testing.assert_allclose(np.sqrt(np.diag(fitted.covariance)), list(fitted.stderr.values()))


def test_what_the_data_leave_open_is_told():
    """The force of a damper of 0.01 N s/m is lost in the noise."""
    fitted = rp.refit(rig(50.0, 0.01), of_rig(3000, noise=20.0, damping=0.0))
    assert fitted.undetermined == ("damper[0].damping",)


def test_a_record_that_is_too_short_is_refused():
    with pytest.raises(rp.InvalidInputError, match="at least 60"):
        rp.refit(oscillator(), record().isel(time=slice(0, 59)))


def test_loops_that_stiffen_are_recovered():
    """Bouc-Wen with beta + gamma < 0: nothing yields, and the simulation stays finite."""
    true = {"force": 1.0, "stiffness": 150.0, "exponent": 1.0, "beta": 0.3, "gamma": -0.9}
    model = oscillator().with_effect("bouc_wen_hysteresis", PLACE, true)
    data = record(3000)
    outputs = rp.simulation.simulate_model(model, data).outputs[:, 0]
    assert np.isfinite(outputs).all()
    noise = 1e-3 * np.std(outputs) * np.random.default_rng(0).standard_normal(3000)
    data = data.assign(x=("time", outputs + noise))
    first = {**true, "stiffness": 130.0, "beta": 0.4, "gamma": -0.8}
    fitted = rp.refit(oscillator().with_effect("bouc_wen_hysteresis", PLACE, first), data)
    found = fitted.model.effects[0].values
    assert fitted.nrmse["x"] == pytest.approx(1e-3, rel=0.1)
    assert found["force"] == 1.0
    assert found["beta"] + found["gamma"] < 0
    for name in ("stiffness", "beta", "gamma"):
        error = fitted.stderr[f"effect[0].{name}"]
        assert abs(found[name] - true[name]) < 4 * error + 0.02 * abs(true[name])
        assert error < 0.3 * abs(true[name])


# The error of a refit is at most that of its start, as `compare` measures it.


def held(seed, most):
    machine = drawn(seed, most)
    given = mistaken(machine, 1000 + seed)
    before, fitted = rp.compare(given, machine.data), rp.refit(given, machine.data)
    after = rp.compare(fitted.model, machine.data)
    if before.reproducible and after.reproducible:
        assert after.nrmse <= before.nrmse * (1 + 1e-9), seed


@pytest.mark.parametrize("seed", range(3))
def test_a_refit_ends_no_worse_than_it_began(seed):
    held(seed, most=1500)


@pytest.mark.long
@pytest.mark.parametrize("seed", [*range(100, 160), *range(1000, 1060)])
def test_a_refit_of_a_longer_record_ends_no_worse(seed):
    held(seed, most=2500)


def test_the_true_numbers_may_stay():
    """With no better ones about, they are returned with their standard errors."""
    machine = drawn(11, most=1500)
    fitted = rp.refit(machine.model, machine.data)
    before = rp.compare(machine.model, machine.data).nrmse
    assert rp.compare(fitted.model, machine.data).nrmse <= before * (1 + 1e-9)
    assert set(fitted.stderr) == set(fitted.units)


def test_a_refit_says_what_looks_wrong():
    fitted = rp.refit(oscillator(), changed(RECORD, x=-X))
    assert any("x moves against the model" in note for note in fitted.notes)
    assert "x moves against the model" in repr(fitted)
    assert rp.refit(oscillator(), RECORD).notes == ()


# Warnings about records, and none about good ones.

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
    comparison = rp.compare(oscillator(), data)
    said = sanity_warnings(comparison.model, comparison.data, comparison.simulated)
    assert len(said) == 1
    assert set(said) <= set(comparison.notes)
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(said[0])


def test_nothing_is_said_of_a_good_record_or_a_wrong_model():
    for model in (oscillator(), oscillator(stiffness=700.0), oscillator(damping=20.0)):
        found = rp.compare(model, RECORD)
        assert sanity_warnings(model, found.data, found.simulated) == ()


@pytest.mark.parametrize("stiffness", [0.0, 4.0, 40.0, 4000.0, 40_000.0])
def test_a_spring_that_is_missing_or_far_off_is_no_wrong_sign(stiffness):
    model = oscillator(stiffness=stiffness) if stiffness else oscillator(springs=[])
    said = " ".join(sanity_warnings(model, RECORD))
    assert not any(words in said for words in ("against", "exchanged", "times as large"))


def test_exchanged_sensors():
    a, b, joint = ("a", "ground"), ("b", "ground"), ("a", "b")
    model = rp.MechanicalModel(
        [rp.Dof("a", 1.0), rp.Dof("b", 2.0)],
        [rp.Spring(a, 800.0), rp.Spring(joint, 400.0), rp.Spring(b, 100.0)],
        [rp.Damper(a, 2.0), rp.Damper(joint, 2.0)],
        [rp.Input("F", a)], [rp.Output("xa", a), rp.Output("xb", b)],
    )  # fmt: skip
    data = rp.compare(model, RECORD.assign(xa=RECORD["x"], xb=RECORD["x"])).simulated
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
    # fairino_joint1 raises a false alarm of its units, which is not solved yet.
    for name in ("bouc_wen", "brb_mode1", "mr_damper_0v", "pendulum_decay", "sloshing"):
        folder = shared / "data/real" / name
        model = rp.MechanicalModel.from_toml(folder / "model.toml")
        found = rp.compare(model, folder / f"{part}.csv")
        assert sanity_warnings(model, found.data, found.simulated) == (), folder.name


@pytest.mark.parametrize("assumed", [0.0, 1.0])
@pytest.mark.parametrize("course", ["held", "straight"])
def test_no_number_is_wrong_by_what_goes_on_between_samples_without_a_word(course, assumed):
    rng, dt, m, k, c, n = np.random.default_rng(3), 1e-3, 2.0, 5053.2, 6.0, 8000
    system = control.ss([[0, 1], [-k / m, -c / m]], [[0], [1 / m]], [[1.0, 0]], 0)
    t, force = dt * np.arange(n), np.convolve(rng.normal(size=n), np.ones(8) / 3, "same")
    if course == "straight":
        y = linear_response(system, t, force[:, None]).outputs[:, 0]
    else:  # a digital controller, whose force the record holds, stays until the next sample
        step, x, y, rate = control.c2d(system, dt), np.zeros(2), np.zeros(n), 0.0
        for i in range(n):
            y[i] = x[0]
            rate = 0.8 * rate + 0.2 * (y[i] - y[i - 1]) / dt if i else 0.0
            force[i] -= 20000 * y[i] + 100 * rate
            x = step.A @ x + step.B[:, 0] * force[i]
    noisy = y + 1e-7 * rng.normal(size=n)
    data = rp.read_measurement({"time [s]": t, "F [N]": force, "x [m]": noisy})
    model = rp.MechanicalModel(
        [rp.Dof("x", m)], [rp.Spring(PLACE, 1.15 * k)], [rp.Damper(PLACE, 2 * c)],
        [rp.Input("F", PLACE)], [rp.Output("x", PLACE)],
    )  # fmt: skip
    if assumed == 0.0:
        model = model.with_effect("input_hold", "F", {"order": 0.0})
    fitted, key = rp.refit(model, data), "damper[0].damping"
    seen = any(f"F: looks {course} between samples" in note for note in fitted.notes)
    wrong = abs(fitted.model.parameters[key] - c) > 4 * fitted.stderr[key]
    assert seen or not wrong
    assert not any("between samples" in n for n in fitted.notes) or seen
    assert seen or course == "straight" or assumed == 0.0
