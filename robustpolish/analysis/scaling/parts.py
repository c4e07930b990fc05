"""A system as a list of parts that share no signal; norms are taken part by part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robustpolish.analysis.scaling.decoupled_blocks import Block, decoupled_blocks
from robustpolish.exact.realisation import Realisation


def parts(model: Realisation) -> list[Realisation]:
    """Split a system into its decoupled blocks."""
    return [part for part, _ in parts_with_indices(model)]


def parts_with_indices(model: Realisation) -> list[tuple[Realisation, tuple[int, ...]]]:
    """Split a system into its decoupled blocks; tell which states each has."""
    blocks = decoupled_blocks(model.A, model.B, model.C, model.D)
    if len(blocks) == 1:
        return [(model, blocks[0].states)]
    return [(_part(model, block), block.states) for block in blocks]


def _part(model: Realisation, block: Block) -> Realisation:
    return replace(
        model,
        A=model.A[np.ix_(block.states, block.states)],
        B=model.B[np.ix_(block.states, block.inputs)],
        C=model.C[np.ix_(block.outputs, block.states)],
        D=model.D[np.ix_(block.outputs, block.inputs)],
    )


def parts_with_states(model: Realisation) -> list[tuple[Realisation, tuple[int, ...]]]:
    """Split the states alone, whatever the inputs and outputs join; tell which is where."""
    none = (np.zeros((model.states, 0)), np.zeros((0, model.states)))
    alone = replace(model, B=none[0], C=none[1], D=np.zeros((0, 0)))
    return parts_with_indices(alone)
