"""The tightest bound that can be proven for a loop, at the least expense."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal

from robustpolish.deadline import look_at_the_clock
from robustpolish.synthesis.certificate.long_arithmetic import precise_peak
from robustpolish.synthesis.certificate.loop_balls import (
    BITS,
    LoopBalls,
    angle,
    cayley,
    rate,
    rounding_level,
)
from robustpolish.synthesis.certificate.norm_proof import (
    SLACK,
    NormProof,
    Proven,
    prove_h2,
    prove_hinf,
    prove_stability,
    slacks,
)

TIGHT = 1e-3
"""How far above the computed norm, relative, the proven bound of a valid certificate may lie."""
_MOST_BITS = 1920
# The square of the bits times the third power of the states, which sets the time of a precise
# proof: some seconds for 24 states with all the bits, 40 states with 480, or 100 with 240.
_MOST_WORK = 240**2 * 100**3

Enclose = Callable[[int], LoopBalls]


def tightest_proof(
    enclose: Enclose,
    norm: Literal["hinf", "h2"],
    achieved: float,
    frequency: float | None,
    claimed: float | None,
    step: float | None,
) -> Proven:
    """Prove the smallest bound that can be proven; stability alone if no bound can.

    P is sought in doubles first. Where that proves no bound near the norm, the H-infinity norm is
    computed once more without rounding the loop, and P is sought with more and more bits.

    Parameters
    ----------
    enclose : callable
        Returns the loop, enclosed with a number of bits.
    norm : {"hinf", "h2"}
    achieved : float
        The norm that was computed.
    frequency : float or None
        Where it peaks, in rad/s.
    claimed : float or None
        A bound that would do as well.
    step : float or None
        Sampling time; None for a continuous-time loop.
    """

    def flow(bits: int) -> LoopBalls:
        return enclose(bits) if step is None else cayley(enclose(bits), bits)

    try:
        loop = flow(BITS)
    except ZeroDivisionError:  # a pole at -1
        return Proven(None, achieved, frequency)
    states, discrete = loop.A.nrows(), step is not None
    precisions = list(_precisions(states))
    if norm == "h2":
        # Where nothing comes through, both norms vanish; a Gramian would leave a little.
        found = prove_hinf(loop, 0.0) if achieved == 0 else None
        found = found or _first(prove_h2(enclose(BITS), discrete, slack) for slack in SLACK)
        if found is None or found.bound > achieved * (1 + TIGHT):
            found = _first(prove_h2(enclose(b), discrete, bits=b) for b in precisions) or found
    else:
        tried = slacks(loop)
        found = _first(prove_hinf(loop, achieved * (1 + slack), slack) for slack in tried)
        if found is None and precisions:
            gain, where = precise_peak(loop, angle(frequency or 0.0, step))
            if gain > achieved:
                achieved, frequency = gain, rate(where, step)
            bound = achieved * (1 + SLACK[-1])
            found = _first(prove_hinf(flow(bits), bound, bits=bits) for bits in precisions)
        found = found or _first(_looser(loop, achieved, claimed))
    if found is None:
        found = prove_stability(loop) or _first(prove_stability(flow(b), b) for b in precisions)
    return Proven(found, achieved, frequency)


def _first(proofs: Iterable[NormProof | None]) -> NormProof | None:
    for proof in proofs:
        if proof is not None:
            return proof
        look_at_the_clock()
    return None


def _precisions(states: int) -> Iterator[int]:
    """Yield the numbers of bits that are worth a trial, each twice the one before."""
    bits = BITS
    while bits <= _MOST_BITS and bits**2 * states**3 <= _MOST_WORK:
        yield bits
        bits *= 2


def _looser(loop: LoopBalls, achieved: float, claimed: float | None) -> Iterator[NormProof | None]:
    """Try the bound that was claimed, and those below which doubles see nothing but rounding."""
    if claimed is not None and claimed > achieved * (1 + SLACK[-1]):
        yield prove_hinf(loop, claimed, min(0.1, claimed / achieved - 1) if achieved else 0.1)
    level = rounding_level(loop)
    if achieved <= level:
        for factor in (1.0, 1e3):
            yield prove_hinf(loop, level * factor, 0.1)
