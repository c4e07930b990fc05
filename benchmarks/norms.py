"""Time norms of random systems against SLICOT's routines, as ratios within one run.

Run with ``python benchmarks/norms.py``, on one thread (``OMP_NUM_THREADS=1``). Times are of the
processor, the least of several calls. The systems are dense, with two inputs and two outputs and
poles that come as near to the axis as a twentieth of their spread. AB13DD searches for the
H-infinity norm to 1e-6 and proves nothing; "proven" is a bracket of 1e-9 (about 1e-8 for 400
states). The last column is the larger relative difference between theirs and ours.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import control
import numpy as np
from slycot import ab13bd, ab13dd

import robustpolish as rp

STATES = (4, 12, 24, 40, 60, 80, 120, 200, 300, 400)
HEAD = (
    "| states | AB13DD [ms] | exact=False | ratio | proven | ratio | AB13BD [ms] | H2 | ratio "
    "| difference |"
)


def system(states: int) -> control.StateSpace:
    """Return a random stable system."""
    rng = np.random.default_rng(states)
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + 0.05 * np.sqrt(states)) * np.eye(states)
    B, C = rng.standard_normal((states, 2)), rng.standard_normal((2, states))
    return control.StateSpace(A, B, C, np.zeros((2, 2)))


def milliseconds(call: Callable[[], object], repeats: int) -> float:
    """Return the least time of the processor that a call takes, after one that warms up."""
    call()
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return 1e3 * best


def slicot_hinf(G: control.StateSpace) -> float:
    """Return the H-infinity norm by AB13DD."""
    n, m, p = G.nstates, G.ninputs, G.noutputs
    return ab13dd("C", "I", "N", "Z", n, m, p, G.A, np.eye(n), G.B, G.C, G.D, 1e-6)[0]


def slicot_h2(G: control.StateSpace) -> float:
    """Return the H2 norm by AB13BD."""
    return ab13bd("C", "H", G.nstates, G.ninputs, G.noutputs, G.A, G.B, G.C, G.D)


def row(states: int) -> str:
    """Time all norms of one system."""
    G, repeats = system(states), 20 if states <= 60 else 2
    theirs = milliseconds(lambda: slicot_hinf(G), repeats)
    theirs_h2 = milliseconds(lambda: slicot_h2(G), repeats)
    quick = milliseconds(lambda: rp.hinf_norm(G, exact=False), repeats)
    proven = milliseconds(lambda: rp.hinf_norm(G), repeats)
    h2 = milliseconds(lambda: rp.h2_norm(G), repeats)
    away = abs(float(rp.hinf_norm(G)) / slicot_hinf(G) - 1)
    away = max(away, abs(float(rp.h2_norm(G)) / slicot_h2(G) - 1))
    cells = [
        f"{states}", f"{theirs:.2f}", f"{quick:.2f}", f"{quick / theirs:.1f}",
        f"{proven:.2f}", f"{proven / theirs:.1f}",
        f"{theirs_h2:.2f}", f"{h2:.2f}", f"{h2 / theirs_h2:.1f}", f"{away:.0e}",
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    print(HEAD)
    print("|" + "---:|" * HEAD.count(" | ") + "---:|")
    for states in STATES:
        print(row(states), flush=True)


if __name__ == "__main__":
    main()
