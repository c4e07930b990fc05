"""Resonances in measured responses, with their uncertainty, and the model's modes beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.signal import find_peaks, peak_prominences

from robustpolish.arrays import AnyArray, Array
from robustpolish.identification.frequency.measured import (
    FREQUENCY_POLICY,
    FrequencyPolicy,
    MeasuredResponse,
)
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.effect_slopes import sensor_gains, signal_gains
from robustpolish.models.mechanical.frequency_response import linear_system


@dataclass(frozen=True, eq=False)
class Resonance:
    """A pole that shows in a response.

    Attributes
    ----------
    frequency, damping : float
        Undamped natural frequency in Hz, and damping ratio.
    frequency_error, damping_error : float
        Standard errors; 0 for a model's own.
    shape : ndarray, shape (pairs,)
        Complex residues: how strongly each pair shows it.
    """

    frequency: float
    damping: float
    frequency_error: float
    damping_error: float
    shape: AnyArray


def likeness(first: AnyArray, second: AnyArray) -> float:
    """Return the modal assurance criterion of two shapes, from 0 to 1."""
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(abs(np.vdot(first, second)) / size) ** 2 if size > 0 else 0.0


def model_resonances(model: MechanicalModel, measured: MeasuredResponse) -> tuple[Resonance, ...]:
    """Return the modes of a model, effects linearised, as the measured pairs show them.

    Parameters
    ----------
    model : MechanicalModel
    measured : MeasuredResponse

    Returns
    -------
    tuple of Resonance
        From low to high frequency.
    """
    (A, B, C, _), _ = linear_system(model)
    poles, right = np.linalg.eig(A)
    left = np.linalg.pinv(right)
    residues = np.einsum("ok,ki->koi", C @ right, left @ B)
    residues = residues * sensor_gains(model)[:, None] * signal_gains(model)
    signals = model.matrices.sources
    columns = [signals.index(name) for name in model.input_names]
    shapes = measured.chosen(model, residues[:, :, columns])
    found = [
        Resonance(float(abs(pole)) / (2 * np.pi), float(-pole.real / abs(pole)), 0.0, 0.0, shape)
        for pole, shape in zip(poles, shapes, strict=True)
        if pole.imag > 1e-9 * abs(pole)
    ]
    return tuple(sorted(found, key=lambda mode: mode.frequency))


def measured_resonances(
    measured: MeasuredResponse, policy: FrequencyPolicy = FREQUENCY_POLICY
) -> tuple[Resonance, ...]:
    """Find the resonances that stand out of measured responses.

    About each maximum of the pairs together one pole is fitted to all pairs, with a straight line
    for what other modes add there.

    Parameters
    ----------
    measured : MeasuredResponse
    policy : FrequencyPolicy, optional

    Returns
    -------
    tuple of Resonance
        From low to high frequency.
    """
    values = np.where(measured.there, measured.values, 0.0)
    size = np.abs(values) ** 2
    typical = np.array([np.median(column[column > 0]) for column in size.T])
    sum_ = np.sum(size / typical, axis=1)
    noise = np.sqrt(np.sum((measured.variance / typical) * size / typical, axis=1))
    decibels = 10 * np.log10(np.maximum(sum_, 1e-300))
    scatter = 20 / np.log(10) * np.minimum(noise / np.maximum(sum_, 1e-300), 1.0)
    tops, _ = find_peaks(decibels)
    prominence = peak_prominences(decibels, tops)[0]
    tops = tops[prominence > policy.peak + policy.noisy * scatter[tops]]
    found: list[Resonance] = []
    for i, top in enumerate(tops):
        lowest = tops[i - 1] + int(np.argmin(sum_[tops[i - 1] : top])) if i else 0
        last = i + 1 < len(tops)
        highest = top + int(np.argmin(sum_[top : tops[i + 1]])) if last else len(sum_) - 1
        mode = _fitted(measured, values, sum_, top, (lowest, highest), policy)
        if mode is not None:
            found.append(mode)
    return tuple(found)


def matched(
    modelled: tuple[Resonance, ...],
    measured: tuple[Resonance, ...],
    policy: FrequencyPolicy = FREQUENCY_POLICY,
) -> list[tuple[int, int]]:
    """Return which mode of a model belongs to which measured one, by frequency and shape.

    Parameters
    ----------
    modelled, measured : tuple of Resonance
    policy : FrequencyPolicy, optional

    Returns
    -------
    list of (int, int)
        Positions; modes without a partner are left out.
    """
    if not modelled or not measured:
        return []
    cost = np.array(
        [
            [
                abs(np.log(ours.frequency / theirs.frequency))
                + 0.5 * (1 - likeness(ours.shape, theirs.shape))
                for theirs in measured
            ]
            for ours in modelled
        ]
    )
    # Beyond the limit all are equally bad, so that one stray peak moves no other.
    rows, columns = linear_sum_assignment(np.minimum(cost, policy.alike))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, j) for i, j in pairs if cost[i, j] < policy.alike]


def _fitted(
    measured: MeasuredResponse,
    values: AnyArray,
    sum_: Array,
    top: int,
    valley: tuple[int, int],
    policy: FrequencyPolicy,
) -> Resonance | None:
    """Fit a pole to the lines about a maximum; None if there is none."""
    omega = 2 * np.pi * measured.frequency
    half = [_half_power(sum_, top, valley, side) for side in (-1, 1)]
    reach = 2 * max(half) + 2
    first, last = max(top - reach, valley[0]), min(top + reach, valley[1])
    lines = slice(first, last + 1)
    count = last + 1 - first
    if count < 5:
        return None
    w, H = omega[lines], values[lines]
    there = measured.there[lines]
    level = np.sqrt(np.mean(np.abs(H) ** 2, axis=0))
    weight = there / np.sqrt(measured.variance[lines] + (0.01 * level) ** 2 + 1e-300)
    x = (w - omega[top]) / max(w[-1] - w[0], 1e-300)
    background = np.column_stack([np.ones(count), x] if count > 6 else [np.ones(count)])
    width = max((omega[min(top + half[1], len(omega) - 1)] - omega[max(top - half[0], 0)]) / 2,
                float(np.min(np.diff(w))) / 2)  # fmt: skip
    pole = complex(-width, omega[top])
    for _ in range(30):
        residual, slopes, _ = _projected(pole, w, H, weight, background)
        J = _parts(slopes)
        r = _parts(residual)
        step, *_ = np.linalg.lstsq(J, -r, rcond=1e-12)
        change = complex(*step)
        limit = abs(pole.real) + float(np.min(np.diff(w)))
        if abs(change) > limit:
            change *= limit / abs(change)
        pole += change
        if pole.real >= 0:  # a response that stable machines show has its poles on the left
            pole = complex(-0.5 * abs(pole.real - change.real), pole.imag)
        if abs(change) < 1e-10 * abs(pole):
            break
    residual, slopes, shape = _projected(pole, w, H, weight, background)
    damping = -pole.real / abs(pole)
    inside = w[0] <= pole.imag <= w[-1]
    if not inside or not 0 < damping < policy.most_damping:
        return None
    # What the pole explains has to stand above what is left.
    free = 2 * (np.count_nonzero(weight) - H.shape[1] * (1 + background.shape[1])) - 2
    if free < 1:
        return None
    left = float(np.sum(np.abs(residual) ** 2)) / free
    J = _parts(slopes)
    covariance = np.linalg.pinv(J.T @ J) * left
    without = _background_only(H, weight, background)
    if without - np.sum(np.abs(residual) ** 2) < policy.evident * left:
        return None
    height = np.abs(shape) / -pole.real / np.max(np.abs(H), axis=0)
    spread = float(np.sqrt(covariance[0, 0]))
    if np.max(height) < 0.3 or spread > -pole.real:
        return None
    by_frequency = np.array([pole.real, pole.imag]) / abs(pole)
    by_damping = np.array([-1.0, 0.0]) / abs(pole) - damping * by_frequency / abs(pole)
    errors = [float(np.sqrt(max(g @ covariance @ g, 0.0))) for g in (by_frequency, by_damping)]
    return Resonance(
        abs(pole) / (2 * np.pi), float(damping), errors[0] / (2 * np.pi), errors[1], shape
    )


def _background_only(H: AnyArray, weight: Array, background: Array) -> float:
    """Return the weighted sum of squares that the background leaves."""
    total = 0.0
    for j in range(H.shape[1]):
        Q, _ = np.linalg.qr(background * weight[:, [j]])
        target = H[:, j] * weight[:, j]
        total += float(np.sum(np.abs(target - Q @ (Q.T @ target)) ** 2))
    return total


def _parts(values: AnyArray) -> Array:
    """Return real parts above imaginary ones."""
    return np.concatenate([np.real(values), np.imag(values)])


def _projected(
    pole: complex, w: Array, H: AnyArray, weight: Array, background: Array
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return weighted residuals, their slopes over the pole's parts, and the residues.

    Residues and background follow by linear least squares for each pole (variable projection,
    with Kaufman's slopes).
    """
    by_pole = 1 / (1j * w - pole)
    residuals, slopes, shape = [], [], []
    for j in range(H.shape[1]):
        scale = weight[:, j]
        basis = np.column_stack([by_pole, background]) * scale[:, None]
        Q, R = np.linalg.qr(basis)
        target = H[:, j] * scale
        parts = Q.conj().T @ target
        coefficients = np.linalg.lstsq(R, parts, rcond=1e-14)[0]
        residuals.append(Q @ parts - target)
        moved = coefficients[0] * by_pole**2 * scale
        moved = moved - Q @ (Q.conj().T @ moved)
        slopes.append(np.column_stack([moved, 1j * moved]))
        shape.append(coefficients[0])
    return np.concatenate(residuals), np.concatenate(slopes), np.array(shape)


def _half_power(sum_: Array, top: int, valley: tuple[int, int], side: int) -> int:
    """Return how many lines aside of a maximum the power has halved."""
    end = valley[0] if side < 0 else valley[1]
    i = top
    while i != end and sum_[i] > sum_[top] / 2:
        i += side
    return abs(i - top)
