"""The numbers that steer the search for an experiment, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.identification.policy import POLICY


@dataclass(frozen=True)
class ExperimentPolicy:
    """What experiments are tried, and when one tells two machines apart.

    Attributes
    ----------
    times : tuple of float
        Amplitudes, as multiples of those of the record: forces that grow with different powers of
        the motion, that saturate or that need a least motion show within a decade and a half.
    samples : int
        Longest experiment; 8000 samples hold some dozen swings of most machines, and all
        experiments together take seconds.
    slow : float
        Swings of the slowest mode within one to and fro of a slow one: fewer, and inertia
        and damping join in.
    fro : float
        Turns of a slow to and fro: one to leave the start behind, one and a half to see both ways.
    swings : float
        Of the slowest mode that a free decay and a sweep have time for.
    below, above : float
        Where a sweep begins and ends, as multiples of the lowest and of the highest frequency.
    nyquist : float
        Share of the sampling rate above which nothing is excited: ten samples per turn.
    reach : float
        Times its largest value in the record that an output may reach: ten for the largest
        amplitude, and a little for what a resonance adds. A machine has stops.
    repeats : float
        Share of the difference that may come from a start which errs by `start` of the amplitude;
        beyond, an experiment tells nothing because nobody could repeat it.
    start : float
        See `repeats`; a hundredth of a per cent of the motion is a good sensor's noise.
    rounds, stretches : int
        Steps that the numbers of the second machine may take towards the first on each stretch,
        and how many stretches there are, each twice as long as the one before: over the whole of
        thirty swings a stiffness that is 2 % off is a turn off.
    settled : float
        Share of the sum of squares that a step has to come below to be followed by another.
    step : float
        Change of a number for a derivative, as a share of it, where its error is not known.
    widest : float
        Share by which such a step may move a number: beyond, nothing is linear in it.
    sure : float
        Times the noise that the difference should be for an experiment to be recommended at an
        amplitude; larger amplitudes cost wear, and are proposed only where smaller ones fall short.
    """

    times: tuple[float, ...] = (0.3, 1.0, 3.0, 10.0)
    samples: int = 8000
    slow: float = 20.0
    fro: float = 2.5
    swings: float = 30.0
    below: float = 0.3
    above: float = 2.0
    nyquist: float = 0.1
    reach: float = 12.0
    repeats: float = 0.3
    start: float = 1e-4
    rounds: int = 3
    stretches: int = 5
    settled: float = 0.97
    step: float = 0.01
    widest: float = 0.1
    sure: float = 3.0

    @property
    def clear(self) -> float:
        """Times the noise from which the wrong machine errs visibly more than the right one.

        Its error is noise and difference together, and a diagnosis calls a fall by `visible_fall`
        visible.
        """
        return float(np.sqrt(1 / (1 - POLICY.visible_fall) ** 2 - 1))


EXPERIMENTS = ExperimentPolicy()
"""What `tell_apart` goes by."""
