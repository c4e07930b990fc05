"""How much control a smaller norm costs: one design for each price on u."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.display import Card, Displayed, Table
from robustpolish.models import GeneralizedPlant
from robustpolish.plotting import plot_gain_against_norm
from robustpolish.sweeps import sweep
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.state_feedback import state_feedback
from robustpolish.validation import instance_of, invalid, positive

Synthesis = Callable[..., Design]
_FIGURES = ("performance", "effort", "largest_gain", "fastest_pole")
_HEADER = ("control weight", "performance", "effort", "largest gain", "fastest pole [Hz]")


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
        name = "H-infinity" if self.norm == "hinf" else "H2"
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
        return Card("Trade-off", (Table("", _HEADER, rows, digits=4),), tuple(why))


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
        raise invalid(
            "control_weight", settings["control_weight"], "nothing", "Write control_weights=[...]."
        )
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
