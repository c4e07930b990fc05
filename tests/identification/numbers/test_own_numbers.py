from dataclasses import replace

import pytest

from robustpolish.identification.refit import (
    fit_own_parameters,
    scaled_to_priors,
    with_reselected_holds,
    with_resolved_delay,
    with_selected_holds,
)
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.parts import Dof, Input, Output, Spring
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, of_rig, oscillator, rig


def held_model(**changes):
    case = Case("held", one(), drive=10.0, samples=1500, **changes)
    model = model_of(case)
    return with_selected_holds(model, prepared_of(model, records(case)[0][0]))


def test_inputs_that_stay_between_samples_are_found():
    (hold,) = held_model(held=True).effects
    assert (hold.kind, hold.at, hold.values["order"]) == ("input_hold", ("F_x",), 0.0)


@pytest.mark.parametrize("hidden", [[], [("input_delay", ("F_x",), [0.005])]])
def test_neither_a_linear_input_nor_a_late_one_is_a_hold(hidden):
    assert held_model(effects=hidden).effects == ()


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("taken", [True, False])
def test_a_hold_of_before_is_asked_about_like_any_other(held, taken):
    case = Case("held", one(), drive=10.0, samples=1500, held=held, noise_db=60.0)
    model = model_of(case)
    prepared = prepared_of(model, records(case)[0][0])
    before = model.with_effect("input_hold", "F_x", {"order": 0.0}) if taken else model
    found = with_selected_holds(before, prepared)
    assert [e.values["order"] for e in found.effects] == [0.0] * held
    assert (found is before) == (held == taken)


def test_what_has_no_force_has_no_hold():
    assert with_selected_holds(rig(), prepared_of(rig(), of_rig())).effects == ()
    assert with_reselected_holds(rig(), rig(), prepared_of(rig(), of_rig())) is None


LATE = ("input_delay", ("F_x",), [0.0052])


@pytest.mark.parametrize("effects", [[], [LATE]])
@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("taken", [True, False])
def test_a_hold_that_was_taken_wrongly_is_mended_beside_what_was_found(effects, held, taken):
    """A delay has the half sample of a hold for its own."""
    case = Case("held", one(), effects, drive=10.0, samples=1500, held=held, noise_db=80.0)
    plain = model_of(case)
    prepared = prepared_of(plain, records(case)[0][0])
    hold = ("input_hold", ("F_x",), {"order": 0.0})
    reference = plain.with_effect(*hold) if taken else plain
    model = reference
    for kind, at, (delay,) in effects:
        lag = case.machine.dt / 2 * (held - taken)
        model = model.with_effect(kind, at, {"delay": delay + lag})
    found = with_reselected_holds(model, reference, prepared)
    if held == taken:
        assert found is None
    else:
        assert [e.kind for e in found.effects] == ["input_hold"] * held


def test_wrong_numbers_are_mended():
    case = Case("wrong", one(), drive=10.0, samples=1500, wrong={"stiffness": 0.3, "damping": 2.0})
    model = model_of(case)
    own = fit_own_parameters(model, prepared_of(model, records(case)[0][0]))
    for found in (own.stage.model.parameters, own.short_window_model.parameters):
        stiffness = found["spring[0].stiffness"] / found["dof.x.mass"]
        assert stiffness == pytest.approx(3000, rel=0.01)
    assert own.stage.reproducible
    damping = own.stage.model.parameters["damper[0].damping"]
    assert damping == pytest.approx(2 * 0.02 * 3000**0.5, rel=0.1)


TWO = {
    "dofs": [Dof("x", 2.0), Dof("y", 1.0)],
    "springs": [Spring(PLACE, 400.0), Spring(("y", "x"), 100.0)],
    "inputs": [Input("F", PLACE), Input("G", ("y", "ground"))],
}


def test_a_chain_with_two_inputs_goes_back_to_what_is_known_of_it():
    """All of its numbers are larger by a tenth; masses and gains tell that, a spring is stiffer."""
    reference = oscillator(**TWO)
    larger = {key: 1.1 * value for key, value in reference.parameters.items()}
    larger["spring[1].stiffness"] = 165.0
    found = scaled_to_priors(reference.with_parameters(larger), reference, 0.01).parameters
    for key, value in reference.parameters.items():
        expected = 150.0 if key == "spring[1].stiffness" else value
        assert found[key] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"inputs": [Input("F", PLACE)]},  # the gain is the only one: it stays as it is
        {"outputs": [Output("f", PLACE, "force")]},  # forces are known
    ],
)
def test_a_chain_whose_factor_the_data_know_stays(changes):
    reference = oscillator(**{**TWO, **changes})
    larger = reference.with_parameters({k: 1.1 * v for k, v in reference.parameters.items()})
    assert scaled_to_priors(larger, reference, 0.01) is larger
    assert scaled_to_priors(reference, reference, 0.01) is reference


@pytest.mark.parametrize("samples", [2.2, 5.7])
def test_a_delay_of_a_held_input_begins_within_its_sample(samples):
    machine = replace(one(), measured=[("x", "acceleration")])
    delay = samples * machine.dt
    late = [("input_delay", ("F_x",), [delay])]
    case = Case("late", machine, late, drive=8.0, samples=1200, held=True)
    held = model_of(case).with_effect("input_hold", "F_x", {"order": 0.0})
    prepared = prepared_of(held, records(case)[0][0])
    first = Effect("input_delay", "F_x", {"delay": 4.0 * machine.dt})
    found = with_resolved_delay(first, held, prepared)
    assert abs(found.values["delay"] - delay) < 0.5 * machine.dt
    assert (
        with_resolved_delay(first, model_of(case), prepared) is first
    )  # nothing jumps between samples
    friction = Effect("coulomb_friction", ("x", "ground"), {"force": 1.0})
    assert with_resolved_delay(friction, held, prepared) is friction
