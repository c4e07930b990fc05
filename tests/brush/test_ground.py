import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing.simulate import largest_bend_under_disc

AREA = {"x": (-0.03, 0.03), "y": (-0.03, 0.03)}
SPIRAL = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)


def refused(message, **arguments):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.simulate_brush(duration=0.01, **arguments)


def test_paths_that_leave_the_mould_or_end_too_soon():
    small = rp.polishing.Mould.from_formula("x**2 + y**2", x=(-0.02, 0.02), y=(-0.02, 0.02))
    refused("leaves the mould by 3.18 mm around x = 12 mm", surface=small, path=SPIRAL)
    with pytest.raises(rp.InvalidInputError, match="at least the duration"):
        rp.simulate_brush(duration=10.0, path=SPIRAL)


def test_bulges_are_refused_but_saddles_and_planes_are_not():
    refused(
        "bulges by 100 µm",
        surface=rp.polishing.Mould.from_formula("-x**2 - y**2", **AREA),
        path=SPIRAL,
    )
    for text in ("3*y**2 - 2*x**2", "0*x", "0.1*x"):
        mould = rp.polishing.Mould.from_formula(text, **AREA)
        assert rp.simulate_brush(duration=0.01, surface=mould, path=SPIRAL).attrs["converged"]


def test_the_listing_knows_the_trough_only():
    mould = rp.polishing.Mould.from_formula("x**2 + y**2", **AREA)
    with pytest.raises(rp.InvalidInputError, match="physical simulator"):
        rp.simulate_brush("listing", duration=0.01, surface=mould, path=SPIRAL)
    with pytest.raises(rp.InvalidInputError, match="physical simulator"):
        rp.simulate_brush("listing", duration=0.01, path=SPIRAL)


def test_largest_bends_under_the_disc():
    mould = rp.polishing.Mould.from_formula("10*x**3", **AREA)
    least, most = largest_bend_under_disc(mould, np.array([[0.0, 0.01], [0.0, 0.0]]), 0.01)
    np.testing.assert_allclose(most, [0.6, 1.2], rtol=1e-6)
    np.testing.assert_allclose(least, [0.0, 0.0], atol=1e-6)
