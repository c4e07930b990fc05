"""Ready-made controllers of the polishing force (thesis, section 3.4.1)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi, sqrt

import control
import numpy as np

from robustpolish.analysis import stability
from robustpolish.closed_loop.force_control.axis import PolishingAxis
from robustpolish.synthesis import output_feedback
from robustpolish.synthesis.design.design import Design
from robustpolish.validation import described, instance_of, invalid, positive


@dataclass(frozen=True, eq=False)
class ForceControl:
    """A way to control the polishing force.

    Attributes
    ----------
    name : str
    axis : PolishingAxis
        With what the tool hangs in.
    controller : control.StateSpace
        From the measurements of ``axis.plant()`` (force error, height, climb) to its push.
    loop : control.StateSpace
        From `surface` and `force_noise` to `force_error`, `tool`, `gap` and the push; stable.
    design : Design or None
        The certified design, where there is one.

    Examples
    --------
    >>> import robustpolish as rp
    >>> way = rp.impedance_control(rp.PolishingAxis())
    >>> way.name, way.controller.D.shape
    ('impedance, 100 N/m', (1, 3))
    """

    name: str
    axis: PolishingAxis
    controller: control.StateSpace = field(repr=False)
    loop: control.StateSpace = field(repr=False)
    design: Design | None = field(default=None, repr=False)


def passive_stiffness(
    axis: PolishingAxis, stiffness: float = 500.0, damping: float | None = None
) -> ForceControl:
    """Hang the tool in a soft spring and a damper, preloaded to the polishing force.

    No force is measured and nothing is driven: where the mould is higher by s, the force is higher
    by about k s.

    Parameters
    ----------
    axis : PolishingAxis
    stiffness : float
        k of the spring [N/m].
    damping : float, optional
        c of the damper [N s/m]; a tenth of the critical one of spring and mass.

    Returns
    -------
    ForceControl

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.passive_stiffness(rp.PolishingAxis(), 500.0)
    >>> round(float(found.loop.dcgain()[0, 0]), 1)  # N per m: 500 and 1e4 N/m in series
    476.2
    """
    k = positive("stiffness", stiffness, "N/m")
    c = 0.2 * sqrt(k * _axis(axis).mass) if damping is None else _zero_or_more(damping)
    hung = replace(axis, stiffness=k, damping=c)
    return _closed(f"passive, {k:.4g} N/m", hung, _static([0.0, 0.0, 0.0]))


def impedance_control(
    axis: PolishingAxis,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float = 100.0,
) -> ForceControl:
    """Drive the tool so that it answers forces like a wanted mass, damper and spring.

    M z'' + B z' + K z = F - F_p (N. Hogan, "Impedance control: an approach to manipulation",
    J. Dynamic Systems, Measurement and Control 107 (1985)): the actuator replaces the tool's own
    mass by M and adds B and K. At rest the force is off by K times the height, as with a
    spring of K, which may be softer than any that carries a tool.

    Parameters
    ----------
    axis : PolishingAxis
    mass : float, optional
        M [kg]; that of the tool, for which no force has to be measured.
    damping : float, optional
        B [N s/m]; critical for M and K.
    stiffness : float
        K [N/m].

    Returns
    -------
    ForceControl

    Raises
    ------
    InvalidInputError
        If the loop is not stable: the actuator is too slow for a mass so much smaller.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.impedance_control(rp.PolishingAxis(), stiffness=100.0)
    >>> round(float(found.loop.dcgain()[0, 0]), 1)
    99.0
    """
    own = _axis(axis).mass
    wanted = own if mass is None else positive("mass", mass, "kg")
    k = positive("stiffness", stiffness, "N/m")
    b = 2 * sqrt(k * wanted) if damping is None else _zero_or_more(damping)
    ratio = own / wanted
    # What hangs already is taken out again.
    gain = [ratio - 1, axis.stiffness - ratio * k, axis.damping - ratio * b]
    return _closed(f"impedance, {k:.4g} N/m", axis, _static(gain))


def admittance_control(
    axis: PolishingAxis,
    damping: float | None = None,
    mass: float | None = None,
    stiffness: float = 0.0,
    position_bandwidth: float = 40.0,
) -> ForceControl:
    """Shift the height that a position controller holds, as the measured force asks.

    M r'' + B r' + K r = F - F_p gives the height r, which a proportional-derivative controller
    follows. Without K the force is right at rest, whatever the height, and off by B times the
    speed at which the mould rises.

    Parameters
    ----------
    axis : PolishingAxis
    damping : float, optional
        B [N s/m]; such that force is corrected with a bandwidth of a tenth of the position's.
    mass : float, optional
        M [kg]; a tenth of B divided by the position's bandwidth.
    stiffness : float
        K [N/m].
    position_bandwidth : float
        Of the position controller without contact [Hz].

    Returns
    -------
    ForceControl

    Raises
    ------
    InvalidInputError
        If the loop is not stable.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.admittance_control(rp.PolishingAxis())
    >>> abs(round(float(found.loop.dcgain()[0, 0]), 3))
    0.0
    """
    omega = 2 * pi * positive("position_bandwidth", position_bandwidth, "Hz")
    b = (
        10 * _axis(axis).contact_stiffness / omega
        if damping is None
        else positive("damping", damping)
    )
    m = 0.1 * b / omega if mass is None else positive("mass", mass, "kg")
    k = positive("stiffness", stiffness, "N/m", zero=True)
    hold, brake = axis.mass * omega**2, 1.4 * axis.mass * omega
    A = np.array([[0.0, 1.0], [-k / m, -b / m]])  # r, r'
    B = np.array([[0.0, 0.0, 0.0], [1 / m, 0.0, 0.0]])
    controller = control.StateSpace(A, B, [[hold, brake]], [[0.0, -hold, -brake]])
    return _closed(f"admittance, {b:.4g} N s/m", axis, controller)


def hinf_force_control(
    axis: PolishingAxis,
    bandwidth: float = 5.0,
    *,
    deviation: float = 1e-3,
    accuracy: float = 0.01,
    largest_push: float = 20.0,
) -> ForceControl:
    """Design an output feedback that keeps the force error small, by its H-infinity norm.

    Any controller with a weighted norm below 1 will do; the central one has less gain and slower
    poles than those near the least norm.

    Parameters
    ----------
    axis : PolishingAxis
    bandwidth : float
        In Hz: waves of the mould that pass more slowly shall not be felt.
    deviation : float
        How far the mould is off [m], in that band.
    accuracy : float
        Error of the force that counts as 1, as a share of the polishing force.
    largest_push : float
        Push of the actuator that counts as much [N].

    Returns
    -------
    ForceControl
        With its certified `design`.

    Raises
    ------
    InfeasibleError
        If no controller comes below 1: ask for less accuracy, or allow larger pushes.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.hinf_force_control(rp.PolishingAxis())
    >>> found.design.certificate.stable
    True
    """
    plant = _axis(axis).plant()
    force, edge = axis.polishing_force, positive("bandwidth", bandwidth, "Hz")
    size = positive("deviation", deviation, "m")
    # Waves of the mould fade above the band; below it an error of `accuracy` counts as 1.
    lag = 1.0 / (2 * pi * edge)
    slow = control.TransferFunction([size], [lag**2, 2 * lag, 1.0])
    share = positive("accuracy", accuracy)
    asked = plant.weighted(
        {"surface": slow, "force_noise": 1e-3 * force, "force_error": 1.0 / (share * force)}
    )
    design = output_feedback(
        asked,
        control_weight=1.0 / positive("largest_push", largest_push, "N"),
        gamma=1.0,
        measurement_noise=[1e-3 * force, 1e-2 * size, 1e-2 * size * 2 * pi * edge],
    )
    return _closed("H-infinity", axis, design.controller, design)


def _axis(axis: PolishingAxis) -> PolishingAxis:
    return instance_of("axis", axis, PolishingAxis, "a PolishingAxis", "Pass PolishingAxis(...).")


def _static(gain: list[float]) -> control.StateSpace:
    return control.StateSpace([], [], [], np.array([gain]))


def _zero_or_more(damping: float) -> float:
    return positive("damping", damping, "N s/m", zero=True)


def _closed(
    name: str, axis: PolishingAxis, controller: control.StateSpace, design: Design | None = None
) -> ForceControl:
    """Close the loop, and refuse one that is not stable."""
    loop = axis.plant().with_control_outputs().closed_loop(controller)
    found = stability(loop)
    if found.verdict != "stable":
        raise invalid(
            "controller",
            described(f"{name}, whose loop has a pole at {found.pole:.3g} rad/s"),
            "a stable loop",
            "Ask for less: more damping, a larger mass or a smaller bandwidth.",
        )
    return ForceControl(name, axis, controller, loop, design)
