"""Kinds of tunable blocks: free matrices, lead and lag, low-pass and notch filters, and PID."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.checks import described, invalid, misfit, one_of, whole_number
from robustpolish.synthesis.structured.block_parts import (
    Given,
    Names,
    ParameterSlot,
    Stage,
    TunableBlock,
    block_of,
)

# A frequency in Hz, above 0.
_frequency = partial(ParameterSlot, time=-1, low=0.0, search="positive", hertz=True)


# Matrices whose entries are free: static gains, and state spaces of given order.


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeEntries(Stage):
    """x' = A x + B e, v = C x + D e with a number for each free entry.

    Attributes
    ----------
    structure : ndarray of bool or None
        Entries of D that may differ from zero; all by default.
    gain : ndarray of object or None
        Numbers or tunable numbers, one for each entry of D or one for all.
    feedthrough : bool
        False for D = 0.
    """

    structure: NDArray[np.bool_] | None = None
    gain: Any = None
    feedthrough: bool = True

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Free entries of [[A, B], [C, D]]; the others are zero."""
        k = len(self.states)
        free = np.ones((k + self.outputs, k + self.inputs), bool)
        free[k:, k:] = self.feedthrough if self.structure is None else self.structure
        return free

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]."""
        M = np.zeros(self.mask.shape)
        M[self.mask] = values
        return M

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Return the free entries of the gradient."""
        return gradient[self.mask]

    def sized(self, inputs: int, outputs: int) -> Self:
        """Return the stage for so many signals, with a number for each entry."""
        shape, want = (outputs, inputs), f"{(outputs, inputs)}: controls by measurements"
        if self.structure is not None and self.structure.shape != shape:
            remedy = "Mark the entries that may differ from zero."
            raise misfit("structure", f"shape {self.structure.shape}", want, remedy)
        given: Any = np.full((1, 1), None) if self.gain is None else self.gain
        if given.size == 1:
            given = np.full(shape, given.item())
        if given.shape != shape:
            raise invalid("gain", described(f"shape {given.shape}"), want, "One per entry.")
        stage = replace(self, inputs=inputs, outputs=outputs)
        slots = tuple(stage._slot(int(i), int(j), given) for i, j in np.argwhere(stage.mask))
        if all(slot.held == 0 for slot in slots):
            shown = described("entries that are all zero")
            raise invalid("gain", shown, "one that is tuned, or is not 0", "Free an entry.")
        return replace(stage, slots=slots)

    def _slot(self, i: int, j: int, given: Any) -> ParameterSlot:
        """Return the slot of an entry of [[A, B], [C, D]]."""
        k = len(self.states)
        if not k:
            name = "gain" if given.size == 1 else f"gain[{i},{j}]"
            return ParameterSlot(name, given[i, j], out=i, into=j)
        above, left = i < k, j < k
        letter = "ABCD"[2 * (not above) + (not left)]
        row, column = i - (0 if above else k), j - (0 if left else k)
        # A state has no unit of its own: B and C share that of the signals.
        return ParameterSlot(
            f"{letter}[{row},{column}]",
            None,
            time=-1 if above else 0,
            out=None if above else row,
            into=None if left else column,
            default=-1.0 if letter == "A" and i == j else 0.0,
        )


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
        States, at least 1; for none see :func:`robustpolish.tunable.static_gain`.
    feedthrough : bool, optional
        False for D = 0, a strictly proper block.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.tunable.pid`.
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
    >>> rp.tunable.fixed_order("x", "F", order=2, feedthrough=False)
    block: F = (C (s I - A)^-1 B) x
    """
    whole_number("order", order, 1, remedy="Use static_gain for none.")
    if not isinstance(feedthrough, bool):
        raise invalid("feedthrough", feedthrough, "True or False", "False is strictly proper.")
    stage = FreeEntries(
        kind="fixed_order",
        formula="(C (s I - A)^-1 B + D)" if feedthrough else "(C (s I - A)^-1 B)",
        states=tuple(f"x{i + 1}" for i in range(order)),
        name=name,
        resizable=True,
        feedthrough=feedthrough,
    )
    return block_of(stage, measurements, controls, sign)


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
        -1 for the usual notation of negative feedback; see :func:`robustpolish.tunable.pid`.
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
    >>> rp.tunable.static_gain(
    ...     ["x", "v"], "F", gain=[[None, rp.tunable.tunable("d", 1.0, low=0.0)]], sign=-1
    ... )
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
    entries = None if gain is None else np.atleast_2d(np.array(gain, dtype=object))
    stage = FreeEntries(
        kind="gain", formula="gain", name=name, resizable=True, structure=mask, gain=entries
    )
    return block_of(stage, measurements, controls, sign)


# A lead or lag of first order.


class LeadLag(Stage):
    """gain (1 + s/z)/(1 + s/p) with z and p given in Hz; its state is the filtered input."""

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]: x' = p (e - x), v = gain (r e + (1 - r) x) with r = p/z."""
        gain, zero, pole = values
        rate, ratio = 2 * math.pi * pole, pole / zero
        return np.array([[-rate, rate], [gain * (1 - ratio), gain * ratio]])

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over gain, zero and pole."""
        gain, zero, pole = values
        G, ratio = gradient, pole / zero
        on_ratio = gain * (G[1, 1] - G[1, 0])
        return np.array(
            [
                G[1, 0] * (1 - ratio) + G[1, 1] * ratio,
                -on_ratio * ratio / zero,
                on_ratio / zero + 2 * math.pi * (G[0, 1] - G[0, 0]),
            ]
        )


def lead_lag(
    measurement: str | None = None,
    control: str | None = None,
    *,
    gain: Given = None,
    zero_hz: Given = None,
    pole_hz: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a lead or lag of first order to be tuned.

    .. math:: u = \mathrm{sign}\, g\, \frac{1 + s / (2\pi f_z)}{1 + s / (2\pi f_p)}\, y

    A lead has its zero below its pole, a lag above it.

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives; may be left out where there is only one, or in a series.
    gain : Tunable or float, optional
        Gain at rest, in units of u over y, of either sign. A plain number is held;
        :func:`robustpolish.tunable` gives start and limits; without either it is tuned freely. In a
        series only the first block with a gain has these units: hold the others at 1.
    zero_hz, pole_hz : Tunable or float, optional
        Where it turns, above 0, in Hz.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.tunable.pid`.
    name : str, optional
        By default ``lead_lag_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense.

    Examples
    --------
    >>> import robustpolish as rp
    >>> zero = rp.tunable.tunable("fz", 2.0, low=1.0)
    >>> rp.tunable.pid("x", kind="PI") * rp.tunable.lead_lag(gain=1.0, zero_hz=zero)
    block: u = (Kp + Ki/s) * gain (1 + s/(2 pi zero_hz))/(1 + s/(2 pi pole_hz)) x
    """
    slots = (
        ParameterSlot("gain", gain, out=0, into=0),
        _frequency("zero_hz", zero_hz, default=0.1),
        _frequency("pole_hz", pole_hz, default=0.5),
    )
    if slots[0].held == 0:
        raise invalid("gain", described("a gain held at 0"), "another one", "Leave it out.")
    formula = "gain (1 + s/(2 pi zero_hz))/(1 + s/(2 pi pole_hz))"
    stage = LeadLag(kind="lead_lag", formula=formula, states=("filtered",), slots=slots, name=name)
    return block_of(stage, measurement, control, sign)


# A low-pass filter of first or second order.


class LowPass(Stage):
    """w/(s + w), or w^2/(s^2 + 2 damping w s + w^2); its states are the output and its rate."""

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]."""
        w = 2 * math.pi * values[0]
        if len(values) == 1:
            return np.array([[-w, w], [1.0, 0.0]])
        return np.array([[0.0, w, 0.0], [-w, -2 * values[1] * w, w], [1.0, 0.0, 0.0]])

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over frequency and damping."""
        G = gradient
        if len(values) == 1:
            return np.array([2 * math.pi * (G[0, 1] - G[0, 0])])
        frequency, damping = values
        on_w = G[0, 1] - G[1, 0] - 2 * damping * G[1, 1] + G[1, 2]
        return 2 * math.pi * np.array([on_w, -2 * frequency * G[1, 1]])


def low_pass(
    measurement: str | None = None,
    control: str | None = None,
    *,
    order: int = 2,
    frequency_hz: Given = None,
    damping: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a low-pass filter to be tuned.

    It usually stands in series: ``rp.tunable.low_pass() * rp.tunable.pid("x")``.

    .. math:: H(s) = \frac{\omega^2}{s^2 + 2 \zeta \omega s + \omega^2}
              \quad\text{or}\quad \frac{\omega}{s + \omega}, \quad \omega = 2 \pi f

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives; may be left out where there is only one, or in a series.
    order : {1, 2}, optional
        Its states.
    frequency_hz : Tunable or float, optional
        f, above 0, in Hz. A plain number is held; :func:`robustpolish.tunable` gives start and
        limits; without either it is tuned freely.
    damping : Tunable or float, optional
        Damping ratio of the second order, from 0.05 to 10.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.tunable.pid`.
    name : str, optional
        By default ``low_pass_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.tunable.low_pass(damping=0.7) * rp.tunable.pid("x", kind="PD")
    block: u = low_pass(s) * (Kp + Kd s/(Tf s + 1)) x
    """
    if isinstance(order, bool) or order not in (1, 2):
        raise invalid("order", order, "1 or 2", "Put two filters in series for more.")
    if order == 1 and damping is not None:
        shown = described("a damping of a filter of first order")
        raise invalid("damping", shown, "none", "Choose order=2, or leave it out.")
    slots = (
        _frequency("frequency_hz", frequency_hz, default=0.5),
        ParameterSlot("damping", damping, low=0.05, high=10.0, default=0.7, search="positive"),
    )
    stage = LowPass(
        kind="low_pass",
        formula="low_pass(s)",
        states=("filtered", "rate")[:order],
        slots=slots[:order],
        name=name,
        has_gain=False,
    )
    return block_of(stage, measurement, control, sign)


# A notch filter.


class Notch(Stage):
    """(s^2 + depth width w s + w^2)/(s^2 + width w s + w^2)."""

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]: the input less a share of a band-pass of it."""
        frequency, depth, width = values
        w = 2 * math.pi * frequency
        return np.array(
            [[0.0, w, 0.0], [-w, -width * w, w], [0.0, -(1 - depth) * width, 1.0]],
        )

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over frequency, depth and width."""
        frequency, depth, width = values
        G = gradient
        on_w = G[0, 1] - G[1, 0] - width * G[1, 1] + G[1, 2]
        on_width = -2 * math.pi * frequency * G[1, 1] - (1 - depth) * G[2, 1]
        return np.array([2 * math.pi * on_w, width * G[2, 1], on_width])


def notch(
    measurement: str | None = None,
    control: str | None = None,
    *,
    frequency_hz: Given = None,
    depth: Given = None,
    width: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a notch filter to be tuned.

    It usually stands in series: ``rp.tunable.pid("x") * rp.tunable.notch()``.

    .. math:: H(s) = \frac{s^2 + d\, b\, \omega s + \omega^2}{s^2 + b\, \omega s + \omega^2},
              \quad \omega = 2 \pi f

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives; may be left out where there is only one, or in a series.
    frequency_hz : Tunable or float, optional
        Its centre f, above 0, in Hz. A plain number is held; :func:`robustpolish.tunable` gives
        start and limits; without either it is tuned freely.
    depth : Tunable or float, optional
        Gain d at the centre, from 0 to 1 (no notch at all).
    width : Tunable or float, optional
        Width b over the centre, above 0 and at most 10: twice the damping of the poles.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback; see :func:`robustpolish.tunable.pid`.
    name : str, optional
        By default ``notch_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.tunable.notch(
    ...     "x", frequency_hz=rp.tunable.tunable("f", 120.0, low=100.0, high=140.0), depth=0.05
    ... )
    block: u = notch(s) x
    """
    slots = (
        _frequency("frequency_hz", frequency_hz, default=0.5 / math.pi),
        ParameterSlot("depth", depth, low=0.0, high=1.0, default=0.3),
        ParameterSlot("width", width, low=0.0, high=10.0, default=1.0, search="positive"),
    )
    # The integral of the band around the frequency, and that band.
    states = ("band_integral", "band")
    stage = Notch(
        kind="notch", formula="notch(s)", states=states, slots=slots, name=name, has_gain=False
    )
    return block_of(stage, measurement, control, sign)


# PID and its parts, with a filtered derivative.

# Which term needs a number, and the numbers of a PID.
_TERMS = {"Kp": "P", "Ki": "I", "Kd": "D", "Tf": "D"}
_WORDS = {"P": "Kp", "I": "Ki/s", "D": "Kd s/(Tf s + 1)"}


class Pid(Stage):
    """Kp + Ki/s + Kd s/(Tf s + 1), or some of these terms.

    Its states are the integral of the input, and the filtered input.
    """

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]: x1' = e, Tf x2' = e - x2, v = Kp e + Ki x1 + Kd x2'."""
        number, n = self._numbers(values), len(self.states)
        M = np.zeros((n + 1, n + 1))
        M[n, n] = number.get("Kp", 0.0)
        if "Ki" in number:
            M[0, n] = 1.0
            M[n, 0] = number["Ki"]
        if "Kd" in number:
            Kd, Tf = number["Kd"], number["Tf"]
            M[n - 1, n - 1], M[n - 1, n] = -1 / Tf, 1 / Tf
            M[n, n - 1] = -Kd / Tf
            M[n, n] += Kd / Tf
        return M

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over the numbers."""
        G, number, n = gradient, self._numbers(values), len(self.states)
        slopes = {"Kp": G[n, n], "Ki": G[n, 0]}
        if "Kd" in number:
            Kd, Tf = number["Kd"], number["Tf"]
            slopes["Kd"] = (G[n, n] - G[n, n - 1]) / Tf
            into = G[n - 1, n] - G[n - 1, n - 1] + Kd * (G[n, n] - G[n, n - 1])
            slopes["Tf"] = -into / Tf**2
        return np.array([slopes[name] for name in number])

    def _numbers(self, values: Vector) -> dict[str, float]:
        return dict(zip((slot.name for slot in self.slots), values, strict=True))


def pid(
    measurement: str | None = None,
    control: str | None = None,
    kind: str = "PID",
    *,
    Kp: Given = None,
    Ki: Given = None,
    Kd: Given = None,
    Tf: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a PID controller to be tuned, or a part of one.

    .. math:: u = \mathrm{sign}\,\left(K_p + \frac{K_i}{s} + \frac{K_d\, s}{T_f\, s + 1}\right) y

    The sign of the loop is that of the whole package, u = K y: with ``sign=1`` a positive Kp pushes
    in the direction of y, and negative feedback has negative gains. With ``sign=-1`` they are those
    of the usual controller of an error r - y at r = 0, positive for negative feedback. Gains are
    free in sign unless limits say otherwise, so that either way the same loop is found.

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives, by the plant's names; may be left out where there is only one.
    kind : {"PID", "PI", "PD", "P", "I", "D", "ID"}, optional
        Which terms; in small letters too.
    Kp, Ki, Kd : Tunable or float, optional
        Gains in units of u over y, per second for Ki, times seconds for Kd. A plain number is held;
        :func:`robustpolish.tunable` gives start and limits; without either it is tuned freely.
    Tf : Tunable or float, optional
        Time constant of the filter of the derivative, above 0, in s.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback.
    name : str, optional
        By default ``pid_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense or belongs to a term that `kind` leaves out.

    Notes
    -----
    As MATLAB's ``tunablePID``, with ``sign=-1`` in a loop with negative feedback.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.tunable.pid(
    ...     "x", control="F", kind="PI", Kp=rp.tunable.tunable("Kp", 2.0, low=0.0), sign=-1
    ... )
    block: F = -(Kp + Ki/s) x
    """
    kinds = ("P", "I", "D", "PI", "PD", "ID", "PID")
    terms = one_of("kind", kind.upper() if isinstance(kind, str) else kind, kinds)
    for number, value in {"Kp": Kp, "Ki": Ki, "Kd": Kd, "Tf": Tf}.items():
        if value is not None and _TERMS[number] not in terms:
            shown = described(f"a number for a controller of kind {terms}")
            raise invalid(number, shown, "none", "Leave it out, or choose another kind.")
    slots = (
        ParameterSlot("Kp", Kp, out=0, into=0),
        ParameterSlot("Ki", Ki, time=-1, out=0, into=0, search="integral"),
        ParameterSlot("Kd", Kd, time=1, out=0, into=0),
        ParameterSlot("Tf", Tf, time=1, low=0.0, default=0.1, search="positive"),
    )
    slots = tuple(slot for slot in slots if _TERMS[slot.name] in terms)
    if all(slot.held == 0 for slot in slots if slot.out is not None):
        shown = described("gains that are all held at 0")
        raise invalid("Kp", shown, "a gain that is tuned, or is not 0", "Leave one out.")
    formula = " + ".join(_WORDS[term] for term in terms)
    stage = Pid(
        kind="pid",
        formula=f"({formula})" if len(terms) > 1 else formula,
        states=("integral",) * ("I" in terms) + ("filtered",) * ("D" in terms),
        slots=slots,
        name=name,
    )
    return block_of(stage, measurement, control, sign)
