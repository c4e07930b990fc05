"""What the thesis estimates of one blow: its mass, duration and depth (section 7.5)."""

from __future__ import annotations

from math import pi, sqrt

from robustpolish.brush.parameters import BrushParameters
from robustpolish.validation import positive


def rim_mass(parameters: BrushParameters) -> float:
    """Mass that a blow at the rim meets when the disc tilts about its joint, I_0 / r^2.

    Parameters
    ----------
    parameters : BrushParameters

    Returns
    -------
    float
        In kg; 0.053 for the thesis's disc, of which the listings let all 0.2 kg hit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.brush import rim_mass
    >>> round(rim_mass(rp.BrushParameters()), 4)
    0.0533
    """
    return parameters.tilt_inertia / parameters.rim_distance**2


def quarter_period(mass: float, stiffness: float) -> float:
    """Duration t_m [s] of an impact as the thesis takes it, (7.39) and (7.40): until the rest.

    Parameters
    ----------
    mass : float
        In kg.
    stiffness : float
        k_p in N/m.

    Returns
    -------
    float
        In s.

    Examples
    --------
    >>> from robustpolish.brush import quarter_period
    >>> round(1e3 * quarter_period(0.2, 1e4), 3)
    7.025
    """
    return 0.5 * pi * sqrt(positive("mass", mass, "kg") / positive("stiffness", stiffness, "N/m"))


def impact_depth(mass: float, stiffness: float, speed: float) -> float:
    """Largest deflection d_max [m] of a linear spring by a blow, (7.41) to (7.43).

    Parameters
    ----------
    mass : float
        In kg.
    stiffness : float
        k_p in N/m.
    speed : float
        In m/s.

    Returns
    -------
    float
        In m.

    Examples
    --------
    >>> from robustpolish.brush import impact_depth
    >>> round(impact_depth(0.2, 1e8, 1.0), 9)
    4.4721e-05
    """
    mass, stiffness = positive("mass", mass, "kg"), positive("stiffness", stiffness, "N/m")
    return sqrt(mass / stiffness) * abs(speed)
