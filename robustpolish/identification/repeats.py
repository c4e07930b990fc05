"""The noise of sensors, from records that repeat each other.

Where the same inputs made the same motion, records differ by noise alone: its variance is half the
mean square of their difference, whatever its colour, and no model is asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel


@dataclass(frozen=True)
class _Alike:
    """From where on two records are no repeats.

    Attributes
    ----------
    least : int
        Samples below which nothing can be said.
    inputs : float
        Difference of the inputs over their size: measured ones have noise too.
    outputs : float
        Half the mean square of the difference over that of the motion: records without an input,
        of which any two would have the same, show the same motion or not.
    motion : float
        Share of the difference that follows from the motion by a short filter: other amplitudes,
        a shift in time. Of short records with slow noise 15 % do by chance; as much again makes
        the noise 20 % too large.
    lags : int
        Of that filter, to either side.
    visible : float
        Share of the largest below which the singular values of such a filter's signals are noise.
    blocks : int
        In which the difference is looked at.
    unsteady : float
        Times the median of the blocks that one of them may be: a start that was not the same dies
        out, noise stays. Blocks of slow noise scatter by a factor of two.
    """

    least: int = 200
    inputs: float = 0.02
    outputs: float = 0.25
    motion: float = 0.3
    lags: int = 4
    visible: float = 0.03
    blocks: int = 5
    unsteady: float = 4.0


_ALIKE = _Alike()


@dataclass(frozen=True)
class Repeats:
    """Noise that records show which repeat each other.

    Attributes
    ----------
    noise : ndarray, shape (ny,)
        Standard deviation, in the outputs' units.
    pairs : tuple of (str, str)
        Names of the records.
    """

    noise: Array
    pairs: tuple[tuple[str, str], ...]

    @property
    def names(self) -> str:
        """The records, in words."""
        found = list(dict.fromkeys(name for pair in self.pairs for name in pair))
        return f"{', '.join(found[:-1])} and {found[-1]}"


def repeats(model: MechanicalModel, record: Record) -> Repeats | None:
    """Return the noise that repeated records show, None if no two of them are alike.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
        Several records; they have to begin with the same sample of the motion.

    Returns
    -------
    Repeats or None
    """
    inputs = record.signals(model)
    parts = [(part, part.own(inputs)) for part in record.parts]
    found, pairs = [], []
    for (one, u), (other, w) in combinations(parts, 2):
        n = min(one.samples, other.samples)
        if n < _ALIKE.least or not _same(u[:n], w[:n]):
            continue
        difference = (one.Y[:n] - other.Y[:n]) / np.sqrt(2)
        motion = (one.Y[:n] + other.Y[:n]) / 2
        if all(_noise_alone(d, m) for d, m in zip(difference.T, motion.T, strict=True)):
            found.append(np.mean(difference**2, axis=0))
            pairs.append((one.name, other.name))
    if not found or np.any(np.mean(found, axis=0) == 0):
        return None  # copies of one record, or a record without noise
    return Repeats(np.sqrt(np.mean(found, axis=0)), tuple(pairs))


def _same(one: Array, other: Array) -> bool:
    """Return whether two inputs are the same but for noise."""
    size = np.sqrt(np.mean(one**2 + other**2, axis=0) / 2)
    return bool(np.all(np.std(one - other, axis=0) <= _ALIKE.inputs * size))


def _noise_alone(difference: Array, motion: Array) -> bool:
    """Return whether the difference of two outputs is small, steady and not made by the motion."""
    power = float(np.mean(difference**2))
    if power > _ALIKE.outputs * float(np.var(motion)):
        return False
    blocks = [float(np.mean(block**2)) for block in np.array_split(difference, _ALIKE.blocks)]
    if max(blocks) > _ALIKE.unsteady * float(np.median(blocks)):
        return False
    k, n = _ALIKE.lags, len(motion)
    near = np.column_stack([motion[k + lag : n - k + lag] for lag in range(-k, k + 1)])
    near, inner = near - near.mean(axis=0), difference[k : n - k] - np.mean(difference[k : n - k])
    left = inner - near @ np.linalg.lstsq(near, inner, rcond=_ALIKE.visible)[0]
    return float(left @ left) >= (1 - _ALIKE.motion) * float(inner @ inner)
