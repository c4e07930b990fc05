"""Many periods at once, against one small step after the other."""

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.implementation.run import PeriodFlow, sampled_run
from robustpolish.implementation.sampled.lifting import split_delay
from robustpolish.linear.response import first_order_hold
from robustpolish.plants.blocks import matrices_of

PERIOD, COUNT = 0.1, 20


def plant(rng):
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
    machine = plant(rng)
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


def test_a_control_that_comes_just_before_the_next_sample_comes_with_it():
    machine = plant(np.random.default_rng(0))
    late = PERIOD * (1 - 4e-8)  # nearer to the sample than steps are told apart
    flow = PeriodFlow.of(machine, PERIOD, COUNT, late)
    assert (flow.whole, flow.cut, flow.left) == (1, 0, 0.0)
    u = flow.held(np.zeros((1, 2)), np.ones((1, 2)))
    assert u.min() == 1
