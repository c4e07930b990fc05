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

from robustpolish.base.arrays import Matrix, Vector
from robustpolish.base.checks import described, invalid, misfit, whole_number
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.base.sampling import share_at_least
from robustpolish.base.sweep import sweep
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


# Parameter samples from the covariance of a fit.

# Beyond this share of draws of the wrong sign the truncated distribution is not that of the fit.
_MOST_REDRAWN = 0.5


def draw(
    model: MechanicalModel, keys: tuple[str, ...], covariance: Matrix, samples: int, seed: int
) -> tuple[tuple[str, ...], Matrix, Vector, tuple[str, ...]]:
    """Draw numbers of a model.

    A draw in which a mass, a stiffness or a damping changes its sign is no machine of this kind and
    is drawn again.

    Parameters
    ----------
    model : MechanicalModel
    keys : tuple of str
        Of the uncertain numbers.
    covariance : ndarray, shape (keys, keys)
        Infinite or NaN on the diagonal where nothing is known.
    samples, seed : int

    Returns
    -------
    keys : tuple of str
    values : ndarray, shape (samples, keys)
    nominal : ndarray, shape (keys,)
    left_out : tuple of str
        Keys whose error is not known; they keep their value.
    """
    whole_number("samples", samples, 1, remedy="Ask for 200 machines.")
    variances = np.diag(covariance)
    if np.any(variances < 0):
        raise misfit("standard_errors", "a negative variance", "errors of at least 0", "Check it.")
    known = np.isfinite(variances)
    used, left_out = (
        tuple(key for key, here in zip(keys, known == kind, strict=True) if here)
        for kind in (True, False)
    )
    if not used:
        shown = described("no number with a known error")
        remedy = "Pass standard_errors, or fit to data that determines the numbers."
        raise invalid("learned", shown, "a fit with standard errors", remedy)
    nominal = np.array([model.parameters[key] for key in used])
    # A square root of the covariance of numbers of very different size.
    size = np.sqrt(variances[known])
    safe = np.where(size > 0, size, 1.0)
    eigen, vectors = np.linalg.eigh(covariance[known][:, known] / np.outer(safe, safe))
    root = safe[:, None] * vectors * np.sqrt(np.maximum(eigen, 0.0))
    sign = np.array([0.0 if key.startswith(("effect", "input")) else 1.0 for key in used])
    sign *= np.sign(nominal)
    rng = np.random.default_rng(seed)
    values = nominal + rng.standard_normal((samples, len(used))) @ root.T
    again = np.flatnonzero(np.any(values * sign < 0, axis=1))
    if again.size <= _MOST_REDRAWN * samples:
        while again.size:
            values[again] = nominal + rng.standard_normal((again.size, len(used))) @ root.T
            again = again[np.any(values[again] * sign < 0, axis=1)]
        return used, values, nominal, left_out
    worst = used[int(np.argmax(np.linalg.norm(root, axis=1) / np.maximum(abs(nominal), 1e-300)))]
    shown, want = f"an error of {worst} as large as its value", "smaller errors"
    raise misfit("standard_errors", shown, want, "Hold the number fixed, or measure it better.")


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
    model, uncertain, covariance = _source(learned, standard_errors)
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
                want = "a key of model.parameters"
                raise invalid("standard_errors", key, want, "Check its spelling.")
        errors = np.array([float(error) for error in standard_errors.values()])
        return model, tuple(standard_errors), np.diag(errors**2)
    covariance = getattr(learned, "covariance", None)
    if covariance is None:
        want = "errors for a model without a fit"
        raise invalid("standard_errors", None, want, "Pass a mapping by key.")
    keys = tuple(str(key) for key in covariance[covariance.dims[0]].values)
    return model, keys, np.asarray(covariance.values, dtype=float)
