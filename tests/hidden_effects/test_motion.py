"""What moves a hidden case: forces that are late."""

from dataclasses import replace

import numpy as np
import pytest

from tests.hidden_effects.cases import Case
from tests.hidden_effects.catalogue import one
from tests.hidden_effects.motion import motion


@pytest.mark.parametrize("held", [False, True])
def test_a_delay_of_whole_samples_is_a_shift_of_the_force(held):
    machine = one()
    late = Case("delay", machine, [("input_delay", ("F_x",), [4 * machine.dt])], samples=500)
    late = replace(late, warm_up=0, held=held)
    force = np.random.default_rng(0).standard_normal((500, 1))
    force[:5] = force[0]
    shifted = np.vstack([force[:1].repeat(4, axis=0), force[:-4]])
    found = motion(late, inputs=force)
    wanted = motion(replace(late, effects=[]), inputs=shifted)
    scale = np.abs(wanted.acceleration).max()
    np.testing.assert_allclose(found.acceleration[:-1], wanted.acceleration[:-1], atol=1e-9 * scale)
    assert (found.inputs == force).all()


@pytest.mark.parametrize("held", [False, True])
def test_a_lag_takes_high_frequencies_away_and_turns_the_others(held):
    machine, lag = one(), 0.004
    time = np.arange(6000) * machine.dt
    omega = 2 * np.pi * 0.02 / machine.dt
    lagging = Case("lag", machine, [("input_lag", ("F_x",), [lag])], samples=6000)
    lagging = replace(lagging, warm_up=0, held=held)
    found, plain = (
        motion(case, inputs=np.cos(omega * time)[:, None]).displacement[5000:, 0]
        for case in (lagging, replace(lagging, effects=[]))
    )
    line = np.exp(-1j * omega * time[5000:])
    ratio = (found @ line) / (plain @ line)
    assert ratio == pytest.approx(1 / (1 + 1j * omega * lag), rel=2e-3)


def test_half_a_sample_later_keeps_the_size_of_the_force():
    """Linear interpolation at the samples would leave 0.89 of this sine."""
    machine = one()
    force = np.cos(0.3 * np.pi * np.arange(6000))[:, None]
    late = Case("delay", machine, [("input_delay", ("F_x",), [0.5 * machine.dt])], samples=6000)
    late = replace(late, warm_up=0)
    sizes = [
        np.std(motion(case, inputs=force).displacement[5000:])
        for case in (late, replace(late, effects=[]))
    ]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.02)


@pytest.mark.parametrize(
    ("kind", "number", "acting"),
    [
        ("input_saturation", 6.0, lambda u: np.clip(u, -6.0, 6.0)),
        ("input_dead_zone", 2.0, lambda u: u - np.clip(u, -2.0, 2.0)),
    ],
)
def test_a_held_actuator_acts_as_its_samples_do(kind, number, acting):
    case = Case(kind, one(), [(kind, ("F_x",), [number])], samples=1500, drive=10)
    case = replace(case, warm_up=0, held=True)
    asked = motion(case).inputs
    plain = motion(replace(case, effects=[]), inputs=acting(asked))
    np.testing.assert_allclose(motion(case).displacement, plain.displacement, rtol=1e-6, atol=1e-9)
