"""The trough, against finite differences and the thesis's numbers."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.surfaces.surface import Surface


def test_published_surface_is_equation_9_1() -> None:
    x, y = 0.013, -0.004
    expected = 0.1 * (5 * x / 4) ** 2 + 5 * (4 * y) ** 2
    assert Surface.as_published().height(x, y) == pytest.approx(expected, rel=1e-14)


def test_slopes_are_the_derivatives_of_the_height() -> None:
    surface, x, y, step = Surface(0.7, 3.0), 0.02, 0.005, 1e-6
    slope_x, slope_y = surface.gradient(x, y)
    assert slope_x == pytest.approx(
        (surface.height(x + step, y) - surface.height(x - step, y)) / (2 * step), rel=1e-8
    )
    assert slope_y == pytest.approx(
        (surface.height(x, y + step) - surface.height(x, y - step)) / (2 * step), rel=1e-8
    )


def test_elevation_does_not_depend_on_the_length_of_the_direction() -> None:
    surface = Surface()
    short, long = (surface.elevation(0.01, 0.01, (s * 3.0, s * 4.0)) for s in (1e-9, 1e9))
    assert short == pytest.approx(long, rel=1e-14)
    assert surface.elevation(0.01, 0.01, (-3.0, -4.0)) == pytest.approx(-long, rel=1e-14)


def test_the_disc_fits_by_default_but_not_in_the_published_trough() -> None:
    assert Surface().fits(0.010)
    assert Surface.as_published().trough_radius == pytest.approx(6.25e-3)
    assert not Surface.as_published().fits(0.010)
    assert Surface.flat().trough_radius == np.inf


def test_direction_without_length_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="direction"):
        Surface().elevation(0.0, 0.0, (0.0, 0.0))


@pytest.mark.parametrize("values", [{"along": -0.1}, {"across": np.nan}, {"across": "steep"}])
def test_bad_coefficients_are_named(values: dict) -> None:
    with pytest.raises(InvalidInputError, match=next(iter(values))):
        Surface(**values)
