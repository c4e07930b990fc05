"""Whirl frequencies over speed, each followed from one speed to the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, overload

import numpy as np
from matplotlib.axes import Axes
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from robustpolish.base.arrays import AnyArray, AnyMatrix, AnyVector, Array, Matrix, Vector
from robustpolish.base.checks import described, invalid
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.machines.rotor.assembly import SecondOrder
from robustpolish.plots.poles import plot_campbell, plot_whirl_shapes

# Speeds at which an unbalance meets a whirl of its own frequency.


def critical_speeds(system: SecondOrder) -> Vector:
    """Return where the undamped rotor whirls as fast as it spins, in rad/s, rising.

    Parameters
    ----------
    system : SecondOrder
        Of two planes with as many coordinates each, x before y.

    Returns
    -------
    ndarray, shape (speeds,)

    Raises
    ------
    InvalidInputError
        If nothing holds the rotor.
    """
    K = (system.stiffness + system.stiffness.T) / 2
    sizes = np.sqrt(np.diag(K))
    if not (sizes > 0).all() or system.normal_modes[0].min(initial=np.inf) == 0:
        what = described("a rotor that nothing holds")
        raise invalid("bearings", what, "bearings that hold the rotor", "Add a bearing.")
    # K X = speed^2 (M - j G) X is what an unbalance meets; X turns as exp(j speed t).
    spun = (system.mass - 1j * system.gyroscopic) / np.outer(sizes, sizes)
    inverse, shapes = eigh(spun, K / np.outer(sizes, sizes))
    x, y = np.split(shapes / sizes[:, None], 2)
    forward = np.linalg.norm(x + 1j * y, axis=0) > 1e-6 * np.linalg.norm(x, axis=0)
    listed = forward & (inverse > 1e-14 * inverse[-1])
    speeds = np.sort(1 / np.sqrt(inverse[listed]))
    # Without gyroscopic moments both ways round are one speed.
    return speeds[np.r_[True, np.diff(speeds) > 1e-9 * speeds[1:]][: len(speeds)]]


# Whirl at a speed: frequency, damping, shape, and which way round.

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
    >>> lowest = rp.polishing.spindle_rotor().modes(314.0)[0]
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
    >>> found = rp.polishing.spindle_rotor().modes(314.0, count=2)
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
        >>> rp.polishing.spindle_rotor().modes(300.0, count=2).plot().get_xlabel()
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
    >>> found = rp.polishing.spindle_rotor().campbell(np.linspace(0.0, 1200.0, 7), count=2)
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
        >>> rp.polishing.spindle_rotor().campbell([0.0, 600.0], count=2).plot().get_xlabel()
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


def track_modes(
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
    eigenvalues, whirl = [], []
    for speed in speeds.tolist():
        values, vectors, chosen = _continued_modes(system, shapes, at, speed, 0)
        if speed >= slow:
            shapes, at = vectors[:, chosen], speed
        eigenvalues.append(values[chosen])
        found = whirl_modes(values, vectors, system, rows)
        whirl.append([found[k].whirl for k in chosen])
    return np.array(eigenvalues), np.array(whirl)


def _continued_modes(
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
    _, between, there = _continued_modes(system, shapes, start, middle, depth + 1)
    return _continued_modes(system, between[:, there], middle, end, depth + 1)
