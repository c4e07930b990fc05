from dataclasses import replace

import pytest

from robustpolish.effects import Effect
from robustpolish.identification.fit.first_values import idle, sized, timely
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE

STRIBECK = {"force": 3.0, "static_force": 4.0, "velocity": 0.5, "width": 0.1}


def test_a_share_is_of_forces_alone():
    half = sized(Effect("stribeck_friction", PLACE, STRIBECK), 0.5)
    assert dict(half.values) == {**STRIBECK, "force": 1.5, "static_force": 2.0}
    line = Effect("harmonic_force", "x", {"amplitude": 2.0, "frequency": 5.0, "phase": 0.3})
    assert dict(sized(line, 0.1).values) == {"amplitude": 0.2, "frequency": 5.0, "phase": 0.3}
    delay = Effect("input_delay", "F", {"delay": 0.01})
    assert sized(delay, 0.1).values == delay.values


def test_without_force_an_effect_is_idle():
    assert idle(Effect("quadratic_damping", PLACE, {"coefficient": 0.0}))
    assert not idle(Effect("quadratic_damping", PLACE, {"coefficient": 1e-9}))
    assert idle(Effect("dahl_friction", PLACE, {"force": 0.0, "stiffness": 0.0}))
    assert not idle(Effect("input_delay", "F", {"delay": 0.0}))  # it makes none anyway


@pytest.mark.parametrize("samples", [2.2, 5.7])
def test_a_delay_of_a_held_input_begins_within_its_sample(samples):
    machine = replace(one(), measured=[("x", "acceleration")])
    delay = samples * machine.dt
    late = [("input_delay", ("F_x",), [delay])]
    case = Case("late", machine, late, drive=8.0, samples=1200, held=True)
    held = model_of(case).with_effect("input_hold", "F_x", {"order": 0.0})
    prepared = prepared_of(held, records(case)[0][0])
    first = Effect("input_delay", "F_x", {"delay": 4.0 * machine.dt})
    found = timely(first, held, prepared)
    assert abs(found.values["delay"] - delay) < 0.5 * machine.dt
    assert timely(first, model_of(case), prepared) is first  # nothing jumps between samples
    friction = Effect("coulomb_friction", ("x", "ground"), {"force": 1.0})
    assert timely(friction, held, prepared) is friction
