"""A controller that somebody else designed, certified like our own."""

from __future__ import annotations

from typing import Literal

from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.controllers import GivenController, controller_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import certify
from robustpolish.synthesis.design import Design


def given_controller(
    plant: GeneralizedPlant,
    controller: GivenController,
    norm: Literal["hinf", "h2"] = "hinf",
) -> Design:
    """Certify a given controller and return it as a design, to be simulated and compared.

    Parameters
    ----------
    plant : GeneralizedPlant
        Its measurements y are what the controller reads; for a state feedback pass
        ``plant.with_full_state()``.
    controller : control.StateSpace, control.TransferFunction or array_like, shape (nu, ny)
        K in u = K y (positive sign): a system or a gain.
    norm : {"hinf", "h2"}, optional
        The norm that is certified.

    Returns
    -------
    Design
        With status "suboptimal", since nothing was optimised.

    Raises
    ------
    InvalidInputError
        If plant and controller do not fit.
    SolverError
        If the loop cannot be certified, for instance because it is unstable.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.given_controller(plant, [[-3.0]]).certificate.valid
    True
    """
    clock = Budget()
    controller = controller_system(plant, controller)
    certificate = certify(plant, controller, norm)
    if not certificate.valid:
        raise SolverError(
            "controller: not certified, because "
            + "; ".join(certificate.reasons)
            + ". Check its sign (u = K y) and its units."
        )
    return Design(
        plant=plant,
        controller=controller,
        closed_loop=plant.closed_loop(controller),
        norm=norm,
        status="suboptimal",
        message="This controller was given; it is certified, not optimised.",
        certificate=certificate,
        method="given",
        backend="none",
        elapsed=clock.elapsed,
    )
