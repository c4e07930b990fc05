"""Whatever describes a controller, as a state-space system with the plant's signal names."""

from __future__ import annotations

from typing import Any

import control
from control.exception import ControlMIMONotImplemented
from numpy.typing import ArrayLike

from robustpolish.models import GeneralizedPlant
from robustpolish.validation import described, invalid

GivenController = control.StateSpace | control.TransferFunction | ArrayLike


def controller_system(plant: GeneralizedPlant, controller: GivenController) -> control.StateSpace:
    """Return K of u = K y as a system.

    Parameters
    ----------
    plant : GeneralizedPlant
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
        return _realised(plant, controller)
    if isinstance(controller, control.InputOutputSystem | control.LTI):
        raise invalid(
            "controller",
            described(type(controller).__name__),
            "a control.StateSpace, a control.TransferFunction or a gain",
            "Fit or linearise it first.",
        )
    return plant.static_controller(controller)


def _realised(plant: GeneralizedPlant, K: control.TransferFunction) -> control.StateSpace:
    if (K.noutputs, K.ninputs) != (plant.nu, plant.ny):
        raise invalid(
            "controller",
            described(f"a TransferFunction with {K.noutputs} outputs and {K.ninputs} inputs"),
            f"one with {plant.nu} outputs and {plant.ny} inputs",
            "It leads from the measurements y to the controls u.",
        )
    pairs = zip(K.num_list, K.den_list, strict=True)
    if any(n.size > d.size for row in pairs for n, d in zip(*row, strict=True)):
        raise invalid(
            "controller",
            described("an improper TransferFunction"),
            "one with no more zeros than poles",
            "Add a lag to its derivative action.",
        )
    # A transfer function without a sampling time takes that of the plant.
    timed = control.TransferFunction(K.num_list, K.den_list, plant.dt if K.dt is None else K.dt)
    single = K.ninputs == K.noutputs == 1
    try:
        realised: Any = control.ss(
            timed,
            method="scipy" if single else None,
            inputs=list(plant.measurement_names),
            outputs=list(plant.control_names),
        )
    except (ControlMIMONotImplemented, ImportError):
        raise invalid(
            "controller",
            described("a TransferFunction of several inputs or outputs, and slycot is missing"),
            "a control.StateSpace",
            "Install slycot, or pass a state-space realisation.",
        ) from None
    return realised
