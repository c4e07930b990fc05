"""The controllers that the thesis asked for, beside the one that it found."""

from __future__ import annotations

from typing import Literal

from robustpolish.models import air_bearing
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.given_controller import given_controller
from robustpolish.synthesis.methods.observer_feedback import observer_feedback
from robustpolish.synthesis.methods.output_feedback import output_feedback
from robustpolish.synthesis.methods.published_controllers import (
    PUBLISHED_CONTROLLERS,
    published_gain,
)
from robustpolish.synthesis.methods.state_feedback import state_feedback
from robustpolish.synthesis.methods.static_output_feedback import static_output_feedback
from robustpolish.validation import one_of

# Per unit of u, so that runs 1 and 4 ask for a few N, or a few m/s.
_PRICE = {"force": 1e-7, "displacement": 1e-8}


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
    >>> from robustpolish.closed_loop import thesis_structures
    >>> designs = thesis_structures("force", time_limit=2)
    >>> [design.certificate.valid for design in designs.values()]
    [True, True, True, True, True]
    """
    one_of("actuation", actuation, _PRICE)
    price = _PRICE[actuation] if control_weight is None else control_weight
    full = air_bearing(actuation=actuation)
    measured = air_bearing(actuation=actuation, measured="displacement")
    printed = "second_scaled" if actuation == "force" else "first_scaled"
    return {
        f"static state feedback, {PUBLISHED_CONTROLLERS[printed]}": given_controller(
            full.with_full_state(), published_gain(printed)
        ),
        "static state feedback, ours": state_feedback(full, control_weight=price),
        "dynamic output feedback": output_feedback(
            measured,
            control_weight=price,
            measurement_noise=measurement_noise,
            time_limit=time_limit,
        ),
        "static output feedback": static_output_feedback(
            measured, control_weight=price, time_limit=time_limit
        ),
        "observer-based": observer_feedback(
            measured,
            control_weight=price,
            measurement_noise=measurement_noise,
            time_limit=time_limit,
        ),
    }
