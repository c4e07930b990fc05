import numpy as np
import pytest

from robustpolish.identification.record import record_of
from robustpolish.identification.structure.decays import split_decays
from tests.identification.decays.pendulums import STEP, decay, pendulum
from tests.identification.oscillators import oscillator, record


def cut(model, *data):
    return split_decays(model, record_of(model, list(data) if len(data) > 1 else data[0]))


def test_a_decay_is_cut_where_its_time_is_three_fifths_over():
    found = cut(pendulum(), decay())
    (early,), (late,) = found
    assert late.follows(early)
    assert early.samples == pytest.approx(0.6 * 1400, abs=3)
    assert early.samples + late.samples == pytest.approx(1400, abs=5)
    assert np.ptp(late.Y) < np.ptp(early.Y)


def test_a_long_quiet_end_is_not_predicted():
    data = decay()
    quiet = decay(noise=0.0) * 0.0 + 1e-3 * np.random.default_rng(1).standard_normal(1400)
    model = pendulum()
    ends = decay(samples=1400, coulomb=2.0)  # at rest after a third of the time
    (early,), (late,) = cut(model, ends)
    assert early.samples + late.samples < 0.6 * 1400
    assert cut(model, quiet) is None
    assert cut(model, data) is not None


def test_motion_that_hardly_falls_is_no_decay():
    assert cut(pendulum(), decay(coulomb=0.0, drag=0.0, viscous=0.02)) is None


def test_driven_motion_is_no_decay():
    assert cut(oscillator(), record()) is None


def test_a_blow_is_part_of_the_early_part():
    data = decay()
    push = np.zeros(1400)
    push[100:110] = 5.0
    data = data.assign(F=("time", push))
    model = pendulum(inputs=("F",))
    (early,), _ = cut(model, data)
    assert early.samples == pytest.approx(109 + 0.6 * 1291, abs=3)
    late_push = data.assign(F=("time", push[::-1].copy()))
    assert cut(model, late_push) is None


def test_every_record_has_to_be_a_decay():
    model = pendulum()
    assert len(cut(model, decay(), decay(coulomb=0.3)).late) == 2
    assert cut(model, decay(), decay(coulomb=0.0, drag=0.0, viscous=0.02)) is None


def test_a_short_decay_is_not_cut():
    short = decay(coulomb=3.0, samples=90)
    assert short.sizes["time"] * STEP < 2
    assert cut(pendulum(), short) is None
