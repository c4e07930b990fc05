"""Chapters 10 and 11 of the thesis recomputed: printed controllers, tables, and structures."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.linalg import block_diag

from robustpolish.base.checks import one_of
from robustpolish.closed_loop.simulate import ControllerComparison, tabulate
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing
from robustpolish.polishing.ideal import DEFAULT_CONTROL_WEIGHT
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.thesis.listing import Workaround, listing_response
from robustpolish.synthesis.design import Design, given_controller
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback
from robustpolish.synthesis.state_feedback.state_feedback import state_feedback
from robustpolish.synthesis.structured.methods import observer_feedback, static_output_feedback

# Controllers of appendix C, in physical units.
#
# The numbers are those of M.L. Postma, Polishing robot: vibrations due to impact. C.1 and C.2
# minimise the H2 norm, the others the H-infinity norm; C.1 to C.4 belong to the actuation
# "displacement" (10.40), C.5 and C.6 to "force" (10.41). They stand in controllers.csv.

# diag(T_L) of (10.52) and (10.56); scaled controllers go back by D_c = D_c^s T_L, (10.60).
_SCALING = {
    "first": (256, 7.8125e-3, 64, 6.25e-2) * 2 + (256, 3.9063e-3, 128, 7.8125e-3),
    "second": (4096, 0.125, 1024, 1, 4096, 0.125, 1024, 0.5, 8192, 0.125, 4096, 0.25),
}

_CONTROLLERS = ("first_h2", "first_h2_scaled", "first", "first_scaled", "second", "second_scaled")

PUBLISHED_CONTROLLERS: Mapping[str, str] = MappingProxyType(
    {name: f"C.{number}" for number, name in enumerate(_CONTROLLERS, 1)}
)
"""Names of the controllers and their numbers in appendix C."""

PUBLISHED_NORMS: Mapping[str, float] = MappingProxyType(
    {"first": 3.4459e-6, "first_scaled": 5.0011e-6, "second": 6.5060e-5, "second_scaled": 5.3719e-5}
)
"""H-infinity norms [m/N] that sections 11.1.1 and 11.2.1 print: the solver's bounds."""


def published_gain(name: str) -> NDArray[np.float64]:
    """Return one of the printed state feedbacks.

    Parameters
    ----------
    name : str
        "first..." for displacement actuation, "second..." for force actuation; see
        `PUBLISHED_CONTROLLERS`. A scaled one is mapped back to physical units by (10.60).

    Returns
    -------
    ndarray, shape (6, 12)
        D_c in u = D_c x, for the plant of :func:`robustpolish.air_bearing`.

    Raises
    ------
    InvalidInputError
        If the name is unknown.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import published_gain
    >>> loop = rp.air_bearing().state_feedback_loop(published_gain("first_scaled"))
    >>> f"{rp.hinf_norm(loop).value:.4g}"
    '3.361e-06'
    """
    one_of("name", name, PUBLISHED_CONTROLLERS)
    lines = Path(__file__).with_name("controllers.csv").read_text("utf-8").splitlines()
    rows = (row[2:] for row in csv.reader(lines) if row[0] == name)
    gain: NDArray[np.float64] = np.asarray(block_diag(*np.array([*rows], float).reshape(3, 2, 4)))
    if name.endswith("_scaled"):
        gain = gain * np.array(_SCALING[name.split("_")[0]])
    return gain


# Tables of chapter 11, with the unequal loads of the thesis.

UNEQUAL_LOAD = (
    "not the same load: as in the thesis, F_y drives y without control and x with it, and the "
    "forces depend on the solver's steps"
)
_WORKAROUND: Mapping[int, Workaround] = {1: "divide", 4: "impulse"}


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
        Names of `robustpolish.polishing.PUBLISHED_CONTROLLERS`.
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
    >>> from robustpolish.polishing import thesis_comparison
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
    # c_A in the brush's equations in x and y, as lines 144 and 148 of D.2 have it.
    listed, c_A = plant.A.copy(), p.damping(0.001).c_A
    for row, bearing in ((3, 1), (7, 5)):
        listed[row, bearing], listed[row, row] = c_A / p.m_t, -c_A / p.m_t
    open_loop = listing_response(
        listed, plant.B1, total, brush, bearing_mass=p.m_z, tolerance=tolerance
    )
    responses = {"without control": open_loop}
    for name in controllers:
        actuation = "displacement" if name.startswith("first") else "force"
        plant = air_bearing(p, actuation=actuation, load="printed")
        loop = plant.A + plant.B2 @ published_gain(name)
        responses[name] = listing_response(loop, plant.B1, total, brush, tolerance=tolerance)
    signals = {}
    for name, found in responses.items():
        columns = zip("xyz", found["response"].values.T, strict=True)
        variables = {axis: ("time", values, {"units": "m"}) for axis, values in columns}
        signals[name] = xr.Dataset(variables, {"time": found["time"]})
    largest = {name: found["largest"].to_numpy() for name, found in responses.items()}
    return tabulate(signals, ("x", "y", "z"), (), UNEQUAL_LOAD, largest=largest)


# Largest deviations printed in chapter 11.
#
# The numbers are those of M.L. Postma, Polishing robot: vibrations due to impact, tables 11.1,
# 11.3, 11.5 and 11.7. What they are worth is told by
# :func:`robustpolish.polishing.thesis.comparison.thesis_comparison`.

Deviations = Mapping[str, tuple[float, float, float]]


def _deviations(without: tuple[float, ...], *controlled: tuple[float, float]) -> Deviations:
    """Return the rows of a table: with a controller nothing moves in x."""
    names = ("without control", "first", "first_scaled", "second", "second_scaled")
    rows: Any = (without, *((0.0, *row) for row in controlled))
    return MappingProxyType(dict(zip(names, rows, strict=True)))


PUBLISHED_DEVIATIONS: Mapping[int, Deviations] = MappingProxyType({
    1: _deviations(
        (7.8095e-4, 0.0177, 1.9855e-4), (7.5486e-4, 7.1232e-6), (4.5467e-4, 8.0705e-6),
        (7.4643e-5, 2.4510e-5), (6.8915e-4, 9.7659e-6),
    ),
    4: _deviations(
        (0.0011, 0.0094, 1.5049e-4), (7.9841e-4, 1.2877e-5), (4.9490e-4, 1.2861e-5),
        (8.2640e-5, 4.6829e-5), (8.0809e-4, 1.9925e-5),
    ),
})  # fmt: skip
"""Largest deviation [m] in x, y and z by run and row, as printed."""


def thesis_structures(
    actuation: Literal["force", "displacement"] = "force",
    *,
    control_weight: float | None = None,
    measurement_noise: float = 1e-8,
    time_limit: float = 20.0,
) -> dict[str, Design]:
    """Design dynamic, static and observer-based controllers for the thesis's plant.

    Chapter 10 derives them and leaves them open: the dynamic one "never gave a solid result", the
    observer is "a little tricky". They measure the six displacements only (10.75). Static state
    feedback, printed in appendix C and ours, measures all twelve states.

    Parameters
    ----------
    actuation : {"force", "displacement"}, optional
        See :func:`robustpolish.air_bearing`.
    control_weight : float, optional
        Price on u, in m per N or m per (m/s); 1e-7 for forces and 1e-8 for
        displacements by default.
    measurement_noise : float, optional
        Noise on the measured displacements, m per unit of w. Static output feedback is designed
        without it: a gain passes noise on at all frequencies.
    time_limit : float, optional
        Seconds for each of the static and the observer-based design, which use them up.

    Returns
    -------
    dict of str to Design
        Certified; for :func:`robustpolish.compare_controllers`.

    Raises
    ------
    InvalidInputError
        If an argument does not fit.
    SolverError
        If a controller was not found in its time.

    Examples
    --------
    >>> from robustpolish.polishing import thesis_structures
    >>> designs = thesis_structures("force", time_limit=30)
    >>> [design.certificate.valid for design in designs.values()]
    [True, True, True, True, True]
    """
    one_of("actuation", actuation, DEFAULT_CONTROL_WEIGHT)
    price = DEFAULT_CONTROL_WEIGHT[actuation] if control_weight is None else control_weight
    full = air_bearing(actuation=actuation)
    measured = air_bearing(actuation=actuation, measured="displacement")
    printed = "second_scaled" if actuation == "force" else "first_scaled"
    priced: dict[str, Any] = {"control_weight": price, "time_limit": time_limit}
    noisy = {**priced, "measurement_noise": measurement_noise}
    return {
        f"static state feedback, {PUBLISHED_CONTROLLERS[printed]}": given_controller(
            full.with_full_state(), published_gain(printed)
        ),
        "static state feedback, ours": state_feedback(full, control_weight=price),
        "dynamic output feedback": output_feedback(measured, **noisy),
        "static output feedback": static_output_feedback(measured, **priced),
        "observer-based": observer_feedback(measured, **noisy),
    }
