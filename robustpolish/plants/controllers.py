"""Whatever users call a controller, as a system from measurements to controls."""

from __future__ import annotations

import control
from numpy.typing import ArrayLike

from robustpolish.base.checks import described, invalid
from robustpolish.plants.blocks import PlantBlocks, realised, static_controller

GivenController = control.StateSpace | control.TransferFunction | ArrayLike


def controller_system(plant: PlantBlocks, controller: GivenController) -> control.StateSpace:
    """Return K of u = K y as a system.

    Parameters
    ----------
    plant : PlantBlocks
    controller : control.StateSpace, control.TransferFunction or array_like, shape (nu, ny)
        A system comes back as it is. A transfer function is realised; its states have no meaning.
        One of several inputs or outputs takes slycot, which realises it with the fewest states.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If it is of another kind, improper or of another shape than the plant needs.
    """
    if isinstance(controller, control.StateSpace):
        return controller
    if isinstance(controller, control.TransferFunction):
        if (controller.noutputs, controller.ninputs) != (plant.nu, plant.ny):
            shown = f"{controller.noutputs} outputs and {controller.ninputs} inputs"
            want = f"one with {plant.nu} outputs and {plant.ny} inputs"
            remedy = "It leads from the measurements y to the controls u."
            raise invalid("controller", described(f"a TransferFunction with {shown}"), want, remedy)
        # A transfer function without a sampling time takes that of the plant.
        names = (plant.measurement_names, plant.control_names)
        return realised("controller", controller, plant.dt, *names)
    if isinstance(controller, control.InputOutputSystem | control.LTI):
        raise invalid(
            "controller",
            described(type(controller).__name__),
            "a control.StateSpace, a control.TransferFunction or a gain",
            "Fit or linearise it first.",
        )
    return static_controller(plant, controller)
