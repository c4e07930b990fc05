import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp

AREA = {"x": (-0.03, 0.03), "y": (-0.03, 0.03)}


def test_the_sharpest_hollow_is_found_where_it_is():
    mould = rp.polishing.Mould.from_formula(
        "2*x**2 - 2e-3*exp(-((x-0.01)**2 + y**2)/(2*0.004**2))", **AREA
    )
    fit = rp.polishing.check_brush_fit(mould, 0.010)
    assert not fit.fits
    x, y, radius = fit.sharpest
    # At the bottom of the dent: 4 + 2e-3 / 0.004^2 = 129 per metre.
    assert (x, y) == pytest.approx((0.01, 0.0), abs=1e-3)
    assert radius == pytest.approx(1 / 129, rel=0.02)
    assert 0 < fit.share_too_narrow < 0.1
    assert "does not fit" in fit.explain()
    away = rp.polishing.ToolPath.through([(-0.015, 0.0), (-0.01, 0.005)], speed=0.01)
    assert rp.polishing.check_brush_fit(mould, 0.010, away).fits
    assert fit.plot().get_xlabel() == "x [mm]"
    plt.close("all")


def test_bulges_are_told_apart_from_saddles():
    for text, share in (("-x**2-y**2", 1.0), ("x**2-2*y**2", 0.0), ("0*x", 0.0), ("x**2", 0.0)):
        fit = rp.polishing.check_brush_fit(rp.polishing.Mould.from_formula(text, **AREA))
        assert fit.share_bulging == share, text
        assert fit.fits
    assert np.isinf(
        rp.polishing.check_brush_fit(
            rp.polishing.Mould.from_formula("-x**2-y**2", **AREA)
        ).sharpest[2]
    )
