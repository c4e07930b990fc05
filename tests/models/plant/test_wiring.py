"""Surgery on signals with delay lines still open."""

import numpy as np

import robustpolish as rp
from robustpolish.plants.blocks import closed_loop
from robustpolish.plants.wiring import Wiring
from tests.models.plant.random_plants import random_plant


def wiring():
    plant = random_plant(np.random.default_rng(7))
    return Wiring(plant.system, plant.ny, plant.nu)


def test_lines_stand_last_among_disturbances_and_outputs():
    line = rp.simulation.DelayLine("u2", 0.1, 2)
    wired = (
        wiring().delayed("input", 3, line).delayed("output", 3, rp.simulation.DelayLine("y1", 0.2))
    )
    assert wired.disturbance_names == ("w1", "w2", "delay 1", "delay 2")
    assert wired.performance_names == ("z1", "z2", "delay 1", "delay 2")
    assert wired.control_names == ("u1", "u2", "u3")
    more = wired.with_disturbances(np.ones((2, 1)), ["n"])
    more = more.with_performance(np.zeros((1, 2)), np.ones((1, 3)), ["sum"])
    assert more.disturbance_names == ("w1", "w2", "n", "delay 1", "delay 2")
    assert more.performance_names == ("z1", "z2", "sum", "delay 1", "delay 2")
    part = more.chosen([2], [1], [2], [])
    assert part.disturbance_names == ("n", "delay 1", "delay 2")
    assert part.pade_model().input_labels == ["n", "u2"]
    assert part.pade_model().nstates == 4 + 2 + 3


def test_closing_the_loop_and_closing_the_delays_commute():
    wired = wiring().delayed("input", 2, rp.simulation.DelayLine("u1", 0.1, 2))
    K = np.random.default_rng(2).standard_normal((3, 2)) / 5
    first = rp.simulation.DelayedSystem(closed_loop(wired, K), wired.lines).pade_model()
    model = rp.GeneralizedPlant(wired.pade_model(), 2, 3).closed_loop(K)
    for s in (0.0, 2j, 1 + 10j):
        np.testing.assert_allclose(first(s), model(s))


def test_noise_and_prices_on_taken_names_get_numbers():
    wired = wiring().with_disturbances(np.eye(2), ["w1", "new"])
    assert wired.disturbance_names == ("w1", "w2", "w1_2", "new")
    np.testing.assert_array_equal(wired.D21[:, 2:], np.eye(2))
    np.testing.assert_array_equal(wired.D21[:, :2], wiring().D21)


def test_outputs_of_measurements_and_controls():
    own = wiring()
    shown = own.with_performance(np.array([[1.0, 2.0]]), np.array([[0.0, 3.0, 0.0]]), ["both"])
    np.testing.assert_allclose(shown.C1[2], own.C2[0] + 2 * own.C2[1])
    np.testing.assert_allclose(shown.D12[2], own.D22[0] + 2 * own.D22[1] + [0, 3, 0])
    np.testing.assert_allclose(shown.D11[2], own.D21[0] + 2 * own.D21[1])


def test_inputs_twice():
    own = wiring()
    twice = own.with_inputs_twice(["a", "b", "c"])
    assert twice.disturbance_names == ("a", "b", "c", "w1", "w2")
    np.testing.assert_array_equal(twice.B1[:, :3], own.B2)
    np.testing.assert_array_equal(twice.D21[:, :3], own.D22)
