"""A family of plants as one plant with dynamics below a weight."""

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.plants.uncertain.cover import bounding_weight


def rig(w, damping=0.1):
    """An integrator and a resonance at w rad/s."""
    return control.ss(control.tf([w**2], [1, 2 * damping * w, w**2, 0]))


RIGS = [rig(w) for w in (20.0, 22.0, 25.0, 28.0, 30.0)]


@pytest.mark.parametrize("kind", ["output", "input", "additive"])
def test_every_plant_is_one_of_the_uncertain_system(kind):
    plants = [control.tf([1.0], [1.0, 0.2 * w, w**2]) for w in (20.0, 25.0, 30.0)]
    found = rp.uncertain.cover(plants, plants[1], kind=kind, order=4)
    assert found.covered
    W = np.abs(found.weight(1j * found.frequency).ravel())
    P0, P = plants[1](1j * found.frequency), plants[2](1j * found.frequency)
    size = np.abs(P - P0) if kind == "additive" else np.abs(P / P0 - 1)
    assert (size <= W).all()
    # The delta that makes the plant of the nominal one, at a frequency: a rotation below 1.
    i = len(W) // 2
    delta = control.ss([], [], [], [[0.3]])
    made = found.system.at({"cover": delta})(1j * found.frequency[i])
    w = found.weight(1j * found.frequency[i])
    assert made == pytest.approx(P0[i] + 0.3 * w * (1 if kind == "additive" else P0[i]))


def test_model_in_the_middle_is_chosen():
    found = rp.uncertain.cover(RIGS, order=3)
    tried = [rp.uncertain.cover(RIGS, plant, order=0).errors.max() for plant in RIGS]
    assert found.errors.max() == pytest.approx(min(tried))
    assert found.nominal.poles() == pytest.approx(RIGS[int(np.argmin(tried))].poles())


def test_several_signals():
    plant = control.ss(np.diag([-1.0, -2.0]), np.eye(2), [[1.0, 0.3], [0.2, 1.0]], np.zeros((2, 2)))
    family = [plant * np.diag([1 + a, 1 - a]) for a in (-0.2, 0.0, 0.2)]
    # A change of gains at the input has the same size at all frequencies there, and no weight.
    found = rp.uncertain.cover(family, kind="input", order=2)
    assert found.weight.nstates == 0
    assert found.gains == pytest.approx(0.2)
    assert found.system.blocks[0].element.shape == (2, 2)
    assert rp.uncertain.cover(family, kind="output").errors.max() > 0.2


def test_unequal_numbers_of_signals():
    tall = control.ss([[-1.0]], [[1.0]], [[1.0], [2.0]], [[0.0], [0.0]])
    family = [tall, 1.1 * tall]
    assert rp.uncertain.cover(family, tall, kind="input", order=0).gains == pytest.approx(0.1)
    turned = [tall, control.ss([[-1.0]], [[1.0]], [[1.0], [2.1]], [[0.0], [0.0]])]
    with pytest.raises(rp.InvalidInputError, match='Take kind="additive" or "output"'):
        rp.uncertain.cover(turned, tall, kind="input")
    assert rp.uncertain.cover(turned, tall, kind="additive", order=2).system.shape == (2, 1)


def test_sampled_plants():
    plants = [control.sample_system(p, 0.01, "zoh") for p in RIGS]
    found = rp.uncertain.cover(plants, plants[2], order=3)
    assert found.covered
    assert found.weight.dt == found.system.dt == 0.01
    assert (np.abs(found.weight.poles()) < 1).all()
    assert (np.abs(found.weight.zeros()) < 1).all()
    assert found.frequency.max() < np.pi / 0.01


def test_measured_responses():
    hertz = np.geomspace(0.1, 100, 200)
    responses = [
        xr.DataArray(
            p(2j * np.pi * hertz)[:, None, None],
            {"frequency": hertz, "output": ["x"], "input": ["F"]},
            ("frequency", "output", "input"),
        )
        for p in RIGS
    ]
    found = rp.uncertain.cover(responses, RIGS[2], order=3)
    assert found.covered
    assert found.frequency == pytest.approx(2 * np.pi * hertz)
    np.testing.assert_allclose(found.errors[2], 0, atol=1e-12)
    same = [control.FrequencyResponseData(r.values[:, 0, 0], 2 * np.pi * hertz) for r in responses]
    np.testing.assert_allclose(
        rp.uncertain.cover(same, RIGS[2], order=3).gains, found.gains, rtol=1e-9
    )


def test_loop_that_is_proven_for_the_cover_is_stable_for_the_family():
    found = rp.uncertain.cover(RIGS, RIGS[2], order=5)
    gain = 0.5
    margin = rp.robust_stability((found.system * gain).feedback())
    assert margin.robust
    # Up to the margin the whole family is stable: the errors grow with it.
    assert all((control.feedback(gain * plant, 1).poles().real < 0).all() for plant in RIGS)
    too_much = rp.robust_stability((found.system * 4.5).feedback())
    assert too_much.robust is False
    assert any((control.feedback(4.5 * plant, 1).poles().real > 0).any() for plant in RIGS)


def test_what_it_says():
    found = rp.uncertain.cover(RIGS, RIGS[2], order=3)
    text = str(found)
    assert "relative error at the output" in text
    assert "nothing is known of the plants between" in text
    assert found.tightness >= 1
    labels = [t.get_text() for t in found.plot().get_legend().get_texts()]
    assert labels[-1] == "weight"
    assert len(labels) == 6
    many = rp.uncertain.cover([rig(w) for w in np.linspace(20, 30, 9)], rig(25.0), order=1)
    assert len(many.plot().get_lines()) == 2


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kind": "feedback"}, "one of"),
        ({"order": 1.5}, "whole number"),
        ({"order": -1}, "whole number"),
        ({"plants": [RIGS[0]], "nominal": RIGS[0]}, "nothing to cover"),
    ],
)
def test_bad_arguments(change, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.uncertain.cover(**({"plants": RIGS} | change))


UNSTABLE = control.tf([1.0], [1.0, -1.0])


@pytest.mark.parametrize(
    ("plants", "nominal", "says"),
    [
        ([], None, "list of them"),
        ("plants", None, "list of them"),
        ([rig(20.0), UNSTABLE], None, "as many unstable poles"),
        ([rig(20.0), np.eye(2)], None, "1 x 1|2 x 2"),
        ([rig(20.0), control.tf([1.0], [1.0, -0.5], 0.1)], None, "sampling time"),
        ([control.FrequencyResponseData(np.ones(3), [1.0, 2, 3])], None, "a model in their middle"),
        ([control.FrequencyResponseData(np.ones(3), [1.0, 2, 3]), rig(20.0)], rig(20.0), "models"),
        ([control.FrequencyResponseData(np.ones(3), [1.0, 2, k]) for k in (3, 4)], rig(20.0),
         "another list of frequencies"),
        ([control.FrequencyResponseData(np.array([1.0, np.nan, 1]), [1.0, 2, 3])], rig(20.0),
         "not finite"),
    ],
)  # fmt: skip
def test_families_that_do_not_go_together(plants, nominal, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.uncertain.cover(plants, nominal)


OMEGA = np.geomspace(1e-3, 1e5, 300)
S = 1j * OMEGA


def ratios(weight, omega, gains):
    return np.abs(weight(1j * omega).ravel()) / gains


def assert_stable_with_stable_inverse(weight):
    assert (weight.poles().real < 0).all()
    assert (weight.zeros().real < 0).all()


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_gain_of_a_system_is_found_again(unit):
    gains = np.abs(2 * (S + 1) / (S + 100))
    weight = bounding_weight(OMEGA * unit, 1e-5 * gains, 3)
    assert weight.nstates == 1
    assert weight.poles().real == pytest.approx([-100 * unit], rel=1e-2)
    found = ratios(weight, OMEGA * unit, 1e-5 * gains)
    assert found.min() >= 1
    assert found.max() < 1.001


@pytest.mark.parametrize("order", [0, 1, 3, 5])
@pytest.mark.parametrize("seed", [0, 1])
def test_weight_lies_above_rough_gains(seed, order):
    random = np.random.default_rng(seed)
    walk = np.cumsum(random.standard_normal(120)) * 0.2
    omega, gains = np.geomspace(0.1, 1e3, 120), np.exp(walk)
    weight = bounding_weight(omega, gains, order)
    assert weight.nstates <= order
    assert ratios(weight, omega, gains).min() >= 1
    assert_stable_with_stable_inverse(weight)


def test_first_order_is_the_best_of_its_order():
    # No first-order weight that a search over zero and pole finds is nearer.
    gains = np.abs(S / (S + 10) * (S + 500) / (S + 100)) + 0.01
    best = ratios(bounding_weight(OMEGA, gains, 1), OMEGA, gains).max()
    for zero in np.geomspace(1e-3, 1e3, 60):
        for pole in np.geomspace(1e-1, 1e4, 60):
            shape = np.abs((S + zero) / (S + pole)) / gains
            assert shape.max() / shape.min() > best * 0.99
