"""The thesis's brush simulator, mistakes included, as a labelled dataset."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.brush.dataset import (
    angle_variables,
    force_variables,
    labelled,
    parameter_attributes,
    path_variables,
    quantity,
)
from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.equations import UPRIGHT
from robustpolish.brush.listing.motion import listing_forces, listing_motion
from robustpolish.brush.parameters import BrushParameters

Workaround = Literal["none", "divide", "impulse"]


def run_listing(
    parameters: BrushParameters,
    time: NDArray[np.float64],
    *,
    defects: ListingDefects,
    workaround: Workaround,
    relative: float,
) -> xr.Dataset:
    """Integrate listing D.1, evaluate the forces of D.2, and label both."""
    states, counts = listing_motion(parameters, defects, time, relative)
    theta, theta_rate, psi, psi_rate = states.T
    divisor = force_divisor(parameters, workaround)
    impacts, touching = listing_forces(parameters, defects, time, states, divisor)
    forces = {name: impacts[:, i] for i, name in enumerate(("F_x", "F_y", "F_z"))}
    forces["F_p"] = np.full(time.size, parameters.polishing_force)
    names = ("tilt towards the feed", "roll about the feed")
    variables = {
        **angle_variables((theta, psi, theta_rate, psi_rate), names, level=UPRIGHT),
        **force_variables(forces),
        "contact": quantity(touching, "1", "whether the point touches", ("time", "point")),
        **path_variables(time, parameters),
    }
    attributes = {
        "simulator": "listing",
        "disc": "two-angle",
        **parameter_attributes(parameters),
        "workaround": workaround,
        "defects": " ".join(defects.names()),
        "relative_tolerance": relative,
        "steps": counts[0],
        "refused_steps": counts[1],
        "impacts": counts[2],
    }
    return labelled(time, variables, attributes)


def force_divisor(parameters: BrushParameters, workaround: str) -> float:
    """Return what the thesis divides impact forces by (section 9.4.5)."""
    if workaround == "divide":
        return 10000.0
    return 1.0 / parameters.impact_duration if workaround == "impulse" else 1.0
