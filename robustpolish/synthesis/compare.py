"""How much control a smaller norm costs: one design for each price on u."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base.budget import Budget, progress_bar
from robustpolish.base.checks import instance_of, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.base.sweep import sweep
from robustpolish.errors import RobustPolishError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.charts import plot_gain_against_norm
from robustpolish.plots.style import legend, log_axis, new_axes, si_axis
from robustpolish.synthesis.certificate import Norm, norm_in_words
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback
from robustpolish.synthesis.problem.preflight import (
    check_solvability,
    decoupled_parts,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.state_feedback.state_feedback import state_feedback

# One plant, several methods, one table.

METHODS = ("auto", "riccati", "lmi/cvxpy", "lmi/picos", "slycot")
_HEADER = (
    "part", "method", "status", "claimed", "achieved", "gain", "condition", "order", "seconds",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class MethodResult(Displayed):
    """What one method made of one part of the plant.

    Attributes
    ----------
    part : str
        Names of the part's controls.
    method : str
    status : str
        That of the design, or "infeasible", "refused" and "missing" for a method that raised
        an InfeasibleError, another error, or that lacks its solver.
    claimed, achieved : float
        The norm that the method promised, and that of its loop, computed afresh and certified;
        not a number without a controller. The latter may lie above a true claim by less than the
        tolerance, where modes that hardly count were left out of the controller.
    gain : float
        Largest entry of the controller's matrices.
    condition : float
        Condition number of the eigenvectors of the loop: how sensitive its poles are.
    order : int
        States of the controller; -1 without one.
    seconds : float
        Wall time.
    message : str
        What the method said.
    design : Design or None
        For the part, with the price and the noise in its plant.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> result = rp.compare_methods(plant, ["riccati"])["riccati"]
    >>> result.row()[1:3], result.design.certificate.valid
    (('riccati', 'optimal'), True)
    >>> result.plot().get_xlabel()
    'frequency'
    """

    part: str
    method: str
    status: str
    claimed: float
    achieved: float
    gain: float
    condition: float
    order: int
    seconds: float
    message: str
    design: Design | None = field(default=None, repr=False)

    def row(self) -> tuple[Any, ...]:
        """Return the figures in the order of the table's columns.

        Returns
        -------
        tuple
        """
        rounded = [float(f"{x:.2g}") for x in (self.gain, self.condition)]
        order = self.order if self.order >= 0 else None
        figures = (self.claimed, self.achieved, *rounded, order, round(self.seconds, 2))
        return self.part, self.method, self.status, *figures

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the frequency response of the design, as :meth:`Design.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        if self.design is None:
            raise invalid("design", None, "a controller to draw", self.message)
        return self.design.plot(ax)

    def _card(self) -> Card:
        rows = tuple(zip(_HEADER[3:], self.row()[3:], strict=True))
        title = f"{self.part}, {self.method}: {self.status}"
        return Card(title, (quantities(*rows),), (self.message,))


@dataclass(frozen=True, eq=False, repr=False)
class MethodComparison(Displayed):
    """The results of several methods on each part of a plant; ``print`` shows them as a table.

    ``comparison[method]`` is the result of a method where the plant is one part, and
    ``comparison[part, method]`` where it has several.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    results : tuple of MethodResult

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> [result.method for result in rp.compare_methods(plant, ["riccati", "lmi/cvxpy"])]
    ['riccati', 'lmi/cvxpy']
    """

    norm: Norm
    results: tuple[MethodResult, ...]

    def __iter__(self) -> Iterator[MethodResult]:
        return iter(self.results)

    def __len__(self) -> int:
        return len(self.results)

    @property
    def _named(self) -> dict[str | tuple[str, str], MethodResult]:
        alone = len({r.part for r in self.results}) == 1
        return {r.method if alone else (r.part, r.method): r for r in self.results}

    def __getitem__(self, name: str | tuple[str, str]) -> MethodResult:
        """Return a result by the name of its method, or of its part and method."""
        return self._named[name]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the norms that each method claims and achieves, and the lower bound of each part.

        A claim below the bound is false. A method without a controller has an empty row.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices(
        ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
        ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
        >>> rp.compare_methods(plant, ["riccati"]).plot().get_xlabel()
        'H-infinity norm'
        """
        ax = new_axes(ax)
        places = np.arange(len(self.results))
        bounds = [(r.design and r.design.lower_bound) or math.nan for r in self.results]
        claimed, achieved = ([getattr(r, key) for r in self.results] for key in _HEADER[3:5])
        ax.hlines(places, claimed, achieved, color="0.6")
        ax.plot(bounds, places, "k|", markersize=14, label="no controller comes below")
        ax.plot(claimed, places, "o", color="#d55e00", fillstyle="none", label="claimed")
        ax.plot(achieved, places, "x", color="#0072b2", label="achieved")
        labels = [name if isinstance(name, str) else ": ".join(name) for name in self._named]
        ax.set_yticks(places, labels)
        ax.set_ylim(len(places) - 0.5, -0.5)
        shown = [x for x in (*bounds, *claimed, *achieved) if x > 0]
        name = f"{norm_in_words(self.norm)} norm"
        if max(shown, default=1.0) > 1.5 * min(shown, default=1.0):
            log_axis(ax, "x", name, "")
        else:
            si_axis(ax.xaxis, name, "")
        legend(ax)
        return ax

    def _card(self) -> Card:
        rows = tuple(r.row() for r in self.results)
        why = tuple(f"{r.part}, {r.method}: {r.message}" for r in self.results if r.design is None)
        return Card("", (Table("", _HEADER, rows, digits=6),), why)


def compare_methods(
    plant: GeneralizedPlant,
    methods: Sequence[str] = METHODS,
    *,
    norm: Norm = "hinf",
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    tolerance: float = 4e-3,
    time_limit: float = 60.0,
) -> MethodComparison:
    """Run several methods of output feedback and compare what they claim with what they reach.

    Parts of the plant that share no signal are designed and listed one by one.

    Parameters
    ----------
    plant : GeneralizedPlant
    methods : sequence of str
        Out of "auto", "riccati", "lmi/cvxpy", "lmi/picos" and "slycot"; a third part names a
        solver, as in "lmi/cvxpy/SCS".
    norm : {"hinf", "h2"}
    control_weight : float or array_like, shape (nu,), optional
        Price on u, in units of z per unit of u; for norms that are to be compared, give it and
        `measurement_noise`, because without them the infimum is often zero.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y, in units of y per unit of w. Both as for :func:`output_feedback`.
    tolerance : float
        As for :func:`output_feedback`.
    time_limit : float
        A safety net for each method and part, in seconds.

    Returns
    -------
    MethodComparison
        Every norm achieved in it is certified; a method that finds no certified controller is
        listed with the reason. Parts without control or measurement are not listed. A plant with
        delays, or one that no controller stabilises, is listed as a whole.

    Raises
    ------
    InvalidInputError
        If a method is not known or an argument does not fit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> table = rp.compare_methods(plant, ["riccati", "lmi/cvxpy"])
    >>> table["riccati"].status, round(table["riccati"].achieved, 1)
    ('optimal', 2.7)
    """
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", "Build one first.")
    one_of("norm", norm, ("hinf", "h2"))
    positive("tolerance", tolerance)
    positive("time_limit", time_limit, "s")
    if isinstance(methods, str) or not all(isinstance(name, str) for name in methods):
        raise invalid("methods", methods, "a list of names", f"Choose from {METHODS}.")
    tasks = [(name, _parsed(name)) for name in dict.fromkeys(methods)]
    options = {"norm": norm, "tolerance": tolerance, "time_limit": time_limit}
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)
    parts = [part.plant for part in decoupled_parts(whole) if part.controls and part.measurements]
    # Only the whole keeps its exact delays, and has the mode that no part with control has.
    if len(parts) < 2 or whole.delays or check_solvability(whole).fixed_modes:
        parts = [whole]
    results = []
    with progress_bar("Comparing methods", len(parts) * len(tasks)) as tell:
        for part, (name, task) in product(parts, tasks):
            tell(name)
            results.append(_run(part, name, task | options))
    return MethodComparison(norm, tuple(results))


def _parsed(name: str) -> dict[str, Any]:
    """Split a name into method, backend and solver."""
    method, *rest = name.split("/")
    known = {each.split("/")[0] for each in METHODS}
    if method not in known or (rest and method != "lmi") or len(rest) > 2:
        raise invalid("methods", name, f"one of {', '.join(METHODS)}", "Check its spelling.")
    backend, solver = (*rest, *("cvxpy", None)[len(rest) :])
    one_of("methods", backend, ("cvxpy", "picos"))
    return {"method": method, "backend": backend, "solver": solver}


def _run(plant: GeneralizedPlant, name: str, options: Mapping[str, Any]) -> MethodResult:
    clock, part = Budget(), ", ".join(plant.control_names)
    try:
        design = output_feedback(plant, **options)
    except RobustPolishError as error:
        kinds = {"InfeasibleError": "infeasible", "MissingDependencyError": "missing"}
        status, none = kinds.get(type(error).__name__, "refused"), math.nan
        seconds = clock.elapsed
        return MethodResult(part, name, status, none, none, none, none, -1, seconds, str(error))
    certificate = design.certificate
    _, vectors = np.linalg.eig(np.asarray(design.closed_loop.A))
    return MethodResult(
        part,
        name,
        design.status,
        float(design.details["claim"]),
        certificate.achieved,
        certificate.largest_gain,
        float(np.linalg.cond(vectors)) if vectors.size else 1.0,
        int(design.controller.nstates or 0),
        clock.elapsed,
        design.message,
        design,
    )


Synthesis = Callable[..., Design]
_FIGURES = ("performance", "effort", "largest_gain", "fastest_pole")
_TRADE_OFF_HEADER = ("control weight", "performance", "effort", "largest gain", "fastest pole [Hz]")


@dataclass(frozen=True, eq=False, repr=False)
class TradeOff(Displayed):
    """What each price on u buys; ``print`` shows it as a table.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    dataset : xarray.Dataset
        Over ``control_weight``: ``performance``, the norm from w to z without the price;
        ``effort``, the norm from w to u; ``largest_gain``, the largest entry of the controller's
        matrices; ``fastest_pole`` of the loop, in Hz; ``failure``, why there is no design, else "".

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> found = rp.trade_off(plant, [0.1, 1.0], norm="h2")
    >>> found.dataset.performance.values.round(3).tolist()
    [0.223, 0.595]
    """

    norm: Literal["hinf", "h2"]
    dataset: xr.Dataset

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw performance over effort: below the curve lies what no price buys.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.trade_off(plant, [0.1, 1.0], norm="h2").plot().get_xlabel()
        'H2 norm, w to u'
        """
        name = norm_in_words(self.norm)
        names = [f"weight {weight:.3g}" for weight in self.dataset.control_weight.values]
        axes = {"gain": ("effort", "w to u"), "norm": ("performance", "w to z")}
        points = {
            key: ("controller", self.dataset[of].values, {"long_name": f"{name} norm, {way}"})
            for key, (of, way) in axes.items()
        }
        return plot_gain_against_norm(xr.Dataset(points, {"controller": names}), ax)

    def _card(self) -> Card:
        of = self.dataset
        columns = (of.control_weight.values, *(of[name].values for name in _FIGURES))
        rows = tuple(tuple(map(float, row)) for row in zip(*columns, strict=True))
        why = [f"{w:g}: {f}" for w, f in zip(columns[0], of.failure.values, strict=True) if f]
        return Card("Trade-off", (Table("", _TRADE_OFF_HEADER, rows, digits=4),), tuple(why))


def trade_off(
    plant: GeneralizedPlant,
    control_weights: ArrayLike,
    synthesis: Synthesis = state_feedback,
    *,
    executor: Executor | Literal["serial"] | None = "serial",
    file: str | os.PathLike[str] | None = None,
    progress: bool = True,
    **settings: Any,
) -> TradeOff:
    """Design a controller for each price on u and tell what it reaches and what it spends.

    Parameters
    ----------
    plant : GeneralizedPlant
    control_weights : array_like, shape (k,)
        Prices, in units of z per unit of u, above zero; the `control_weight` of
        each design.
    synthesis : callable
        :func:`state_feedback`, :func:`output_feedback` or another function that takes the plant and
        ``control_weight`` and returns a :class:`Design`.
    executor : concurrent.futures.Executor, "serial" or None, optional
        Who does the work, and None for local processes: see :func:`sweep`.
    file : path, optional
        Where finished designs are noted, to go on from after an interruption: see :func:`sweep`.
    progress : bool, optional
        Show a bar in terminals and notebooks.
    **settings
        Further arguments of `synthesis`, as ``norm="h2"``.

    Returns
    -------
    TradeOff
        Norms in it are computed afresh from the certified loops. A price without a design is a
        failure with its reason.

    Raises
    ------
    InvalidInputError
        If the weights are no positive numbers.
    TypeError
        If `synthesis` has no such argument.

    Notes
    -----
    Every design starts from nothing and not from that of the price beside it, so that the same
    price gives the same controller, alone or among others and on any number of workers. The H2
    curve of state feedback is the limit of what any controller reaches; H-infinity designs lie
    near theirs, within their tolerance.

    Examples
    --------
    A higher price spends less:

    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> found = rp.trade_off(plant, [1e-8, 1e-7, 1e-6], norm="h2").dataset
    >>> bool((found.effort.diff("control_weight") < 0).all())
    True
    """
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", "Build one first.")
    # A price of zero leaves u free, which has no point on the curve.
    listed = control_weights if np.iterable(control_weights) else [control_weights]
    weights = [positive("control_weights", weight, "of z per unit of u") for weight in listed]
    if "control_weight" in settings:
        given = settings["control_weight"]
        raise invalid("control_weight", given, "nothing", "Write control_weights=[...].")
    call = inspect.signature(synthesis).bind_partial(plant, control_weight=1.0, **settings)
    call.apply_defaults()
    point = partial(_point, plant=plant, synthesis=synthesis, settings=settings)
    grid = {"control_weight": np.unique(weights)}
    found = sweep(point, grid, executor=executor, file=file, progress=progress)
    for name in set(_FIGURES) - set(found):  # where no price has a design
        found[name] = ("control_weight", np.full(found.sizes["control_weight"], np.nan))
    return TradeOff(call.arguments.get("norm", "hinf"), found)


def _point(
    control_weight: float,
    plant: GeneralizedPlant,
    synthesis: Synthesis,
    settings: Mapping[str, Any],
) -> dict[str, float]:
    """Design for one price, and measure the loop."""
    design = synthesis(plant, control_weight=control_weight, **settings)
    loop = design.closed_loop
    norm = hinf_norm if design.norm == "hinf" else h2_norm
    return {
        "performance": float(norm(loop[: plant.nz, :])),
        "effort": float(norm(loop[-plant.nu :, :])) / control_weight,
        "largest_gain": float(design.certificate.largest_gain),
        "fastest_pole": float(design.certificate.frequencies_hz.max(initial=0.0)),
    }
