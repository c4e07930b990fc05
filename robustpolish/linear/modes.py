"""The modes of a system: frequency, damping and the state that carries each; and its zeros."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import overload

import control
import numpy as np
import scipy.linalg as sla
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from robustpolish.base.checks import positive
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.linear.arithmetic.exact import EXACT_STATES, rational, rescaled
from robustpolish.linear.scaling import equilibrating_scales, in_units, parts_with_states
from robustpolish.linear.stability import EPS, eigensystem, eigenvalues, pair_text
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


@dataclass(frozen=True)
class AxisZero:
    """An invariant zero on or near the stability boundary.

    Attributes
    ----------
    frequency : float
        In rad/s, at least 0 (in discrete time the angle over the sampling time).
    distance : float
        Size of a relative change of the scaled matrices that puts a zero exactly
        on the boundary there: the smallest singular value that the normal rank leaves.
    """

    frequency: float
    distance: float


def zeros_on_axis(system: control.StateSpace, *, tolerance: float = 1e-9) -> tuple[AxisZero, ...]:
    r"""Find where on the stability boundary the system matrix loses rank.

    The matrix (A - lambda I, B; C, D) has its normal rank except at the invariant zeros. Those
    of (A, B2, C1, D12) and of (A, B1, C2, D21) on the imaginary axis (unit circle) break
    the assumptions of Riccati-based synthesis. Candidates are the generalised eigenvalues of the
    matrix, squared by two random compressions; each is then moved along the boundary to the least
    smallest singular value. It counts if that is within the tolerance and far below its
    surroundings. Zeros at infinity (a rank-deficient D)
    are not listed.

    Parameters
    ----------
    system : control.StateSpace
        The channel in question, continuous or discrete.
    tolerance : float, optional
        Largest relative distance that counts, in scaled units.

    Returns
    -------
    tuple of AxisZero
        By frequency; a pair counts once.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, not finite, or the tolerance is not positive.

    Examples
    --------
    >>> import control
    >>> from robustpolish.linear import zeros_on_axis
    >>> notch = control.ss([[0, 1], [-1, -1]], [[0], [1]], [[3, -1]], 1)  # (s^2 + 4)/(s^2 + s + 1)
    >>> [round(zero.frequency, 6) for zero in zeros_on_axis(notch)]
    [2.0]
    """
    tolerance = positive("tolerance", tolerance)
    model = realisation("system", system)
    if 0 in model.D.shape:
        return ()
    m, p = model.B.shape[1], model.C.shape[0]
    each = [np.array([i]) for i in range(m)], [np.array([i]) for i in range(p)]
    scaled = in_units(model, equilibrating_scales(model, *each))
    M = np.block([[scaled.A, scaled.B], [scaled.C, scaled.D]])
    N = np.zeros(M.shape)
    N[: scaled.states, : scaled.states] = np.eye(scaled.states)
    rng, size = np.random.default_rng(0), float(np.linalg.norm(M, 2))
    points = rng.standard_normal(3) + 1j * rng.standard_normal(3)
    ranks = [np.linalg.matrix_rank(M - s * N, tol=100 * EPS * max(size, 1)) for s in points]
    rank = int(max(ranks))

    def smallest(angle: float) -> float:
        """Return the last singular value of the normal rank, relative to the matrices."""
        point = complex(np.exp(1j * angle)) if scaled.discrete else 1j * angle
        singular = np.linalg.svd(M - point * N, compute_uv=False)
        return float(singular[rank - 1]) / max(size, 1e-300)

    rng, starts = np.random.default_rng(1), [0.0]
    for _ in range(2):
        left, right = (rng.standard_normal(shape) for shape in ((rank, len(M)), (len(M.T), rank)))
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.asarray(sla.eigvals(left @ M @ right, left @ N @ right))
        values = values[np.isfinite(values) & (np.abs(values) < 1e3 * max(size, 1))]
        starts += list(np.abs(np.angle(values) if scaled.discrete else np.imag(values)))
    found: list[AxisZero] = []
    for start in starts:
        angle, distance = _descended(smallest, start)
        frequency = angle * scaled.time / scaled.step
        # Beside a zero the rank is full, unlike in the decay towards a zero at infinity.
        width = 0.03 * angle if angle else 0.03
        beside = min(smallest(abs(angle - width)), smallest(angle + width))
        known = any(math.isclose(frequency, zero.frequency, rel_tol=1e-6) for zero in found)
        if distance <= min(tolerance, 1e-3 * beside) and not known:
            found.append(AxisZero(float(frequency), distance))
    return tuple(sorted(found, key=lambda zero: zero.frequency))


def _descended(smallest: Callable[[float], float], start: float) -> tuple[float, float]:
    """Minimise along the boundary by shrinking steps around the start."""
    angle, value = start, smallest(start)
    step = 0.1 * start if start else 0.01
    for _ in range(120):
        reached, trial = min((smallest(x), x) for x in (abs(angle - step), angle + step))
        if reached < value:
            angle, value = trial, reached
        else:
            step *= 0.5
        if step <= EPS * max(angle, 1e-3):
            break
    # What rounding alone tells from zero is zero.
    at_rest = smallest(0.0)
    return (0.0, at_rest) if at_rest <= max(2 * value, 10 * EPS) else (angle, value)
