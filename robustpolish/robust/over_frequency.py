"""What results of robust analysis share: bounds over frequency, and what each block costs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import AnyMatrix
from robustpolish.display import Displayed
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.plotting.systems.frequency_response import plot_gains
from robustpolish.robust.all_pass import all_pass
from robustpolish.robust.coverage import response
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.scaled.centre import Level, lowered, started
from robustpolish.robust.scaled.scalings import Inequality, Space
from robustpolish.robust.witness import directions, smallest
from robustpolish.validation import described, invalid

# Frequencies of a picture besides those of the poles, and decades beyond these.
_POINTS = 40
_BEYOND = 1.0
_DIRECTIONS = 2
# Relative change of a block's size from which its cost is taken.
_CHANGE = 0.05


@dataclass(frozen=True, eq=False)
class Asked:
    """The loop that a result is about.

    Attributes
    ----------
    loop : LoopModel
    unit : float
        Levels of the loop's model times this are what is drawn.
    fixed : tuple of bool
        Blocks that have size 1 whatever the level is.
    at : float
        The critical frequency of the model; nan if none is known.
    system : UncertainSystem or None
        What the witness is to be put into.
    """

    loop: LoopModel
    unit: float
    fixed: tuple[bool, ...]
    at: float
    system: UncertainSystem | None = None

    @property
    def space(self) -> Space:
        """The scalings."""
        return Space(self.loop.structure, self.fixed)

    def bounds_at(self, x: float) -> tuple[float, float]:
        """Return both bounds at a frequency of the model; nan those that were not found."""
        try:
            M = response(self.loop.model, x)
        except np.linalg.LinAlgError:
            return math.nan, math.nan
        inequality = Inequality(self.space, M[None])
        level = self._least(inequality)
        if not math.isfinite(level.square):
            return math.nan, math.nan
        upper = math.sqrt(max(level.square, 0.0))
        _, still, scaled, _ = self.space.matrices(level.x)
        scale = 1 / np.sqrt(np.maximum(np.real(np.diagonal(still + scaled)), 1e-300))
        scale, lower = scale / scale.max(), math.nan
        # Far from all poles a search may leave the range of doubles: it finds nothing then.
        with np.errstate(all="ignore"):
            for w in directions(inequality, level.square, level.x, _DIRECTIONS):
                found = smallest(
                    self.loop.structure, lambda _: (M, np.zeros_like(M)), w, 0.0, False, scale,
                    fixed=self.fixed,
                )  # fmt: skip
                if found and found.size > 0:
                    lower = max(1 / found.size, 0.0 if math.isnan(lower) else lower)
        return lower * self.unit, upper * self.unit

    def curves(self) -> xr.Dataset:
        """Return both bounds over frequency in Hz."""
        seeds = np.array([x for x in (*self.loop.seeds(), self.at) if 0 < x < math.inf] or [1.0])
        ends = np.log10(seeds.min()) - _BEYOND, np.log10(seeds.max()) + _BEYOND
        grid = np.unique(np.concatenate([np.logspace(*ends, _POINTS), seeds]))
        values = np.array([self.bounds_at(float(x)) for x in grid])
        hertz = [self.loop.omega(float(x)) / (2 * math.pi) for x in grid]
        return xr.Dataset(
            {"at least": ("frequency", values[:, 0]), "at most": ("frequency", values[:, 1])},
            coords={"frequency": ("frequency", hertz, {"units": "Hz"})},
        )

    def costs(self) -> dict[str, float]:
        """Return the relative change of the upper bound per relative change of a block's size."""
        M = response(self.loop.model, self.at)
        structure, found = self.loop.structure, {}
        scaled_alone = any(self.fixed)
        for block, rows, held in zip(structure.blocks, structure.inputs, self.fixed, strict=True):
            if scaled_alone and not held:
                continue  # the gain itself, which is in proportion
            levels = []
            for factor in (1 - _CHANGE, 1 + _CHANGE):
                scaled: AnyMatrix = M.copy()
                scaled[rows] *= factor
                levels.append(self._least(Inequality(self.space, scaled[None])).square)
            low, high = levels
            known = 0 < low < math.inf and 0 < high < math.inf
            width = math.log((1 + _CHANGE) / (1 - _CHANGE))
            found[block.name] = math.log(high / low) / 2 / width if known else math.nan
        return found

    @staticmethod
    def _least(inequality: Inequality) -> Level:
        start = started(inequality)
        return lowered(inequality, start) if math.isfinite(start.square) else start


@dataclass(frozen=True, eq=False, repr=False)
class OverFrequency(Displayed):
    """A result about a loop, which can be looked at over frequency."""

    _asked: Asked | None = field(default=None, kw_only=True)

    _drawn: ClassVar[str] = "structured singular value"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw both bounds over frequency, with the proven level and the critical frequency.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            Over frequency in Hz. What is drawn is computed at single frequencies: the proof is the
            level line, which holds between them too. The lower bound has gaps where no search found
            a witness, as real numbers reach the boundary at few frequencies.

        Raises
        ------
        InvalidInputError
            If there is no loop to draw: of a matrix, or where the nominal loop is not stable.
        """
        asked, (name, value, omega) = self._source(), self._shown()
        curves = asked.curves()
        marks: dict[str, tuple[float, float]] = {"proven": (math.nan, value[1])}
        if omega > 0:
            marks["critical frequency"] = (omega / (2 * math.pi), value[0])
        gains: dict[str, Any] = {str(k): curve for k, curve in curves.data_vars.items()}
        return plot_gains(gains, marks, ax, name=name)

    @cached_property
    def sensitivity(self) -> Mapping[str, float]:
        """How many percent the bound gets worse per percent that the range of each block grows.

        By name, at the critical frequency, from the bound by scalings: shares of the blame, whose
        sum is 1 for margins, where the performance block counts as one; of a worst-case gain they
        are what the gain rises by. A block of 0 can be forgotten, one of 0.9 is worth measuring.
        """
        asked = self._source()
        if math.isnan(asked.at):
            return {block.name: math.nan for block in asked.loop.structure.blocks}
        return asked.costs()

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        """Return what is drawn, its bounds, and the critical frequency in rad/s."""
        raise NotImplementedError

    def _source(self) -> Asked:
        if self._asked is None:
            raise invalid(
                "result",
                described("no loop behind it"),
                "the result of a stable loop in which something uncertain acts back",
                "Look at .status, which says what it is.",
            )
        return self._asked


@dataclass(frozen=True, eq=False, repr=False)
class Witnessed(OverFrequency):
    """A result about an uncertain system, with the machine that reaches its bound."""

    def worst_plant(self) -> control.StateSpace:
        """Return the system at the witness.

        Returns
        -------
        control.StateSpace
            A complex number is replaced by a stable system that has its value at the critical
            frequency, and its size at all of them.

        Raises
        ------
        InvalidInputError
            If no witness was found.
        """
        asked, witness = self._source(), getattr(self, "witness", None)
        if not witness or asked.system is None:
            remedy = "Look at .status, which says why."
            raise invalid("result", described("no witness"), "one that was found", remedy)
        omega = getattr(self, "critical_frequency", math.nan)
        return machine_at(asked.system, witness, omega, asked.loop.step)


def machine_at(
    system: UncertainSystem, values: Mapping[str, Any], omega: float, step: float
) -> Any:
    """Return a system at a witness, with real systems for complex numbers."""
    found = {}
    for name, value in values.items():
        if isinstance(value, complex):
            nominal = getattr(system.elements[name], "nominal", 0.0)
            value = nominal + all_pass(np.array([[value - nominal]]), omega, step)
        found[name] = value
    return system.at(found)
