"""A low-pass filter of first or second order."""

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
class LowPass(Stage):
    """w/(s + w), or w^2/(s^2 + 2 damping w s + w^2)."""

    kind: ClassVar[str] = "low_pass"
    carries: ClassVar[bool] = False

    @property
    def states(self) -> tuple[str, ...]:
        """The output, and in the second order its rate."""
        return ("filtered", "rate")[: len(self.slots)]

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        return "low_pass(s)"

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]."""
        w = 2 * math.pi * values[0]
        if len(values) == 1:
            return np.array([[-w, w], [1.0, 0.0]])
        return np.array([[0.0, w, 0.0], [-w, -2 * values[1] * w, w], [1.0, 0.0, 0.0]])

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over frequency and damping."""
        G = gradient
        if len(values) == 1:
            return np.array([2 * math.pi * (G[0, 1] - G[0, 0])])
        frequency, damping = values
        on_w = G[0, 1] - G[1, 0] - 2 * damping * G[1, 1] + G[1, 2]
        return 2 * math.pi * np.array([on_w, -2 * frequency * G[1, 1]])


def low_pass(
    measurement: str | None = None,
    control: str | None = None,
    *,
    order: int = 2,
    frequency_hz: Given = None,
    damping: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a low-pass filter to be tuned, usually in series: ``rp.low_pass() * rp.pid("x")``.

    .. math:: H(s) = \frac{\omega^2}{s^2 + 2 \zeta \omega s + \omega^2}
              \quad\text{or}\quad \frac{\omega}{s + \omega}, \quad \omega = 2 \pi f

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives; may be left out where there is only one, or in a series.
    order : {1, 2}, optional
        Its states.
    frequency_hz : Tunable or float, optional
        f, above 0, in Hz. A plain number is held; :func:`robustpolish.tunable` gives start and
        limits; without either it is tuned freely.
    damping : Tunable or float, optional
        Damping ratio of the second order, from 0.05 to 10.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.pid`.
    name : str, optional
        By default ``low_pass_`` and the measurement.

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
    >>> rp.low_pass(damping=0.7) * rp.pid("x", kind="PD")
    block: u = low_pass(s) * (Kp + Kd s/(Tf s + 1)) x
    """
    if isinstance(order, bool) or order not in (1, 2):
        raise invalid("order", order, "1 or 2", "Put two filters in series for more.")
    if order == 1 and damping is not None:
        shown = described("a damping of a filter of first order")
        raise invalid("damping", shown, "none", "Choose order=2, or leave it out.")
    slots = (
        Slot(
            "frequency_hz",
            frequency_hz,
            time=-1,
            low=0.0,
            default=0.5,
            search="positive",
            hertz=True,
        ),
        Slot("damping", damping, low=0.05, high=10.0, default=0.7, search="positive"),
    )[:order]
    stage = LowPass(name=name, slots=tuple(checked_slot(slot) for slot in slots))
    return block_of(stage, measurement, control, sign)
