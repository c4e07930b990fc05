"""Measured against simulated: signs, units, exchanged sensors, means."""

import numpy as np
import pytest

from robustpolish.identification.sanity import (
    amplitudes,
    coherent_gain,
    means,
    signs,
    swapped_outputs,
)

A, B, C = np.random.default_rng(0).standard_normal((3, 6000))
SIMULATED = {"x": A, "y": 0.4 * A + B}
KINDS = {"x": "displacement in m", "y": "displacement in m"}


def gains_of(**measured):
    return {
        (a, b): coherent_gain(SIMULATED[b], values, 0.01)
        for a, values in measured.items()
        for b in SIMULATED
    }


def own(**measured):
    return {a: gain for (a, b), gain in gains_of(**measured).items() if a == b}


def test_one_sign_or_all():
    assert signs(own(x=A, y=SIMULATED["y"])) == []
    (one,) = signs(own(x=-A, y=SIMULATED["y"]))
    assert one.startswith("x moves against the model")
    assert one.endswith("direction of its sensor")
    (every,) = signs(own(x=-A, y=-SIMULATED["y"]))
    assert every.startswith("x, y all move against the model")
    (alone,) = signs(own(x=-3 * A + C))
    assert alone.endswith("or of the input")


def test_units_of_one_output_or_of_the_input():
    assert amplitudes(own(x=3 * A, y=0.2 * SIMULATED["y"]), ["F"]) == []
    (one,) = amplitudes(own(x=-1e3 * A, y=SIMULATED["y"]), ["F"])
    assert "x is 1e+03 times" in one
    assert "unit of x, and" in one
    both = amplitudes(own(x=700 * A, y=1500 * SIMULATED["y"]), ["F", "G"])
    assert len(both) == 2
    assert all("unit of" in text and "and of F, G" in text for text in both)


def test_exchanged_sensors_of_one_kind():
    straight = gains_of(x=A, y=SIMULATED["y"])
    crossed = gains_of(x=SIMULATED["y"] + 0.05 * C, y=A)
    assert swapped_outputs(straight, KINDS) == []
    assert "x and y look exchanged" in swapped_outputs(crossed, KINDS)[0]
    assert swapped_outputs(crossed, {**KINDS, "y": "velocity in m/s"}) == []
    assert swapped_outputs(gains_of(x=C, y=A), KINDS) == []  # only one of them has another place


@pytest.mark.parametrize(
    ("away", "unit", "words"),
    [(9.81, "m/s^2", "feels gravity"), (9.81, "m", "sensor's zero"), (-5.0, "m/s^2", "zero")],
)
def test_means_far_from_the_model(away, unit, words):
    (found,) = means({"x": A + away}, {"x": A}, {"x": unit})
    assert words in found
    assert f"{away:.3g} {unit} from the model" in found


def test_means_within_the_motion_are_left_alone():
    assert means({"x": A + 2}, {"x": A}, {"x": "m"}) == []
    assert means({"x": A + 9}, {"x": np.full(6000, np.inf)}, {"x": "m"}) == []
