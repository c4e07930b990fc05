import lmfit
import numpy as np
import xarray as xr

from robustpolish.identification.fit.result import Refit
from tests import made_up

ERRORS = {"dof.x.mass": 0.1, "spring[0].stiffness": 6e4, "damper[0].damping": np.inf}
UNITS = dict(zip(ERRORS, ("kg", "N/m", "N s/m"), strict=True))


def refitted(model=None):
    keys = list(ERRORS)
    covariance = xr.DataArray(np.diag([0.01, 36e8, np.inf]), {"parameter": keys, "other": keys})
    return Refit(
        model=model or made_up.model(),
        parameters=lmfit.Parameters(),
        units=UNITS,
        nrmse={"x": 0.0125},
        undetermined=("spring[0].stiffness", "damper[0].damping"),
        stderr=ERRORS,
        covariance=covariance,
    )


def test_it_shows_values_errors_and_what_the_data_leave_open():
    rows = [line.split() for line in repr(refitted()).splitlines()]
    assert rows[0] == ["Refit"]
    assert ["dof.x.mass", "2.00", "0.10", "kg", "yes"] in rows
    assert ["spring[0].stiffness", "8.0e+04", "6.0e+04", "N/m", "no"] in rows
    assert any(row[0] == "damper[0].damping" and row[-1] == "no" for row in rows)
    assert ["x", "0.0125"] in rows


def test_it_draws_errors_relative_to_their_values():
    """0.1 of 2 kg and 6e4 of 8e4 N/m; what is not known at all, or is nought, has no bar."""
    ax = refitted().plot()
    widths = sorted(bar.get_width() for bar in ax.patches if np.isfinite(bar.get_width()))
    np.testing.assert_allclose([w for w in widths if w][:2], [5.0, 75.0])
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert "dof.x.mass = 2 kg" in labels
    nought = refitted(made_up.model().with_parameters({"damper[0].damping": 0.0}))
    assert nought.plot().get_xlabel() == "relative standard error [%]"
