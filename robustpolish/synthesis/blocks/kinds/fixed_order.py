"""A state-space controller of given order with all entries free."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from robustpolish.synthesis.blocks.block import Names, TunableBlock, block_of
from robustpolish.synthesis.blocks.masked_stage import MaskedStage
from robustpolish.synthesis.blocks.slot import Slot
from robustpolish.validation import invalid, is_whole


@dataclass(frozen=True, eq=False, kw_only=True)
class FixedOrder(MaskedStage):
    """x' = A x + B e, v = C x + D e with free A, B, C and perhaps D.

    Attributes
    ----------
    order : int
    feedthrough : bool
        Whether D is free; otherwise zero.
    """

    kind: ClassVar[str] = "fixed_order"
    resizable: ClassVar[bool] = True
    discrete: ClassVar[bool] = True

    order: int = 1
    feedthrough: bool = True

    @property
    def states(self) -> tuple[str, ...]:
        """Names of x."""
        return tuple(f"x{i + 1}" for i in range(self.order))

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        return "(C (s I - A)^-1 B + D)" if self.feedthrough else "(C (s I - A)^-1 B)"

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Free entries of [[A, B], [C, D]]."""
        free = np.ones((self.order + self.outputs, self.order + self.inputs), bool)
        free[self.order :, self.order :] = self.feedthrough
        return free

    def sized(self, inputs: int, outputs: int) -> Self:
        """Return the stage for so many signals, with a number for each entry."""
        stage = replace(self, inputs=inputs, outputs=outputs)
        k, slots = self.order, []
        for i, j in np.argwhere(stage.mask):
            above, left = i < k, j < k
            letter = ("A" if left else "B") if above else ("C" if left else "D")
            name = f"{letter}[{i - (0 if above else k)},{j - (0 if left else k)}]"
            # A state has no unit of its own: B and C share that of the signals.
            slots.append(
                Slot(
                    name,
                    None,
                    time=-1 if above else 0,
                    out=None if above else int(i - k),
                    into=None if left else int(j - k),
                    default=-1.0 if letter == "A" and i == j else 0.0,
                )
            )
        return replace(stage, slots=tuple(slots))


def fixed_order(
    measurements: Names = None,
    controls: Names = None,
    *,
    order: int,
    feedthrough: bool = True,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    """Return a state-space controller of given order, all of whose entries are tuned.

    Parameters
    ----------
    measurements, controls : str or sequence of str, optional
        What it reads and drives; all of the plant by default.
    order : int
        States, at least 1; for none see :func:`robustpolish.static_gain`.
    feedthrough : bool, optional
        False for D = 0, a strictly proper block.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.pid`.
    name : str, optional
        By default ``fixed_order_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If the order is none.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.fixed_order("x", "F", order=2, feedthrough=False)
    block: F = (C (s I - A)^-1 B) x
    """
    if not is_whole(order) or order < 1:
        raise invalid("order", order, "a whole number of at least 1", "Use static_gain for none.")
    if not isinstance(feedthrough, bool):
        raise invalid("feedthrough", feedthrough, "True or False", "False is strictly proper.")
    stage = FixedOrder(name=name, order=int(order), feedthrough=feedthrough)
    return block_of(stage, measurements, controls, sign)
