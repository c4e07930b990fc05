"""The weight that gives a plant the gain of a wanted loop, and what the plant says to it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.analysis.delays.delayed_system import resolvent_response
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
from robustpolish.synthesis.loop_shaping.coprime import cayley, cayley_back, coprime, in_series
from robustpolish.synthesis.loop_shaping.target import (
    POLICY,
    WantedLoop,
    gains,
    points_of,
    step_of,
)
from robustpolish.synthesis.problem.matrices import SystemMatrices
from robustpolish.validation import described, invalid


def target_weight(plant: SystemMatrices, wanted: WantedLoop) -> SystemMatrices:
    r"""Return a stable weight W1 for which G W1 has the wanted singular values.

    With G = inv(M) N, M inner, N has the singular values of G and no unstable poles; its
    spectral factor V, :math:`V^\sim V = \varepsilon^2 I + N^\sim N`, is stable with its
    inverse, and W1 = inv(V) Gd gives G W1 the singular values of Gd wherever those of G are
    above :math:`\varepsilon`. For the problem see V. X. Le, M. G. Safonov, "Rational matrix GCD's
    and the design of squaring-down compensators", IEEE Trans. Automatic Control 37 (1992) 384-392.

    Parameters
    ----------
    plant : SystemMatrices
        G. Of more controls than measurements, as many combinations are used as there are
        measurements.
    wanted : WantedLoop
    """
    T = _directions(plant, wanted)
    square = _driven(plant, T)
    sizes = gains(square, wanted.frequencies, wanted.dt)
    sizes = sizes[np.isfinite(sizes).all(axis=1)]
    if not sizes.size or not sizes.any():
        shown = described("a plant without gain in the band of the target")
        raise invalid("plant", shown, "a plant with gain there", "Check band_hz= and target=.")
    level = POLICY.roll_off * max(sizes[:, -1].min(), POLICY.faintest * sizes[:, 0].max())
    low = wanted.band[0]
    if wanted.dt:
        square = SystemMatrices(*cayley(*square))
        low = math.tan(low * step_of(wanted.dt) / 2)
    inverse = _inverted(_mirrored(_off_the_axis(square, low)), level)
    into, back = wanted.system, cayley_back(inverse) if wanted.dt else inverse
    return in_series(in_series(into, back), _gain(T))


def limits_in_words(plant: SystemMatrices, wanted: WantedLoop) -> str:
    """Say which unstable poles and zeros of a plant do not permit the wanted bandwidth.

    S. Skogestad, I. Postlethwaite, "Multivariable Feedback Control", 2nd ed., sections 5.7 and
    5.9: below half of a zero in the right half plane, above twice a pole.

    Parameters
    ----------
    plant : SystemMatrices
    wanted : WantedLoop

    Returns
    -------
    str
        Empty if none does.
    """
    square = _driven(plant, _directions(plant, wanted))
    poles, zeros = (
        _rates(values, wanted.dt) for values in (np.linalg.eigvals(plant.A), _zeros(square))
    )
    text = ""
    slow, fast = wanted.crossovers
    nearest = np.abs(zeros[zeros.real > 1e-6 * np.abs(zeros)]).min(initial=math.inf)
    if fast > nearest / 2:
        text += (
            f" The plant has a zero in the right half plane at {nearest:.4g} rad/s, which "
            f"permits bandwidths up to about half of it; the target has {fast:.4g} rad/s."
        )
    fastest = np.abs(poles[poles.real > 1e-6 * np.abs(poles)]).max(initial=0.0)
    if slow < 2 * fastest:
        text += (
            f" The plant has an unstable pole at {fastest:.4g} rad/s, which needs a bandwidth "
            f"of about twice that; the target has {slow:.4g} rad/s."
        )
    return text


def _directions(plant: SystemMatrices, wanted: WantedLoop) -> Matrix:
    """Return the combinations of controls that are used, shape (nu, channels)."""
    ny, nu = plant.D.shape
    if nu <= ny:
        return np.eye(nu)
    # Where a pole stands on the crossover its neighbourhood tells the same directions.
    point = points_of(np.array([wanted.crossovers[0] * (1 + 1e-6)]), wanted.dt)
    value = resolvent_response(*plant, point)[0]
    _, _, Vh = np.linalg.svd(np.vstack([value.real, value.imag]))
    return np.asarray(Vh[:ny].T, dtype=float)


def _driven(plant: SystemMatrices, T: Matrix) -> SystemMatrices:
    """Return G T."""
    return plant._replace(B=plant.B @ T, D=plant.D @ T)


def _gain(T: Matrix) -> SystemMatrices:
    return SystemMatrices(np.zeros((0, 0)), np.zeros((0, T.shape[1])), np.zeros((len(T), 0)), T)


def _inverted(stable: SystemMatrices, level: float) -> SystemMatrices:
    """Return inv(V) with V~V = level^2 I + N~N: the denominator of the factors of N / level."""
    one = stable._replace(C=stable.C / level, D=stable.D / level)
    ny, nu = one.D.shape
    sizes = (("u", nu), ("y", ny), ("x", len(one.A)))
    names = [[f"{kind}{i}" for i in range(count)] for kind, count in sizes]
    right = coprime(GeneralizedPlant.from_loop(named_system(one, 0, *names))).right()
    return SystemMatrices(right.A, right.B, right.C[ny:] / level, right.D[ny:] / level)


def _off_the_axis(plant: SystemMatrices, low: float) -> SystemMatrices:
    """Move the poles to the left by a little, if any lies on the axis."""
    poles = np.linalg.eigvals(plant.A)
    size = max(low, float(np.abs(poles).max(initial=0.0)))
    if not (np.abs(poles.real) <= POLICY.on_axis * size).any():
        return plant
    return plant._replace(A=plant.A - POLICY.shift * low * np.eye(len(poles)))


def _mirrored(plant: SystemMatrices) -> SystemMatrices:
    """Return the plant with its unstable poles mirrored, all singular values being kept."""
    A, B, C, D = plant
    T, Z, count = linalg.schur(A, output="real", sort="rhp")  # type: ignore[misc]
    if not count:
        return plant
    U, unstable = Z[:, :count], T[:count, :count]
    seen = C @ U
    # A Y + Y A' = Y C'C Y with Y = U inv(P) U'.
    P = linalg.solve_continuous_lyapunov(unstable.T, seen.T @ seen)
    L = -U @ np.linalg.solve(P, U.T @ C.T)
    return SystemMatrices(A + L @ C, B + L @ D, C, D)


def _zeros(plant: SystemMatrices) -> Any:
    """Return the finite zeros of a square plant; of others none, which have them by accident."""
    A, B, C, D = plant
    if D.shape[0] != D.shape[1] or not len(A):
        return np.zeros(0, dtype=complex)
    P = np.block([[A, B], [C, D]])
    N = linalg.block_diag(np.eye(len(A)), np.zeros(D.shape))
    values: Any = linalg.eigvals(P, N)
    finite = np.isfinite(values)
    return values[finite & (np.abs(np.where(finite, values, 0)) < 1e6 * np.linalg.norm(A))]


def _rates(values: Any, dt: float | bool) -> Any:
    """Return poles or zeros as continuous rates in rad/s."""
    if not dt:
        return np.asarray(values, dtype=complex)
    values = np.asarray(values, dtype=complex)
    return np.log(values[values != 0]) / step_of(dt)
