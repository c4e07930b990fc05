import numpy as np
import pytest

import robustpolish as rp

BOWL = "0.05 - sqrt(0.05**2 - x**2 - y**2)"


def test_a_sphere_has_one_curvature_wherever_it_slopes():
    sphere = rp.polishing.Mould.from_formula(BOWL, x=(-0.02, 0.02), y=(-0.02, 0.02))
    x, y = np.random.default_rng(0).uniform(-0.015, 0.015, (2, 30))
    for curvature in sphere.principal_curvatures(x, y):
        np.testing.assert_allclose(curvature, 20.0, rtol=1e-3)


def test_elevation_of_a_mould_is_that_of_the_same_trough():
    trough = rp.polishing.Surface(0.2, 1.5)
    along, across = (0.5 * bend for bend in trough.curvatures)
    mould = rp.polishing.Mould.from_formula(
        "a*x**2 + b*y**2", x=(-0.02, 0.02), y=(-0.02, 0.02), parameters={"a": along, "b": across}
    )
    x, y = np.random.default_rng(0).uniform(-0.02, 0.02, (2, 20))
    direction = (np.cos(x * 500), np.sin(x * 500))
    found = mould.elevation(x, y, direction)
    np.testing.assert_allclose(found, trough.elevation(x, y, direction), atol=1e-12)
    with pytest.raises(rp.InvalidInputError, match="length above 0"):
        mould.elevation(0.0, 0.0, (0.0, 0.0))
