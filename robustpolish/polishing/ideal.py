"""State feedback for the air bearing with ideal sensors and actuators, as in the thesis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.results import Card, Displayed
from robustpolish.closed_loop.simulate import ControllerComparison, compare_controllers
from robustpolish.linear.norms.h2 import H2Norm, h2_norm
from robustpolish.linear.norms.hinf import HinfNorm, hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import AirBearingParameters
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.state_feedback.state_feedback import state_feedback

# What a unit of control costs, in metres of deviation, where the user names no price. A force is
# priced like the deflection of a spring of 1e7 N/m, thirty times as stiff as the rod; a velocity
# like the distance that it covers in 10 ns.
DEFAULT_CONTROL_WEIGHT = {"force": 1e-7, "displacement": 1e-8}


@dataclass(frozen=True, eq=False, repr=False)
class BrushDesign(Displayed):
    """A certified controller and what it does to the brush's disturbance.

    Attributes
    ----------
    plant : GeneralizedPlant
        The air bearing.
    parameters : AirBearingParameters
        What it is made of.
    disturbance : xarray.Dataset
        Forces and motion of the brush.
    design : Design
        The controller with its certificate.
    control_weight : float or None
        The price on u that was paid, in m per unit of u.
    gain_bound : float or None
        The bound on the gain that was kept.
    open_loop_norm : HinfNorm or H2Norm
        The norm without control.
    closed_loop_norm : HinfNorm or H2Norm
        The norm from w to the displacements with control, without the price on u.
    comparison : ControllerComparison
        Largest deviations of the brush without and with control.

    Examples
    --------
    >>> import robustpolish as rp
    >>> job = rp.polishing.design_against_brush(duration=0.02, realisation="ideal")
    >>> job.verdict().split(":")[0]
    'The controller is certified'
    """

    plant: GeneralizedPlant
    parameters: AirBearingParameters
    disturbance: xr.Dataset
    design: Design
    control_weight: float | None
    gain_bound: float | None
    open_loop_norm: HinfNorm | H2Norm
    closed_loop_norm: HinfNorm | H2Norm
    comparison: ControllerComparison

    @property
    def good(self) -> bool:
        """Whether the verdict is good news."""
        return self.design.certificate.valid

    def verdict(self) -> str:
        """Say in two sentences what was found.

        Returns
        -------
        str

        Examples
        --------
        >>> import robustpolish as rp
        >>> job = rp.polishing.design_against_brush(duration=0.02, realisation="ideal")
        >>> "H-infinity norm" in job.verdict()
        True
        """
        certificate = self.design.certificate
        proven = "certified" if certificate.valid else "NOT certified"
        name = {"hinf": "H-infinity", "h2": "H2"}[self.design.norm]
        unit = {"hinf": "m/N", "h2": "m/(N s^0.5)"}[self.design.norm]
        improvement = self.comparison.table["improvement"].sel(row="with control")
        gained = ", ".join(
            f"{axis} by {float(improvement.sel(signal=axis)):.2f} %"
            for axis in improvement["signal"].values
            if np.isfinite(improvement.sel(signal=axis))
        )
        return (
            f"The controller is {proven}: its loop is "
            f"{'stable' if certificate.stable else 'unstable'}, and the {name} norm from the "
            f"brush's forces to the displacements falls from {float(self.open_loop_norm):.4g} to "
            f"{float(self.closed_loop_norm):.4g} {unit}. Under the same load, it reduces the "
            f"largest deviation in {gained}."
        )

    def plot(self, ax: Axes | None = None, *, signal: str | None = None) -> Axes:
        """Draw one displacement without and with control, as `comparison.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        signal : str, optional
            x, y or z; by default the one that deviates most without control.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> design = rp.polishing.design_against_brush(duration=0.02, realisation="ideal")
        >>> design.plot().get_xlabel()
        'time [ms]'
        """
        return self.comparison.plot(ax, signal=signal)

    def _card(self) -> Card:
        tables = self.comparison._card().tables
        return Card("Design against the brush", tables, (self.verdict(), self.design.message))


def ideal_against_brush(
    plant: GeneralizedPlant,
    parameters: AirBearingParameters,
    load: Callable[[], xr.Dataset],
    actuation: Literal["force", "displacement"],
    tell: Callable[[str], None],
    *,
    norm: Literal["hinf", "h2"] = "hinf",
    control_weight: float | None = None,
    gain_bound: float | None = None,
    **options: Any,
) -> BrushDesign:
    """Design a state feedback that has all states and ideal forces, and try it on the load."""
    if control_weight is None and gain_bound is None:
        control_weight = DEFAULT_CONTROL_WEIGHT[actuation]
    method = options.get("method", "lmi")
    tell(f"Designing a state feedback ({norm}, {method}) ...")
    design = state_feedback(
        plant, norm=norm, control_weight=control_weight, gain_bound=gain_bound, **options
    )
    disturbance = load()
    tell("Comparing the loops under the brush's forces ...")
    comparison = compare_controllers(
        {"with control": design}, disturbance, plant=plant, signals=("x", "y", "z")
    )
    measure = hinf_norm if norm == "hinf" else h2_norm
    return BrushDesign(
        plant=plant,
        parameters=parameters,
        disturbance=disturbance,
        design=design,
        control_weight=control_weight,
        gain_bound=gain_bound,
        open_loop_norm=measure(plant.open_loop),
        closed_loop_norm=measure(plant.state_feedback_loop(design.controller.D)),
        comparison=comparison,
    )
