"""Whether the error of a free run can judge a model at all.

Backlash and stops in lightly damped systems are chaotic: two runs of the true model from nearly
the same start part company, while its parameters may be right to a fraction of a percent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.compare.comparison import Reproducibility
from robustpolish.identification.observer.free_run import EstimatedRun, FreeRun
from robustpolish.identification.observer.scales import white_noise

Array = NDArray[np.float64]

_TINY = 1e-6
_DIRECTIONS = 3
# Share of an output's size below which a change matters to nobody, however quiet the sensor.
_VISIBLE = 1e-3


def reproducibility(
    run: FreeRun, start: EstimatedRun, span: float | None, method: str = "free run"
) -> Reproducibility:
    """Change the start by a millionth and see whether the runs part by more than the noise.

    Parameters
    ----------
    run : FreeRun
    start : EstimatedRun
        Estimated start of the record and the outputs simulated from there on.
    span : float or None
        Length of the windows or the horizon in s: only so long do runs have to agree.
    method : str, optional
        How the comparison runs; decides on the advice.

    Returns
    -------
    Reproducibility
    """
    diverged = _divergence(start.outputs[0 if method != "prediction" else -1 :])
    if diverged is not None:
        after = diverged * run.step
        return Reproducibility(
            False,
            np.inf,
            after,
            f"the free run diverges after {after:.4g} s: its error judges nothing; "
            "compare in windows, or check the signs of the model's damping and stiffness",
        )
    if not run.start_size:
        return Reproducibility(True, 0.0, None, "")
    length = run.samples if span is None else min(run.samples, max(round(span / run.step), 2))
    size = np.std(run.measured, axis=0)
    size = np.where(size > 0, size, 1.0)
    change = _largest_change(run, start.state, length, size)
    noise = _noise(run, size)
    beyond = np.flatnonzero(~(change <= max(noise, _VISIBLE)))
    growth = float(np.max(change) / _TINY) if np.isfinite(change).all() else np.inf
    if not beyond.size:
        return Reproducibility(True, growth, None, _drift_note(run, span))
    after = float(beyond[0] * run.step)
    advice = (
        f"compare in windows shorter than {after:.3g} s" if method != "prediction" else "look ahead"
    )
    return Reproducibility(
        False,
        growth,
        after,
        f"the free run is not reproducible: a change of the start by a millionth grows beyond the "
        f"noise within {after:.4g} s, so that its error judges nothing; {advice}",
    )


def _noise(run: FreeRun, size: Array) -> float:
    """Return the noise of the quietest output, as a share of its size."""
    if run.samples < 64:  # too few for a spectrum
        return 0.0
    return min(white_noise(y, run.step) / s for y, s in zip(run.measured.T, size, strict=True))


def _divergence(outputs: Array) -> int | None:
    bad = np.flatnonzero(~np.isfinite(outputs).all(axis=1))
    return int(bad[0]) if bad.size else None


def _largest_change(run: FreeRun, state: Array, length: int, size: Array) -> Array:
    """Largest change of an output at each sample, as a share of its size, over a few directions."""
    base, states, internal = run.states(state, 0, length)
    every = np.hstack([states, internal])
    typical = np.std(every, axis=0)
    typical = np.maximum(typical, 1e-3 * np.max(np.abs(every), axis=0))
    typical[run.system.states :] = 0.0  # the memory of an effect follows from the motion
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (_DIRECTIONS, state.size))
    change = np.zeros(length)
    for sign in signs:
        other = run.run(state + _TINY * sign * typical, 0, length)
        with np.errstate(invalid="ignore", over="ignore"):
            change = np.maximum(change, np.max(np.abs(other - base) / size, axis=1))
    return change


def _drift_note(run: FreeRun, span: float | None) -> str:
    """Warn of a plant that integrates, whose free run sums up every small error."""
    if span is not None or not run.system.states:
        return ""
    poles = np.linalg.eigvals(run.system.A)
    fastest = float(np.max(np.abs(poles)))
    record = run.samples * run.step
    slow = np.abs(poles) * record < 1e-3
    if slow.any() and fastest > 0:
        return "the model integrates: a free run sums up small errors; windows judge it better"
    return ""
