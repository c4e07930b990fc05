from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.fit.parameters import (
    chain_keys,
    connected,
    free_parameters,
    inputs_of_chain,
    makes_no_force,
    scale_fixing_masses,
    scaled_effect,
    with_fixed_force_scale,
)
from robustpolish.identification.policy import POLICY
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE, oscillator, rig


def machine(**changes):
    """Two masses in a chain, pushed at both, and a third one that hangs on nothing of theirs."""
    parts = {
        "dofs": [Dof("a", 2.0), Dof("b", 1.0), Dof("z", 4.0)],
        "springs": [
            Spring(("a", "ground"), 900.0),
            Spring(("b", "a"), 500.0),
            Spring(("z", "ground"), 100.0),
        ],
        "dampers": [Damper(("b", "a"), 3.0)],
        "inputs": [Input("F_a", ("a", "ground")), Input("F_b", ("b", "ground"), gain=-2.0)],
        "outputs": [Output("b", ("b", "ground")), Output("z", ("z", "ground"))],
    }
    return MechanicalModel(**{**parts, **changes})


def free(model, **options):
    return {p.key: p for p in free_parameters(model, 10.0, POLICY, **options)}


def test_chains_are_what_parts_and_effects_join():
    assert connected(machine()) == [{"z"}, {"a", "b"}]
    joined = machine().with_effect("coulomb_friction", ("z", "b"), {"force": 1.0})
    assert connected(joined) == [{"a", "b", "z"}]
    assert chain_keys(machine(), {"a", "b"}) == (
        ["dof.a.mass", "dof.b.mass"],
        ["spring[0].stiffness", "spring[1].stiffness"],
        ["damper[0].damping"],
    )
    assert inputs_of_chain(machine(), {"a", "b"}) == ["F_a", "F_b"]
    assert inputs_of_chain(machine(), {"z"}) == []


def test_a_mass_gives_the_unit_of_force_where_no_force_is_known():
    assert scale_fixing_masses(machine()) == {"z": {"z"}}
    decay = machine(inputs=[])
    assert scale_fixing_masses(decay) == {"z": {"z"}, "a": {"a", "b"}}  # the heavier one
    measured = machine(inputs=[], outputs=[Output("f", ("a", "ground"), "force")])
    assert set(scale_fixing_masses(measured)) == {"z"}
    unknown = oscillator().with_effect("input_gain", "F", {"gain": 2.0})
    assert set(scale_fixing_masses(unknown)) == {"x"}
    assert set(
        scale_fixing_masses(oscillator().with_effect("sensor_gain", "x", {"gain": 2.0}))
    ) == {"x"}


def test_a_mass_that_gives_the_unit_stays_and_its_chain_goes_along():
    known = machine(inputs=[])
    fitted = known.with_parameters({"dof.a.mass": 4.0, "spring[1].stiffness": 700.0})
    found = with_fixed_force_scale(fitted, known).parameters
    assert found["dof.a.mass"] == 2.0
    assert found["dof.b.mass"] == 0.5
    assert found["spring[1].stiffness"] == 350.0
    assert found["spring[2].stiffness"] == 100.0  # of the other chain
    assert with_fixed_force_scale(known, known) is known


def test_what_is_fitted():
    assert set(free(machine())) == {
        "dof.a.mass", "dof.b.mass", "spring[0].stiffness", "spring[1].stiffness",
        "spring[2].stiffness", "damper[0].damping", "input.F_a.gain", "input.F_b.gain",
    }  # fmt: skip
    # the gain of an only input says nothing beside masses and springs
    assert "input.F.gain" not in free(oscillator())
    assert set(free(rig())) == {"spring[0].stiffness", "damper[0].damping"}


def test_well_known_numbers_stay_near_what_was_known():
    reference = machine()
    fitted = reference.with_parameters({"dof.a.mass": 2.2, "input.F_b.gain": -1.9})
    found = free(fitted, reference=reference)
    mass, gain = found["dof.a.mass"], found["input.F_b.gain"]
    assert (mass.start, mass.centre, mass.prior) == (2.2, 2.0, 0.05 * 2.0)
    assert (mass.lower, mass.upper) == pytest.approx((0.8, 5.0))
    assert (gain.start, gain.centre, gain.prior) == (-1.9, -2.0, pytest.approx(0.1))
    assert (gain.lower, gain.upper) == pytest.approx((-5.0, -0.8))


def test_springs_and_dampers_keep_their_signs_and_may_be_missing():
    model = machine(
        springs=[Spring(("a", "ground"), -900.0), Spring(("b", "a"), 0.0)],
        dampers=[Damper(("b", "a"), 3.0), Damper(("a", "ground"), 0.0)],
    )
    found = free(model)
    magnet, none = found["spring[0].stiffness"], found["spring[1].stiffness"]
    assert (magnet.lower, magnet.upper, magnet.prior) == (-np.inf, 0.0, 0.3 * 900.0)
    assert (none.lower, none.upper, none.prior) == (0.0, np.inf, np.inf)
    mass = (2.0 + 1.0 + 4.0) / 3
    assert none.scale == pytest.approx(mass * 10.0**2)  # what moves it at the bandwidth
    assert found["damper[1].damping"].scale == pytest.approx(0.02 * mass * 10.0)
    assert found["damper[0].damping"].prior == 3.0


def test_effects_say_themselves_what_is_fitted_and_how_far():
    model = oscillator().with_effect("coulomb_friction", PLACE, {"force": 3.0})
    found = free(model)["effect[0].force"]
    assert found.is_effect
    assert (found.start, found.scale, found.lower, found.upper) == (3.0, 3.0, 0.0, np.inf)
    assert found.prior == np.inf
    assert "effect[0].width" not in free(model)
    asked = replace(model.effects[0], parameters={"force": 3.0, "asymmetry": 0.1})
    assert "effect[0].asymmetry" not in free(replace(model, effects=(asked,)))
    assert not free(model)["dof.x.mass"].is_effect


def test_a_channel_belongs_to_no_chain():
    model = machine()
    assert connected(model.with_channel("u", "V")) == connected(model)
    assert chosen(model.with_channel("u", "V")) == chosen(model)


def chosen(model):
    return [free.key for free in free_parameters(model, 30.0, POLICY)]


def test_a_friction_that_turns_over_gently_never_becomes_a_jump_in_one_fit():
    model = oscillator().with_effect("coulomb_friction", PLACE, {"force": 1.0, "width": 0.2})
    numbers = free_parameters(model, 10.0, POLICY, oscillator())
    (width,) = (number for number in numbers if number.key == "effect[0].width")
    assert (width.lower, width.start) == (pytest.approx(0.02), 0.2)


STRIBECK = {"force": 3.0, "static_force": 4.0, "velocity": 0.5, "width": 0.1}


def test_a_share_is_of_forces_alone():
    half = scaled_effect(Effect("stribeck_friction", PLACE, STRIBECK), 0.5)
    assert dict(half.values) == {**STRIBECK, "force": 1.5, "static_force": 2.0}
    line = Effect("harmonic_force", "x", {"amplitude": 2.0, "frequency": 5.0, "phase": 0.3})
    assert dict(scaled_effect(line, 0.1).values) == {
        "amplitude": 0.2,
        "frequency": 5.0,
        "phase": 0.3,
    }
    delay = Effect("input_delay", "F", {"delay": 0.01})
    assert scaled_effect(delay, 0.1).values == delay.values


def test_without_force_an_effect_is_idle():
    assert makes_no_force(Effect("quadratic_damping", PLACE, {"coefficient": 0.0}))
    assert not makes_no_force(Effect("quadratic_damping", PLACE, {"coefficient": 1e-9}))
    assert makes_no_force(Effect("dahl_friction", PLACE, {"force": 0.0, "stiffness": 0.0}))
    assert not makes_no_force(Effect("input_delay", "F", {"delay": 0.0}))  # it makes none anyway
