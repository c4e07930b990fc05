"""Split a system into parts that share no state, input or output; norms are taken part by part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from robustpolish.arrays import Matrix
from robustpolish.exact.realisation import Realisation
from robustpolish.validation import matrix, positive, square


@dataclass(frozen=True)
class Block:
    """Indices of one decoupled part of a system.

    Attributes
    ----------
    states, inputs, outputs : tuple of int
        Ascending; each may be empty.
    """

    states: tuple[int, ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


def decoupled_blocks(
    A: ArrayLike,
    B: ArrayLike,
    C: ArrayLike,
    D: ArrayLike | None = None,
    *,
    tolerance: float = 0.0,
) -> tuple[Block, ...]:
    """Find the connected components of a system's graph.

    States, inputs and outputs are nodes; an entry that is not zero joins two
    of them. The system is, after a permutation, block diagonal in these parts,
    so each can be analysed or designed alone.

    Parameters
    ----------
    A : array_like, shape (n, n)
        State matrix.
    B : array_like, shape (n, m)
        Input matrix; for a generalised plant all inputs, (B1, B2).
    C : array_like, shape (p, n)
        Output matrix; for a generalised plant all outputs.
    D : array_like, shape (p, m), optional
        Feedthrough; zero by default.
    tolerance : float, optional
        An entry couples if it is larger in magnitude. Zero, the default, keeps
        the split exact; a larger value has a meaning only for scaled matrices.

    Returns
    -------
    tuple of Block
        Ordered by the first state; parts without states come last.

    Raises
    ------
    InvalidInputError
        If the shapes do not fit or an entry is not finite.

    Examples
    --------
    >>> from robustpolish.analysis import decoupled_blocks
    >>> A, B, C = [[-1, 0], [0, -2]], [[1, 0], [0, 1]], [[0, 1]]
    >>> for block in decoupled_blocks(A, B, C):
    ...     print(block)
    Block(states=(0,), inputs=(0,), outputs=())
    Block(states=(1,), inputs=(1,), outputs=(0,))
    """
    A = square("A", A)
    n = A.shape[0]
    B, C = matrix("B", B, (n, None)), matrix("C", C, (None, n))
    m, p = B.shape[1], C.shape[0]
    D = np.zeros((p, m)) if D is None else matrix("D", D, (p, m))
    tolerance = positive("tolerance", tolerance, zero=True)
    graph = np.zeros((n + m + p, n + m + p), dtype=bool)
    graph[:n, :n] = np.abs(A) > tolerance
    graph[:n, n : n + m] = np.abs(B) > tolerance
    graph[n + m :, :n] = np.abs(C) > tolerance
    graph[n + m :, n : n + m] = np.abs(D) > tolerance
    count, labels = connected_components(csr_array(graph), directed=False)
    blocks = []
    for label in range(count):
        nodes = np.flatnonzero(labels == label)
        blocks.append(
            Block(
                tuple(int(i) for i in nodes if i < n),
                tuple(int(i - n) for i in nodes if n <= i < n + m),
                tuple(int(i - n - m) for i in nodes if i >= n + m),
            )
        )
    return tuple(sorted(blocks, key=lambda b: (not b.states, b.states, b.inputs, b.outputs)))


def parts(model: Realisation) -> list[Realisation]:
    """Split a system into its decoupled blocks."""
    return [part for part, _ in parts_with_indices(model)]


def parts_with_indices(model: Realisation) -> list[tuple[Realisation, tuple[int, ...]]]:
    """Split a system into its decoupled blocks; tell which states each has."""
    if _is_one_part(model):
        return [(model, tuple(range(model.states)))]
    blocks = decoupled_blocks(model.A, model.B, model.C, model.D)
    if len(blocks) == 1:
        return [(model, blocks[0].states)]
    return [(_part(model, block), block.states) for block in blocks]


def _is_one_part(model: Realisation) -> bool:
    """Say, sooner than by components, whether all states are coupled and no signal is idle."""
    if not (_full(model.B) or model.B.any(axis=0).all()):
        return False
    if not (_full(model.C) or model.C.any(axis=1).all()):
        return False
    if model.states and _full(model.A):
        return True
    joined = model.A != 0
    reached = np.zeros(model.states, bool)
    reached[:1] = True
    count = 0
    while count < (found := int(np.count_nonzero(reached))):
        count = found
        reached |= joined[reached].any(axis=0) | joined[:, reached].any(axis=1)
    return 0 < model.states == count


def _full(M: Matrix) -> bool:
    """Say whether no entry is zero, quicker than `all` does."""
    return np.count_nonzero(M) == M.size


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
