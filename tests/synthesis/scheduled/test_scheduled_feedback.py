"""Controllers that follow measured numbers: their bound, their mixtures and their simulation."""

from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp

k = rp.uncertain.real("k", 5.0, range=(1.0, 9.0))
PRICE, NOISE = 1.0, 0.1
T = np.arange(0, 80, 0.04)


def mass(stiffness, outputs=2, pushed=1.0):
    """A mass on a spring; the position is z, and y too."""
    return rp.uncertain.system(
        [[0, 1], [-stiffness, -0.1]], [[0, 0], [1, pushed]], [[1, 0]] * outputs, 0
    )


def square(rate):
    return 5.0 + 4.0 * np.sign(np.sin(rate * T))


def energy_ratio(design, track, push):
    name = design.plants[0].disturbance_names[0]
    given = xr.Dataset({name: ("time", push)}, coords={"time": T})
    z = design.simulate(given, {"k": track})
    energy = sum(float((z[signal] ** 2).sum()) for signal in z)
    return np.sqrt(energy / float((push**2).sum()))


@pytest.fixture(scope="module")
def scheduled():
    return rp.scheduled_feedback(
        mass(k), controls=1, measurements=1, control_weight=PRICE, measurement_noise=NOISE
    )


def test_output_feedback_keeps_its_bound_while_the_spring_jumps(scheduled):
    assert scheduled.status == "proven"
    frozen = [
        float(rp.hinf_norm(scheduled.closed_loop({"k": v}))) for v in np.linspace(1.0, 9.0, 9)
    ]
    assert max(frozen) <= scheduled.bound
    # At every rate at which a spring can pump, and with pushes at half of it.
    ratios = [
        energy_ratio(scheduled, square(rate), np.sin(rate / 2 * T + phase))
        for rate in (2.0, 3.2, 4.4)
        for phase in (0.0, 1.5)
    ]
    assert 0.5 * scheduled.bound < max(ratios) <= scheduled.bound


def test_a_fixed_controller_for_the_middle_does_worse_than_the_bound(scheduled):
    middle = rp.GeneralizedPlant(mass(k).nominal, measurements=1, controls=1)
    fixed = rp.output_feedback(middle, control_weight=PRICE, measurement_noise=NOISE).controller
    alone = replace(scheduled, controllers=(fixed,) * 2)
    worst = max(
        energy_ratio(alone, square(rate), np.sin(rate / 2 * T)) for rate in (2.0, 3.2, 3.6, 4.4)
    )
    assert worst > 1.1 * scheduled.bound


def test_rates_lower_the_bound_and_keep_it(scheduled):
    slow = rp.scheduled_feedback(
        mass(k), controls=1, measurements=1, control_weight=PRICE, measurement_noise=NOISE,
        rates={"k": 0.5},
    )  # fmt: skip
    assert slow.bound < 0.95 * scheduled.bound
    frozen = max(float(rp.hinf_norm(slow.closed_loop({"k": v}))) for v in (1.0, 3.0, 5.0, 9.0))
    assert frozen <= slow.bound
    triangle = 5.0 + 4.0 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * T / 32.0))
    assert np.abs(np.diff(triangle)).max() / 0.04 <= 0.5 * (1 + 1e-9)
    tones = np.sin(1.0 * T) + np.sin(1.7 * T) + np.sin(2.3 * T)
    assert energy_ratio(slow, triangle, tones) <= slow.bound


def test_state_feedback_with_rates():
    plant = rp.uncertain.system([[0, k], [-1, 0.5]], [[1, 0], [0, 1]], [[1, 0]], 0)
    jumps = rp.scheduled_feedback(plant, controls=1, control_weight=PRICE)
    slow = rp.scheduled_feedback(plant, controls=1, control_weight=PRICE, rates={"k": 0.1})
    fixed = rp.robust_state_feedback(plant, controls=1, control_weight=PRICE, lyapunov="common")
    # One Lyapunov matrix: a fixed gain reaches as much.
    assert jumps.bound == pytest.approx(fixed.bound, rel=0.01)
    assert slow.bound < 0.85 * jumps.bound
    assert slow.controllers[0].nstates == 0
    for rate in (0.5, 1.0, 3.0, 4.4):
        assert energy_ratio(jumps, square(rate), np.sin(rate / 2 * T)) <= jumps.bound


def test_two_numbers_of_which_one_is_bent():
    # A nominal value beside the middle is a fraction of the delta, and the number itself.
    k, m = rp.uncertain.real("k", 2.0, range=(1.0, 9.0)), rp.uncertain.real("m", 1.0, percent=30)
    plant = rp.uncertain.system([[0, 1], [-k / m, -0.1 / m]], [[0, 0], [1 / m, 1]], [[1, 0]], 0)
    design = rp.scheduled_feedback(plant, controls=1, control_weight=PRICE, rates={"m": 0.1})
    assert len(design.controllers) == 4
    assert design.rates == {"k": np.inf, "m": 0.1}
    values = {"k": 3.0, "m": 0.8}
    loop = design.closed_loop(values)
    gain = design.at(values).D
    A = np.array([[0, 1], [-3.0 / 0.8, -0.1 / 0.8]]) + np.array([[0.0], [1.0]]) @ gain
    assert pytest.approx(A) == loop.A
    assert float(rp.hinf_norm(loop)) <= design.bound


def test_sampled_state_feedback():
    a = rp.uncertain.real("a", 0.6, range=(0.3, 0.9))
    plant = rp.uncertain.system([[1.1, a], [0, 0.9]], [[0, 0], [1, 1]], [[1, 0]], 0, dt=True)
    design = rp.scheduled_feedback(plant, controls=1, control_weight=PRICE)
    assert max(float(rp.hinf_norm(design.closed_loop({"a": v}))) for v in (0.3, 0.5, 0.9)) < (
        design.bound
    )
    with pytest.raises(rp.InvalidInputError, match="continuous time"):
        design.simulate(xr.Dataset(), {})


def test_numbers_that_reach_the_controls_are_filtered_as_told():
    gain = rp.uncertain.real("gain", 1.0, percent=50)
    plant = mass(5.0, outputs=1, pushed=gain)
    with pytest.raises(rp.InvalidInputError, match=r"B2.*fast lag before the controls"):
        rp.scheduled_feedback(plant, controls=1, control_weight=PRICE)
    lag = control.ss([[-50.0]], [[50.0]], [[1.0]], 0)
    filtered = plant * rp.uncertain.append(np.eye(1), lag)
    assert rp.scheduled_feedback(filtered, controls=1, control_weight=PRICE).bound < 2.0


def test_refusals(scheduled):
    with pytest.raises(rp.InvalidInputError, match=r"C2.*behind the measurements"):
        seen = rp.uncertain.system([[0, 1], [-5, -0.1]], [[0, 0], [1, 1]], [[1, 0], [k, 0]], 0)
        rp.scheduled_feedback(seen, controls=1, measurements=1)
    with pytest.raises(rp.InvalidInputError, match="not on a line"):
        rp.scheduled_feedback(mass(k * k), controls=1)
    with pytest.raises(rp.InvalidInputError, match="numbers of their own"):
        fit = rp.uncertain.ellipsoid({"k": 5.0}, [[1.0]])
        rp.scheduled_feedback(mass(fit["k"]), controls=1)
    with pytest.raises(rp.InvalidInputError, match="rates"):
        rp.scheduled_feedback(mass(k), controls=1, rates={"K": 1.0})
    with pytest.raises(rp.InvalidInputError, match="measurement_noise"):
        rp.scheduled_feedback(mass(k), controls=1, measurement_noise=0.1)
    with pytest.raises(rp.InvalidInputError, match="from 1 to 9"):
        scheduled.at({"k": 10.0})
    with pytest.raises(rp.InvalidInputError, match="no k"):
        scheduled.at({})


PLANT = rp.uncertain.system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)


@pytest.fixture(scope="module")
def design():
    return rp.scheduled_feedback(PLANT, controls=1, control_weight=1.0)


def test_at_rest_the_simulation_is_that_of_the_frozen_loop(design):
    t = np.linspace(0, 2, 101)
    push = xr.Dataset({"u[0]": ("time", np.sin(t))}, coords={"time": t})
    moved = design.simulate(push, {"k": np.full(t.size, 3.0)})
    still = rp.simulate(design.closed_loop({"k": 3.0}), push)
    for name in still:
        assert moved[name].to_numpy() == pytest.approx(still[name].to_numpy(), abs=1e-13)


def test_names_are_those_of_the_plant(design):
    controller = design.at({"k": 2.0})
    assert controller.output_labels == ["u[1]"]
    assert controller.input_labels == ["measured_x[0]", "measured_x[1]"]
    assert "k" in repr(design)
    assert "1 to 9, jumps" in repr(design)
    assert [dict(point) for point in design.points] == [{"k": 1.0}, {"k": 9.0}]


def test_wrong_signals_are_told(design):
    t = np.linspace(0, 1, 11)
    push = xr.Dataset({"u[0]": ("time", t)}, coords={"time": t})
    with pytest.raises(rp.InvalidInputError, match="11 as of time"):
        design.simulate(push, {"k": [3.0]})
    with pytest.raises(rp.InvalidInputError, match="unknown key"):
        design.simulate(push.rename({"u[0]": "F"}), {"k": np.full(11, 3.0)})
    with pytest.raises(rp.InvalidInputError, match="within its range only"):
        design.simulate(push, {"k": np.full(11, 0.5)})
