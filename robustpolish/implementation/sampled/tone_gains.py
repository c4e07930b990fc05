"""The gain of a sampled loop for disturbances of one frequency at a time."""

from __future__ import annotations

import control
import numpy as np
import xarray as xr
from scipy import linalg

from robustpolish.arrays import AnyMatrix, Vector
from robustpolish.implementation.sampled.loop_delays import loop_delay_taken_out
from robustpolish.implementation.sampled.period_map import period_map
from robustpolish.implementation.sampled.scaled_map import ScaledMap, scaled
from robustpolish.models import GeneralizedPlant

_POINTS = 120
_DECADES = 4.0


def tone_gains(
    plant: GeneralizedPlant, controller: control.StateSpace, delay: float
) -> xr.DataArray:
    """Return the largest RMS of z for a sinusoidal w of RMS one, over frequency.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter; the sampled loop is stable.
    controller : control.StateSpace
        Discrete.
    delay : float
        In s.

    Returns
    -------
    xarray.DataArray
        Over `frequency` in Hz, up to half the sample rate. z holds other frequencies besides,
        which count too.
    """
    period = float(controller.dt)
    plant, own = loop_delay_taken_out(plant)
    loop = scaled(period_map(plant, controller, period, delay + own))
    half = 0.5 / period
    poles = np.abs(np.angle(np.linalg.eigvals(loop.transition()))) / (2 * np.pi * period)
    grid = half * np.logspace(-_DECADES, 0, _POINTS)
    hertz = np.unique(np.concatenate([grid, poles[poles > grid[0]]]))
    values = [_gain(loop, 2 * np.pi * f) for f in hertz]
    return xr.DataArray(
        np.array(values),
        dims="frequency",
        coords={"frequency": ("frequency", hertz, {"units": "Hz"})},
    )


def _gain(loop: ScaledMap, omega: float) -> float:
    n, m = loop.phases[0].B.shape
    through: AnyMatrix = np.eye(n + m, dtype=complex)
    energy: AnyMatrix = np.zeros((n + m, n + m), dtype=complex)
    for phase in loop.phases:
        E = np.zeros((n + m, n + m), dtype=complex)
        E[:n, :n], E[:n, n:], E[n:, n:] = phase.A, phase.B, 1j * omega * np.eye(m)
        out = np.hstack([phase.C, phase.D])
        step, own = _flow(E, out, phase.length)
        energy = energy + through.conj().T @ own @ through
        through = step @ through
    turn = np.exp(1j * omega * loop.map.period)
    L, N, M = loop.L, loop.N, loop.M
    back = turn * np.eye(len(N)) - N - M @ through[:n, :n] @ L
    start: AnyMatrix = np.vstack([L @ np.linalg.solve(back, M @ through[:n, n:]), np.eye(m)])
    power: Vector = np.linalg.eigvalsh(start.conj().T @ energy @ start) / loop.map.period
    return float(np.sqrt(max(power[-1], 0.0)))


def _flow(E: AnyMatrix, out: AnyMatrix, length: float) -> tuple[AnyMatrix, AnyMatrix]:
    """Return the exponential and the energy of the output, in steps too short to overflow."""
    n = len(E)
    times = max(0, int(np.ceil(np.log2(max(np.linalg.norm(E, 1) * length, 1e-300)))))
    weight = out.conj().T @ out
    block = np.block([[-E.conj().T, weight], [np.zeros((n, n)), E]]) * (length / 2**times)
    found = np.asarray(linalg.expm(block))
    step = found[n:, n:]
    energy = step.conj().T @ found[:n, n:]
    for _ in range(times):
        energy = energy + step.conj().T @ energy @ step
        step = step @ step
    return step, energy
