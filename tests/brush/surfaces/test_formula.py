import numpy as np
import pytest

import robustpolish as rp

AREA = {"x": (-0.02, 0.03), "y": (-0.01, 0.01)}


def test_names_constants_and_an_equals_sign():
    mould = rp.polishing.Mould.from_formula("z = depth*(1 - exp(-x**2/w**2)) + 0*y*pi", **AREA,
                                  parameters={"depth": 0.002, "w": 0.02})  # fmt: skip
    assert mould.height(0.01, 0.0) == pytest.approx(0.002 * (1 - np.exp(-0.25)), abs=1e-9)
    assert mould.error <= 1e-9


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("abs(x)", "edge"),
        ("a*x", "the name 'a'"),
        ("log(x)", "without a value"),
        ("1/x", "off on a grid"),
        ("__import__('os')", "the name"),
        ("x.real", "formula"),
        ("sqrt(x**2 + 1e-12)", "off on a grid"),
        (7, "text"),
    ],
)
def test_what_is_no_smooth_height_is_refused(text, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.polishing.Mould.from_formula(text, **AREA)


def test_areas_and_parameters_are_checked():
    with pytest.raises(rp.InvalidInputError, match="x"):
        rp.polishing.Mould.from_formula("x", x=(0.0, 0.0), y=(0.0, 1.0))
    with pytest.raises(rp.InvalidInputError, match="finite"):
        rp.polishing.Mould.from_formula("a*x", **AREA, parameters={"a": np.nan})
