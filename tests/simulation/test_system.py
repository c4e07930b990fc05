"""A model with effects as a linear system with nonlinear ports."""

import numpy as np

import robustpolish as rp
from robustpolish.machines.simulation.run import build_system, needed_substeps

GROUND = ("x", "ground")
PLAIN = rp.MechanicalModel(
    [rp.Dof("x", 2.0)], [rp.Spring(GROUND, 800.0)], [rp.Damper(GROUND, 4.0)],
    [rp.Input("F", GROUND)], [rp.Output("x", GROUND)],
)  # fmt: skip


def test_parameters_and_states_of_the_effects_stand_one_after_the_other():
    resonator = {"mass": 0.02, "stiffness": 500.0, "damping": 0.3}
    model = (
        PLAIN.with_effect("cubic_stiffness", GROUND, {"stiffness": 5.0})
        .with_effect("input_gain", "F", {"gain": 2.0})
        .with_effect("attached_resonator", "x", resonator)
    )
    system = build_system(model, 1e-3)
    assert [effect.kind for effect in system.effects] == ["cubic_stiffness", "attached_resonator"]
    ports, states = system.layout[:, :2], system.layout[:, 2:4]
    assert ports.tolist() == [[0, 1], [1, 1]]
    assert states.tolist() == [[0, 0], [0, system.internal]]
    first, count = system.layout[1, 4:6]
    assert system.values[0] == 5.0
    np.testing.assert_array_equal(system.values[first : first + 3], list(resonator.values()))
    assert first + count == system.values.size
    assert len(system.laws) == 2
    np.testing.assert_allclose(system.G, [[0.0, 0.0], [0.5, 0.5]])


def test_friction_that_a_step_cannot_resolve_is_ideal():
    """0.2 N on 2 kg change the speed by 1e-4 m/s in a step of 1 ms."""
    for width, dry in ((0.0, True), (0.9e-4, True), (1.1e-4, False)):
        friction = {"force": 0.2, "width": width}
        system = build_system(PLAIN.with_effect("coulomb_friction", GROUND, friction), 1e-3)
        assert bool(system.layout[0, 6]) == dry
        assert system.values[2:].tolist() == ([0.0, 0.0] if dry else [width, 5e-4])
    cubic = PLAIN.with_effect("cubic_stiffness", GROUND, {"stiffness": 5.0})
    assert build_system(cubic, 1e-3).layout[0, 6] == 0


def test_the_linear_part_is_that_of_the_model():
    system = build_system(PLAIN, 1e-3)
    linear = PLAIN.state_space()
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(system, name), getattr(linear, name))
    assert (system.states, system.internal, system.G.shape) == (2, 0, (2, 0))


def test_stiffer_effects_take_more_steps_up_to_a_limit():
    assert needed_substeps(PLAIN, 1e-3, 1e-3) == 1
    counts = [
        needed_substeps(
            PLAIN.with_effect("cubic_stiffness", GROUND, {"stiffness": stiffness}), 1e-3, 1e-3
        )
        for stiffness in (1.0, 1e13, 1e30)
    ]
    assert counts[0] == 2
    assert 2 < counts[1] < 32
    assert counts[2] == 32
    sharp = PLAIN.with_effect("coulomb_friction", GROUND, {"force": 1e-6})
    assert needed_substeps(sharp, 1e-3, 1e-3) >= 4
