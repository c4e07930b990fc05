"""Does a design survive what is not known about the machine? Monte Carlo over its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from robustpolish.closed_loop.parameter_samples import draw
from robustpolish.closed_loop.robustness_result import RobustnessCheck
from robustpolish.closed_loop.studies.trial import PlantOf, Trial, column, linearized
from robustpolish.models import MechanicalModel
from robustpolish.sweeps import sweep
from robustpolish.synthesis.design.checked import checked_design
from robustpolish.synthesis.design.design import Design
from robustpolish.validation import described, invalid


class Learned(Protocol):
    """A model that was fitted to data, such as a diagnosis or a refit."""

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        ...

    @property
    def covariance(self) -> Any:
        """Covariance of the fitted numbers: an xarray.DataArray over their keys, twice."""
        ...


def check_robustness(
    design: Design,
    learned: Learned | MechanicalModel,
    *,
    standard_errors: Mapping[str, float] | None = None,
    plant_of: PlantOf | None = None,
    samples: int = 200,
    seed: int = 0,
    executor: Executor | Literal["serial"] | None = "serial",
) -> RobustnessCheck:
    """Close a design's loop around machines that the data allows for as well.

    The numbers of the model are drawn from a normal distribution with the covariance of their fit;
    each draw is linearised anew and its loop is closed with the controller as it is.

    Parameters
    ----------
    design : Design
        Designed for the plant that `plant_of` makes of the model.
    learned : Diagnosis, Refit or MechanicalModel
        What a fit found, with the covariance of its numbers; or a model, with `standard_errors`.
    standard_errors : mapping of str to float, optional
        Standard errors by the keys of ``model.parameters``, in SI units, taken as independent. They
        replace the covariance of a fit.
    plant_of : callable, optional
        Makes a plant of a model in the way in which the design's plant was made;
        ``model.linearize()`` by default.
    samples : int, optional
        Number of machines that are drawn.
    seed : int, optional
        Of the random numbers: the same seed draws the same machines.
    executor : concurrent.futures.Executor, "serial" or None, optional
        As for :func:`sweep`, with the same norms: this process by default, None for local
        processes.

    Returns
    -------
    RobustnessCheck

    Raises
    ------
    InvalidInputError
        If the design does not belong to plants of this kind, or a standard error is no smaller than
        what its number may be.

    Notes
    -----
    Prices on u and noise on y that the synthesis added are kept. If n of n loops are stable, at
    least 0.05^(1/n) of all are, with 95 % confidence (Clopper and Pearson, Biometrika 26, 1934). No
    number of draws proves all of them: :func:`robust_stability` and :func:`worst_case_gain` of the
    ``uncertain()`` machines of the fit do.

    Examples
    --------
    >>> import robustpolish as rp
    >>> machine = rp.MechanicalModel(
    ...     [rp.Dof("x", 2.0)],
    ...     [rp.Spring(("x", "ground"), 800.0)],
    ...     [rp.Damper(("x", "ground"), 4.0)],
    ...     [rp.Input("F", ("x", "ground"))], [rp.Output("x", ("x", "ground"))])
    >>> design = rp.state_feedback(machine.linearize(measured="state"), control_weight=1e-3)
    >>> check = rp.check_robustness(
    ...     design, machine, standard_errors={"spring[0].stiffness": 40.0, "dof.x.mass": 0.1},
    ...     plant_of=lambda model: model.linearize(measured="state"), samples=50)
    >>> check.share_stable, bool(check.worst < 1.5 * design.certificate.achieved)
    (1.0, True)
    """
    checked_design("design", design)
    drawn = draw(*_source(learned, standard_errors), samples, seed)
    trial = Trial(
        plant=design.plant,
        controller=design.controller,
        norm=design.norm,
        machine=drawn.model,
        plant_of=plant_of or linearized,
        names=drawn.keys,
    )
    points = [{column(i): value for i, value in enumerate(row)} for row in drawn.values.tolist()]
    found = sweep(trial, points, executor=executor)
    for i in np.flatnonzero(found["failure"].values != "")[:1]:
        trial(**points[i])  # raises here what it raised there
    norms = found["norm"].values
    return RobustnessCheck(
        norm=design.norm,
        nominal=design.certificate.achieved,
        norms=norms,
        keys=drawn.keys,
        parameters=drawn.values,
        nominal_parameters=drawn.nominal,
        left_out=drawn.left_out,
        unit=design.gain_unit if design.norm == "hinf" else "",
    )


def _source(
    learned: Any, standard_errors: Mapping[str, float] | None
) -> tuple[MechanicalModel, tuple[str, ...], NDArray[np.float64]]:
    """Return the model, the keys of its uncertain numbers, and their covariance."""
    model = learned if isinstance(learned, MechanicalModel) else getattr(learned, "model", None)
    if not isinstance(model, MechanicalModel):
        shown = described(type(learned).__name__)
        raise invalid("learned", shown, "a diagnosis, a refit or a model", "Pass one of these.")
    if standard_errors is not None:
        for key in standard_errors:
            if key not in model.parameters:
                raise invalid(
                    "standard_errors", key, "a key of model.parameters", "Check its spelling."
                )
        errors = np.array([float(error) for error in standard_errors.values()])
        return model, tuple(standard_errors), np.diag(errors**2)
    covariance = getattr(learned, "covariance", None)
    if covariance is None:
        raise invalid(
            "standard_errors", None, "errors for a model without a fit", "Pass a mapping by key."
        )
    keys = tuple(str(key) for key in covariance[covariance.dims[0]].values)
    return model, keys, np.asarray(covariance.values, dtype=float)
