"""A force at one frequency that nobody measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.effects.shapes import Motion, Shape


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = p[0] * np.cos(2.0 * np.pi * p[1] * t + p[2])


def _shapes(motion: Motion) -> list[Shape]:
    if motion.force is None:
        return []
    return [_at(motion, frequency) for frequency in _lines(motion.time, motion.force[0])]


def _at(motion: Motion, frequency: float) -> Shape:
    angle = 2 * np.pi * frequency * motion.time

    def values(c: NDArray[np.float64]) -> Mapping[str, float]:
        phase = float(np.arctan2(-c[1], c[0]))
        return {"amplitude": float(np.hypot(*c)), "frequency": frequency, "phase": phase}

    return Shape(np.stack([np.cos(angle), np.sin(angle)])[:, None], values, (0, 0))


def _lines(time: NDArray[np.float64], force: NDArray[np.float64]) -> list[float]:
    """Return the frequencies of the strongest lines, refined between the bins."""
    n = force.size
    spectrum = np.abs(np.fft.rfft((force - force.mean()) * np.hanning(n), 4 * n))
    bins = np.fft.rfftfreq(4 * n, time[1] - time[0])
    spectrum[:8] = 0.0
    lines = []
    for _ in range(3):
        k = int(np.argmax(spectrum))
        lines.append(float(bins[k]))
        spectrum[max(k - 10, 0) : k + 11] = 0.0
    return lines


KIND = EffectKind(
    kind="harmonic_force",
    title="Harmonic force",
    domain="dof",
    parameters=(
        Parameter("amplitude", "F", "amplitude along the coordinate", lower=0.0),
        Parameter("frequency", "1/T", "frequency in Hz", lower=0.0, fit_scale=1e-3),
        Parameter("phase", "rad", "phase of the cosine at time 0"),
    ),
    law=_law,
    shapes=_shapes,
    looks_like="One line in the residual's spectrum, whatever the input does.",
    checks=(
        "Fans, pumps, mains hum, drives and neighbours that run at this frequency.",
        "Record with the input switched off: the line stays.",
    ),
    references=("Ewins (2000), Modal Testing, chapter 3, Research Studies Press",),
)
