"""Controllers for plants of moderate size, each against the nearest routine at hand.

State feedback goes against the textbook inequality in cvxpy, output feedback against
``control.hinfsyn`` and ``control.h2syn`` (SLICOT's SB10AD and SB10HD), static output feedback
against no routine at all: none of those installed has one. Every norm is that of the closed loop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Literal

import control
import cvxpy as cp
import numpy as np

import robustpolish as rp
from benchmarks.row import Row, limited, once
from tests.synthesis.hard_plants import flexible_structure

SECONDS = 40.0

_PROOFS = (
    "ours tries several engines, reduces the gain's size where the norm allows it, and proves the "
    "norm of the closed loop; the peer is one solve"
)
_LADDER = (
    "ours climbs a ladder of regularised plants, compares candidates and proves the norm of the "
    "loop; the peer is one call, whose answer nobody has checked"
)
_NONE = "no peer: HIFOO and hinfstruct need MATLAB"


def norm_of(plant: rp.GeneralizedPlant, controller: control.StateSpace, norm: str) -> float:
    """Return the norm of a closed loop, infinite if it is unstable."""
    loop = plant.closed_loop(controller)
    return (rp.hinf_norm(loop) if norm == "hinf" else rp.h2_norm(loop)).value


def plain_state_feedback(plant: rp.GeneralizedPlant) -> np.ndarray:
    """Solve the textbook inequality for u = F x with cvxpy and Clarabel."""
    n, nu = plant.nx, plant.nu
    Y, M, gamma = cp.Variable((n, n), symmetric=True), cp.Variable((nu, n)), cp.Variable()
    A, C = plant.A @ Y + plant.B2 @ M, plant.C1 @ Y + plant.D12 @ M
    whole = cp.bmat(
        [
            [A + A.T, plant.B1, C.T],
            [plant.B1.T, -gamma * np.eye(plant.nw), plant.D11.T],
            [C, plant.D11, -gamma * np.eye(plant.nz)],
        ]
    )
    constraints = [(whole + whole.T) / 2 << 0, Y >> 1e-9 * np.eye(n)]
    cp.Problem(cp.Minimize(gamma), constraints).solve(cp.CLARABEL)
    return np.linalg.solve(np.asarray(Y.value).T, np.asarray(M.value).T).T


def _ours(plant: rp.GeneralizedPlant, norm: Literal["hinf", "h2"]) -> float:
    return norm_of(plant, rp.output_feedback(plant, norm).controller, norm)


def _hinfsyn(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, control.hinfsyn(plant.system, plant.ny, plant.nu)[0], "hinf")


def _h2syn(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, control.h2syn(plant.system, plant.ny, plant.nu), "h2")


def _plain(plant: rp.GeneralizedPlant) -> float:
    return rp.hinf_norm(plant.state_feedback_loop(plain_state_feedback(plant))).value


def _state_feedback(plant: rp.GeneralizedPlant) -> float:
    return rp.state_feedback(plant).certificate.achieved


LINES: tuple[tuple[str, str, Callable[..., float], str, Callable[..., float], str], ...] = (
    ("state feedback hinf", "rp.state_feedback", _state_feedback,
     "plain inequality, cvxpy", _plain, _PROOFS),
    ("output feedback hinf", "rp.output_feedback('hinf')", partial(_ours, norm="hinf"),
     "control.hinfsyn", _hinfsyn, _LADDER),
    ("output feedback h2", "rp.output_feedback('h2')", partial(_ours, norm="h2"),
     "control.h2syn", _h2syn, _LADDER),
)  # fmt: skip


def _against(plant: rp.GeneralizedPlant) -> Iterator[Row]:
    for what, ours, call, peer, other, reason in LINES:
        task = f"{what}, flexible structure of {plant.nx} states"
        spent, found = once(call, plant)
        theirs, answer = limited(SECONDS, other, plant)
        said = f"norm {found:.4g}"
        if theirs is None:
            reason = f"the peer: {answer}"
        else:
            said += f", peer {answer:.4g}"
        yield Row("synthesis", task, ours, spent, peer, theirs, said, reason=reason)


def rows(quick: bool) -> Iterator[Row]:
    """Time a controller of every kind; what is compiled at first use is left out."""
    rp.output_feedback(flexible_structure(2))
    rp.state_feedback(flexible_structure(2))
    for modes in (3,) if quick else (3, 6, 12):
        plant = flexible_structure(modes)
        yield from _against(plant)
        if modes > 6:
            continue
        spent, design = once(rp.static_output_feedback, plant)
        said = f"norm {norm_of(plant, design.controller, 'hinf'):.4g}; {_NONE}"
        task = f"static output feedback, flexible structure of {plant.nx} states"
        yield Row("synthesis", task, "rp.static_output_feedback", spent, answers=said)
