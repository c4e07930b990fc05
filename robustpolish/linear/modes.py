"""The modes of a system: frequency, damping and the state that carries each; and its zeros."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import control
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from robustpolish.base.results import Card, Displayed, Table
from robustpolish.linear.arithmetic.exact import EXACT_STATES, rational, rescaled
from robustpolish.linear.scaling import parts_with_states
from robustpolish.linear.stability import eigensystem, eigenvalues, pair_text
from robustpolish.linear.systems import Realisation, realisation
from robustpolish.plots.poles import plot_poles


@dataclass(frozen=True)
class Mode:
    """One real eigenvalue, or a pair of complex ones.

    Attributes
    ----------
    eigenvalue : complex
        Eigenvalue of the state matrix with imaginary part at or above zero: in rad/s, or in
        discrete time without unit.
    natural_frequency_hz : float
        Magnitude over 2 pi. In discrete time that of log(eigenvalue)/dt.
    frequency_hz : float
        Frequency of the damped oscillation, the imaginary part over 2 pi (thesis 8.40);
        0 for a real eigenvalue.
    damping_ratio : float
        Negative real part over magnitude (thesis 8.39): 1 for a real stable eigenvalue,
        negative if unstable, nan at zero.
    state : str
        The state that takes the largest part in the mode.
    participation : float
        That state's share, between 0 and 1, whatever the units.
    """

    eigenvalue: complex
    natural_frequency_hz: float
    frequency_hz: float
    damping_ratio: float
    state: str
    participation: float


@dataclass(frozen=True, repr=False)
class Modes(Displayed, Sequence[Mode]):
    """The modes of a system, slowest first; prints as a table.

    Attributes
    ----------
    modes : tuple of Mode
        A complex pair counts once.
    discrete : bool
        Whether the eigenvalues are those of a discrete-time system.

    Examples
    --------
    >>> import robustpolish as rp
    >>> found = rp.modes(rp.air_bearing().open_loop)
    >>> len(found), round(float(found.frequencies_hz.min()), 1)
    (6, 194.1)
    """

    modes: tuple[Mode, ...]
    discrete: bool = False

    def __len__(self) -> int:
        return len(self.modes)

    @overload
    def __getitem__(self, index: int) -> Mode: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Mode, ...]: ...
    def __getitem__(self, index: int | slice) -> Mode | tuple[Mode, ...]:
        return self.modes[index]

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues, one of each pair."""
        return np.array([mode.eigenvalue for mode in self.modes], dtype=complex)

    @property
    def frequencies_hz(self) -> NDArray[np.float64]:
        """Damped frequencies in Hz."""
        return np.array([mode.frequency_hz for mode in self.modes])

    @property
    def natural_frequencies_hz(self) -> NDArray[np.float64]:
        """Natural frequencies in Hz."""
        return np.array([mode.natural_frequency_hz for mode in self.modes])

    @property
    def damping_ratios(self) -> NDArray[np.float64]:
        """Damping ratios."""
        return np.array([mode.damping_ratio for mode in self.modes])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the eigenvalues in the complex plane.

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
        >>> rp.modes(rp.air_bearing().open_loop).plot().get_ylabel()
        'frequency [kHz]'
        """
        values = np.concatenate([self.eigenvalues, np.conj(self.eigenvalues)])
        return plot_poles({"modes": values}, ax=ax, discrete=self.discrete)

    def _card(self) -> Card:
        columns = ("state", "natural [Hz]", "damped [Hz]", "damping", "share", "eigenvalue")
        rows = [
            (m.state, m.natural_frequency_hz, m.frequency_hz, m.damping_ratio,
             round(m.participation, 2), pair_text(m.eigenvalue)) for m in self.modes
        ]  # fmt: skip
        return Card("", (Table("", columns, tuple(rows), digits=7),))


def modes(system: control.StateSpace) -> Modes:
    """Compute eigenfrequencies, damping ratios and the state that dominates each mode.

    Up to 60 coupled states the eigenvalues are roots of the exact characteristic
    polynomial, so even a damping ratio of 1e-15 is right for the stored matrix.

    Parameters
    ----------
    system : control.StateSpace, or any other system
        Continuous or discrete: a transfer function, a system of scipy.signal, a MechanicalModel.

    Returns
    -------
    Modes
        Sorted by natural frequency.

    Raises
    ------
    InvalidInputError
        If it is no system or has entries that are not finite.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> plant = control.ss([[0, 1], [-4, -0.04]], [[0], [1]], [[1, 0]], 0, states=["x", "v"])
    >>> rp.modes(plant)
    state  natural [Hz]  damped [Hz]  damping  share  eigenvalue
    x         0.3183099     0.318294     0.01    0.5  -0.02 +/- 1.9999j
    """
    model = realisation("system", system)
    names = list(model.source.state_labels)
    found: list[Mode] = []
    for part, indices in parts_with_states(model):
        found += _part_modes(part, [names[i] for i in indices])
    ordered = sorted(found, key=lambda m: (m.natural_frequency_hz, m.state))
    return Modes(tuple(ordered), model.discrete)


def _part_modes(model: Realisation, names: list[str]) -> list[Mode]:
    if model.states == 0:
        return []
    scaled = rescaled(model)
    spectrum = eigensystem(scaled.A)
    values, share = spectrum.values, spectrum.shares
    if model.states <= EXACT_STATES:  # in the order of those whose vectors are known
        exact = np.array(eigenvalues(rational(scaled.A)))
        _, columns = linear_sum_assignment(np.abs(values[:, None] - exact[None, :]))
        values = exact[columns]
    result = []
    for i, value in enumerate(values):
        if value.imag < 0:
            continue
        state, value = int(np.argmax(share[:, i])), value * scaled.time
        rate = value
        if model.discrete:
            rate = np.log(value) / model.step if value != 0 else complex(-math.inf, 0)
        size = abs(rate)
        damping = math.nan if size == 0 else (1.0 if math.isinf(size) else 0.0 - rate.real / size)
        hertz, damped = size / (2 * math.pi), abs(rate.imag) / (2 * math.pi)
        participation = min(1.0, float(share[state, i]))
        result.append(Mode(complex(value), hertz, damped, damping, names[state], participation))
    return result


# Invariant zeros on the stability boundary, where Riccati equations lose their solution.
