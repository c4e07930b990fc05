from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.experiments.candidates import (
    MachinePair,
    UnusableExperimentError,
    distance,
    experiments,
)
from robustpolish.identification.record import record_of
from tests.identification.oscillators import PLACE, double_well, oscillator, record

FAR = np.array([1e9])
KEYS = {"spring[0].stiffness": np.inf, "damper[0].damping": np.inf}


def machines(first, second, known=(), precision=None, noise=1e-4):
    known = dict(known)
    size = len(known)
    exact = np.zeros((size, size)) if precision is None else precision
    return MachinePair(first, second, ("one", "other"), np.array([noise]), known, exact)


def step(times=1.0, kind="step"):
    model = oscillator()
    found = experiments(model, record_of(model, record()))
    return next(e for e in found if (e.kind, e.times) == (kind, times))


def test_two_springs_differ_by_what_statics_say():
    slow = step(kind="to and fro", times=0.3)
    force = slow.inputs["F"].values
    pair = machines(oscillator(400.0, damping=20.0), oscillator(440.0, damping=20.0))
    found = distance(pair, slow, FAR)
    statics = np.sqrt(np.mean(force**2)) * (1 / 400 - 1 / 440)
    assert found.apart[0] == pytest.approx(statics, rel=0.05)
    np.testing.assert_array_equal(found.adapted, found.second)  # nothing may move


def test_what_a_fit_would_mend_tells_nothing():
    pair = machines(oscillator(400.0), oscillator(420.0, damping=1.05), KEYS)
    found = distance(pair, step(), FAR)
    assert found.apart[0] > 3e-4
    assert found.left[0] < 0.01 * found.apart[0]


def test_what_the_record_knows_may_not_move():
    sharp = np.diag([1e12, 1e12])
    known = dict.fromkeys(KEYS, 1e-6)
    pair = machines(oscillator(400.0), oscillator(420.0, damping=1.05), known, sharp)
    found = distance(pair, step(), FAR)
    assert found.left == pytest.approx(found.apart, rel=1e-3)


def test_a_cubic_spring_shows_at_large_amplitudes_whatever_the_linear_numbers_do():
    cubic = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": 1e5})
    left = []
    for times in (1.0, 10.0):
        found = distance(machines(cubic, oscillator(), KEYS), step(times, "decay"), FAR)
        assert found.left[0] <= found.apart[0]
        left.append(found.left[0])
    assert left[1] > 20 * left[0]


def test_how_something_with_a_memory_was_pulled_is_not_known():
    dahl = oscillator().with_effect("dahl_friction", PLACE)
    with pytest.raises(UnusableExperimentError, match="how it was pulled"):
        distance(machines(oscillator(), dahl), step(kind="decay"), FAR)
    assert distance(machines(oscillator(), dahl), step(), FAR).apart[0] >= 0
    free, other = oscillator(inputs=[]), oscillator(inputs=[], effects=dahl.effects)
    still = step(kind="decay")
    alone = replace(still, inputs=still.inputs.drop_vars("F"))
    assert distance(machines(free, other), alone, FAR).apart[0] >= 0  # nothing else can be made


def test_a_machine_does_not_leave_its_range():
    pair = machines(oscillator(400.0), oscillator(440.0))
    with pytest.raises(UnusableExperimentError, match=r"x would reach .* times its limit"):
        distance(pair, step(), np.array([1e-3]))


def test_a_machine_that_runs_away_is_no_experiment():
    unstable = oscillator(damping=-400.0)
    with pytest.raises(UnusableExperimentError, match=r"run away|limit"):
        distance(machines(oscillator(), unstable), step(), FAR)


def test_what_nobody_can_repeat_is_no_experiment():
    well, data = double_well(400.0)
    (first, *_) = (e for e in experiments(well, record_of(well, data)) if e.kind == "record")
    strong = replace(first, inputs=data[["F"]], motion=1.0)
    other = well.with_parameters({"damper[0].damping": 0.151})
    with pytest.raises(UnusableExperimentError, match="tiny change of the start"):
        distance(machines(well, other), strong, FAR)
