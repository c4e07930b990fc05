"""How the time of a full-order controller grows with the number of states, and that of its proof.

The plants are flexible structures: lightly damped modes over two decades, two controls and two
measurements. Peers run in a process of their own and are ended after a while; beyond the first
size that a peer does not answer it is not asked again. The last lines certify the loops of the
largest plants with controllers of as many states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal

import control

import robustpolish as rp
from benchmarks.norms import slicot_h2, slicot_hinf
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

_PROVES = (
    "ours connects the loop and proves stability and the bound in ball arithmetic; the peer "
    "computes a norm in doubles and proves nothing"
)
Norm = Literal["hinf", "h2"]
REASONS: dict[Norm, str] = {
    "hinf": "ours climbs a ladder of regularised plants, compares candidates and proves the norm; "
    "the peer is one call, whose answer nobody has checked",
    "h2": "ours proves stability and norm of the loop in ball arithmetic, which takes nearly all "
    "of the time; the peer is one call, whose answer nobody has checked",
}


def _hinfsyn(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, control.hinfsyn(plant.system, plant.ny, plant.nu)[0], "hinf")


def _inequalities(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, plain_lmi_cvxpy(plant)[0], "hinf")


def _h2syn(plant: rp.GeneralizedPlant) -> float:
    return norm_of(plant, control.h2syn(plant.system, plant.ny, plant.nu), "h2")


PEERS: dict[Norm, dict[str, Callable[[rp.GeneralizedPlant], float]]] = {
    "hinf": {"control.hinfsyn": _hinfsyn, "plain inequalities, cvxpy": _inequalities},
    "h2": {"control.h2syn": _h2syn},
}
CHECKS: dict[Norm, tuple[str, Callable[[control.StateSpace], float]]] = {
    "hinf": ("AB13DD", slicot_hinf),
    "h2": ("AB13BD", slicot_h2),
}


def rows(quick: bool) -> Iterator[Row]:
    """Time ours at every size, and the peers as far as they get; then the proofs alone."""
    designs: dict[Norm, rp.results.Design] = {}
    for norm in PEERS:
        rp.output_feedback(flexible_structure(12), norm)  # compiles
        silent: dict[str, str] = {}
        for states in QUICK if quick else STATES:
            plant = flexible_structure(states // 2)
            ours, designs[norm] = once(rp.output_feedback, plant, norm, time_limit=NO_LIMIT)
            for peer in PEERS[norm]:
                yield _against(peer, norm, plant, ours, designs[norm], silent)
    for norm in CHECKS:
        yield certified(norm, designs["h2"])


def _against(
    peer: str,
    norm: Norm,
    plant: rp.GeneralizedPlant,
    ours: float,
    design: rp.results.Design,
    silent: dict[str, str],
) -> Row:
    """Return the line of a design and a peer; `silent` are peers that gave up, and why."""
    spent, found = None, silent.get(peer)
    if found is None:
        spent, found = limited(PATIENCE, PEERS[norm][peer], plant)
    said, reason = f"norm {design.certificate.achieved:.4g}, {above(design)}", REASONS[norm]
    if spent is None:
        reason = f"the peer: {silent.setdefault(peer, f'{found}, at {plant.nx} states')}"
    else:
        said += f"; peer {found:.4g}"
    return Row(
        "growth", f"output feedback {norm}, {plant.nx} states", "rp.output_feedback", ours,
        peer, spent, said, ASKED.get(plant.nx), seconds=True, reason=reason,
    )  # fmt: skip


def above(design: rp.results.Design) -> str:
    """Say how far a norm lies above what no controller falls below, as far as that is known."""
    known, estimate = design.lower_bound, design.details["estimated_infimum"]
    if not (known or estimate):
        return "no lower bound"
    above = design.certificate.achieved / (known or estimate) - 1
    what = "the lower bound" if known else "the infimum as doubles estimate it"
    return f"{max(above, 0.0):.1%} above {what}"


def certified(norm: Norm, design: rp.results.Design) -> Row:
    """Return the line of the certificate of a loop, and of a routine that computes its norm."""
    spent, proof = once(rp.certify, design.plant, design.controller, norm)
    peer, routine = CHECKS[norm]
    theirs, found = limited(PATIENCE, routine, design.closed_loop)
    said = f"{proof.achieved:.6g}, proven below {proof.bound:.6g}" if proof.valid else "not proven"
    reason = f"the peer: {found}" if theirs is None else _PROVES
    said += "" if theirs is None else f"; peer {found:.6g}"
    task = f"certificate {norm}, {proof.poles.size} closed-loop states"
    return Row("growth", task, "rp.certify", spent, peer, theirs, said, reason=reason)
