"""What a kind of effect has to have, and what a linear model keeps of it."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects import effect as catalogue
from robustpolish.machines.effects.effect import Effect, lookup, register
from robustpolish.machines.effects.kind import EffectKind, Parameter

FACTOR = (Parameter("factor", "1", "true over measured", default=1.0),)


def scaled(u, time, values):
    return values["factor"] * u


def law(t, q, v, z, p, f, dz):
    f[0] = -p[0] * q[0]


def test_units_follow_the_motion():
    parameter = lookup("cubic_stiffness").parameter("stiffness")
    assert parameter.unit() == "N/m^3"
    assert parameter.unit(rotational=True) == "N m/rad^3"


@pytest.mark.parametrize("domain", ["input", "output"])
def test_an_effect_on_a_signal_without_its_function_is_refused(domain):
    with pytest.raises(InvalidInputError, match="neither law nor on_signal") as caught:
        EffectKind("lost", "Lost", domain, FACTOR)
    assert caught.value.key == ("lost", "on_signal")
    with pytest.raises(InvalidInputError, match="with law"):
        EffectKind("lost", "Lost", domain, FACTOR, law)


def test_an_effect_that_makes_a_force_needs_a_law():
    with pytest.raises(InvalidInputError, match=r"lost\.law"):
        EffectKind("lost", "Lost", "pair", FACTOR)
    with pytest.raises(InvalidInputError, match="on_signal"):
        EffectKind("lost", "Lost", "pair", FACTOR, law, on_signal=scaled)
    with pytest.raises(InvalidInputError, match="domain"):
        EffectKind("lost", "Lost", "nowhere", FACTOR, law)


def test_the_linear_part_is_the_answer_to_a_step_if_nothing_else_is_said():
    kind = EffectKind("scaled", "Scaled", "input", FACTOR, on_signal=scaled)
    assert kind.signal_slope({"factor": 2.5}) == (2.5, 0.0, 0.0)


def test_the_linear_part_may_be_told_as_a_gain_and_a_delay():
    told = {"on_signal": scaled, "linear_signal": lambda values: (values["factor"], 0.25)}
    kind = EffectKind("scaled", "Scaled", "input", FACTOR, **told)
    slope = kind.signal_slope({"factor": 2.5})
    assert (slope.gain, slope.delay, slope.lag) == (2.5, 0.25, 0.0)


def test_a_signal_of_another_length_is_refused(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})
    register(EffectKind("cut", "Cut", "input", FACTOR, on_signal=lambda u, t, values: u[1:]))
    with pytest.raises(InvalidInputError, match="like the signal"):
        Effect("cut", "F").on_signal(np.ones(5), np.arange(5.0))


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("cubic_stiffness", {"stiffness": -2.0}, (3 * 2.0 * 0.3**2, 0.0, 0.0)),
        ("quadratic_stiffness", {"stiffness": 2.0}, (2 * 2.0 * 0.3, 0.0, 0.0)),
        ("quadratic_damping", {"coefficient": 2.0}, (0.0, 2 * 2.0 * 5.0, 0.0)),
        (
            "displacement_dependent_damping",
            {"coefficient": 2.0},
            (2 * 2.0 * 0.3 * 5.0, 2.0 * 0.3**2, 0.0),
        ),
        ("contact_stop", {"stiffness": 7.0, "gap": 0.1}, (7.0, 0.0, 0.0)),
        ("gyroscopic_coupling", {"coefficient": -7.0}, (0.0, 7.0, 0.0)),
        ("cross_stiffness", {"stiffness_xy": 2.0, "stiffness_yx": -7.0}, (7.0, 0.0, 0.0)),
        ("constant_force", {"force": 7.0}, (0.0, 0.0, 0.0)),
        ("unbalance", {"unbalance": 7.0}, (0.0, 0.0, 0.0)),
    ],
)
def test_the_units_tell_how_steep_a_power_law_is(name, values, expected):
    kind = lookup(name)
    full = {p.name: p.default for p in kind.parameters} | values
    assert kind.steepness(full, 0.3, 5.0) == pytest.approx(expected)


def test_powers_need_not_be_whole_and_other_units_stay():
    contact = Parameter("stiffness", "F/L^1.5", "of a ball on a plane")
    assert contact.unit() == "N/m^1.5"
    assert contact.unit(rotational=True) == "N m/rad^1.5"
    assert contact.powers == {"F": 1, "L": -1.5, "T": 0, "M": 0}
    assert contact.slopes(2.0, q=4.0, v=1.0) == (6.0, 0.0)
    assert Parameter("root", "F/L^0.5", "").slopes(2.0, q=0.0, v=0.0) == (0.0, 0.0)
    pressed = Parameter("gain", "F*T/L/MPa", "damping by pressure")
    assert pressed.unit() == "N s/m/MPa"
    assert pressed.powers == {"F": 1, "L": -1, "T": 1, "M": 0}


def test_a_kind_shows_itself_in_a_line():
    shown = repr(lookup("coulomb_friction"))
    assert shown.startswith("EffectKind('coulomb_friction', 'pair': force [N]")
    assert len(shown.splitlines()) == 1
