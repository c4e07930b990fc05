"""A matrix of gains, some of which may be zero."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.synthesis.blocks.block import Names, TunableBlock, block_of
from robustpolish.synthesis.blocks.masked_stage import MaskedStage
from robustpolish.synthesis.blocks.slot import Given, Slot, checked_slot
from robustpolish.synthesis.blocks.tunable import Tunable
from robustpolish.validation import described, invalid


@dataclass(frozen=True, eq=False, kw_only=True)
class StaticGain(MaskedStage):
    """u = gain y, with zeros where the structure has them.

    Attributes
    ----------
    structure : ndarray of bool or None
        Entries that may differ from zero; all by default.
    gain : ndarray of object or None
        Numbers or tunable numbers, one for each entry or one for all.
    """

    kind: ClassVar[str] = "gain"
    resizable: ClassVar[bool] = True
    discrete: ClassVar[bool] = True

    structure: NDArray[np.bool_] | None = None
    gain: Any = None

    @property
    def states(self) -> tuple[str, ...]:
        """None."""
        return ()

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        return "gain"

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Entries that may differ from zero."""
        free = np.ones((self.outputs, self.inputs), bool)
        return free if self.structure is None else self.structure

    def sized(self, inputs: int, outputs: int) -> Self:
        """Return the stage for so many signals, with a number for each entry."""
        shape = (outputs, inputs)
        mask = replace(self, inputs=inputs, outputs=outputs).mask
        if mask.shape != shape:
            raise invalid(
                "structure",
                described(f"shape {mask.shape}"),
                f"{shape}: controls by measurements",
                "Mark the entries that may differ from zero.",
            )
        given: Any = np.full(shape, None) if self.gain is None else self.gain
        if given.size == 1:
            given = np.full(shape, given.item())
        if given.shape != shape:
            shown = described(f"shape {given.shape}")
            raise invalid("gain", shown, f"{shape}: controls by measurements", "One per entry.")
        single = shape == (1, 1)
        slots = tuple(
            checked_slot(
                Slot("gain" if single else f"gain[{i},{j}]", given[i, j], out=int(i), into=int(j))
            )
            for i, j in np.argwhere(mask)
        )
        if all(slot.held == 0 for slot in slots):
            shown = described("entries that are all zero")
            raise invalid("gain", shown, "one that is tuned, or is not 0", "Free an entry.")
        return replace(self, structure=mask, slots=slots, inputs=inputs, outputs=outputs)


def static_gain(
    measurements: Names = None,
    controls: Names = None,
    *,
    gain: Given | ArrayLike = None,
    structure: ArrayLike | None = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    """Return a matrix of gains to be tuned, u = sign gain y.

    Parameters
    ----------
    measurements, controls : str or sequence of str, optional
        What it reads and drives; all of the plant by default.
    gain : Tunable, float or array_like of these, shape (controls, measurements), optional
        A plain number is held; :func:`robustpolish.tunable` gives start and limits; None is tuned
        freely. In units of u over y. One tunable number for all entries is a shared one.
    structure : array_like of bool, shape (controls, measurements), optional
        True where the gain may differ from zero.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.pid`.
    name : str, optional
        By default ``gain_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense, or all entries are zero.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.static_gain(["x", "v"], "F", gain=[[None, rp.tunable("d", 1.0, low=0.0)]], sign=-1)
    block: F = -gain [x, v]
    """
    mask = None
    if structure is not None:
        mask = np.atleast_2d(np.asarray(structure))
        known = mask.dtype == bool or (mask.dtype.kind in "iuf" and np.isin(mask, (0, 1)).all())
        if not known or mask.ndim != 2 or not mask.any():
            shown = described(f"entries {mask.dtype}, {int(mask.astype(bool).sum())} of them true")
            raise invalid("structure", shown, "booleans, some of them true", "Mark free entries.")
        mask = mask.astype(bool)
    entries = None
    if isinstance(gain, Tunable):
        entries = np.full((1, 1), gain, dtype=object)
    elif gain is not None:
        entries = np.atleast_2d(np.array(gain, dtype=object))
    stage = StaticGain(name=name, structure=mask, gain=entries)
    return block_of(stage, measurements, controls, sign)
