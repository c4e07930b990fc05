"""How the time of a full-order H-infinity controller grows with the number of states.

The plants are flexible structures: lightly damped modes over two decades, two controls and two
measurements. Peers run in a process of their own and are ended after a while; beyond the first
size that a peer does not answer it is not asked again.
"""

from __future__ import annotations

from collections.abc import Iterator

import control

import robustpolish as rp
from benchmarks.plain_lmi import plain_lmi_cvxpy
from benchmarks.row import Row, limited, once
from benchmarks.synthesis import norm_of
from tests.synthesis.hard_plants import flexible_structure

STATES = (10, 20, 30, 60, 120, 250, 300)
QUICK = (10, 20)
# What is asked for, in seconds.
ASKED = {120: 5.0, 250: 60.0, 300: 60.0}
PATIENCE = 40.0
# Ours ends by its work; the safety net of seconds is for users, on a machine that is not shared.
NO_LIMIT = 3600.0

_REASON = (
    "ours climbs a ladder of regularised plants, compares candidates and proves the norm; the peer "
    "is one call, whose answer nobody has checked"
)


def _hinfsyn(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, control.hinfsyn(plant.system, plant.ny, plant.nu)[0], "hinf")


def _inequalities(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, plain_lmi_cvxpy(plant)[0], "hinf")


PEERS = {"control.hinfsyn": _hinfsyn, "plain inequalities, cvxpy": _inequalities}


def rows(quick: bool) -> Iterator[Row]:
    """Time ours at every size, and the peers as far as they get."""
    rp.output_feedback(flexible_structure(2))
    silent: dict[str, str] = {}
    for states in QUICK if quick else STATES:
        plant = flexible_structure(states // 2)
        ours, design = once(rp.output_feedback, plant, time_limit=NO_LIMIT)
        for peer, call in PEERS.items():
            spent, found = None, silent.get(peer)
            if found is None:
                spent, found = limited(PATIENCE, call, plant)
            said, reason = f"norm {design.certificate.achieved:.4g}", _REASON
            if spent is None:
                reason = f"the peer: {silent.setdefault(peer, f'{found}, at {states} states')}"
            else:
                said += f", peer {found:.4g}"
            yield Row(
                "growth", f"output feedback hinf, {states} states", "rp.output_feedback", ours,
                peer, spent, said, ASKED.get(states), seconds=True, reason=reason,
            )  # fmt: skip
