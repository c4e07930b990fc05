"""Loops with known margins, and the closed loop with a delay approximated to high order."""

from functools import cache

import control
import numpy as np

import robustpolish as rp

s = control.tf("s")
TEXTBOOK = 1 / (s * (s + 1) * (0.5 * s + 1))
"""Gain margin 3 at sqrt(2) rad/s."""

CONDITIONAL = 80 * (s + 1) ** 2 / (s**3 * (0.02 * s + 1) ** 2)
"""Stable, but not with less gain."""

SATELLITE = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], 0)
"""The spinning satellite with a = 10, Skogestad and Postlethwaite, section 3.7.1."""


@cache
def satellite():
    """Return the analysis of the satellite with a gain of one in both loops."""
    return rp.loop_analysis(SATELLITE, -np.eye(2))


@cache
def textbook(gain=-1):
    """Return the analysis of the textbook's loop with a gain."""
    return rp.loop_analysis(TEXTBOOK, gain)


def delayed_poles(system, gain, delays, order=8):
    """Return the poles of u = gain y where control i comes late by delays[i], by Padé."""
    lags = [
        control.ss(control.tf(*control.pade(delay, order))) if delay else control.ss([], [], [], 1)
        for delay in delays
    ]
    late = control.append(*lags)
    return control.feedback(control.ss(system) * late, control.ss([], [], [], gain), 1).poles()


def random_loop(seed, states=5, signals=2):
    """Return a plant with an unstable pole at 0.3 rad/s and its LQG controller."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    A = A - (np.linalg.eigvals(A).real.max() - 0.3) * np.eye(states)
    B, C = rng.standard_normal((states, signals)), rng.standard_normal((signals, states))
    gain, *_ = control.lqr(A, B, np.eye(states), np.eye(signals))
    observer = control.lqr(A.T, C.T, np.eye(states), np.eye(signals))[0].T
    K = control.ss(A - B @ gain - observer @ C, observer, -gain, 0)
    return control.ss(A, B, C, 0), K
