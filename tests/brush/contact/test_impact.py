"""The thesis's estimates of one blow."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.thesis.contact_study import impact_depth, quarter_period, rim_mass


def test_durations_and_depths_of_the_thesis():
    for run in (1, 2, 3, 4):
        brush = BrushParameters.for_run(run)
        assert quarter_period(brush.mass, brush.contact_stiffness) == brush.impact_duration
    stored = 0.5 * 1e8 * impact_depth(0.2, 1e8, 0.7) ** 2
    assert stored == pytest.approx(0.5 * 0.2 * 0.7**2)


def test_the_mass_at_the_rim():
    assert rim_mass(BrushParameters()) == pytest.approx(6.6667e-6 / 1.25e-4, rel=1e-4)


def test_bad_numbers_are_named():
    with pytest.raises(InvalidInputError, match="mass"):
        quarter_period(0.0, 1e4)
    with pytest.raises(InvalidInputError, match="stiffness"):
        impact_depth(0.2, -1.0, 1.0)
