"""Whirl frequencies over speed, each followed from one speed to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import linear_sum_assignment

from robustpolish.arrays import AnyArray, AnyMatrix, AnyVector, Array, Matrix, Vector
from robustpolish.display import Card, Displayed, Table
from robustpolish.models.rotor.second_order import SecondOrder
from robustpolish.models.rotor.whirl import WhirlMode, eigen_whirl, whirl_modes
from robustpolish.plotting import plot_campbell

_ALIKE = 0.6
"""A step is halved where a shape has less than this overlap with the one that it continues."""
_HALVINGS = 6
_SLOW = 1e-6
"""Share of the largest speed at which a rotor at rest is taken to whirl: at rest two shapes of one
frequency are arbitrary, and cannot be followed."""


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Displayed):
    """Whirl frequencies over speed; a column belongs to one mode throughout.

    Attributes
    ----------
    speeds : ndarray, shape (speeds,)
        In rad/s, rising.
    eigenvalues : ndarray of complex, shape (speeds, modes)
        In rad/s.
    whirl : ndarray, shape (speeds, modes)
        From -1, backward, to 1, forward; see `WhirlMode`.
    critical_speeds : ndarray
        In rad/s, within the speeds: where the undamped rotor whirls as fast as it spins.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> found = rp.spindle_rotor().campbell(np.linspace(0.0, 1200.0, 7), count=2)
    >>> found.frequencies_hz[[0, -1]].round(1).tolist()
    [[131.8, 131.8], [117.6, 146.8]]
    >>> found.critical_speeds.round(1), found.stability_limit
    (array([898.5]), 1000.0)
    """

    speeds: Vector
    eigenvalues: AnyMatrix
    whirl: Matrix
    critical_speeds: Vector

    @property
    def frequencies_hz(self) -> Array:
        """Frequencies of the oscillations in Hz, shape (speeds, modes)."""
        return np.imag(self.eigenvalues) / (2 * math.pi)

    @property
    def damping_ratios(self) -> Array:
        """Damping ratios, shape (speeds, modes); negative where a whirl grows."""
        return -np.real(self.eigenvalues) / np.abs(self.eigenvalues)

    @property
    def stability_limit(self) -> float:
        """Lowest given speed in rad/s at which a listed mode grows; inf if none does."""
        growing = (np.real(self.eigenvalues) > 1e-9 * np.abs(self.eigenvalues)).any(axis=1)
        return float(self.speeds[growing.argmax()]) if growing.any() else math.inf

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the Campbell diagram, with the line on which the rotor whirls as fast as it spins.

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
        >>> rp.spindle_rotor().campbell([0.0, 600.0], count=2).plot().get_xlabel()
        'speed [rev/min]'
        """
        return plot_campbell(
            self.speeds, self.frequencies_hz, self.whirl, critical=self.critical_speeds, ax=ax
        )

    def _card(self) -> Card:
        first, last = (f"{speed * 30 / math.pi:.6g} rev/min [Hz]" for speed in self.speeds[[0, -1]])
        table = zip(*self.frequencies_hz[[0, -1]].tolist(), self.whirl[-1].tolist(), strict=True)
        rows = tuple((k + 1, *values) for k, values in enumerate(table))
        rpm = ", ".join(f"{speed * 30 / math.pi:.6g}" for speed in self.critical_speeds)
        note = f"Critical speeds [rev/min]: {rpm or 'none within'}"
        columns = ("mode", first, last, "whirl")
        return Card("Campbell diagram", (Table("", columns, rows, digits=6),), (note,))


def followed(
    system: SecondOrder, rows: Matrix, speeds: Vector, count: int
) -> tuple[AnyMatrix, Matrix]:
    """Return eigenvalues and whirl of the lowest modes at the first speed, over all speeds.

    Parameters
    ----------
    system : SecondOrder
    rows : ndarray
        From coordinates to x and y of the nodes.
    speeds : ndarray, shape (speeds,)
        Rising.
    count : int

    Returns
    -------
    eigenvalues, whirl : ndarray, shape (speeds, count)
    """
    slow = max(float(speeds[0]), _SLOW * float(np.abs(speeds).max()))
    values, vectors, _ = eigen_whirl(system, slow)
    count = min(count, len(values))
    shapes, at = vectors[:, :count], slow
    eigenvalues = np.empty((len(speeds), count), dtype=complex)
    whirl = np.empty((len(speeds), count))
    for i, speed in enumerate(speeds.tolist()):
        values, vectors, chosen = _carried(system, shapes, at, speed, 0)
        if speed >= slow:
            shapes, at = vectors[:, chosen], speed
        eigenvalues[i] = values[chosen]
        whirl[i] = [mode.whirl for mode in _modes(values, vectors, system, rows, chosen)]
    return eigenvalues, whirl


def _modes(
    values: AnyVector, vectors: AnyMatrix, system: SecondOrder, rows: Matrix, chosen: AnyArray
) -> list[WhirlMode]:
    found = whirl_modes(values, vectors, system, rows)
    return [found[k] for k in chosen]


def _carried(
    system: SecondOrder, shapes: AnyMatrix, start: float, end: float, depth: int
) -> tuple[AnyVector, AnyMatrix, AnyArray]:
    """Return eigenvalues and vectors at `end`, and which of them continue `shapes`.

    States have the size of the square root of their energy, so that the overlap of two shapes is
    the share of one that moves as the other.
    """
    values, vectors, _ = eigen_whirl(system, end)
    overlap = np.abs(shapes.conj().T @ vectors)
    _, chosen = linear_sum_assignment(-overlap)
    least = overlap[np.arange(len(chosen)), chosen].min(initial=1.0)
    if least >= _ALIKE or depth == _HALVINGS or end <= start:
        return values, vectors, chosen
    middle = (start + end) / 2
    _, between, there = _carried(system, shapes, start, middle, depth + 1)
    return _carried(system, between[:, there], middle, end, depth + 1)
