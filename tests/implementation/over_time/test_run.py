"""Runs of a sampled loop, against the fine simulation and by hand."""

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from tests.implementation.designs import sampled_servo, servo, servo_design, static_gain


def push(time, **signals):
    data = {name: ("time", np.broadcast_to(values, time.shape)) for name, values in signals.items()}
    return xr.Dataset(data, {"time": time})


def test_without_limits_it_tends_to_the_continuous_loop():
    time = np.linspace(0, 20, 2001)
    load = push(time, w1=np.sin(time), w2=0.0)
    sampled = servo_design().discretize(0.001)
    found = sampled.simulate(load)
    expected = rp.simulate(servo_design(), load)
    z = np.interp(time, found["time"], found["z1"])
    np.testing.assert_allclose(z, expected["z1"], atol=5e-3 * np.abs(expected["z1"]).max())
    assert found["F"].attrs["units"] == "N"


def test_a_held_control_by_hand():
    # x' = x + w + u, w = 1, u = -3 x(kh): exact between the samples.
    h = 0.1
    found = static_gain().simulate(push(np.arange(0, 1.001, h), w1=1.0))
    x, expected = 0.0, []
    for _ in range(10):
        start, u = x, -3 * x
        expected += [start * np.exp(t) + (1 + u) * np.expm1(t) for t in h * np.arange(10) / 10]
        x = start * np.exp(h) + (1 + u) * np.expm1(h)
    np.testing.assert_allclose(found["z1"][:100], expected, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("delay", [0.0, 0.017, 0.05, 0.1234])
def test_energies_stay_below_the_certificate(delay):
    sampled = servo_design().discretize(0.05, delay=delay)
    time = np.linspace(0, 60, 12001)
    rng = np.random.default_rng(1)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        fade = np.exp(-0.05 * time)
        load = push(
            time, w1=rng.normal(size=time.size) * fade, w2=rng.normal(size=time.size) * fade
        )
        found = sampled.simulate(load)
        t = found["time"].values
        power = sum(found[name].values ** 2 for name in ("z1", "z2"))
        given = sum(load[name].values ** 2 for name in ("w1", "w2"))
        gain = np.sqrt(np.trapezoid(power, t) / np.trapezoid(given, time))
        assert gain < sampled.certificate.bound


def test_limits_are_kept_and_anti_windup_helps():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-0.1]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], controls=["F"]
    )

    K = control.ss([[-1e-6]], [[1.0]], [[-1.0]], [[-2.0]])
    sampled = rp.given_controller(plant, K).discretize(0.05)
    time = np.linspace(0, 60, 1201)
    load = push(time, w1=np.where(time < 20, 2.0, 0.0))
    runs = {
        form: sampled.simulate(load, limits={"F": 1.0}, anti_windup=form)
        for form in ("none", "conditioned", "observer")
    }
    after = {
        form: float((run["z1"] ** 2).sel(time=slice(25, 60)).sum()) for form, run in runs.items()
    }
    for run in runs.values():
        assert np.abs(run["F"]).max() <= 1.0
        assert 0 < run["F"].attrs["at_limit"] <= 1
    assert after["conditioned"] < 0.5 * after["none"]
    assert after["observer"] < 0.5 * after["none"]
    free = sampled.simulate(load)
    assert free["F"].attrs["at_limit"] == 0


def test_limits_that_the_plant_knows_are_kept_unless_others_are_given(tmp_path):
    sampled = rp.given_controller(servo().with_actuator("F", limit=0.3), servo_design().controller)
    sampled = sampled.discretize(0.05)
    load = push(np.linspace(0, 20, 401), w1=1.0)
    by_default, by_hand = sampled.simulate(load), sampled.simulate(load, limits={"F": 0.3})
    xr.testing.assert_identical(by_default, by_hand)
    xr.testing.assert_identical(rp.simulate(sampled, load), by_default)
    assert np.abs(by_default["F"]).max() == 0.3
    assert by_default["F"].attrs["at_limit"] > 0
    free = sampled.simulate(load, limits=np.inf)
    assert np.abs(free["F"]).max() > 0.3
    assert free["F"].attrs["at_limit"] == 0
    default = sampled.export_c(tmp_path / "a.c", name="servo").read_text()
    assert default == sampled.export_c(tmp_path / "b.c", name="servo", limits=0.3).read_text()
    assert "0.3" not in sampled.export_c(tmp_path / "c.c", name="servo", limits=np.inf).read_text()


def test_a_z_with_the_name_of_a_control_stays_beside_it():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], D12=[[0.0], [0.1]],
        performance=["x", "F"], controls=["F"],
    )  # fmt: skip
    design = rp.given_controller(plant, [[-3.0]])
    load = push(np.linspace(0, 1, 11), w1=1.0)
    run = design.discretize(0.1).simulate(load)
    assert list(run) == list(rp.simulate(design, load)) == ["x", "F", "F_2"]
    assert np.abs(run["F"]).max() > 0
    np.testing.assert_allclose(run["F"], 0.1 * run["F_2"], rtol=1e-12)


def test_wrong_disturbances_are_refused():
    sampled = sampled_servo()
    time = np.linspace(0, 1, 11)
    with pytest.raises(rp.InvalidInputError, match="w1"):
        sampled.simulate(push(time, other=1.0))
    with pytest.raises(rp.InvalidInputError, match="time"):
        sampled.simulate(xr.Dataset({"w1": ("t", time)}))
    with pytest.raises(rp.InvalidInputError, match="finite"):
        sampled.simulate(push(time, w1=np.nan))
    with pytest.raises(rp.InvalidInputError, match="Dataset"):
        sampled.simulate(time)
    with pytest.raises(rp.InvalidInputError, match="samples per period"):
        sampled.simulate(push(time * 1e-6, w1=1.0))
    assert servo().nx == 4
