"""The true numbers, in the terms in which the package states them."""

from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.diagnosis.findings import Value
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.simulation.run import simulate_model
from tests.hidden_effects.cases import Case, axes, model_of, one, records, two
from tests.hidden_effects.drawn import AXES, DOF, PAIR, SIGNAL
from tests.hidden_effects.intervals import TRUTH, Stated, effect_numbers, floor_ratios, own_numbers
from tests.hidden_effects.made_up import diagnosis_of, found
from tests.hidden_effects.motion import motion
from tests.hidden_effects.several import several_case

X = ("x", "ground")


def numbers(case, *effects, **more):
    return {
        s.name.partition(".")[2]: s
        for s in effect_numbers(case, diagnosis_of(case, effects, **more))
    }


def test_an_interval_is_two_standard_errors_wide_to_each_side():
    assert Stated("k", 1.0, 1.19, 0.1).covered
    assert not Stated("k", 1.0, 1.2, 0.1).covered


def test_all_kinds_that_are_drawn_have_numbers():
    assert set(PAIR + DOF + AXES + SIGNAL) <= set(TRUTH)


def test_most_numbers_are_the_same():
    case = Case("stribeck", one(), [("stribeck_friction", X, [5.0, 9.0, 0.15, 0.004])])
    told = numbers(case, found("stribeck_friction", X, force=5.05, static_force=9.5, velocity=0.15))
    assert {name: s.truth for name, s in told.items()} == {
        "force": 5.0, "static_force": 9.0, "velocity": 0.15
    }  # fmt: skip
    assert [s.covered for s in told.values()] == [True, False, True]


def test_only_what_is_named_right_and_fitted_is_compared():
    case = Case("coulomb", one(), [("coulomb_friction", X, [5.0, 0.004])])
    assert set(numbers(case, found("coulomb_friction", X, force=5.0, width=0.1))) == {"force"}
    assert not numbers(case, found("stribeck_friction", X, force=5.0))
    held = replace(found("coulomb_friction", X), parameters={"force": Value(5.0, 0.0, "N")})
    assert not numbers(case, held)


def test_bouc_wen_refers_to_another_force():
    case = Case("bouc-wen", one(), [("bouc_wen_hysteresis", X, [2500.0, 0.004, 1.5])])
    told = numbers(case, found("bouc_wen_hysteresis", X, force=20.0, stiffness=1.0, exponent=1.0,
                               beta=1.0, gamma=1.0))  # fmt: skip
    assert told["stiffness"].truth == 2500.0
    assert told["beta"].truth == told["gamma"].truth == pytest.approx(0.5 * 2**1.5)


@pytest.mark.parametrize(
    ("kind", "at", "size", "names"),
    [
        ("harmonic_force", ("x",), 5.0, ("amplitude", "frequency", "phase")),
        ("unbalance", ("x", "y"), 0.002, ("unbalance", "phase")),
        ("parametric_stiffness", X, 400.0, ("amplitude", "phase")),
    ],
)
def test_phases_are_those_at_the_first_sample(kind, at, size, names):
    case = Case(kind, axes(), [(kind, at, [size, 2 * np.pi * 9.0, 0.7])], warm_up=300, samples=2000)
    told = numbers(case, found(kind, at, **dict.fromkeys(names, 1.0)))
    assert_moves_alike(case, Effect(kind, at, {name: s.truth for name, s in told.items()}))


def test_the_other_way_round_turns_what_is_odd():
    case = Case("stop", two(), [("contact_stop", ("x", "x_m"), [0.01, 1e4])])
    told = numbers(case, found("contact_stop", ("x_m", "x"), gap=-0.01, stiffness=1e4))
    assert (told["gap"].truth, told["stiffness"].truth) == (-0.01, 1e4)


@pytest.mark.parametrize(
    ("kind", "p", "names"),
    [
        ("gyroscopic_coupling", [6.0], ("coefficient",)),
        ("cross_stiffness", [90.0, -40.0], ("stiffness_xy", "stiffness_yx")),
    ],
)
def test_the_other_axis_first(kind, p, names):
    case = Case(kind, axes(), [(kind, ("x", "y"), p)], samples=2000)
    turned = found(kind, ("y", "x"), **dict.fromkeys(names, 1.0))
    truth = {name: s.truth for name, s in numbers(case, turned).items()}
    assert_moves_alike(case, Effect(kind, ("y", "x"), truth))


def assert_moves_alike(case, effect):
    """The package's model with these numbers moves as the integrator does."""
    (data, _), _ = records(case)
    moved = motion(case)
    begin = np.concatenate([moved.displacement[0], moved.velocity[0]])
    model = model_of(case).with_effect(effect.kind, effect.at, effect.parameters)
    run = simulate_model(model, data, begin).outputs
    assert np.max(np.abs(run - moved.displacement)) < 1e-3 * np.max(np.abs(run))


def test_a_held_input_lags_half_a_sample():
    case = Case("delay", one(), [("input_delay", ("F_x",), [0.005])], held=True)
    told = found("input_delay", ("F_x",), delay=0.006)
    assert numbers(case, told)["delay"].truth == pytest.approx(0.006)
    knows = model_of(case).with_effect("input_hold", ("F_x",), {"order": 0.0})
    assert numbers(case, told, model=knows)["delay"].truth == 0.005
    assert numbers(replace(case, held=False), told)["delay"].truth == 0.005


def test_a_decay_has_the_unit_of_the_models_mass():
    case = Case("decay", one(), [("cubic_stiffness", X, [4e6])], excitation="none", start=0.02,
                wrong={"mass": 0.05})  # fmt: skip
    assert numbers(case, found("cubic_stiffness", X, stiffness=4e6))["stiffness"].truth == (
        pytest.approx(4.2e6)
    )
    values = {
        "spring[0].stiffness": Value(3150.0, 1.0, "N/m"),
        "dof.x.mass": Value(1.05, 0.0, "kg"),
    }
    own = own_numbers(case, diagnosis_of(case, parameters=values))
    assert [(s.name, s.truth, s.covered) for s in own] == [("spring[0].stiffness", 3150.0, True)]


def test_a_decay_has_the_force_that_bouc_wen_refers_to_in_that_unit():
    case = Case("decay", one(), [("bouc_wen_hysteresis", X, [2500.0, 0.004, 1.5])],
                excitation="none", start=0.02, wrong={"mass": 0.05})  # fmt: skip
    told = numbers(case, found("bouc_wen_hysteresis", X, force=10.5, stiffness=2625.0,
                               exponent=1.5, beta=0.5, gamma=0.5))  # fmt: skip
    assert told["stiffness"].truth == pytest.approx(2625.0)
    assert told["beta"].truth == pytest.approx(0.5)


def test_where_another_gain_is_named_all_is_in_other_units():
    effects = [("sensor_gain", ("x",), [1.3]), ("cubic_stiffness", X, [4e6])]
    case = Case("gain", one(), effects)
    cubic = found("cubic_stiffness", X, stiffness=4e6)
    assert not numbers(case, cubic, found("input_gain", ("F_x",), gain=1.3))
    assert not numbers(case, cubic, found("sensor_gain", ("x",), gain=1.3))  # the only sensor


def test_the_stated_noise_is_compared_in_the_unit_of_the_sensor():
    case = several_case(0)
    (data, noise), _ = records(case)
    stated = {name: 1.2 * noise[name] / float(np.std(data[name].values)) for name in noise}
    ratios = floor_ratios(data, noise, diagnosis_of(case, noise_floor=stated))
    assert ratios == pytest.approx(dict.fromkeys(noise, 1.2))
