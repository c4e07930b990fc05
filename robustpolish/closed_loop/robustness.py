"""Robustness of a design over parameter errors of a fit: Monte Carlo with a normal distribution."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.base.checks import invalid
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.base.sampling import share_at_least
from robustpolish.base.sweep import sweep
from robustpolish.closed_loop.machine_loops import draw, uncertain_numbers
from robustpolish.closed_loop.sampled_loops import LoopTrial, PlantOf, SampledModel, column
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.charts import plot_distribution
from robustpolish.synthesis.design import Design, checked_design

# Result: norms and stability of the sampled loops.


@dataclass(frozen=True, eq=False, repr=False)
class RobustnessCheck(Displayed):
    """A controller around many machines.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    nominal : float
        The norm of the design's certificate.
    norms : ndarray, shape (samples,)
        The norm of every loop; infinite if it is unstable.
    keys : tuple of str
        The numbers that were drawn, by the keys of ``model.parameters``.
    parameters : ndarray, shape (samples, keys)
        In SI units.
    nominal_parameters : ndarray, shape (keys,)
    left_out : tuple of str
        Numbers that were not drawn, because the data does not determine them.
    unit : str
        Of the norms, where all signals have one each.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> check = rp.results.RobustnessCheck(
    ...     "hinf", 1.0, np.array([0.9, 1.2, np.inf]), ("dof.x.mass",),
    ...     np.array([[1.0], [1.1], [2.0]]), np.array([1.0]))
    >>> round(check.share_stable, 2), check.median, check.worst
    (0.67, 1.2, inf)
    >>> check.worst_parameters
    {'dof.x.mass': 2.0}
    >>> check.plot().get_ylabel()
    'number per bin (machine)'
    """

    norm: str
    nominal: float
    norms: NDArray[np.float64]
    keys: tuple[str, ...]
    parameters: NDArray[np.float64]
    nominal_parameters: NDArray[np.float64]
    left_out: tuple[str, ...] = ()
    unit: str = ""

    @property
    def samples(self) -> int:
        """Number of machines."""
        return self.norms.size

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Which loops are stable, shape (samples,)."""
        return np.isfinite(self.norms)

    @property
    def share_stable(self) -> float:
        """Share of the loops that are stable."""
        return float(np.mean(self.stable))

    @property
    def least_share_stable(self) -> float:
        """Share of all such machines that are stable, at least, with 95 % confidence."""
        return share_at_least(int(np.sum(self.stable)), self.samples, 0.95)

    @property
    def most_share_stable(self) -> float:
        """Share of all such machines that are stable, at most, with 95 % confidence."""
        return 1.0 - share_at_least(int(np.sum(~self.stable)), self.samples, 0.95)

    def least_share_within(self, norm: float, confidence: float = 0.95) -> float:
        """Return the share of all such machines whose norm is at most `norm`, at least.

        Parameters
        ----------
        norm : float
            Chosen before looking at the result; :attr:`worst` is the largest of a sample, of which
            the same is true.
        confidence : float, optional

        Returns
        -------
        float
            The lower limit of Clopper and Pearson, for independent draws.

        Examples
        --------
        >>> import numpy as np
        >>> import robustpolish as rp
        >>> check = rp.results.RobustnessCheck(
        ...     "hinf", 1.0, np.linspace(0.9, 1.1, 59), ("dof.x.mass",),
        ...     np.linspace(0.9, 1.1, 59)[:, None], np.array([1.0]))
        >>> round(check.least_share_within(check.worst), 3), round(check.least_share_within(1.0), 2)
        (0.95, 0.39)
        """
        if not 0 < confidence < 1:
            raise invalid("confidence", confidence, "a share between 0 and 1", "Write 0.95.")
        within = self.stable & (self.norms <= norm)
        return share_at_least(int(np.sum(within)), self.samples, confidence)

    @property
    def median(self) -> float:
        """Median of the norms."""
        return float(np.quantile(self.norms, 0.5, method="nearest"))

    @property
    def worst(self) -> float:
        """Largest norm; infinite if a loop is unstable."""
        return float(np.max(self.norms))

    @property
    def worst_parameters(self) -> Mapping[str, float]:
        """The numbers of the worst machine."""
        row = self.parameters[int(np.argmax(self.norms))]
        return dict(zip(self.keys, row.tolist(), strict=True))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw how the norms of the stable loops are distributed about the certificate's.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        name = {"hinf": "H-infinity norm", "h2": "H2 norm"}[self.norm]
        attrs = {"units": self.unit}
        found = xr.DataArray(self.norms[self.stable], dims="machine", name=name, attrs=attrs)
        unstable = self.samples - found.size
        note = f"{unstable} of {self.samples} unstable" if unstable else ""
        return plot_distribution(found, {"certificate": self.nominal}, ax, note=note)

    def _card(self) -> Card:
        # Where a loop is unstable, the share of stable ones says it already.
        within = f"{100 * self.least_share_within(self.worst):.4g} %"
        no_worse = (("no worse, at least (95 %)", within),) if np.isfinite(self.worst) else ()
        table = quantities(
            ("machines", self.samples),
            ("stable", f"{100 * self.share_stable:.4g} %"),
            ("stable, at least (95 %)", f"{100 * self.least_share_stable:.4g} %"),
            ("stable, at most (95 %)", f"{100 * self.most_share_stable:.4g} %"),
            ("norm of the certificate", self.nominal),
            ("median norm", self.median),
            ("worst norm", self.worst),
            *no_worse,
        )
        left = f"Not drawn, because not determined: {', '.join(self.left_out)}."
        return Card("Robustness over the fit's errors", (table,), (left,) if self.left_out else ())


class FittedModel(Protocol):
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
    learned: FittedModel | MechanicalModel,
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
    >>> check = rp.simulation.check_robustness(
    ...     design, machine, standard_errors={"spring[0].stiffness": 40.0, "dof.x.mass": 0.1},
    ...     plant_of=lambda model: model.linearize(measured="state"), samples=50)
    >>> check.share_stable, bool(check.worst < 1.5 * design.certificate.achieved)
    (1.0, True)
    """
    checked_design("design", design)
    model, uncertain, covariance = uncertain_numbers(learned, standard_errors)
    keys, values, nominal, left_out = draw(model, uncertain, covariance, samples, seed)
    machine = SampledModel(model, plant_of)
    trial = LoopTrial(design.plant, design.controller, design.norm, keys, machine)
    points = [{column(i): value for i, value in enumerate(row)} for row in values.tolist()]
    found = sweep(trial, points, executor=executor)
    for i in np.flatnonzero(found["failure"].values != "")[:1]:
        trial(**points[i])  # raises here what it raised there
    unit = design.gain_unit if design.norm == "hinf" else ""
    achieved, norms = design.certificate.achieved, found["norm"].values
    return RobustnessCheck(design.norm, achieved, norms, keys, values, nominal, left_out, unit)
