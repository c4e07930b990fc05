from dataclasses import replace

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.identification.diagnosis.findings import IndistinguishablePair
from robustpolish.machines.effects.effect import Effect
from tests import made_up
from tests.identification.oscillators import PLACE, oscillator, record

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
    drag = Effect("quadratic_damping", PLACE, {"coefficient": 0.5})
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
    with pytest.raises(InvalidInputError, match=message):
        rp.tell_apart(machines, DATA, fit=False, **options)


def test_a_pair_that_is_not_there_is_refused():
    with pytest.raises(InvalidInputError, match="0 to 0"):
        rp.tell_apart(alike(), DATA, pair=1)
    with pytest.raises(InvalidInputError, match="has none"):
        rp.tell_apart(replace(alike(), indistinguishable=()), DATA)
