"""What the air bearing is made of, against the numbers printed in the thesis."""

import dataclasses

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_damping_coefficients_of_table_9_1():
    damping = rp.polishing.AirBearingParameters.as_published().damping(0.001)
    assert damping.c_A == pytest.approx(1.31593, abs=5e-6)
    assert damping.c_D == pytest.approx(0.0389224, abs=5e-8)
    assert damping.c_R == pytest.approx(0.558123, abs=5e-7)


def test_natural_frequencies_of_table_9_1():
    frequency = rp.polishing.AirBearingParameters().natural_frequencies()
    np.testing.assert_allclose(frequency["x"], [13003.5, 1219.37], rtol=5e-6)
    assert frequency["z"][0] == pytest.approx(28970.2, rel=2e-6)
    assert frequency["z_free"][0] == pytest.approx(20157, rel=1e-5)
    assert frequency["z_free"][1] == 0


def test_table_to_the_letter_gives_other_modes():
    printed = rp.polishing.AirBearingParameters.as_printed()
    assert (printed.bearing_mass, printed.holder_stiffness) == (0.337, 1e10)
    assert printed.natural_frequencies()["x"][0] / (2 * np.pi) == pytest.approx(5271.9, abs=0.05)


def test_corrected_inertia():
    corrected = rp.polishing.AirBearingParameters.corrected()
    assert corrected.m_x == pytest.approx(0.242, abs=5e-4)
    assert corrected.natural_frequencies()["x"][0] / (2 * np.pi) == pytest.approx(3361, abs=0.5)


@pytest.mark.parametrize(
    "change",
    [
        {"brush_mass": -0.2},
        {"rod_length": 0},
        {"young_modulus": float("nan")},
        {"rod_mass": -1},
        {"inertia_reading": "guess"},
        {"bearing_mass": "heavy"},
        {"rod_mass": 10.0},
    ],
)
def test_unphysical_parameters_are_refused(change):
    with pytest.raises(InvalidInputError) as caught:
        rp.polishing.AirBearingParameters(**change)
    assert str(caught.value).split(":")[0] in {*change, "bearing_mass"}


def test_every_field_has_unit_and_source():
    for name, value, unit, source in rp.polishing.AirBearingParameters().table():
        assert source, name
        assert unit or isinstance(value, str), name
    with pytest.raises(dataclasses.FrozenInstanceError):
        rp.polishing.AirBearingParameters().brush_mass = 1.0
