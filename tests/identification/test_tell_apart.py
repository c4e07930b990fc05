"""Experiments that tell two machines apart."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.identification.experiments import (
    Experiment,
    MachinePair,
    SimulatedExperiment,
    UnusableExperimentError,
    experiments,
    simulate_experiment,
)
from robustpolish.identification.findings import IndistinguishablePair
from robustpolish.identification.record import record_of
from tests import made_up
from tests.identification.oscillators import PLACE, double_well, oscillator, record

DATA = record(1500, noise=0.01)
CUBIC = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": 2e4})


def test_a_cubic_spring_is_told_from_a_linear_machine():
    found = rp.tell_apart((CUBIC, oscillator()), DATA, fit=False)
    best = found.recommended
    assert best is not None
    assert best.left > 3
    assert best.apart >= best.left
    # a force with the cube of the motion
    decays = {t.experiment.times: t.left for t in found.tried if t.experiment.kind == "decay"}
    assert decays[0.3] < 0.1 * decays[1.0] < 0.1 * decays[10.0]
    lefts = [t.left for t in found.tried]
    assert lefts == sorted(lefts, reverse=True)
    assert found.machines.names == ("cubic_stiffness at x, ground", "the model (second)")


def test_machines_that_a_fit_makes_one_are_not_told_apart():
    found = rp.tell_apart((oscillator(400.0), oscillator(415.0)), DATA, fit=False)
    assert max(t.apart for t in found.tried) > 3
    assert found.recommended is None
    assert "no experiment that was tried tells them apart" in found.explain()


def test_both_are_fitted_to_the_record_before():
    told = []
    found = rp.tell_apart(
        (oscillator(380.0), oscillator(430.0)), DATA, progress=told.append, noise={"x": 1e-4}
    )
    one, other = (m.parameters for m in (found.machines.first, found.machines.second))
    for values in (one, other):
        ratio = values["spring[0].stiffness"] / values["dof.x.mass"]
        assert ratio == pytest.approx(400.0, rel=0.01)
    assert found.on_record["x"] == pytest.approx((0.01, 0.01), rel=0.1)
    assert found.recommended is None
    assert sum("refit" in text for text in told) == 2
    assert found.machines.noise == pytest.approx([1e-4])


def alike():
    """A diagnosis that found a cubic spring, and calls a quadratic drag as good."""
    drag = rp.effects.Effect("quadratic_damping", PLACE, {"coefficient": 0.5})
    found = replace(
        made_up.diagnosis(),
        model=CUBIC,
        indistinguishable=(
            IndistinguishablePair(CUBIC.effects[0], drag, "Repeat at three amplitudes."),
        ),
    )
    spread = float(DATA["x"].std())
    ledger = replace(found.ledger, noise_floor={"x": 1e-4 / spread})
    return replace(found, ledger=ledger)


def test_a_pair_of_a_diagnosis_is_taken_with_its_noise_floor():
    found = rp.tell_apart(alike(), DATA, fit=False)
    assert found.machines.noise == pytest.approx([1e-4], rel=1e-6)
    names = [name.partition(" at ")[0] for name in found.machines.names]
    assert names == ["cubic_stiffness", "quadratic_damping"]
    assert found.recommended is not None
    assert found.hint == "Repeat at three amplitudes."


def test_limits_keep_experiments_small():
    largest = float(np.abs(DATA["F"]).max())
    limits = {"F": largest, "x": float(abs(DATA["x"]).max())}
    found = rp.tell_apart((CUBIC, oscillator()), DATA, fit=False, limits=limits)
    assert all(t.experiment.amplitude <= 1.001 * largest for t in found.tried)
    assert any("times its limit" in why for _, why in found.refused)


@pytest.mark.parametrize(
    ("machines", "options", "message"),
    [
        ((oscillator(), oscillator(), oscillator()), {}, "two models"),
        ((oscillator(), oscillator(inputs=[])), {}, "same names"),
        (oscillator(), {}, "two models"),
        ((oscillator(), CUBIC), {"noise": {"y": 1.0}}, "an output: x"),
        ((oscillator(), CUBIC), {"limits": {"G": 1.0}}, "one of F, x"),
        ((oscillator(), CUBIC), {"limits": {"F": -1.0}}, "above 0"),
    ],
)
def test_refused(machines, options, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.tell_apart(machines, DATA, fit=False, **options)


def test_a_pair_that_is_not_there_is_refused():
    with pytest.raises(rp.InvalidInputError, match="0 to 0"):
        rp.tell_apart(alike(), DATA, pair=1)
    with pytest.raises(rp.InvalidInputError, match="has none"):
        rp.tell_apart(replace(alike(), indistinguishable=()), DATA)


TIME = np.arange(400) / 100
WAVE = np.sqrt(2) * np.sin(2 * np.pi * TIME)
NOISE = np.array([2e-6])


def tried(left, times=1.0, kind="sweep", apart=None):
    """An experiment in which two machines are so many times the noise apart."""
    inputs = xr.Dataset({"F": ("time", WAVE)}, {"time": TIME})
    how = (times, 4.0 * times, "N", (0.5, 5.0))
    experiment = Experiment(kind, "F", *how, inputs, np.zeros(2), 1.0)
    runs = [np.zeros((400, 1)), -NOISE * (left if apart is None else apart) * WAVE[:, None],
            -NOISE * left * WAVE[:, None]]  # fmt: skip
    return SimulatedExperiment(experiment, NOISE, *runs)


def told(*experiments):
    machines = MachinePair(
        oscillator(), oscillator(), ("Coulomb", "Dahl"), NOISE, {}, np.zeros((0, 0))
    )
    ordered = tuple(sorted(experiments, key=lambda t: -t.left))
    refused = (("a step", "x would reach 2 times its limit"),)
    return rp.results.ToldApart(machines, ordered, refused, {}, "Rest.")


def test_it_says_what_to_do_and_how_far_they_are_apart():
    text = told(tried(4.0, 3.0, apart=6.0)).explain()
    assert text.splitlines()[:2] == [
        "To tell Coulomb from Dahl:",
        "make a sweep on F, up to 12 N (3 times that of the record) from 0.5 to 5 Hz.",
    ]
    assert "x differs by 1.2e-05 m (root mean square), 6 times its noise of 2e-06 m" in text
    assert "by 8e-06 m, 4 times, once the numbers of Dahl are fitted" in text
    assert "Left out: a step: x would reach 2 times its limit." in text
    assert "Rest." not in text


def test_it_is_honest_where_nothing_tells():
    text = told(tried(0.2, apart=3.0)).explain()
    assert "no experiment that was tried tells them apart." in text
    assert "0.2 times" in text
    assert "What may help instead: Rest." in text
    assert "one machine to every experiment" not in text
    assert "one machine to every experiment" in told(tried(0.2)).explain()


def test_plain_data_and_table_hold_the_same_figures():
    found = told(tried(4.0, 3.0, apart=6.0), tried(1.0))
    content = found.to_dict()
    assert content["told_apart"] is True
    assert [e["left_over_noise"] for e in content["experiments"]] == pytest.approx([4.0, 1.0])
    assert content["experiments"][0]["apart"]["x"] == pytest.approx(1.2e-5)
    assert content["recommended"].startswith("a sweep on F")
    rows = found.table().rows
    assert rows[0][:6] == ("sweep", "F", 12.0, "N", 0.5, 5.0)
    assert rows[0][6:] == pytest.approx((6.0, 4.0))
    assert "difference over noise" in repr(found)


def test_pictures_show_the_recommended_experiment_and_all_distances():
    found = told(tried(4.0, 3.0, apart=6.0), tried(0.5))
    bars = found.plot()
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([4.0, 0.5])
    drive, both, apart = found.plot_panels().axes
    np.testing.assert_allclose(np.asarray(drive.lines[0].get_ydata()), WAVE)
    assert [str(line.get_label()) for line in both.lines] == ["Coulomb", "Dahl"]
    largest = [np.abs(np.asarray(line.get_ydata())).max() for line in apart.lines]
    assert largest == pytest.approx([6 * 2e-6 * np.sqrt(2), 4 * 2e-6 * np.sqrt(2)], rel=1e-3)


def test_without_an_experiment_there_is_no_picture():
    with pytest.raises(rp.InvalidInputError, match="2 times its limit"):
        told().plot_panels()
    assert "no experiment could be made." in told().explain()


FAR = np.array([1e9])


def machines(first, second, known=(), precision=None, noise=1e-4):
    known = dict(known)
    size = len(known)
    exact = np.zeros((size, size)) if precision is None else precision
    return MachinePair(first, second, ("one", "other"), np.array([noise]), known, exact)


def step(times=1.0, kind="step"):
    model = oscillator()
    found = experiments(model, record_of(model, record()), (), None)
    return next(e for e in found if (e.kind, e.times) == (kind, times))


def test_two_springs_differ_by_what_statics_say():
    slow = step(kind="to and fro", times=0.3)
    force = slow.inputs["F"].values
    pair = machines(oscillator(400.0, damping=20.0), oscillator(440.0, damping=20.0))
    found = simulate_experiment(pair, slow, FAR)
    statics = np.sqrt(np.mean(force**2)) * (1 / 400 - 1 / 440)
    assert found.differences[0] == pytest.approx([statics], rel=0.05)
    np.testing.assert_array_equal(found.adapted, found.second)  # nothing may move


def test_what_nobody_can_repeat_is_no_experiment():
    well, data = double_well(400.0)
    (first, *_) = (
        e for e in experiments(well, record_of(well, data), (), None) if e.kind == "record"
    )
    strong = replace(first, inputs=data[["F"]], motion=1.0)
    other = well.with_parameters({"damper[0].damping": 0.151})
    with pytest.raises(UnusableExperimentError, match="tiny change of the start"):
        simulate_experiment(machines(well, other), strong, FAR)
