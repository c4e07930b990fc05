"""A continuous controller imitated at the samples."""

from __future__ import annotations

import math
from typing import Any, Literal, get_args

import control
import numpy as np
from scipy import signal
from scipy.linalg import null_space

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import invalid, misfit, one_of, positive
from robustpolish.implementation.realization import realized
from robustpolish.implementation.sampled.lifting import named_like
from robustpolish.linear.systems import of_roots
from robustpolish.plants.blocks import matrices_of

Method = Literal["tustin", "zoh", "foh", "matched", "impulse", "forward", "backward"]
METHODS: tuple[str, ...] = get_args(Method)
_SAME = {"bilinear": "tustin", "euler": "forward", "backward_diff": "backward"}


def emulated(
    controller: control.StateSpace,
    period: float,
    method: str = "tustin",
    prewarp_hz: float | None = None,
) -> control.StateSpace:
    """Imitate a continuous controller at samples.

    Parameters
    ----------
    controller : control.StateSpace
        Continuous, or a static gain.
    period : float
        In s.
    method : str, optional
        "tustin" (trapezoidal rule; "bilinear" is the same), "zoh" and "foh" (exact for
        measurements that are held, or joined by straight lines, between samples), "matched"
        (poles and zeros; one measurement and one control), "impulse" (same impulse response),
        "forward" and "backward" (Euler's rules).
    prewarp_hz : float, optional
        Where "tustin" is exact, in Hz.

    Returns
    -------
    control.StateSpace
        Discrete, with the names of `controller`; as many states.

    Raises
    ------
    InvalidInputError
        If the method does not exist or does not fit the controller.

    Examples
    --------
    >>> import control
    >>> from robustpolish.implementation import emulated
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> discrete = emulated(lag, 0.1, "zoh")
    >>> round(float(discrete.A[0, 0]), 6), float(discrete.dt)
    (0.904837, 0.1)
    """
    period = positive("period", period, "s")
    kind = one_of("method", _SAME.get(method, method), METHODS)
    if prewarp_hz is not None:
        if kind != "tustin":
            raise invalid("prewarp_hz", prewarp_hz, "None for this method", "Use method='tustin'.")
        if positive("prewarp_hz", prewarp_hz, "Hz") * 2 * period >= 1:
            want = f"less than half the sample rate, {0.5 / period:.6g} Hz"
            raise invalid("prewarp_hz", prewarp_hz, want, "Sample faster or warp elsewhere.")
    A, B, C, D = matrices_of(controller)
    found: Any = (A, B, C, D)
    if not A.size:
        pass
    elif kind in ("tustin", "forward", "backward"):
        found = integration_rule(A, B, C, D, period, kind, prewarp_hz)
    elif kind == "matched":
        found = _matched(controller, period)
    else:
        try:
            with np.errstate(all="ignore"):
                sampled: Any = signal.cont2discrete(found, period, method=kind)
            found = sampled[:4]
        except ValueError as error:
            remedy = "Use method='tustin'."
            raise invalid("method", method, f"one that suits it ({error})", remedy) from None
    if not all(np.isfinite(M).all() for M in found):
        shown = f"{kind} with a period of {period:.6g} s, which overflows"
        raise misfit("period", shown, "a shorter one", "Use method='tustin'.")
    return named_like(controller, found, period)


def integration_rule(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, period: float, kind: str,
    prewarp_hz: float | None = None,
) -> tuple[Any, Any, Any, Any]:  # fmt: skip
    """Replace s by a rule of integration that weighs the new sample with `alpha`."""
    if kind == "forward":
        return np.eye(len(A)) + period * A, period * B, C, D
    step = period
    if prewarp_hz is not None:
        half = math.pi * prewarp_hz * period
        step = period * math.tan(half) / half
    alpha = 1.0 if kind == "backward" else 0.5
    left = np.eye(len(A)) - alpha * step * A
    if A.size and np.linalg.cond(left) > 1e13:
        pole = 1 / (alpha * step)
        shown = f"a controller with a pole at {pole:.6g} rad/s and a period {period:.6g} s"
        remedy = "Change the period a little, or use method='zoh'."
        raise misfit("period", shown, "no pole where the rule of integration has one", remedy)
    Ad = np.linalg.solve(left, np.eye(len(A)) + (1 - alpha) * step * A)
    Bd = np.linalg.solve(left, step * B)
    Cd = np.linalg.solve(left.T, C.T).T
    return Ad, Bd, Cd, D + alpha * C @ Bd


def _matched(controller: control.StateSpace, period: float) -> tuple[Any, Any, Any, Any]:
    if (controller.ninputs, controller.noutputs) != (1, 1):
        shown = f"{controller.ninputs} measurements and {controller.noutputs} controls"
        remedy = "Use method='tustin', with prewarp_hz for one frequency."
        raise misfit("method", shown, "one of each for 'matched'", remedy)
    A, B, C, D = matrices_of(controller)
    poles, zeros, gain = np.linalg.eigvals(A), *_zeros_and_gain(A, B, C, float(D[0, 0]))
    with np.errstate(all="ignore"):
        # Near s = 0 a factor z - exp(r T) is (s - r) (exp(r T) - 1)/r, and T s for r = 0.
        slope = [
            np.where(r == 0, period, np.expm1(period * r) / np.where(r == 0, 1, r))
            for r in (poles, zeros)
        ]
        gain *= float(np.real(np.prod(slope[0]) / np.prod(slope[1])))
        # Polynomials in z - 1: in z those of slow roots would lose their digits.
        moved = np.expm1(period * zeros), np.expm1(period * poles)
        found = of_roots(*moved, gain, period, about=1.0)
    if not all(np.isfinite(M).all() for M in matrices_of(found)):
        return matrices_of(found)
    return matrices_of(realized(found, "modal"))


def _zeros_and_gain(A: Matrix, B: Matrix, C: Matrix, D: float) -> tuple[Any, float]:
    """Return the finite zeros of one channel, and D or its first Markov parameter C A^k B."""
    row, bound, rows, first = C, np.abs(C), np.zeros((0, len(A))), D
    while first == 0 and len(rows) < len(A):
        rows = np.vstack([rows, row / max(float(np.abs(row).max()), 1e-300)])
        first = float((row @ B)[0, 0])
        if abs(first) <= 1e-14 * float((bound @ np.abs(B))[0, 0]):  # nothing but rounding
            first = 0.0
        row, bound = row @ A, bound @ np.abs(A)
    if first == 0:
        return np.zeros(0), 0.0
    # y and its first derivatives stay zero on Z, with u = -(C A^k / first) x.
    Z = null_space(rows) if len(rows) else np.eye(len(A))
    return np.linalg.eigvals(Z.T @ (A - B @ row / first) @ Z), first
