"""Norms of random systems against SLICOT's routines.

The systems are dense, with two inputs and two outputs and poles that come as near to the axis as a
twentieth of their spread. AB13DD searches for the H-infinity norm to 1e-6 and proves nothing;
"proven" is a bracket of 1e-9 (about 1e-8 for 400 states).
"""

from __future__ import annotations

from collections.abc import Iterator

import control
import numpy as np
from slycot import ab13bd, ab13dd

import robustpolish as rp
from benchmarks.row import Row, differ, milliseconds
from robustpolish.linear.norms.hinf import EXACT_FIRST

STATES = (4, 12, 24, 40, 60, 80, 120, 200, 300, 400)
QUICK = (4, 12, 24)
# From so many states on the ratio is asked for.
SEARCH, PROOF = (12, 1.5), (24, 5.0)

_SMALL = (
    "some 30 calls of numpy and LAPACK cost the same for any small size: arguments checked, units "
    "scaled exactly, parts told apart"
)
_EXACT = "up to 6 states it is proven in fractions, without rounding; AB13DD proves nothing"
_PROVES = (
    "every frequency is covered and all rounding enclosed in extended precision; "
    "AB13DD proves nothing"
)
_H2 = "the value is bracketed by the residual of the equation, for hidden and slow modes too"


def system(states: int) -> control.StateSpace:
    """Return a random stable system."""
    rng = np.random.default_rng(states)
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + 0.05 * np.sqrt(states)) * np.eye(states)
    B, C = rng.standard_normal((states, 2)), rng.standard_normal((2, states))
    return control.StateSpace(A, B, C, np.zeros((2, 2)))


def slicot_hinf(G: control.StateSpace) -> float:
    """Return the H-infinity norm by AB13DD."""
    n, m, p = G.nstates, G.ninputs, G.noutputs
    return ab13dd("C", "I", "N", "Z", n, m, p, G.A, np.eye(n), G.B, G.C, G.D, 1e-6)[0]


def slicot_h2(G: control.StateSpace) -> float:
    """Return the H2 norm by AB13BD."""
    return ab13bd("C", "H", G.nstates, G.ninputs, G.noutputs, G.A, G.B, G.C, G.D)


def rows(quick: bool) -> Iterator[Row]:
    """Time all norms."""
    for states in QUICK if quick else STATES:
        G, repeats = system(states), 50 if states <= 60 else 3
        theirs = milliseconds(repeats, slicot_hinf, G)
        task = f"H-infinity norm, {states} states"
        for name, exact, (first, ratio), reason in (
            ("rp.hinf_norm(exact=False)", False, SEARCH, _SMALL),
            ("rp.hinf_norm, proven", True, PROOF, _EXACT if states <= EXACT_FIRST else _PROVES),
        ):
            spent = milliseconds(repeats, rp.hinf_norm, G, exact=exact)
            away = differ(rp.hinf_norm(G, exact=exact).value, slicot_hinf(G))
            asked = ratio if states >= first else None
            yield Row("norms", task, name, spent, "AB13DD", theirs, away, asked, reason=reason)
        h2 = milliseconds(repeats, rp.h2_norm, G)
        theirs_h2 = milliseconds(repeats, slicot_h2, G)
        away = differ(rp.h2_norm(G).value, slicot_h2(G))
        task = f"H2 norm, {states} states"
        yield Row("norms", task, "rp.h2_norm", h2, "AB13BD", theirs_h2, away, reason=_H2)
