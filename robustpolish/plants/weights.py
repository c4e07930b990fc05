"""Weights, and the plants that they make of a system: what a loop is asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import control
import numpy as np

from robustpolish.base.checks import described, invalid, positive, whole_number
from robustpolish.linear.arithmetic.exact import LARGEST
from robustpolish.linear.systems import as_state_space, in_a_row, named_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import Wiring, bilinear, single_filter, state_names

# The plant of mixed sensitivity: performance, effort and robustness with a weight each.

Weight = control.StateSpace | control.TransferFunction | float
Weights = Weight | Sequence[Weight | None]


def mixed_sensitivity(
    plant: GeneralizedPlant | control.StateSpace | control.TransferFunction,
    performance: Weights | None = None,
    effort: Weights | None = None,
    robustness: Weights | None = None,
) -> GeneralizedPlant:
    r"""Build the plant whose H-infinity norm is that of weighted sensitivities.

    ::

                                    r (a reference, or noise, of the other sign)
                                    |
        u --->[ G ]---+------------>+---> y, measured      z = [ performance y ]
                      |                                        [ effort u      ]
                      +---> G u                                [ robustness G u]

    With u = K y and S = (I - G K)^-1 the loop from r to z is [W1 S; W2 K S; W3 G K S], and
    :func:`robustpolish.output_feedback` makes its norm as small as it can be. Where it comes
    below 1, S keeps below 1 / W1 at all frequencies, K S below 1 / W2, and T below 1 / W3.

    Parameters
    ----------
    plant : GeneralizedPlant, control.StateSpace or control.TransferFunction
        G. Of a generalised plant, the part from its controls to its measurements, with actuators,
        sensors, delays, limits and units; its disturbances and performance outputs are left out.
    performance, effort, robustness : system, number or sequence of them, optional
        W1 on S, W2 on K S, W3 on T = -G K S: a weight of one input and one output that stands for
        all channels, one per channel (None leaves a channel out), or a system of several inputs
        and outputs, such as a diagonal one. At least one of the three is needed; see
        :func:`robustpolish.weight`.

    Returns
    -------
    GeneralizedPlant
        Its disturbances are ``reference_`` and the name of each measurement; its outputs
        ``performance_`` and ``robustness_`` and the name of each measurement, ``effort_`` and the
        name of each control. Controls and measurements keep their names, all their units.

    Raises
    ------
    InvalidInputError
        If no weight is given, or one does not fit the plant.

    Notes
    -----
    The sign of the controller: here u = K y, so that K can be put on the machine, given to
    ``plant.closed_loop`` and analysed as all others of this package. MATLAB's ``mixsyn`` and
    python-control's ``mixsyn`` feed the error r - y to the controller: theirs is -K. Norms and
    sensitivities are the same.

    Weights have to be stable, since no controller could do anything about them: put a slow pole
    (``weight(1e4, ...)``) in the place of an integrator. Skogestad, Postlethwaite, "Multivariable
    Feedback Control", 2nd edition, 2005, section 3.5.7.

    Examples
    --------
    The disturbance process of Skogestad and Postlethwaite, example 2.17, where 1.37 is printed:

    >>> import control
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> G = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
    >>> W1 = (s / 1.5 + 10) / (s + 10 * 1e-4)
    >>> plant = rp.mixed_sensitivity(G, performance=W1, effort=1.0)
    >>> round(rp.output_feedback(plant).certificate.achieved, 2)
    1.37
    """
    if isinstance(plant, GeneralizedPlant):
        G = plant
    else:
        system = as_state_space("plant", plant)
        G = GeneralizedPlant(system, measurements=system.noutputs, controls=system.ninputs)
    if not (G.nu and G.ny):
        shown = described(f"{G.nu} controls and {G.ny} measurements")
        raise invalid("plant", shown, "at least one of each", "Check controls=, measurements=.")
    u, y = G.control_names, G.measurement_names
    wiring = G.wiring.chosen([], range(G.nu), [], range(G.ny))
    if performance is None and effort is None and robustness is None:
        shown = described("no weight at all")
        raise invalid("performance", shown, "a weight", "Say what the loop has to achieve.")
    # What is led out before the reference enters does not show it.
    wiring = _with_outputs(wiring, "robustness", robustness, y, G)
    first = wiring.nz - len(wiring.lines)
    wiring = wiring.with_disturbances(np.eye(G.ny), [f"reference_{name}" for name in y])
    wiring = _with_outputs(wiring, "performance", performance, y, G)
    wiring = _with_outputs(wiring, "effort", effort, u, G)
    z = [*range(first, wiring.nz - len(wiring.lines)), *range(first)]
    w = range(wiring.nw - len(wiring.lines))
    whole = wiring.chosen(w, range(G.nu), z, range(G.ny))
    # Disturbances and outputs of a generalised plant are gone, and their units with them.
    there = {*whole.system.input_labels, *whole.system.output_labels, *whole.states}
    prefixes = ("", "reference_", "performance_", "effort_", "robustness_")
    own = {name: unit for name, unit in G.units.items() if name in {*u, *y, *G.states}}
    named = {f"{prefix}{name}": unit for name, unit in own.items() for prefix in prefixes}
    return G.rewired(whole, units={name: unit for name, unit in named.items() if name in there})


def _with_outputs(
    wiring: Wiring, kind: str, given: Any, names: Sequence[str], plant: GeneralizedPlant
) -> Wiring:
    """Append weighted measurements or controls to the outputs, those that have a weight."""
    if given is None:
        return wiring
    count, at = len(names), wiring.nz - len(wiring.lines)
    none, one = np.zeros((count, plant.ny)), np.eye(count)
    rows = (none, one) if kind == "effort" else (one, np.zeros((count, plant.nu)))
    wiring = wiring.with_performance(*rows, [f"{kind}_{name}" for name in names])
    if not isinstance(given, list | tuple):
        system = as_state_space(kind, given, plant.dt)
        sizes = system.ninputs, system.noutputs
        if sizes not in ((1, 1), (count, count)):
            shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
            want = f"one of each, or {count}"
            raise invalid(kind, shown, want, "Pass a number, a weight, or one per channel.")
        if sizes != (1, 1):
            if system.nstates and system.dt is not None and system.dt != plant.dt:
                shown = described(f"sampling time {system.dt}")
                raise invalid(kind, shown, f"{plant.dt} like the plant", "Discretise it.")
            return wiring.series("output", at, system, f"{kind}_weight")
        given = [given] * count
    if len(given) != count:
        shown = described(f"{len(given)} weights")
        raise invalid(kind, shown, f"{count}, one per channel", "Write None for no weight.")
    kept = [i for i, weight in enumerate(given) if weight is not None]
    for i in kept:
        filter = single_filter(f"{kind}[{i}]", given[i], plant.dt)
        wiring = wiring.series("output", at + i, filter, wiring.performance_names[at + i])
    w, z = range(wiring.nw - len(wiring.lines)), [*range(at), *(at + i for i in kept)]
    return wiring.chosen(w, range(wiring.nu), z, range(wiring.ny))


# A weight between a gain at low and a gain at high frequencies.

MOST_ORDER = 10


def weight(
    low: float,
    crossover_hz: float,
    high: float,
    order: int = 1,
    *,
    inverse: bool = False,
    dt: float | bool = 0,
) -> control.StateSpace:
    r"""Return a weight that goes from one gain to another and is 1 in between.

    .. math:: W(s) = \left(\frac{h\, s + l\, p}{s + p}\right)^n, \quad
              l = \mathrm{low}^{1/n},\ h = \mathrm{high}^{1/n}

    with p such that \|W\| = 1 at the crossover.

    Parameters
    ----------
    low : float
        Gain at rest; infinite for an integrator, which suits loop shaping but no norm.
    crossover_hz : float
        Where the gain is 1, in Hz.
    high : float
        Gain at high frequencies, on the other side of 1 than `low`.
    order : int, optional
        Number n of equal sections: the steepness, 20 dB per decade each.
    inverse : bool, optional
        Return 1 / W instead: low, crossover and high are then those of a bound that a transfer
        function has to keep, and W its weight.
    dt : float or True, optional
        Sampling time in s; 0 is continuous. Otherwise the bilinear image with the same gain at
        rest, at the crossover and, for `high`, at the Nyquist frequency.

    Returns
    -------
    control.StateSpace
        Stable, with a stable inverse; of n states in a row.

    Raises
    ------
    InvalidInputError
        If 1 does not lie between the gains, or one is negative.

    Notes
    -----
    As MATLAB's ``makeweight(low, [w 1], high)`` with w in rad/s; for order 1 it is the same system.
    Skogestad, Postlethwaite, "Multivariable Feedback Control", 2nd edition, 2005, equation (2.105)
    gives performance weights as (s / M + w_B) / (s + w_B A): ``weight(1 / A, f, 1 / M)``, whose
    crossover f lies near w_B / (2 pi).

    Examples
    --------
    >>> import robustpolish as rp
    >>> W = rp.weight(100.0, 2.0, 0.5)
    >>> [float(abs(W(2j * 3.141592653589793 * f)).round(4)) for f in (0.0, 2.0, 1e6)]
    [100.0, 1.0, 0.5]
    >>> rp.weight(0.01, 2.0, 10.0, order=2, inverse=True).nstates
    2
    """
    low, high = _gain("low", low), _gain("high", high)
    if not isinstance(inverse, bool | np.bool_):
        raise invalid("inverse", inverse, "True or False", "Choose one of them.")
    if inverse:
        if low == 0 or high == 0:
            name, shown = ("low", low) if low == 0 else ("high", high)
            raise invalid(name, shown, "a gain above 0 to be inverted", "Pass a small one.")
        low, high = 1 / low, 1 / high
    if math.isinf(high):
        shown = described("an infinite gain at high frequencies")
        raise invalid("high", shown, "a finite one", "Such a weight is no state-space system.")
    hertz = positive("crossover_hz", crossover_hz, "Hz")
    if not 1 / LARGEST <= hertz <= LARGEST:
        want = f"a frequency from {1 / LARGEST:g} to {LARGEST:g} Hz"
        raise invalid("crossover_hz", crossover_hz, want, "Check its unit.")
    whole_number("order", order, 1, MOST_ORDER, "Take fewer.")
    if not (low > 1 > high or low < 1 < high):
        want = "one above and one below 1, which the weight passes at its crossover"
        remedy = "For another gain at the crossover multiply the weight by a number."
        raise invalid("low", described(f"gains {low:g} and {high:g}"), want, remedy)
    a, b, c, d = _section(low ** (1 / order), high ** (1 / order))
    one = np.ones((1, 1))
    A, B, C, D = in_a_row([(a * one, b * one, c * one, d)] * int(order))
    rate = 2 * math.pi * hertz
    if dt is not True:
        dt = positive("dt", dt, "s", zero=True)
    if dt:
        return bilinear(A, B, C, D, dt, rate)
    root = math.sqrt(rate)
    matrices = (A * rate, B * root, C * root, D)
    return named_system(matrices, 0, ["u"], ["y"], state_names(len(A)))


def _section(low: float, high: float) -> tuple[float, float, float, float]:
    """Return a, b, c, d of (high s + low p) / (s + p) with gain 1 at 1 rad/s."""
    if math.isinf(low):
        pole, gain = 0.0, math.sqrt(1 - high**2)  # low p in the limit
    else:
        pole = math.sqrt((1 - high**2) / (low**2 - 1))
        gain = (low - high) * pole
    size = math.sqrt(abs(gain))
    return -pole, size, math.copysign(size, gain), high


def _gain(argument: str, value: Any) -> float:
    """Return a gain from 0 to infinity."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not number >= 0:
        raise invalid(argument, value, "a gain of at least 0", "Pass a ratio, not decibels.")
    if number not in (0.0, math.inf) and not 1 / LARGEST <= number <= LARGEST:
        want = f"0, a gain from {1 / LARGEST:g} to {LARGEST:g}, or infinity"
        raise invalid(argument, value, want, "Pass a ratio, not decibels.")
    return number
