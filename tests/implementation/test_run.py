"""Runs of a sampled loop: by hand, by single steps, within limits, against the certificate."""

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.implementation.run import sampled_run
from robustpolish.implementation.sampled.lifting import split_delay
from robustpolish.linear.response import first_order_hold
from robustpolish.plants.blocks import matrices_of
from tests.implementation.designs import sampled_servo, static_gain
from tests.reference.examples import servo_design, servo_plant


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
    sampled = rp.given_controller(
        servo_plant().with_actuator("F", limit=0.3), servo_design().controller
    )
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
    assert servo_plant().nx == 4


PERIOD, COUNT = 0.1, 20


def random_machine(rng):
    n, nw, nu, ny, nz = 3, 2, 2, 2, 3
    return rp.GeneralizedPlant.from_matrices(
        rng.normal(size=(n, n)) - 2 * np.eye(n),
        rng.normal(size=(n, nw)),
        rng.normal(size=(n, nu)),
        rng.normal(size=(nz, n)),
        rng.normal(size=(ny, n)),
        D11=rng.normal(size=(nz, nw)),
        D12=rng.normal(size=(nz, nu)),
        D21=rng.normal(size=(ny, nw)),
        D22=0.1 * rng.normal(size=(ny, nu)),
    )


def step_by_step(plant, controller, delay, w, limit, feedback):
    """Simulate as a computer would live through it: every event when it comes."""
    whole, rest = split_delay(PERIOD, delay)
    step = PERIOD / COUNT
    A, B, C, D = matrices_of(controller)
    n, ny, nu = plant.nx, plant.ny, plant.nu
    grown = np.zeros((n + ny, n + ny))
    grown[:n, :n] = plant.A
    inputs = np.block([[plant.B1, plant.B2], [plant.D21 / PERIOD, np.zeros((ny, nu))]])
    x, xk, acting = np.zeros(n + ny), np.zeros(len(A)), np.zeros(nu)
    waiting, z, u, cut_off = [], [], [], np.zeros(nu)
    for k in range(len(w)):
        now, j = k * step, k % COUNT
        if j == 0:
            y = plant.C2 @ x[:n] + x[n:] + plant.D22 @ acting
            x[n:] = 0
            wanted = C @ xk + D @ y
            given = np.clip(wanted, -limit, limit)
            cut_off += given != wanted
            xk = A @ xk + B @ y + feedback @ (given - wanted)
            waiting.append((now + whole * PERIOD + rest, given))
        while waiting and waiting[0][0] <= now + 1e-9:
            acting = waiting.pop(0)[1]
        z.append(plant.C1 @ x[:n] + plant.D11 @ w[k] + plant.D12 @ acting)
        u.append(acting)
        if k + 1 == len(w):
            break
        parts = [(step, w[k], w[k + 1], acting)]
        if waiting and waiting[0][0] < now + step - 1e-9:
            part, (_, acting) = waiting[0][0] - now, waiting.pop(0)
            between = w[k] + part / step * (w[k + 1] - w[k])
            parts = [(part, w[k], between, parts[0][3]), (step - part, between, w[k + 1], acting)]
        for length, first, last, u_now in parts:
            over, at_first, at_last = first_order_hold(grown, inputs, length)
            x = over @ x + at_first @ np.append(first, u_now) + at_last @ np.append(last, u_now)
    return np.array(z), np.array(u), cut_off / np.ceil(len(w) / COUNT)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.013, 0.0999, 0.1, 0.2371])
@pytest.mark.parametrize("limit", [np.inf, 0.2])
def test_it_is_what_single_steps_give(delay, limit):
    rng = np.random.default_rng(3)
    machine = random_machine(rng)
    matrices = [rng.normal(size=shape) for shape in ((2, 2), (2, 2), (2, 2), (2, 2))]
    K = control.ss(0.5 * matrices[0], matrices[1], 0.2 * matrices[2], 0.1 * matrices[3], PERIOD)
    feedback = 0.1 * rng.normal(size=(2, 2))
    w = rng.normal(size=(211, 2))
    time = PERIOD / COUNT * np.arange(len(w))
    load = xr.Dataset({f"w{i + 1}": ("time", w[:, i]) for i in range(2)}, {"time": time})
    limits = None if limit == np.inf else (np.full(2, -limit), np.full(2, limit))
    run = sampled_run(machine, K, delay, load, limits, feedback)
    z, u, cut_off = step_by_step(machine, K, delay, w, limit, feedback)
    found = np.column_stack([run[name] for name in machine.performance_names])
    np.testing.assert_allclose(found, z, atol=1e-12 * np.abs(z).max())
    found = np.column_stack([run[name] for name in machine.control_names])
    np.testing.assert_allclose(found, u, atol=1e-12 * np.abs(u).max())
    assert [run[name].attrs["at_limit"] for name in machine.control_names] == list(cut_off)
    assert (cut_off > 0).all() == (limit < np.inf)
