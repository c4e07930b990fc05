"""A look for a smaller witness where branching finds the lowest bound."""

from __future__ import annotations

import math

import numpy as np

from robustpolish.arrays import AnyMatrix, Vector
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.numbers.rays import crossings
from robustpolish.robust.structure import Structure
from robustpolish.robust.witness import Witness, smallest


def nearby(
    loop: LoopModel, numbers: Vector, frequency: float, fixed: tuple[bool, ...]
) -> Witness | None:
    """Return the smallest Delta that a search finds from real numbers and a frequency.

    Parameters
    ----------
    loop : LoopModel
        With real numbers.
    numbers : ndarray
        Of the real blocks.
    frequency : float
        Of the model.
    fixed : tuple of bool
        Blocks that have size 1 whatever the size of the others.

    Returns
    -------
    Witness or None
        None too where rounding sees a pole at the frequency.
    """
    structure = loop.structure
    real = [k for k, block in enumerate(structure.blocks) if block.kind == "real"]
    scale = np.ones(structure.shape[1])
    ends = frequency == 0 or math.isinf(frequency)
    angle = loop.angle(frequency)
    try:
        w = worst_signals(structure, loop.response(angle)[0], numbers)
    except np.linalg.LinAlgError:
        return None
    deltas: list[complex | None] = [None] * len(structure.blocks)
    for k, number in zip(real, numbers, strict=True):
        deltas[k] = complex(number)
    starts = [(w, angle, not ends, tuple(deltas))]
    if len(real) == len(structure.blocks):
        for crossing in crossings(loop, (numbers,)):
            angle, moves = loop.start(crossing.frequency)
            starts.append((crossing.w, angle, moves, crossing.deltas))
    found = [
        smallest(structure, loop.response, w, at, moves, scale, given, fixed)
        for w, at, moves, given in starts
    ]
    return min((one for one in found if one), key=lambda one: one.size, default=None)


def worst_signals(structure: Structure, M: AnyMatrix, numbers: Vector) -> AnyMatrix:
    """Return signals w that are nearly a mode with given real numbers.

    They are those that what else there is amplifies most, or those that are left unchanged most
    nearly if there is nothing else.
    """
    gains = np.zeros(structure.shape[::-1])
    others_w, others_z = [], []
    values = iter(numbers)
    for block, w, z in zip(structure.blocks, structure.outputs, structure.inputs, strict=True):
        if block.kind == "real":
            gains[w, z] = float(next(values)) * np.eye(block.copies)
        else:
            others_w += range(w.start, w.stop)
            others_z += range(z.start, z.stop)
    if not others_w:
        return np.conj(np.linalg.svd(np.eye(len(gains)) - gains @ M)[2][-1])
    # z = M w with w = gains z + v, and v of the other blocks only
    z = np.linalg.solve(np.eye(len(M)) - M @ gains, M[:, others_w])
    v = np.conj(np.linalg.svd(z[others_z])[2][0])
    whole = gains @ (z @ v)
    whole[others_w] += v
    return whole
