"""How fast a loop has to be sampled, and how slowly it may be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyVector
from robustpolish.loops.bandwidth import LoopBandwidth
from robustpolish.loops.loop import Loop
from robustpolish.loops.margins.one_loop import LoopMargins
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.simulation.linear_response import first_order_hold

# The search goes from this many samples per time constant of the fastest pole down by this ratio.
_MOST_SAMPLES = 300.0
_RATIO = 1.08
_MOST_STEPS = 600
_BISECTIONS = 30
# An eigenvalue this far outside the unit circle is rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class SampleRate:
    """Sampling rates in Hz that a continuous loop needs, by rule and by exact stability.

    Attributes
    ----------
    needed_hz : float
        The largest of `rules`.
    limited_by : str
        The rule that asks for most.
    rules : mapping of str to float
        Rate by rule; their numbers and sources are those of :class:`LoopRequirements`.
    lowest_stable_hz : float
        Above this rate every sampled loop is stable: the plant with a zero-order hold, exactly,
        the controller by Tustin's rule, and the delay of computation in whole samples; infinite
        if none is stable that was tried, 0 if all are.
    computation_samples : int
        That delay.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = rp.loop_analysis(control.tf([1], [1, 0]), -10).sample_rate
    >>> round(lag.needed_hz / (10 / 6.283185), 1), lag.limited_by
    (36.0, 'phase at the gain crossover')
    >>> round(lag.lowest_stable_hz, 3)  # with a sample of delay 1/T = K
    10.0
    """

    needed_hz: float
    limited_by: str
    rules: dict[str, float]
    lowest_stable_hz: float
    computation_samples: int


def sample_rate(
    loop: Loop,
    margins: Sequence[LoopMargins],
    delay_s: float,
    widths: Sequence[LoopBandwidth],
    asked: LoopRequirements,
) -> SampleRate:
    """Return the rates that a stable continuous loop needs.

    Parameters
    ----------
    loop : Loop
    margins : sequence of LoopMargins
    delay_s : float
        The smallest delay margin.
    widths : sequence of LoopBandwidth
    asked : LoopRequirements
    """
    late = asked.sampling_delay_samples
    crossover = max((c.frequency_hz for m in margins for c in m.gain_crossovers), default=0.0)
    singles = [row.complementary_hz for row in widths if row.name != "all"]
    width = max((hertz for hertz in singles if math.isfinite(hertz)), default=0.0)
    fastest = _fastest(loop)
    if delay_s == 0:
        for_delay = math.inf
    else:
        for_delay = late / (asked.delay_share * delay_s) if math.isfinite(delay_s) else 0.0
    rules = {
        "phase at the gain crossover": late * 360 * crossover / asked.phase_loss_deg,
        "delay margin": for_delay,
        "bandwidth": asked.samples_per_bandwidth * width,
        "fastest closed-loop pole": asked.samples_per_rise * fastest / 2.2,
    }
    limit = max(rules, key=lambda rule: rules[rule])
    samples = math.ceil(asked.computation_samples)
    return SampleRate(rules[limit], limit, rules, lowest_stable_rate(loop, samples), samples)


def _fastest(loop: Loop) -> float:
    """Return the size of the fastest pole; those of Pade models are none of the loop."""
    sizes = np.abs(loop.rates)
    if loop.delayed is not None:
        # Beyond a phase of its order in rad, such a model is no model of its delay.
        lines = loop.delayed.plant.lines
        sizes = sizes[sizes <= min(line.order / line.seconds for line in lines)]
        sizes = np.append(sizes, np.abs(np.linalg.eigvals(loop.controller_matrices[0])))
    return float(sizes.max(initial=0.0))


def lowest_stable_rate(loop: Loop, computation_samples: int) -> float:
    """Return the rate in Hz above which every sampled loop is stable."""
    rates = np.abs(loop.rates)
    rates = rates[rates > 0]
    if not rates.size:
        return 0.0
    period = 1 / (_MOST_SAMPLES * float(rates.max()))
    if not _stable(loop, period, computation_samples):
        return math.inf
    slowest = 30 / float(rates.min())
    for _ in range(_MOST_STEPS):
        if period > slowest:
            return 0.0
        if not _stable(loop, period * _RATIO, computation_samples):
            break
        period *= _RATIO
    good, bad = period, period * _RATIO
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if _stable(loop, middle, computation_samples) else (good, middle)
    return 1 / good


def _stable(loop: Loop, period: float, computation_samples: int) -> bool:
    return bool(np.abs(sampled_poles(loop, period, computation_samples)).max() < 1 + _ROUNDING)


def sampled_poles(loop: Loop, period: float, computation_samples: int) -> AnyVector:
    """Return the poles of the loop sampled with a period in s.

    Parameters
    ----------
    loop : Loop
        Continuous.
    period : float
    computation_samples : int
        Whole samples by which the controls come late.

    Returns
    -------
    ndarray of complex
    """
    A, B, C, D = loop.plant_matrices
    Ak, Bk, Ck, Dk = loop.controller_matrices
    Ad, now, later = first_order_hold(A, B, period)
    Bd = now + later
    n, k, m = A.shape[0], Ak.shape[0], B.shape[1]
    inner = np.linalg.inv(np.eye(k) - Ak * (period / 2))
    # Tustin: z = (1 + sT/2)/(1 - sT/2); the state is that of the trapezoidal rule.
    Akd = inner @ (np.eye(k) + Ak * (period / 2))
    Bkd = inner @ Bk * period
    Ckd = Ck @ inner
    Dkd = Dk + Ck @ inner @ Bk * (period / 2)
    late = computation_samples
    if late == 0:
        u = np.linalg.solve(np.eye(m) - Dkd @ D, np.hstack([Dkd @ C, Ckd]))
        y = D @ u
        y[:, :n] += C
        rows = np.vstack([Bd @ u, Bkd @ y])
        rows[:n, :n] += Ad
        rows[n:, n:] += Akd
        return np.linalg.eigvals(rows)
    # x, controller, then the controls that wait, the oldest first.
    size = n + k + late * m
    rows = np.zeros((size, size))
    oldest = slice(n + k, n + k + m)
    rows[:n, :n], rows[:n, oldest] = Ad, Bd
    rows[n : n + k, :n], rows[n : n + k, n : n + k] = Bkd @ C, Akd
    rows[n : n + k, oldest] = Bkd @ D
    for i in range(late - 1):
        row = n + k + i * m
        rows[row : row + m, row + m : row + 2 * m] = np.eye(m)
    newest = slice(size - m, size)
    rows[newest, :n], rows[newest, n : n + k] = Dkd @ C, Ckd
    rows[newest, oldest] += Dkd @ D
    return np.linalg.eigvals(rows)
