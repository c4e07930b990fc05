"""A mass on a spring that the model does not have: a missing mode."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects.along import force_along
from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.effects.shapes import Motion, Shape


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z: displacement and velocity of the mass, relative to where it is attached
    pull = p[1] * (z[0] - q[0]) + p[2] * (z[1] - v[0])
    f[0] = pull
    dz[0] = z[1]
    dz[1] = -pull / max(p[0], 1e-300)


def _shapes(motion: Motion) -> list[Shape]:
    dt = motion.time[1] - motion.time[0]
    spectrum = np.cumsum(np.abs(np.fft.rfft(motion.q[0] - motion.q[0].mean())) ** 2)
    if spectrum[-1] == 0.0:
        return []
    bins = np.fft.rfftfreq(motion.q.shape[1], dt)
    lowest = bins[np.searchsorted(spectrum, 0.01 * spectrum[-1])]
    highest = bins[np.searchsorted(spectrum, 0.99 * spectrum[-1])]
    low = max(0.5 * lowest, 3 * bins[1])
    high = min(2.0 * highest, 0.15 / dt)
    if high <= low:
        return []
    count = int(np.clip(np.log(high / low) / 0.06, 4, 60))
    return [_at(motion, frequency) for frequency in np.geomspace(low, high, count)]


def _at(motion: Motion, frequency: float) -> Shape:
    """Return the pull of a mass, and its derivative, which moves frequency and damping."""
    omega = 2 * np.pi * frequency
    zeta = 0.04
    column = force_along(KIND, motion, np.array([1.0, omega**2, 2 * zeta * omega]))
    turned = np.gradient(column[0], motion.time[1] - motion.time[0])[None] / omega

    def values(c: NDArray[np.float64]) -> Mapping[str, float]:
        mass = float(c[0])
        return {"mass": mass, "stiffness": mass * omega**2, "damping": 2 * zeta * omega * mass}

    return Shape(np.stack([column, turned]), values, (1, 0), _near)


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
    looks_like="One narrow band of the residual, with a resonance and a notch beside it in the "
    "frequency response.",
    checks=(
        "Cables, covers, tools and sensors that hang on this part.",
        "Tap with a hammer around this frequency, or hold the part by hand and measure again.",
    ),
    references=("Den Hartog (1956), Mechanical Vibrations, section 3.2, McGraw-Hill",),
)
