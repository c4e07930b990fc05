"""Whirl at a speed: frequency, damping, shape, and which way round."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, overload

import numpy as np
from matplotlib.axes import Axes

from robustpolish.arrays import AnyMatrix, AnyVector, Matrix
from robustpolish.display import Card, Displayed, Table
from robustpolish.models.rotor.second_order import SecondOrder
from robustpolish.plotting import plot_whirl_shapes

Direction = Literal["forward", "backward", "planar", "mixed"]
_FLAT = 1e-3
"""An orbit whose two ways round differ by less than this share is a line."""
_BOTH = 0.05
"""A shape is mixed if what runs one way is more than this share of what runs the other."""
_SAME = 1e-7
"""Frequencies nearer than this share of each other are one, and their shapes arbitrary."""


@dataclass(frozen=True, eq=False)
class WhirlMode:
    """One pair of complex eigenvalues of the rotor at its speed.

    Attributes
    ----------
    eigenvalue : complex
        In rad/s, with positive imaginary part.
    whirl : float
        From -1, all nodes run backward on circles, to 1, all forward. Modes of one frequency
        share the mean of their values, because their shapes are arbitrary.
    direction : {"forward", "backward", "planar", "mixed"}
        With the spin, against it, in a plane, or some nodes one way and some the other.
    shape : ndarray, shape (2, nodes)
        Complex amplitudes of x and of y at the nodes, the largest of size 1.

    Examples
    --------
    >>> import robustpolish as rp
    >>> lowest = rp.spindle_rotor().modes(314.0)[0]
    >>> lowest.direction, round(lowest.frequency_hz, 1), round(lowest.whirl, 6)
    ('backward', 128.0, -1.0)
    """

    eigenvalue: complex
    whirl: float
    direction: Direction
    shape: AnyMatrix = field(repr=False)

    @property
    def frequency_hz(self) -> float:
        """Imaginary part over 2 pi, that of the oscillation."""
        return self.eigenvalue.imag / (2 * math.pi)

    @property
    def natural_frequency_hz(self) -> float:
        """Magnitude of the eigenvalue over 2 pi."""
        return abs(self.eigenvalue) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Negative real part over magnitude; negative if the whirl grows."""
        return -self.eigenvalue.real / abs(self.eigenvalue)


@dataclass(frozen=True, eq=False, repr=False)
class RotorModes(Displayed, Sequence[WhirlMode]):
    """The whirl modes of a rotor at one speed, lowest natural frequency first; prints as a table.

    Attributes
    ----------
    modes : tuple of WhirlMode
    speed : float
        In rad/s.
    nodes : ndarray, shape (nodes,)
        Where the shapes are given, in m from the shaft's first end.
    largest_growth : float
        Largest real part of all eigenvalues in 1/s, those not listed included: negative if
        the rotor is stable.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.spindle_rotor().modes(314.0, count=2)
    >>> [mode.direction for mode in found], found.largest_growth < 0
    (['backward', 'forward'], True)
    """

    modes: tuple[WhirlMode, ...]
    speed: float
    nodes: AnyVector
    largest_growth: float

    def __len__(self) -> int:
        return len(self.modes)

    @overload
    def __getitem__(self, index: int) -> WhirlMode: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[WhirlMode, ...]: ...
    def __getitem__(self, index: int | slice) -> WhirlMode | tuple[WhirlMode, ...]:
        return self.modes[index]

    def __iter__(self) -> Iterator[WhirlMode]:
        return iter(self.modes)

    @property
    def frequencies_hz(self) -> AnyVector:
        """Frequencies of the oscillations in Hz."""
        return np.array([mode.frequency_hz for mode in self.modes])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the shapes along the shaft.

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
        >>> rp.spindle_rotor().modes(300.0, count=2).plot().get_xlabel()
        'along the shaft [mm]'
        """
        names = [f"{m.frequency_hz:.4g} Hz, {m.direction}" for m in self.modes]
        shapes = dict(zip(names, (m.shape for m in self.modes), strict=True))
        return plot_whirl_shapes(self.nodes, shapes, ax=ax)

    def _card(self) -> Card:
        columns = ("whirl", "frequency [Hz]", "damping", "roundness")
        rows = tuple(
            (m.direction, m.frequency_hz, _plain(m.damping_ratio), _plain(m.whirl))
            for m in self.modes
        )
        speed = f"{self.speed:.6g} rad/s ({30 * self.speed / math.pi:.6g} rev/min)"
        return Card(f"Whirl at {speed}", (Table("", columns, rows, digits=6),))


def _plain(value: float) -> float:
    """Return what is left of a share without the rounding of eigenvalues."""
    return round(value, 11) + 0.0


def eigen_whirl(system: SecondOrder, speed: float) -> tuple[AnyVector, AnyMatrix, float]:
    """Return eigenvalues above the real axis, their state vectors, and the largest growth in 1/s.

    Parameters
    ----------
    system : SecondOrder
    speed : float

    Returns
    -------
    eigenvalues, vectors : ndarray, shapes (m,) and (2 n, m)
        Sorted by natural frequency; vectors in the states of ``system.state_matrix``.
    growth : float
    """
    values: Any
    values, vectors = np.linalg.eig(system.state_matrix(speed))
    listed = np.flatnonzero(values.imag > 1e-9 * system.state_scale.min())
    order = listed[np.argsort(np.abs(values[listed]), kind="stable")]
    return values[order], vectors[:, order], float(values.real.max())


def whirl_modes(
    eigenvalues: AnyVector, vectors: AnyMatrix, system: SecondOrder, rows: Matrix
) -> tuple[WhirlMode, ...]:
    """Return modes with their shapes at the nodes.

    Parameters
    ----------
    eigenvalues, vectors : ndarray
        As from :func:`eigen_whirl`.
    system : SecondOrder
    rows : ndarray, shape (2 nodes, coordinates)
        From coordinates to x, then y, of all nodes.

    Returns
    -------
    tuple of WhirlMode
    """
    seen = rows @ (system.normal_modes[1] / system.state_scale)
    positions = vectors[: len(system.state_scale)]
    found: list[WhirlMode] = []
    for i, value in enumerate(eigenvalues):
        near = np.abs(eigenvalues - value) <= _SAME * abs(value)
        # Shapes of one frequency are a choice; what an orthogonal set of them does together is not.
        x, y = np.split(seen @ np.linalg.qr(positions[:, near])[0], 2)
        with_spin, against = np.abs(x + 1j * y) ** 2, np.abs(x - 1j * y) ** 2
        turns = (with_spin - against).sum(axis=1) / max(float((with_spin + against).sum()), 1e-300)
        motion = seen @ positions[:, i]
        largest = motion[np.abs(motion).argmax()]
        shape = np.array(np.split(motion, 2)) / (largest if largest != 0 else 1.0)
        found.append(WhirlMode(complex(value), float(turns.sum()), _direction(turns), shape))
    return tuple(found)


def _direction(turns: AnyVector) -> Direction:
    forward, backward = float(turns[turns > 0].sum()), float(-turns[turns < 0].sum())
    if forward + backward < _FLAT:
        return "planar"
    if min(forward, backward) > _BOTH * max(forward, backward):
        return "mixed"
    return "forward" if forward > backward else "backward"
