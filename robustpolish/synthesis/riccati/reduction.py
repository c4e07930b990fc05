"""The two Riccati equations of a plant with controls without price or measurements without noise.

They do not exist as they stand. A measurement without noise tells a part of the state exactly,
and its derivative is a new measurement, of the other states and with the noise of the process.
Repeated until all that is left is noisy, this reduces the equation to the states that stay
uncertain, without changing the infimum; and likewise, transposed, for controls without price.

What counts as no price decides which problem is solved: beside weights with poles at high
frequencies a price of 1e-7 is all that they are. So every reduction is compared with the plant.

Stoorvogel, "The singular H-infinity control problem with dynamic measurement feedback", SIAM J.
Control and Optimization 29 (1991) 160-184.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.two_riccati import Half, TwoHalves

Gains = NDArray[Any]
# Untyped on purpose: the matrices of the loop below hang on them, which checkers follow for long.
_svd: Any = np.linalg.svd


@dataclass(frozen=True)
class ReductionPolicy:
    """Thresholds of the reduction.

    Attributes
    ----------
    noiseless : tuple of float
        Relative sizes of noise on a measurement, or of a price on a control, that count as none.
        Its inverse squared enters the equations, so the largest that keeps the plant is taken.
    unseen : float
        Relative size of what a measurement without noise sees that counts as nothing.
    rounding : float
        Size of an entry beside the largest one that is nothing but rounding (ROC6 in other units).
    changed : float
        What was dropped may change the gain from u to z, relative to itself, by so much: ten
        times less than searches resolve.
    points : int
        Frequencies at which the gains are compared.
    beyond : float
        How far these reach beyond the slowest and the fastest mode.
    """

    noiseless: tuple[float, ...] = (1e-7, 1e-9, 1e-11)
    unseen: float = 1e-9
    rounding: float = 1e-12
    changed: float = 3e-5
    points: int = 12
    beyond: float = 30.0


_POLICY = ReductionPolicy()


def reduced_halves(plant: PlantMatrices) -> TwoHalves | None:
    """Return the equations of a plant, reduced where D12 or D21 is rank-deficient.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, continuous, without D22.

    Returns
    -------
    TwoHalves or None
        None where double precision cannot tell what has a price or noise, so that the equations
        would be those of another plant.
    """
    P = plant
    control = _reduced(P.A, P.B1, P.B2, P.C1, P.D11, P.D12)
    measurement = _reduced(P.A.T, P.C1.T, P.C2.T, P.B1.T, P.D11.T, P.D21.T)
    return None if control is None or measurement is None else TwoHalves(control, measurement)


def _reduced(A: Matrix, B1: Matrix, B2: Matrix, C: Matrix, D11: Matrix, D12: Matrix) -> Half | None:
    """Reduce the half of the controls; measurements are their transpose."""
    probe = _Probe.of(A, B2, C, D12)
    for noiseless in _POLICY.noiseless:
        half, gain = _reduced_by(noiseless, A, B1, B2, C, D11, D12, probe)
        if probe.is_kept_by(gain):
            return half
    return None


def _reduced_by(
    noiseless: float,
    A: Matrix,
    B1: Matrix,
    B2: Matrix,
    C: Matrix,
    D11: Matrix,
    D12: Matrix,
    probe: _Probe,
) -> tuple[Half, Gains]:
    """Replace controls without price by the states that they set at will, until none is left.

    Returns also what they do to z at the probe's frequencies, as gains of the old controls.
    """
    basis: Matrix | None = None
    nothing = 0.0
    controls = probe.unit
    while True:
        size = np.linalg.norm(np.vstack([B2, D12]), axis=0)
        used = size > nothing
        B2, D12 = B2[:, used] / size[used], D12[:, used] / size[used]
        controls = controls[:, used] * size[used, None]
        U, s, Vt = _svd(D12)
        priced = int((s > noiseless).sum())
        if priced == D12.shape[1]:
            break
        B2, D12 = B2 @ Vt.T, D12 @ Vt.T
        controls = Vt @ controls
        W, reach, _ = _svd(B2[:, priced:])
        free = int((reach > _POLICY.unseen).sum())
        states = _states(probe.frequencies, A, B2 @ controls) if free else controls
        B2, D12, controls = B2[:, :priced], D12[:, :priced], controls[:, :priced]
        if free:
            # The states that cost nothing become controls of the others, at the price of z.
            at_will, left = W[:, :free], W[:, free:]
            controls = np.concatenate([controls, at_will.T @ states], axis=1)
            B2 = left.T @ np.hstack([B2, A @ at_will])
            D12 = np.hstack([D12, C @ at_will])
            A, B1, C = left.T @ A @ left, left.T @ B1, C @ left
            basis = left if basis is None else basis @ left
            nothing = _POLICY.rounding * max(np.abs(A).max(initial=0), np.abs(C).max(initial=0))
    nu = D12.shape[1]
    turn = np.vstack([U[:, nu:].T, U[:, :nu].T])
    price = np.vstack([np.zeros((len(D12) - nu, nu)), np.eye(nu)])
    half = Half(A, B1, B2 @ Vt.T / s[:nu], turn @ C, turn @ D11, price, basis)
    return half, C @ _states(probe.frequencies, A, B2 @ controls) + D12 @ controls


class _Probe(NamedTuple):
    """What the controls do to z at complex frequencies in the right half plane.

    Every reduction keeps it: the new controls follow from the old ones, and z from the new.
    """

    frequencies: Gains  # (points,)
    gain: Gains  # (points, nz, nu)
    unit: Gains  # (points, nu, nu), each control its own

    @classmethod
    def of(cls, A: Matrix, B2: Matrix, C: Matrix, D12: Matrix) -> _Probe:
        """Take frequencies all over those of the plant, away from both axes."""
        rates = np.abs(np.linalg.eigvals(A))
        fastest = float(rates.max(initial=0.0)) or 1.0
        slowest = float(rates[rates > _POLICY.unseen * fastest].min(initial=fastest))
        size = np.geomspace(slowest / _POLICY.beyond, fastest * _POLICY.beyond, _POLICY.points)
        points = size * (0.6 + 0.8j)
        unit = np.broadcast_to(
            np.eye(B2.shape[1], dtype=complex), (len(points), *[B2.shape[1]] * 2)
        )
        return cls(points, C @ _states(points, A, B2 @ unit) + D12, unit)

    def is_kept_by(self, gain: Gains) -> bool:
        """Tell whether a gain from the same controls to the same z is this one."""
        size = np.linalg.norm(self.gain, axis=1, keepdims=True)
        unit = np.where(size > 0, size, 1.0)
        change = (gain - self.gain) / unit @ np.linalg.pinv(self.gain / unit, _POLICY.unseen)
        return bool(np.linalg.norm(change, axis=(1, 2)).max() <= _POLICY.changed)


def _states(points: Gains, A: Matrix, into: Gains) -> Gains:
    """Return (s I - A)^-1 `into` at all points s."""
    return np.linalg.solve(points[:, None, None] * np.eye(len(A)) - A, into)
