"""The physical simulator on moulds: the same as on the trough where the mould is the trough."""

import time

import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plots.charts import plot_over_plane
from tests.brush import moulds


@pytest.mark.parametrize(("run", "tolerance"), [(1, 1e-9), (4, 1e-7)])
def test_a_mould_of_the_trough_gives_the_trough(run, tolerance):
    bends = rp.polishing.Surface().curvatures
    trough = rp.polishing.Mould.from_formula(
        "0.5*a*x**2 + 0.5*b*y**2", x=(-0.01, 0.05), y=(-0.02, 0.02),
        parameters={"a": bends[0], "b": bends[1]},
    )  # fmt: skip
    wanted = rp.simulate_brush(run=run, duration=0.05)
    found = rp.simulate_brush(run=run, duration=0.05, surface=trough)
    for name in ("F_x", "F_y", "F_z", "theta", "psi", "tool_z", "elevation"):
        largest = float(np.abs(wanted[name]).max())
        np.testing.assert_allclose(found[name], wanted[name], atol=tolerance * max(largest, 1e-3))
    assert found.attrs["surface"].startswith("Mould(")
    assert "surface_along" not in found.attrs


def test_the_tool_follows_its_path_and_the_mould_carries_the_force():
    side = (-moulds.HALF, moulds.HALF)
    mould = rp.polishing.Mould.from_formula(moulds.FORMULA, x=side, y=side)
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04, over=mould)
    signals = rp.simulate_brush(duration=0.3, surface=mould, path=path)
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
    rp.simulate_brush(duration=0.001, surface=mould, path=path)  # compiles
    start = time.process_time()
    signals = rp.simulate_brush(run=run, duration=5.0, surface=mould, path=path)
    depth = rp.polishing.removal_map(signals, mould)
    plot_over_plane(depth)
    spent = time.process_time() - start
    plt.close("all")
    assert spent < 10.0
    assert signals.attrs["converged"] == 1
    volume = 1e-13 * float(signals["contact_force"].sum("point").mean()) * 5.0 * 100 * np.pi * 0.010
    assert float(depth.sum()) * 2.5e-7 == pytest.approx(volume, rel=0.02)
