"""Which copies of an uncertain block do something: the reduction of repeated blocks.

Copies of a block are to its delta what states are to an integrator [1]_. Those outside the span
that other signals reach are nothing but zero, and those that no other signal sees do not matter.

References
----------
.. [1] C. L. Beck, J. Doyle, K. Glover, "Model reduction of multidimensional and uncertain
   systems", IEEE Transactions on Automatic Control 41 (1996) 1466-1477.
"""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Matrix

# What is left of a direction, relative to its size, below which it is one that was there already:
# far above the rounding of a few products, far below any coupling that somebody meant.
_NEW = 1e-10
# Relative size of a direction that is nothing but rounding of the largest.
_ROUNDING = 1e-15
# Relative size of a coupling that may be rounding of others.
_FAINT = 1e-13


def reduced_copies(
    own: Matrix, moved: Matrix, seen: Matrix, copies: int, shape: tuple[int, int]
) -> tuple[Matrix, Matrix] | None:
    """Return how to leave out copies of a block that do nothing, None if all are needed.

    Parameters
    ----------
    own : ndarray, shape (copies * columns, copies * rows)
        From the block's outputs to its own inputs.
    moved : ndarray, shape (copies * columns, any)
        From everything else to its inputs.
    seen : ndarray, shape (any, copies * rows)
        From its outputs to everything else.
    copies : int
    shape : (int, int)
        Rows and columns of one copy.

    Returns
    -------
    out, into : ndarray, shapes (copies, fewer) and (fewer, copies)
        ``z = (out x I) z_fewer`` and ``z_fewer = (into x I) z``, and the same of w.
    """
    rows, columns = shape
    scale = _balance(moved, seen, copies, rows, columns)
    steps = own.reshape(copies, columns, copies, rows).transpose(1, 3, 0, 2)
    steps = steps.reshape(-1, copies, copies) * scale[None, None, :] / scale[None, :, None]
    enter = moved.reshape(copies, -1) / scale[:, None]
    leave = seen.reshape(len(seen), copies, rows).transpose(0, 2, 1).reshape(-1, copies) * scale
    reached = _span(enter, steps)
    inner = np.einsum("ai,kab,bj->kij", reached, steps, reached)
    visible = _span((leave @ reached).T, inner.transpose(0, 2, 1))
    basis = reached @ visible
    if basis.shape[1] == copies:
        return None
    return scale[:, None] * basis, basis.T / scale


def _span(start: Matrix, steps: Matrix) -> Matrix:
    """Return an orthonormal basis of the least space with `start` that all `steps` map into it."""
    basis = np.zeros((start.shape[0], 0))
    fresh = _beyond(start, basis)
    while fresh.shape[1]:
        basis = np.hstack([basis, fresh])
        fresh = _beyond(np.hstack(list(steps @ fresh)), basis)
    return basis


def _beyond(candidates: Matrix, basis: Matrix) -> Matrix:
    """Return orthonormal directions of the candidates outside a space, each in its own size."""
    sizes = np.linalg.norm(candidates, axis=0)
    used = sizes > _ROUNDING * sizes.max(initial=0.0)
    left = candidates[:, used] / sizes[used]
    for _ in range(2):  # the second projection removes the rounding of the first
        left = left - basis @ (basis.T @ left)
    fresh = np.zeros((len(basis), 0))
    while left.shape[1]:
        sizes = np.linalg.norm(left, axis=0)
        best = int(np.argmax(sizes))
        if sizes[best] <= _NEW:
            break
        direction = left[:, best] / sizes[best]
        direction -= basis @ (basis.T @ direction) + fresh @ (fresh.T @ direction)
        direction /= np.linalg.norm(direction)
        fresh = np.column_stack([fresh, direction])
        left = left - np.outer(direction, direction @ left)
    return fresh


def _balance(moved: Matrix, seen: Matrix, copies: int, rows: int, columns: int) -> Matrix:
    """Return powers of two that make each copy as easily moved as seen: units have no say."""
    into = np.linalg.norm(moved.reshape(copies, -1), axis=1)
    out = np.linalg.norm(seen.reshape(len(seen), copies, rows).transpose(1, 0, 2).reshape(
        copies, -1), axis=1)  # fmt: skip
    scale = np.ones(copies)
    # A copy that is only seen by rounding must not be made as visible as the others.
    used = (into > _FAINT * into.max(initial=0.0)) & (out > _FAINT * out.max(initial=0.0))
    scale[used] = np.exp2(np.round(np.log2(into[used] / out[used]) / 2))
    return scale
