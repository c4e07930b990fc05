"""State scaling for an accurate frequency response, as the thesis's section 10.5 uses it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.analysis.poles.eigen import EPS
from robustpolish.arrays import Vector
from robustpolish.display import Card, Displayed, quantities
from robustpolish.exact.exponents import BeyondDoublesError, refuse_extreme
from robustpolish.exact.realisation import (
    Realisation,
    named_like,
    realisation,
    rescaled,
    state_scales,
)
from robustpolish.plotting import plot_over_frequency
from robustpolish.validation import described, invalid, matrix


@dataclass(frozen=True, eq=False, repr=False)
class Prescaled(Displayed):
    """A system with scaled states, and what the scaling gained.

    Attributes
    ----------
    system : control.StateSpace
        A_s = T_L A T_R, B_s = T_L B, C_s = C T_R, D_s = D (thesis 10.46 to 10.51).
    left, right : ndarray, shape (n, n)
        T_L and T_R, diagonal, of powers of two, inverse to each other; x = T_R x_s.
    frequency : ndarray, shape (k,)
        Where the accuracy was estimated, in rad/s.
    accuracy_before, accuracy_after : ndarray, shape (k,)
        Relative error of the frequency response to be expected from rounding errors of
        the size of each matrix's norm.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rp.prescale(control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0))
    Prescaled system
      states                   2
      worst accuracy before  ...
      worst accuracy after   ...
    """

    system: control.StateSpace
    left: Vector
    right: Vector
    frequency: Vector
    accuracy_before: Vector
    accuracy_after: Vector

    def state_gain(self, gain: ArrayLike) -> Vector:
        """Map a state feedback of the scaled system back, D_c = D_c^s T_R^-1 (thesis 10.60).

        Parameters
        ----------
        gain : array_like, shape (m, n)
            F_s, found for the scaled system.

        Returns
        -------
        ndarray, shape (m, n)

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> scaled = rp.prescale(control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0))
        >>> scaled.state_gain([[1.0, 2.0]]).shape
        (1, 2)
        """
        return matrix("gain", gain, (None, self.left.shape[0])) @ self.left

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the accuracy of the frequency response before and after.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> plant = control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0)
        >>> rp.prescale(plant).plot().get_ylabel()
        'relative error to expect'
        """
        curves = xr.Dataset(
            {
                "as it came": ("frequency", self.accuracy_before),
                "prescaled": ("frequency", self.accuracy_after),
            },
            {"frequency": self.frequency / (2 * np.pi)},
        )
        return plot_over_frequency(curves, "relative error to expect", ax)

    def _card(self) -> Card:
        rows = (
            ("states", int(self.left.shape[0])),
            ("worst accuracy before", float(self.accuracy_before.max(initial=0.0))),
            ("worst accuracy after", float(self.accuracy_after.max(initial=0.0))),
        )
        return Card("Prescaled system", (quantities(*rows, digits=3),))


def prescale(system: control.StateSpace, band: Sequence[float] | None = None) -> Prescaled:
    r"""Scale the states by powers of two for the most accurate frequency response.

    Algorithms that rotate the states leave errors of the rounding unit times
    the norm of each whole matrix. To first order they change the response at a frequency by

    .. math:: \epsilon\, \bigl(\|C R\| (\|A\| + \omega) \|R B\| + \|C\| \|R B\|
              + \|C R\| \|B\| + \|D\|\bigr)

    in Frobenius norms, where :math:`R = (i\omega I - A)^{-1}`; relative to the norm of the
    response that is the accuracy. Starting from the balanced states, each scale is halved or
    doubled as long as the worst accuracy over the band falls. The result is never worse than the
    system as it came. The idea is that of MATLAB's `prescale`, not its algorithm.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete.
    band : (float, float), optional
        Lowest and highest frequency that matter, in rad/s, above 0. By default from a third of the
        slowest pole to three times the fastest.

    Returns
    -------
    Prescaled

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, or the band is not two ascending positive numbers
        (in discrete time, below the Nyquist frequency).

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> plant = control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0)
    >>> scaled = rp.prescale(plant)
    >>> bool(scaled.accuracy_after.max() < 0.01 * scaled.accuracy_before.max())
    True
    """
    model = realisation("system", system)
    refuse_extreme("system", model.matrices)
    frequency = _frequencies(model, band)
    try:
        responses = _Responses.of(model, frequency)
    except np.linalg.LinAlgError:  # an undamped pole on the grid: look beside it
        responses = _Responses.of(model, frequency * (1 + 1e-6))
    scales = _descend(responses, _start(model, responses))
    one = np.ones(model.states)
    A, B, C = model.A * scales / scales[:, None], model.B / scales[:, None], model.C * scales
    return Prescaled(
        named_like(system, A, B, C, model.D),
        np.diag(1 / scales),
        np.diag(scales),
        frequency,
        responses.accuracy(one),
        responses.accuracy(scales),
    )


@dataclass(frozen=True, eq=False)
class _Responses:
    """Squared entries of everything in the error estimate; scaling only weighs them.

    Attributes: A (n, n), B (n,), C (n,), CR and RB (k, n), direct: norm of D,
    point: magnitude of s or z, gain: norm of the response at each frequency.
    """

    A: Vector
    B: Vector
    C: Vector
    CR: Vector
    RB: Vector
    direct: float
    point: Vector
    gain: Vector

    @classmethod
    def of(cls, model: Realisation, frequency: Vector) -> _Responses:
        n = model.states
        s = np.exp(1j * frequency * model.step) if model.discrete else 1j * frequency
        scales, _ = state_scales(model.A, model.B, model.C)  # the resolvent in even units
        A = model.A * scales / scales[:, None]
        resolvent = s[:, None, None] * np.eye(n) - A
        B = np.broadcast_to((model.B / scales[:, None]).astype(complex), (s.size, *model.B.shape))
        C = np.broadcast_to((model.C * scales).T.astype(complex), (s.size, *model.C.T.shape))
        RB = np.linalg.solve(resolvent, B) * scales[:, None]
        CR = np.linalg.solve(resolvent.transpose(0, 2, 1), C) / scales[:, None]
        G = model.C @ RB + model.D
        return cls(
            model.A**2,
            np.sum(model.B**2, axis=1),
            np.sum(model.C**2, axis=0),
            np.sum(np.abs(CR) ** 2, axis=2),
            np.sum(np.abs(RB) ** 2, axis=2),
            float(np.linalg.norm(model.D)),
            np.abs(s),
            np.linalg.norm(G, axis=(1, 2)),
        )

    def accuracy(self, scales: Vector) -> Vector:
        """Return the relative accuracy at each frequency when x = scales * x_s."""
        squares = scales**2
        A = np.sqrt(np.sum(self.A * squares / squares[:, None]))
        B, C = np.sqrt(np.sum(self.B / squares)), np.sqrt(np.sum(self.C * squares))
        RB = np.sqrt(self.RB @ (1 / squares))
        CR = np.sqrt(self.CR @ squares)
        error = EPS * (CR * (A + self.point) * RB + C * RB + CR * B + self.direct)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(error > 0, error / self.gain, EPS)

    def worst(self, scales: Vector) -> float:
        """Return what the search minimises: the worst accuracy, then the mean as a tie-break."""
        accuracy = self.accuracy(scales)
        accuracy = accuracy[np.isfinite(accuracy)]
        if accuracy.size == 0:
            return 0.0
        return float(np.log(accuracy.max()) + 0.01 * np.log(accuracy).mean())


def _start(model: Realisation, responses: _Responses) -> Vector:
    n = model.states
    if n == 0:
        return np.ones(0)
    alone, _ = state_scales(model.A, 0 * model.B, 0 * model.C)
    together, _ = state_scales(model.A, model.B, model.C)
    return min((np.ones(n), alone, together), key=responses.worst)


def _descend(responses: _Responses, scales: Vector) -> Vector:
    scales, best = scales.copy(), responses.worst(scales)
    for _ in range(40):
        before = best
        for i in range(scales.size):
            for factor in (0.5, 2.0, 0.125, 8.0):
                trial = scales.copy()
                trial[i] *= factor
                value = responses.worst(trial)
                if value < best - 1e-9:
                    scales, best = trial, value
        if best >= before - 1e-6:
            break
    return scales


def _frequencies(model: Realisation, band: Sequence[float] | None) -> Vector:
    highest = np.pi / model.step if model.discrete else np.inf
    if band is None:
        low, high = _default_band(model)
        low, high = min(low, highest / 2), min(high, highest)
    else:
        try:
            low, high = (float(edge) for edge in band)
        except (TypeError, ValueError):
            low = high = np.nan
        if not 0 < low < high <= highest or not np.isfinite(high):
            limit = f" up to {highest:.6g} rad/s" if model.discrete else ""
            want = f"(lowest, highest), two ascending positive frequencies{limit}"
            raise invalid("band", described(repr(band)), want, "Give the band in rad/s.")
    return np.geomspace(low, high, 60)


def _default_band(model: Realisation) -> tuple[float, float]:
    if model.states == 0:
        return 0.1, 10.0
    even = rescaled(model)
    poles = np.linalg.eigvals(even.A).astype(complex) * even.time
    if model.discrete:
        poles = np.log(poles[poles != 0]) / model.step
    rates = np.abs(poles)
    rates = rates[rates > 1e-12 * rates.max(initial=0.0)]
    if rates.size == 0:
        return 0.1 / model.step, 3.0 / model.step
    low, high = float(rates.min() / 3), float(3 * rates.max())
    if not (low > 0 and math.isfinite(high)):
        raise BeyondDoublesError
    return low, high
