import numpy as np
import xarray as xr

from robustpolish.plots.residuals import plot_force_curve

FORCE = xr.DataArray(
    np.linspace(-5.0, 5.0, 11),
    {"velocity": ("velocity", np.linspace(-0.02, 0.02, 11), {"units": "m/s"})},
    "velocity",
    attrs={"units": "N"},
)


def test_a_curve_with_its_band():
    ax = plot_force_curve(FORCE, 0.1 * abs(FORCE) + 0.2)
    assert ax.get_xlabel() == "velocity [mm/s]"
    assert ax.get_ylabel() == "force [N]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["learned", "95 % band"]
    np.testing.assert_allclose(ax.lines[-1].get_ydata(), FORCE.values)


def test_an_endless_band_does_not_flatten_the_curve():
    band = xr.full_like(FORCE, np.inf)
    low, high = plot_force_curve(FORCE, band).get_ylim()
    assert -20 < low < -5
    assert 5 < high < 20


def test_it_draws_where_it_is_told():
    ax = plot_force_curve(FORCE)
    assert plot_force_curve(FORCE, ax=ax) is ax
    assert len(ax.collections) == 0
