"""A lead or lag of first order."""

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
from robustpolish.validation import described, invalid


@dataclass(frozen=True, eq=False, kw_only=True)
class LeadLag(Stage):
    """gain (1 + s/z)/(1 + s/p) with z and p given in Hz."""

    kind: ClassVar[str] = "lead_lag"

    @property
    def states(self) -> tuple[str, ...]:
        """The filtered input."""
        return ("filtered",)

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        return "gain (1 + s/(2 pi zero_hz))/(1 + s/(2 pi pole_hz))"

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]: x' = p (e - x), v = gain (r e + (1 - r) x) with r = p/z."""
        gain, zero, pole = values
        rate, ratio = 2 * math.pi * pole, pole / zero
        return np.array([[-rate, rate], [gain * (1 - ratio), gain * ratio]])

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over gain, zero and pole."""
        gain, zero, pole = values
        G, ratio = gradient, pole / zero
        on_ratio = gain * (G[1, 1] - G[1, 0])
        return np.array(
            [
                G[1, 0] * (1 - ratio) + G[1, 1] * ratio,
                -on_ratio * ratio / zero,
                on_ratio / zero + 2 * math.pi * (G[0, 1] - G[0, 0]),
            ]
        )


def lead_lag(
    measurement: str | None = None,
    control: str | None = None,
    *,
    gain: Given = None,
    zero_hz: Given = None,
    pole_hz: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a lead or lag of first order to be tuned.

    .. math:: u = \mathrm{sign}\, g\, \frac{1 + s / (2\pi f_z)}{1 + s / (2\pi f_p)}\, y

    A lead has its zero below its pole, a lag above it.

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives; may be left out where there is only one, or in a series.
    gain : Tunable or float, optional
        Gain at rest, in units of u over y, of either sign. A plain number is held;
        :func:`robustpolish.tunable` gives start and limits; without either it is tuned freely. In a
        series only the first block with a gain has these units: hold the others at 1.
    zero_hz, pole_hz : Tunable or float, optional
        Where it turns, above 0, in Hz.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.pid`.
    name : str, optional
        By default ``lead_lag_`` and the measurement.

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
    >>> rp.pid("x", kind="PI") * rp.lead_lag(gain=1.0, zero_hz=rp.tunable("fz", 2.0, low=1.0))
    block: u = (Kp + Ki/s) * gain (1 + s/(2 pi zero_hz))/(1 + s/(2 pi pole_hz)) x
    """
    slots = (
        Slot("gain", gain, out=0, into=0),
        Slot("zero_hz", zero_hz, time=-1, low=0.0, default=0.1, search="positive", hertz=True),
        Slot("pole_hz", pole_hz, time=-1, low=0.0, default=0.5, search="positive", hertz=True),
    )
    stage = LeadLag(name=name, slots=tuple(checked_slot(slot) for slot in slots))
    if stage.slots[0].held == 0:
        raise invalid("gain", described("a gain held at 0"), "another one", "Leave it out.")
    return block_of(stage, measurement, control, sign)
