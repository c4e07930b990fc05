"""The physical simulator on moulds, where it may be believed, and what it takes off."""

import time

import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plots.charts import plot_over_plane
from tests.polishing import moulds

# The physical simulator on moulds: the same as on the trough where the mould is the trough.


@pytest.mark.parametrize(("run", "tolerance"), [(1, 1e-9), (4, 1e-7)])
def test_a_mould_of_the_trough_gives_the_trough(run, tolerance):
    bends = rp.polishing.Surface().curvatures
    trough = rp.polishing.Mould.from_formula(
        "0.5*a*x**2 + 0.5*b*y**2", x=(-0.01, 0.05), y=(-0.02, 0.02),
        parameters={"a": bends[0], "b": bends[1]},
    )  # fmt: skip
    wanted = rp.polishing.simulate_brush(run=run, duration=0.05)
    found = rp.polishing.simulate_brush(run=run, duration=0.05, surface=trough)
    for name in ("F_x", "F_y", "F_z", "theta", "psi", "tool_z", "elevation"):
        largest = float(np.abs(wanted[name]).max())
        np.testing.assert_allclose(found[name], wanted[name], atol=tolerance * max(largest, 1e-3))
    assert found.attrs["surface"].startswith("Mould(")
    assert "surface_along" not in found.attrs


def test_the_tool_follows_its_path_and_the_mould_carries_the_force():
    side = (-moulds.HALF, moulds.HALF)
    mould = rp.polishing.Mould.from_formula(moulds.FORMULA, x=side, y=side)
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04, over=mould)
    signals = rp.polishing.simulate_brush(duration=0.3, surface=mould, path=path)
    time_ = signals["time"].values
    x, y = path.position(time_)
    np.testing.assert_allclose(signals["tool_x"], x, atol=1e-15)
    np.testing.assert_allclose(
        signals["elevation"], mould.elevation(x, y, tuple(path.velocity(time_))), atol=1e-15
    )
    assert float(signals["F_z"].mean()) == pytest.approx(10.0, rel=2e-3)
    assert signals.attrs["converged"] == 1


@pytest.mark.long
@pytest.mark.parametrize("run", [1, 4])
def test_five_seconds_along_a_spiral_on_an_stl_take_less_than_ten(tmp_path, run):
    file = moulds.write_stl(tmp_path / "mould.stl", *moulds.triangles(scale=1e3))
    mould = rp.polishing.Mould.from_stl(file, unit="mm")
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.015, 0.0025, speed=0.04, over=mould)
    rp.polishing.simulate_brush(duration=0.001, surface=mould, path=path)  # compiles
    start = time.process_time()
    signals = rp.polishing.simulate_brush(run=run, duration=5.0, surface=mould, path=path)
    depth = rp.polishing.removal_map(signals, mould)
    plot_over_plane(depth)
    spent = time.process_time() - start
    plt.close("all")
    assert spent < 10.0
    assert signals.attrs["converged"] == 1
    volume = 1e-13 * float(signals["contact_force"].sum("point").mean()) * 5.0 * 100 * np.pi * 0.010
    assert float(depth.sum()) * 2.5e-7 == pytest.approx(volume, rel=0.02)


# Paths and moulds that the simulator refuses.

AREA = {"x": (-0.03, 0.03), "y": (-0.03, 0.03)}
SPIRAL = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)


def refused(message, **arguments):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.polishing.simulate_brush(duration=0.01, **arguments)


def test_paths_and_bulges_that_are_refused():
    small = rp.polishing.Mould.from_formula("x**2 + y**2", x=(-0.02, 0.02), y=(-0.02, 0.02))
    refused("leaves the mould by 3.18 mm around x = 12 mm", surface=small, path=SPIRAL)
    with pytest.raises(rp.InvalidInputError, match="at least the duration"):
        rp.polishing.simulate_brush(duration=10.0, path=SPIRAL)
    refused(
        "bulges by 100 µm",
        surface=rp.polishing.Mould.from_formula("-x**2 - y**2", **AREA),
        path=SPIRAL,
    )
    for text in ("3*y**2 - 2*x**2", "0*x", "0.1*x"):
        mould = rp.polishing.Mould.from_formula(text, **AREA)
        assert rp.polishing.simulate_brush(duration=0.01, surface=mould, path=SPIRAL).attrs[
            "converged"
        ]
    mould = rp.polishing.Mould.from_formula("x**2 + y**2", **AREA)
    with pytest.raises(rp.InvalidInputError, match="physical simulator"):
        rp.polishing.simulate_brush("listing", duration=0.01, surface=mould, path=SPIRAL)
    with pytest.raises(rp.InvalidInputError, match="physical simulator"):
        rp.polishing.simulate_brush("listing", duration=0.01, path=SPIRAL)


# Curvature of a mould against the radius of the brush.


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
        assert np.isinf(fit.sharpest[2]) or share < 1


# Removal by Preston's law.


@pytest.mark.parametrize("disc", ["two-angle", "three-angle"])
def test_the_volume_is_force_times_way(disc):
    signals = rp.polishing.simulate_brush(duration=0.2, disc=disc)
    depth = rp.polishing.removal_map(signals, rp.polishing.Surface(), preston=1e-12, cell=1e-3)
    force = signals["contact_force"].sum("point")
    spin = signals["omega_z"] if disc == "three-angle" else signals.attrs["spin"]
    # The rim slips at radius times spin; circling adds up to 1 %.
    way = float((force * spin * 0.010).mean()) * 0.2
    assert float(depth.sum()) * 1e-6 == pytest.approx(1e-12 * way, rel=0.02)
    assert float(depth.min()) >= 0


def test_in_a_groove_it_is_taken_off_at_both_sides():
    signals = rp.polishing.simulate_brush(duration=0.1)
    depth = rp.polishing.removal_map(signals, rp.polishing.Surface())
    profile = depth.sum("x")
    # The middle is 3.5 of 24 mm; the rim touches at both sides of it.
    middle = profile.sel(y=slice(-0.001, 0.0025)).sum()
    assert float(middle) < 0.02 * float(profile.sum())


def test_even_forces_take_off_their_volume_and_inputs_are_checked():
    time = np.linspace(0.0, 2.0, 4001)
    even = rp.polishing.removal_of_force(SPIRAL, time, np.full(time.size, 10.0), preston=1e-12)
    # Mean speed over a disc is two thirds of that of its rim.
    way = 2 / 3 * 0.010 * 100 * np.pi * 2.0
    assert float(even.sum()) * 2.5e-7 == pytest.approx(1e-11 * way, rel=0.01)
    lifted = rp.polishing.removal_of_force(
        SPIRAL, time, np.where(time < 1, 10.0, -5.0), preston=1e-12
    )
    assert float(lifted.sum()) == pytest.approx(0.5 * float(even.sum()), rel=0.01)
    with pytest.raises(rp.InvalidInputError, match="physical simulator"):
        rp.polishing.removal_map(
            rp.polishing.simulate_brush("listing", duration=0.001), rp.polishing.Surface()
        )
    with pytest.raises(rp.InvalidInputError, match="one number for each time"):
        rp.polishing.removal_of_force(SPIRAL, [0.0, 1.0], [1.0])


# Picture of a run.


def test_the_path_has_the_colour_of_the_contact_force():
    mould = rp.polishing.Mould.from_formula("x**2 + 2*y**2", **AREA)
    signals = rp.polishing.simulate_brush(duration=0.05, surface=mould, path=SPIRAL)
    ax = rp.polishing.plot_polishing(signals, mould)
    line = ax.collections[1]
    np.testing.assert_allclose(line.get_array(), signals["contact_force"].sum("point").values[:-1])
    assert ax.get_xlabel() == "x [mm]"
    rp.polishing.plot_polishing(
        rp.polishing.simulate_brush("listing", duration=0.001), rp.polishing.Surface.as_published()
    )
    plt.close("all")
