"""Bars of good and bad numbers."""

import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


def test_bars_mark_the_bad():
    where = {"mode": ["a", "b"]}
    ax = plotting.plot_bars(
        xr.DataArray([0.5, 1e-9], where, "mode", "distance"),
        xr.DataArray([False, True], where, "mode"),
        meaning=("seen", "unseen"),
    )
    assert sorted(bar.get_width() for bar in ax.patches) == [1e-9, 0.5]
    assert names(ax) == ["seen", "unseen"]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["a", "b"]
    assert ax.get_xlabel() == "distance"
