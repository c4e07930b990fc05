"""What tests of controllability and observability find."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.analysis.poles.eigen import pair_text
from robustpolish.display import Card, Displayed, Table
from robustpolish.plotting import plot_bars

Kind = Literal["controllability", "observability"]


@dataclass(frozen=True)
class ModeTest:
    """The Popov-Belevitch-Hautus test at one eigenvalue.

    Attributes
    ----------
    eigenvalue : complex
        In rad/s, or in discrete time without unit; of a pair the one with positive
        imaginary part.
    distance : float
        Size of a relative change of the scaled matrices (A, B) or (A, C) that makes a
        mode near this eigenvalue deficient: the smallest singular value of (A - lambda I, B),
        minimised over lambda around here, over their norm.
    state : str
        The state that takes the largest part in the mode.
    deficient : bool
        Whether no input moves the mode (no output sees it), exactly or to rounding.
    stable : bool
        Whether the mode dies out by itself, beyond doubt.
    """

    eigenvalue: complex
    distance: float
    state: str
    deficient: bool
    stable: bool


@dataclass(frozen=True, repr=False)
class PbhTest(Displayed):
    """Result of :func:`controllability` or :func:`observability`; true if no mode is deficient.

    Attributes
    ----------
    kind : {"controllability", "observability"}
    modes : tuple of ModeTest
        All modes, the most nearly deficient first.
    distance : float
        The smallest of their distances, an upper bound of the distance to the nearest
        deficient system; infinite without states.
    deficient : tuple of ModeTest
        Those that cannot be moved or seen.
    harmful : tuple of ModeTest
        The deficient ones that are not stable: they rule stabilising (detecting) out.
    reason : str
        The finding in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.observability([[-1, 0], [0, -2]], [[0, 1]], states=["drift", "v"])
    not observable: -1 (state drift)
      eigenvalue  state  distance  lacking  stable
      -1          drift         0  yes      yes
      -2          v           ...  no       yes
    """

    kind: Kind
    modes: tuple[ModeTest, ...]

    @property
    def distance(self) -> float:
        """Smallest distance of all modes."""
        return min((mode.distance for mode in self.modes), default=np.inf)

    @property
    def deficient(self) -> tuple[ModeTest, ...]:
        """The modes that no input moves, or no output sees."""
        return tuple(mode for mode in self.modes if mode.deficient)

    @property
    def harmful(self) -> tuple[ModeTest, ...]:
        """The deficient modes that are not stable."""
        return tuple(mode for mode in self.deficient if not mode.stable)

    @property
    def reason(self) -> str:
        """The finding in a sentence."""
        adjective = "controllable" if self.kind == "controllability" else "observable"
        if not self.deficient:
            near = f"; the nearest that is not is {self.distance:.2g} away" if self.modes else ""
            return f"{adjective}{near}"
        listed = ", ".join(
            f"{pair_text(m.eigenvalue)} (state {m.state}{'' if m.stable else ', not stable'})"
            for m in self.deficient
        )
        return f"not {adjective}: {listed}"

    def __bool__(self) -> bool:
        return not self.deficient

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each mode's distance from being deficient; a mode at distance zero has no bar.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.controllability([[-1, 0], [0, -2]], [[0], [1]]).plot().get_ylabel()
        'mode'
        """
        inputs = self.kind == "controllability"
        name = f"relative distance from being un{'controllable' if inputs else 'observable'}"
        labels = [f"{mode.state}, {pair_text(mode.eigenvalue)}" for mode in self.modes]
        where = {"mode": labels}
        distance = [mode.distance for mode in self.modes]
        lacking = [mode.deficient for mode in self.modes]
        return plot_bars(
            xr.DataArray(distance, where, "mode", name=name),
            xr.DataArray(lacking, where, "mode"),
            ax,
            meaning=("moved by an input", "moved by none") if inputs
            else ("seen by an output", "seen by none"),
        )  # fmt: skip

    def _card(self) -> Card:
        columns = ("eigenvalue", "state", "distance", "lacking", "stable")
        rows = tuple(
            (
                pair_text(mode.eigenvalue),
                mode.state,
                mode.distance,
                mode.deficient,
                mode.stable,
            )
            for mode in self.modes
        )
        return Card(self.reason, (Table("", columns, rows),))


@dataclass(frozen=True, repr=False)
class Feasibility(Displayed):
    """Result of :func:`is_stabilizable` or :func:`is_detectable`; true if it is.

    Attributes
    ----------
    possible : bool
    modes : tuple of ModeTest
        The modes that rule it out.
    reason : str
        The finding in a sentence.
    test : PbhTest
        The test of all modes.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.is_stabilizable([[1, 0], [0, -2]], [[0], [1]])
    not stabilisable: no input moves 1 (state x[0])
      eigenvalue  state  distance  lacking  stable
      1           x[0]          0  yes      no
      -2          x[1]        ...  no       yes
    """

    possible: bool
    modes: tuple[ModeTest, ...]
    reason: str
    test: PbhTest

    def __bool__(self) -> bool:
        return self.possible

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each mode's distance from being deficient, as :meth:`PbhTest.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.is_detectable([[-1, 0], [0, 2]], [[0, 1]]).plot().get_ylabel()
        'mode'
        """
        return self.test.plot(ax)

    def _card(self) -> Card:
        return Card(self.reason, self.test._card().tables)
