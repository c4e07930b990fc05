"""What measured and simulated outputs tell together: signs, units, exchanged sensors, means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from robustpolish.arrays import Vector
from robustpolish.identification.sanity.gains import CoherentGain
from robustpolish.identification.sanity.limits import LIMITS
from robustpolish.identification.sanity.units import unit_of_ratio

Outputs = Mapping[str, Vector]
"""Signals by the name of the output, all of one length."""


def signs(gains: Mapping[str, CoherentGain]) -> list[str]:
    """Name the outputs whose sign is turned at nearly all frequencies.

    Parameters
    ----------
    gains : mapping of str to CoherentGain
        Measured over simulated, by output.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from robustpolish.identification.sanity.gains import coherent_gain
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> signs({"x": coherent_gain(noise, -3 * noise, 0.01)})[0][:25]
    'x moves against the model'
    >>> signs({"x": coherent_gain(noise, 3 * noise, 0.01)})
    []
    """
    turned = [
        name
        for name, gain in gains.items()
        if gain.enough and gain.reversed >= LIMITS.reversed and gain.scatter <= LIMITS.steady
    ]
    if len(turned) == len(gains) > 1:
        return [
            f"{', '.join(turned)} all move against the model, at nearly all frequencies. Check the "
            "sign of the input and the direction it acts in"
        ]
    return [
        f"{name} moves against the model, at {100 * gains[name].reversed:.0f} % of the frequencies "
        "that reach it. Check the direction of its sensor"
        + (" or of the input" if len(gains) == 1 else "")
        for name in turned
    ]


def amplitudes(gains: Mapping[str, CoherentGain], inputs: Sequence[str]) -> list[str]:
    """Name the outputs whose size is off by a factor that a confusion of units makes.

    Parameters
    ----------
    gains : mapping of str to CoherentGain
        Measured over simulated, by output.
    inputs : sequence of str
        Their names, for the message.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from robustpolish.identification.sanity.gains import coherent_gain
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> amplitudes({"x": coherent_gain(noise, 1e3 * noise, 0.01)}, ["F"])[0][:44]
    'x is 1e+03 times as large as the model makes'
    >>> amplitudes({"x": coherent_gain(noise, 5 * noise, 0.01)}, ["F"])
    []
    """
    found = {}
    for name, gain in gains.items():
        if gain.enough and gain.scatter <= LIMITS.scatter:
            guess = unit_of_ratio(gain.size, gain.scatter)
            if guess:
                found[name] = (gain.size, guess)
    source = ", ".join(inputs)
    # An input in the wrong unit makes all outputs wrong, and a sensor only its own.
    every = f" and of {source}" if len(found) == len(gains) else ""
    return [
        f"{name} is {ratio:.3g} times as large as the model makes it from {source}, {guess}. Check "
        f"the unit of {name}{every}, and mend it with units="
        for name, (ratio, guess) in found.items()
    ]


def exchanged(gains: Mapping[tuple[str, str], CoherentGain], kinds: Mapping[str, str]) -> list[str]:
    """Name two outputs of one kind that fit far better if they change places.

    Parameters
    ----------
    gains : mapping of (str, str) to CoherentGain
        The first output as measured over the second one as simulated.
    kinds : mapping of str to str
        What may change places: the quantity and unit by output.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from robustpolish.identification.sanity.gains import coherent_gain
    >>> x, y = np.random.default_rng(0).standard_normal((2, 4000))
    >>> simulated, measured = {"x": x, "y": y - 3 * x}, {"x": y - 3 * x, "y": x}
    >>> gains = {
    ...     (a, b): coherent_gain(simulated[b], measured[a], 0.01) for a in "xy" for b in "xy"
    ... }
    >>> exchanged(gains, {"x": "m", "y": "m"})[0][:22]
    'x and y look exchanged'
    """
    found = []
    for first, second in combinations(kinds, 2):
        if kinds[first] != kinds[second]:
            continue
        straight = [gains[name, name] for name in (first, second)]
        crossed = [gains[first, second], gains[second, first]]
        # As they are, the outputs may have nothing in common with the model at all.
        if not all(gain.enough for gain in crossed):
            continue
        near = [gain.distance for gain in crossed]
        far = [gain.distance if gain.enough else np.inf for gain in straight]
        if max(near) < LIMITS.crossed and min(far) > LIMITS.straight * max(near):
            found.append(
                f"{first} and {second} look exchanged: each follows the model of the other one "
                f"(within {100 * max(near):.0f} % at half of the frequencies). Check the cables, "
                "or read with rename="
            )
    return found


def means(measured: Outputs, simulated: Outputs, units: Mapping[str, str]) -> list[str]:
    """Name the outputs whose mean lies far from the model's, against the size of their motion.

    Parameters
    ----------
    measured, simulated : mapping of str to ndarray, shape (samples,)
        Of a model that has a place of rest.
    units : mapping of str to str

    Returns
    -------
    list of str

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(1000)
    >>> means({"x": noise + 9}, {"x": noise}, {"x": "m"})[0][:35]
    'the mean of x is 9 m from the model'
    """
    found = []
    for name, values in measured.items():
        if not np.isfinite(simulated[name]).all():
            continue
        away = float(np.mean(values) - np.mean(simulated[name]))
        size = max(float(np.std(values)), float(np.std(simulated[name])))
        if size > 0 and abs(away) > LIMITS.mean * size:
            gravity = units[name] == "m/s^2" and 9.5 < abs(away) < 10.1
            what = (
                "the sensor feels gravity: take it off the channel"
                if gravity
                else "take the sensor's zero off the channel, or give the model the force that "
                "holds it there"
            )
            found.append(
                f"the mean of {name} is {away:.3g} {units[name]} from the model, "
                f"{abs(away) / size:.2g} times the size of its motion: {what}"
            )
    return found
