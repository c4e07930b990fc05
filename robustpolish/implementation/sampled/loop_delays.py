"""Delays of the plant that every signal round a sampled loop meets, taken as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robustpolish.analysis import DelayLine
from robustpolish.arrays import Matrix
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.wiring import Wiring

_SAME = 1e-12
"""Delays that differ by less than this part of one are the same."""


def loop_delay_taken_out(plant: GeneralizedPlant) -> tuple[GeneralizedPlant, float]:
    """Return the plant without what delays all its controls, or all its measurements, alike.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.

    Returns
    -------
    plant : GeneralizedPlant
        What is left of its delays are lines as before.
    seconds : float
        The delay that was taken out, for the sampled loop to have between sample and control.

    Notes
    -----
    A hold that is read late by a delay is a hold that acts late. A sampler that reads late by a
    delay samples at earlier instants, and a loop whose clock is shifted has the same poles and
    norms. An output that shows nothing but a control, and a disturbance that is nothing but noise
    of the readings, are shifted in time themselves, which changes no energy.
    """
    wiring, total = plant.wiring, 0.0
    for side in ("control", "measurement"):
        chains = [_chain(wiring, side, i) for i in range(_count(wiring, side))]
        delays = [sum(wiring.lines[i].seconds for i in chain) for chain in chains]
        common = min(delays, default=0.0)
        if common <= 0:
            continue
        last = {chain[-1]: delay for chain, delay in zip(chains, delays, strict=True)}
        # Of each chain that is longer than the others one line stays, with what it has more.
        kept = {i: delay - common for i, delay in last.items() if delay - common > _SAME * common}
        for i, rest in kept.items():
            wiring = replace(wiring, lines=_with(wiring.lines, i, rest))
        shut = sorted({i for chain in chains for i in chain} - kept.keys(), reverse=True)
        for i in shut:
            wiring = _shorted(wiring, i)
        total += common
    if not total:
        return plant, 0.0
    delays_left: dict[str, float] = {}
    for line in wiring.lines:
        delays_left[line.name] = delays_left.get(line.name, 0.0) + line.seconds
    return plant.rewired(wiring, delays=delays_left), total


def _count(wiring: Wiring, side: str) -> int:
    return wiring.nu if side == "control" else wiring.ny


def _with(lines: tuple[DelayLine, ...], at: int, seconds: float) -> tuple[DelayLine, ...]:
    return (*lines[:at], replace(lines[at], seconds=seconds), *lines[at + 1 :])


def _chain(wiring: Wiring, side: str, signal: int) -> list[int]:
    """Return the lines that a signal runs through with nothing else between, from outside in."""
    _, B, C, D = wiring.arrays()
    k = len(wiring.lines)
    w, z = wiring.nw - k, wiring.nz - k
    if side == "measurement":  # the same question about the transposed system
        B, C, D = C.T, B.T, D.T
        w, z = z, w
    at, found = w + k + signal, []
    while True:
        line = _only_line(B, C, D, at, w, z, k)
        if line is None or line in found:
            return found
        found.append(line)
        at = w + line


def _only_line(B: Matrix, C: Matrix, D: Matrix, at: int, w: int, z: int, k: int) -> int | None:
    """Return the line that an input enters alone; None if it goes anywhere else."""
    enters = [int(i) for i in np.flatnonzero(D[:, at]) if z <= i < z + k]
    if B[:, at].any() or len(enters) != 1 or D[enters[0], at] != 1.0:
        return None
    port = enters[0]
    if C[port].any() or np.flatnonzero(D[port]).tolist() != [at]:
        return None
    for row in np.flatnonzero(D[:, at]):
        # An output beside it may show signals of the outside, and no others.
        if row == port:
            continue
        others = np.flatnonzero(D[row])
        if row >= z or C[row].any() or (others < w + k).any():
            return None
    return port - z


def _shorted(wiring: Wiring, line: int) -> Wiring:
    """Return the wiring with one of its lines without a delay."""
    A, B, C, D = wiring.arrays()
    k = len(wiring.lines)
    i, o = wiring.nw - k + line, wiring.nz - k + line
    enter, out = B[:, [i]], D[:, [i]]
    A, B = A + enter @ C[[o]], B + enter @ D[[o]]
    C, D = C + out @ C[[o]], D + out @ D[[o]]
    system = named_system(
        (A, np.delete(B, i, 1), np.delete(C, o, 0), np.delete(np.delete(D, i, 1), o, 0)),
        wiring.dt,
        np.delete(np.array(wiring.system.input_labels, dtype=object), i).tolist(),
        np.delete(np.array(wiring.system.output_labels, dtype=object), o).tolist(),
        wiring.states,
    )
    lines = (*wiring.lines[:line], *wiring.lines[line + 1 :])
    return Wiring(system, wiring.measurements, wiring.controls, lines)
