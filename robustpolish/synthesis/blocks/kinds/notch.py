"""A notch filter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.blocks.block import TunableBlock, block_of
from robustpolish.synthesis.blocks.slot import Given, Slot, checked_slot
from robustpolish.synthesis.blocks.stage import Stage


@dataclass(frozen=True, eq=False, kw_only=True)
class Notch(Stage):
    """(s^2 + depth width w s + w^2)/(s^2 + width w s + w^2)."""

    kind: ClassVar[str] = "notch"
    carries: ClassVar[bool] = False

    @property
    def states(self) -> tuple[str, ...]:
        """The integral of the band around the frequency, and that band."""
        return ("band_integral", "band")

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        return "notch(s)"

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]: the input less a share of a band-pass of it."""
        frequency, depth, width = values
        w = 2 * math.pi * frequency
        return np.array(
            [[0.0, w, 0.0], [-w, -width * w, w], [0.0, -(1 - depth) * width, 1.0]],
        )

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over frequency, depth and width."""
        frequency, depth, width = values
        G = gradient
        on_w = G[0, 1] - G[1, 0] - width * G[1, 1] + G[1, 2]
        on_width = -2 * math.pi * frequency * G[1, 1] - (1 - depth) * G[2, 1]
        return np.array([2 * math.pi * on_w, width * G[2, 1], on_width])


def notch(
    measurement: str | None = None,
    control: str | None = None,
    *,
    frequency_hz: Given = None,
    depth: Given = None,
    width: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a notch filter to be tuned, usually in series: ``rp.pid("x") * rp.notch()``.

    .. math:: H(s) = \frac{s^2 + d\, b\, \omega s + \omega^2}{s^2 + b\, \omega s + \omega^2},
              \quad \omega = 2 \pi f

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives; may be left out where there is only one, or in a series.
    frequency_hz : Tunable or float, optional
        Its centre f, above 0, in Hz. A plain number is held; :func:`robustpolish.tunable` gives
        start and limits; without either it is tuned freely.
    depth : Tunable or float, optional
        Gain d at the centre, from 0 to 1 (no notch at all).
    width : Tunable or float, optional
        Width b over the centre, above 0 and at most 10: twice the damping of the poles.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.pid`.
    name : str, optional
        By default ``notch_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.notch("x", frequency_hz=rp.tunable("f", 120.0, low=100.0, high=140.0), depth=0.05)
    block: u = notch(s) x
    """
    slots = (
        Slot(
            "frequency_hz",
            frequency_hz,
            time=-1,
            low=0.0,
            default=0.5 / math.pi,
            search="positive",
            hertz=True,
        ),
        Slot("depth", depth, low=0.0, high=1.0, default=0.3),
        Slot("width", width, low=0.0, high=10.0, default=1.0, search="positive"),
    )
    stage = Notch(name=name, slots=tuple(checked_slot(slot) for slot in slots))
    return block_of(stage, measurement, control, sign)
