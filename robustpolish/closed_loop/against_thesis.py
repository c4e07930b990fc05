"""Chapter 11 of the thesis as it was computed, unequal loads and all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.brush import listing_response, simulate_brush
from robustpolish.brush.listing.run import Workaround
from robustpolish.closed_loop.comparison import ControllerComparison, tabulate
from robustpolish.models import AirBearingParameters, air_bearing
from robustpolish.synthesis import PUBLISHED_CONTROLLERS, published_gain
from robustpolish.validation import one_of

UNEQUAL_LOAD = (
    "not the same load: as in the thesis, F_y drives y without control and x with it, and the "
    "forces depend on the solver's steps"
)
_WORKAROUND: Mapping[int, Workaround] = {1: "divide", 4: "impulse"}
_SIGNALS = ("x", "y", "z")


def thesis_comparison(
    run: Literal[1, 4] = 1,
    controllers: Sequence[str] = ("first", "first_scaled", "second", "second_scaled"),
    *,
    duration: float = 5.0,
    tolerance: float = 1e-3,
) -> ControllerComparison:
    """Recompute the rows of tables 11.1, 11.3, 11.5 and 11.7 with the listings' defects.

    The row without control follows listing D.2 (c_A where (8.46) has c_D, load by (8.47)), the
    others D.3 (load by (10.39)). The deviations are those of the sums x_m + x, y_m + y and
    z_m + z, as plotted in the thesis. They reproduce what was printed; they do not say how good
    a controller is. For that use :func:`robustpolish.compare_controllers`.

    Parameters
    ----------
    run : {1, 4}, optional
        Run 1 with forces divided by 10000, or run 4 with forces times t_m (section 9.4.5).
    controllers : sequence of str, optional
        Names of `robustpolish.synthesis.PUBLISHED_CONTROLLERS`.
    duration : float, optional
        Simulated time in s; 5 in the thesis.
    tolerance : float, optional
        Relative tolerance of the solver, on which the rows depend; 1e-3 in the thesis.

    Returns
    -------
    ControllerComparison
        Its `load` says that the loads differ.

    Raises
    ------
    InvalidInputError
        If the run is another one or a controller is unknown.

    Examples
    --------
    >>> from robustpolish.closed_loop import thesis_comparison
    >>> table = thesis_comparison(run=1, controllers=["second"], duration=0.02)
    >>> print(table.load[:17])
    not the same load
    """
    one_of("run", run, _WORKAROUND)
    for name in controllers:
        one_of("controllers", name, PUBLISHED_CONTROLLERS)
    brush = simulate_brush("listing", run, duration, workaround=_WORKAROUND[run])
    p = AirBearingParameters.as_published()
    total = np.kron(np.eye(3), [[1.0, 0.0, 1.0, 0.0]])
    plant = air_bearing(p)
    without = listing_response(
        _as_listed(plant.A, p), plant.B1, total, brush, bearing_mass=p.m_z, tolerance=tolerance
    )
    responses = {"without control": without}
    for name in controllers:
        actuation = "displacement" if name.startswith("first") else "force"
        plant = air_bearing(p, actuation=actuation, load="printed")
        loop = plant.A + plant.B2 @ published_gain(name)
        responses[name] = listing_response(loop, plant.B1, total, brush, tolerance=tolerance)
    return tabulate(
        {name: _labelled(response) for name, response in responses.items()},
        _SIGNALS,
        (),
        UNEQUAL_LOAD,
        largest={name: response["largest"].to_numpy() for name, response in responses.items()},
    )


def _as_listed(A: NDArray[np.float64], p: AirBearingParameters) -> NDArray[np.float64]:
    """Put c_A into the brush's equations in x and y, as lines 144 and 148 of D.2 do."""
    c_A = p.damping(0.001).c_A
    listed = A.copy()
    for row, bearing in ((3, 1), (7, 5)):
        listed[row, bearing] = c_A / p.m_t
        listed[row, row] = -c_A / p.m_t
    return listed


def _labelled(response: xr.Dataset) -> xr.Dataset:
    """Turn the outputs into signals x, y and z."""
    values = response["response"].to_numpy()
    return xr.Dataset(
        {name: ("time", values[:, i], {"units": "m"}) for i, name in enumerate(_SIGNALS)},
        coords={"time": response["time"]},
    )
