"""What the file of a sampled design holds: plant, controller and timing; the rest is proven again.

It lies below the design, which writes and reads itself with it.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Any

import numpy as np

from robustpolish.implementation.discretization.certify_sampled import (
    certify_sampled,
    checked_delay,
    checked_plant,
    discrete_controller,
)
from robustpolish.implementation.realization.forms import FORMS
from robustpolish.implementation.sampled.anti_aliasing import filter_system
from robustpolish.models.plant.file import (
    check_size,
    plant_content,
    system_content,
    system_from,
)
from robustpolish.models.plant.plant import plant_from
from robustpolish.saved_file import Fields, confirm_norm
from robustpolish.validation import invalid

_REMEDY = "Plant, controller or timing were changed after saving; discretize it anew."


def sampled_content(sampled: Any) -> dict[str, Any]:
    """Return what is written of a :class:`robustpolish.SampledDesign`."""
    analogue = sampled.anti_aliasing
    return {
        "norm": sampled.norm,
        "achieved": sampled.certificate.achieved,
        "continuous_norm": sampled.continuous_norm,
        "message": sampled.message,
        "method": sampled.method,
        "period": sampled.period,
        "delay": sampled.delay,
        "form": sampled.details.get("form"),
        "plant": plant_content(sampled.plant),
        "controller": system_content(sampled.controller),
        "anti_aliasing": None if analogue is None else system_content(analogue),
    }


def sampled_fields(fields: Fields) -> dict[str, Any]:
    """Return the fields of the sampled design in a file, with a new certificate.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, if the controller does not earn a certificate, or if its
        loop has another norm than the file says.
    """
    plant = checked_plant(plant_from(fields.table("plant")))
    given = system_from(fields.table("controller"))
    check_size(fields, plant.system, given)
    period, delay = fields.number("period"), fields.number("delay")
    if not (math.isfinite(period) and period > 0):
        raise invalid(f"{fields.where}: period", period, "a time above 0 s", _REMEDY)
    delay = checked_delay(delay, period)
    controller = discrete_controller(plant, given, period)
    analogue = None
    if fields.raw("anti_aliasing") is not None:
        analogue = filter_system(system_from(fields.table("anti_aliasing")), plant.ny)
    norm = fields.text("norm", ("hinf", "h2"))
    certificate = certify_sampled(
        plant,
        controller,
        delay=delay,
        norm="h2" if norm == "h2" else "hinf",
        anti_aliasing=analogue,
    )
    confirm_norm(fields, certificate, _REMEDY)
    before = fields.number("continuous_norm")
    if np.isnan(before) or before < 0:
        raise invalid(f"{fields.where}: continuous_norm", before, "a norm", _REMEDY)
    form = None if fields.raw("form") is None else fields.text("form", FORMS)
    return {
        "plant": plant,
        "controller": controller,
        "period": period,
        "delay": delay,
        "certificate": certificate,
        "message": fields.text("message"),
        "norm": certificate.norm,
        "continuous_norm": before,
        "method": fields.text("method"),
        "anti_aliasing": analogue,
        "details": MappingProxyType({} if form is None else {"form": form}),
    }
