"""The loop that users give: a design, or a plant and a controller of many kinds, checked."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from robustpolish.errors import InvalidInputError
from robustpolish.loops.loop import Loop
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.given_controller import GivenController, controller_system
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.synthesis import Design
from robustpolish.validation import described, invalid


def loop_of(
    plant: Design | GeneralizedPlant | control.StateSpace | control.TransferFunction,
    controller: Design | GivenController | None,
) -> Loop:
    """Return the loop of a design, or of a plant and a controller.

    Raises
    ------
    InvalidInputError
        If it is no plant, if the controller is missing or does not fit, or if the loop has no
        solution.
    """
    if isinstance(plant, Design):
        if controller is not None:
            shown = described("a design and a controller besides")
            remedy = "Pass design.plant to try another controller on its plant."
            raise invalid(
                "controller", shown, "a design alone, or a plant and a controller", remedy
            )
        plant, controller = plant.plant, plant.controller
    whole = _as_plant(plant)
    controller = given_controller(controller)
    if whole.nu == 0 or whole.ny == 0:
        raise _lacks_signals(whole)
    _complain_about_states(whole, controller)
    K = controller_system(whole, controller)
    if K.nstates and K.dt is not None and K.dt != whole.dt and not _same_step(K.dt, whole.dt):
        shown = described(f"{_timing(K.dt)} for a plant in {_timing(whole.dt)}")
        remedy = "Discretise the plant or the controller first, such as with control.c2d."
        raise invalid("controller", shown, "the same time as the plant", remedy)
    if (K.noutputs, K.ninputs) != (whole.nu, whole.ny):
        shown = described(f"{K.ninputs} inputs and {K.noutputs} outputs")
        expected = f"{whole.ny} inputs (y) and {whole.nu} outputs (u)"
        remedy = "It leads from the measurements y to the controls u."
        raise invalid("controller", shown, expected, remedy)
    loop = Loop(whole, K)
    if not loop.well_posed():
        shown = described("a loop matrix I - Dk D22 that is singular")
        remedy = "Change the controller's feedthrough or the plant's D22."
        raise invalid("controller", shown, "a well-posed loop", remedy)
    return loop


def given_controller(controller: Design | GivenController | None) -> GivenController:
    """Return the controller that was given, out of its design if it is in one."""
    if isinstance(controller, Design):
        return controller.controller
    if controller is None:
        remedy = "Call loop_analysis(plant, controller), with u = K y."
        raise invalid("controller", None, "a controller beside the plant", remedy)
    return controller


def measured_plant(plant: Any) -> GeneralizedPlant | None:
    """Return a plant that is known by its frequency response; None of others."""
    own = plant.system if isinstance(plant, GeneralizedPlant) else plant
    if not isinstance(own, control.FrequencyResponseData):
        return None
    whole = plant
    if not isinstance(plant, GeneralizedPlant):
        whole = GeneralizedPlant(own, own.noutputs or 0, own.ninputs or 0)
    if whole.nu == 0 or whole.ny == 0:
        raise _lacks_signals(whole)
    return whole


def _lacks_signals(whole: GeneralizedPlant) -> InvalidInputError:
    shown = described(f"{whole.nu} controls and {whole.ny} measurements")
    remedy = "Name measurements= and controls= of the plant."
    return invalid("plant", shown, "at least one of each", remedy)


def _as_plant(plant: Any) -> GeneralizedPlant:
    if isinstance(plant, GeneralizedPlant):
        return plant
    if isinstance(plant, control.StateSpace | control.TransferFunction):
        system = as_state_space("plant", plant, 0)
        return GeneralizedPlant(system, system.noutputs or 0, system.ninputs or 0)
    raise invalid(
        "plant",
        described(type(plant).__name__),
        "a Design, a GeneralizedPlant, a control.StateSpace or a control.TransferFunction",
        "Pass what a synthesis returned, or a plant and a controller.",
    )


def _complain_about_states(plant: GeneralizedPlant, controller: GivenController) -> None:
    """Tell a gain of a state feedback, given with a plant that measures something else."""
    given = controller
    if isinstance(given, control.StateSpace) and given.nstates == 0:
        given = given.D
    if isinstance(given, control.InputOutputSystem | control.LTI):
        return
    shape = np.shape(given)
    if shape == (plant.nu, plant.nx) and plant.nx != plant.ny:
        shown = described(f"a gain of shape {shape} for {plant.ny} measurements")
        remedy = "For a state feedback pass plant.with_full_state()."
        raise invalid("controller", shown, f"a gain of shape ({plant.nu}, {plant.ny})", remedy)


def _same_step(one: float | bool, other: float | bool) -> bool:
    """Tell whether two sampling times agree, one of which may be unspecified."""
    if one is True or other is True:
        return bool(one) and bool(other)
    return bool(np.isclose(float(one), float(other), rtol=1e-9, atol=0.0))


def _timing(dt: float | bool | None) -> str:
    if not dt:
        return "continuous time"
    return "discrete time" if dt is True else f"discrete time with a step of {dt:g} s"
