"""A record prepared for fits: pieces, sizes and smoothed starts."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.fit.evaluation import (
    motion_along,
    pieces_of,
    state_scale,
)
from robustpolish.identification.fit.least_squares import Piece
from robustpolish.identification.observer.kalman import Scales
from robustpolish.identification.observer.scales import amplitude_of, scales_of
from robustpolish.identification.record import Record, split
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid

Array = NDArray[np.float64]
_TRIAL = 3500
_WINDOWS = 25
_SCREENED = 9000
_SCREENED_IMPOSED = 30000


@dataclass(frozen=True, eq=False)
class Setting:
    """A record prepared for fits: pieces, sizes and smoothed starts.

    Attributes
    ----------
    estimation, trial, held_out, everything : list of Piece
        `trial` is the first part of each estimation piece, for first fits of candidates.
    windows : list of Piece
        The whole record in short pieces, for models whose long free runs judge nothing.
    """

    record: Record
    scales: Scales
    amplitude: float
    state_scale: Array
    estimation: list[Piece]
    trial: list[Piece]
    held_out: list[Piece]
    everything: list[Piece]
    windows: list[Piece]

    @property
    def dt(self) -> float:
        """Sampling step in s."""
        return self.record.dt

    @property
    def screened(self) -> Record:
        """The contiguous part of the record that is screened: the liveliest.

        Where all motion is imposed, screening is quick, and the amplitudes of the whole record
        are welcome.
        """
        most = _SCREENED if self.state_scale.size else _SCREENED_IMPOSED
        length = min(self.record.samples, most)
        power = np.sum((self.record.Y / np.std(self.record.Y, axis=0)) ** 2, axis=1)
        total = np.concatenate([[0.0], np.cumsum(power)])
        starts = np.arange(0, self.record.samples - length + 1, max(1, length // 20))
        begin = int(starts[np.argmax(total[starts + length] - total[starts])])
        return self.record.part(begin, begin + length)


def prepare(model: MechanicalModel, record: Record) -> Setting:
    """Prepare a record for fits of a model and its extensions."""
    scales = scales_of(model, record)
    amplitude = amplitude_of(model, record, scales.bandwidth)
    try:
        motion = motion_along(model.without_effects(), record, scales, amplitude)
    except np.linalg.LinAlgError as error:
        raise invalid(
            "data",
            described(f"motions of {amplitude:.3g} with forces of {np.max(scales.force):.3g}"),
            "motions that the model can have",
            "Check the units of the columns, and the model's masses and stiffnesses.",
        ) from error
    parts = split(record.samples, decays=not model.inputs)
    short = max(60, record.samples // _WINDOWS)
    length = short if drifts(model, record.samples * record.dt) else record.samples

    def pieces(ranges: Sequence[tuple[int, int]]) -> list[Piece]:
        return pieces_of(model, record, _windows(ranges, length), motion)

    return Setting(
        record, scales, amplitude, state_scale(model, motion),
        pieces(parts.estimation), pieces([(a, min(b, a + _TRIAL)) for a, b in parts.estimation]),
        pieces(parts.held_out), pieces([(0, record.samples)]),
        pieces_of(model, record, _windows([(0, record.samples)], short), motion),
    )  # fmt: skip


def drifts(model: MechanicalModel, length: float) -> bool:
    """Return whether the linear part integrates over a record of `length` seconds.

    The free run of such a model forgets nothing, so that it is judged in windows.
    """
    if not model.free:
        return False
    A = np.asarray(model.state_space().A, dtype=float)
    return bool(np.min(np.abs(np.linalg.eigvals(A))) * length < 1)


def _windows(ranges: Sequence[tuple[int, int]], length: int) -> list[tuple[int, int]]:
    """Cut sample ranges into windows of about a length."""
    found = []
    for begin, end in ranges:
        count = max(1, round((end - begin) / length))
        marks = np.linspace(begin, end, count + 1).astype(int)
        found += [(int(a), int(b)) for a, b in itertools.pairwise(marks)]
    return found
