"""A mass on a spring that the model does not have: a missing mode."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.effects.kind import LINE, EffectKind, Motion, Parameter, Scan, Shape

_LINES = Scan("frequency", LINE, (0, 1))
_DAMPING = 0.04
"""Damping ratio that is tried first."""


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z: displacement and velocity of the mass, relative to where it is attached
    pull = p[1] * (z[0] - q[0]) + p[2] * (z[1] - v[0])
    f[0] = pull
    dz[0] = z[1]
    dz[1] = -pull / max(p[0], 1e-300)


def _shapes(motion: Motion) -> list[Shape]:
    """Try frequencies from where displacements begin to where velocities end, and the lines.

    A mass pulls by its acceleration: what is slow for the displacement may be quick for it.
    """
    dt = motion.time[1] - motion.time[0]
    if not motion.q[0].any():
        return []
    first = 3 / (motion.q.shape[1] * dt)
    low = max(0.5 * _frequency_below(motion.q[0], 0.01, dt), first)
    high = min(2.0 * _frequency_below(motion.v[0], 0.99, dt), 0.15 / dt)
    if high <= low:
        return []
    count = int(np.clip(np.log(high / low) / 0.06, 4, 60))
    lines = [f for f in _LINES.values(motion) if first < f < 0.15 / dt]
    return [_at(motion, frequency) for frequency in (*np.geomspace(low, high, count), *lines)]


def _frequency_below(signal: NDArray[np.float64], share: float, dt: float) -> float:
    """Return the frequency below which a share of a signal's power lies, in Hz."""
    power = np.cumsum(np.abs(np.fft.rfft(signal - signal.mean())) ** 2)
    bins = np.fft.rfftfreq(signal.size, dt)
    return float(bins[np.searchsorted(power, share * power[-1])]) if power[-1] > 0 else 0.0


def _at(motion: Motion, frequency: float) -> Shape:
    """Return the pull of a mass, and its derivative, which moves frequency and damping."""
    column = force_with(KIND, _resonator_values(1.0, frequency), motion)
    turned = np.gradient(column[0], motion.time[1] - motion.time[0])[None] / (2 * np.pi * frequency)

    def values(c: NDArray[np.float64]) -> Mapping[str, float]:
        return _resonator_values(float(c[0]), frequency)

    return Shape(np.stack([column, turned]), values, (1, 0), _near)


def _resonator_values(mass: float, frequency: float) -> Mapping[str, float]:
    omega = 2 * np.pi * frequency
    return {"mass": mass, "stiffness": mass * omega**2, "damping": 2 * _DAMPING * omega * mass}


def _near(c: NDArray[np.float64]) -> bool:
    return bool(abs(c[1]) <= abs(c[0]))


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    mass = max(values["mass"], 1e-300)
    return 0.0, 0.0, float(np.sqrt(abs(values["stiffness"]) / mass) + abs(values["damping"]) / mass)


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return (q, v)


KIND = EffectKind(
    kind="attached_resonator",
    title="Attached resonator (missing mode)",
    domain="dof",
    parameters=(
        Parameter("mass", "M", "mass that swings", lower=0.0, default=1.0),
        Parameter("stiffness", "F/L", "its spring", lower=0.0),
        Parameter("damping", "F*T/L", "its damper", lower=0.0),
    ),
    law=_law,
    shapes=_shapes,
    gains=_gains,
    state_sizes=_state_sizes,
    states=2,
    swinging=_resonator_values,
    looks_like="One narrow band of the residual, with a resonance and a notch beside it in the "
    "frequency response.",
    checks=(
        "Cables, covers, tools and sensors that hang on this part.",
        "Tap with a hammer around this frequency, or hold the part by hand and measure again.",
    ),
    references=("Den Hartog (1956), Mechanical Vibrations, section 3.2, McGraw-Hill",),
)
