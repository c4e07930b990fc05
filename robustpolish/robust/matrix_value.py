"""The structured singular value of a matrix, between a proof and a witness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix
from robustpolish.display import Card, Displayed, quantities
from robustpolish.exact.balls import precision
from robustpolish.robust.centre import Level, lowered, started
from robustpolish.robust.proof import Weights, complex_ball, proves
from robustpolish.robust.scalings import Inequality, Space
from robustpolish.robust.structure import Structure, fitting, read_structure
from robustpolish.robust.witness import Witness, directions, smallest
from robustpolish.validation import described, invalid

# Signals from which the lower bound starts: the worst of the upper bound, then mixtures.
_STARTS = 6
_BITS = 160


@dataclass(frozen=True, eq=False, repr=False)
class StructuredSingularValue(Displayed):
    """Bounds of the structured singular value of a matrix.

    Attributes
    ----------
    lower, upper : float
        The value lies between: 1 / lower is the size of `witness`, and no Delta below 1 / upper
        makes I - M Delta singular.
    witness : ndarray of complex or None
        A Delta of the structure for which I - M Delta is singular; None if none was found.
    proven : bool
        Whether `upper` was proven in ball arithmetic.
    status : {"bracketed", "no witness", "zero"}
        Whether there are both bounds, none from below, or M is zero.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.structured_singular_value([[0.0, 0.0], [0.0, 0.0]], ["real", "complex"]).status
    'zero'
    """

    lower: float
    upper: float
    witness: AnyMatrix | None
    proven: bool
    status: Literal["bracketed", "no witness", "zero"]

    def _card(self) -> Card:
        rows = (("at least", self.lower), ("at most", self.upper), ("proven", self.proven))
        return Card(f"Structured singular value: {self.status}", (quantities(*rows),))


def structured_singular_value(M: Any, blocks: Any) -> StructuredSingularValue:
    r"""Bound the structured singular value of a complex matrix.

    It is one over the size of the smallest Delta, block-diagonal as told, that makes I - M Delta
    singular; 0 if there is none. The upper bound is that of scalings D and G [1]_, the lower one
    comes with the Delta that reaches it.

    Parameters
    ----------
    M : array_like of complex, shape (nz, nw)
        From the outputs w of Delta to its inputs z.
    blocks : sequence
        The blocks on the diagonal of Delta, in their order: ``"real"`` or ``("real", copies)`` for
        a real number, repeated on the diagonal; ``"complex"`` or ``("complex", copies)`` for a
        complex one; ``("full", (rows, columns))`` for a full complex matrix, ``("full", n)`` for a
        square one. Rows of MATLAB's ``mussv`` are taken too: ``[-r, 0]``, ``[r, 0]``, ``[r, c]``.

    Returns
    -------
    StructuredSingularValue

    Raises
    ------
    InvalidInputError
        If M is not a finite matrix, or the blocks do not fit it.

    Notes
    -----
    An upper bound of real numbers is not always reached. Nor is one of more than three full
    blocks, but the gap is small in most cases.

    References
    ----------
    .. [1] M. K. H. Fan, A. L. Tits, J. C. Doyle, "Robustness in the presence of mixed parametric
       uncertainty and unmodeled dynamics", IEEE Transactions on Automatic Control 36 (1991) 25-38.

    Examples
    --------
    >>> import robustpolish as rp
    >>> mu = rp.structured_singular_value([[2, 2], [-1, -1]], ["complex", "complex"])
    >>> round(mu.lower, 4), round(mu.upper, 4), mu.proven
    (3.0, 3.0, True)
    >>> round(rp.structured_singular_value([[2, 2], [-1, -1]], [("full", 2)]).upper, 4)
    3.1623
    """
    matrix = _complex_matrix(M)
    structure = read_structure(blocks)
    fitting(matrix.shape, structure)
    space = Space(structure, (False,) * len(structure.blocks))
    size = float(np.linalg.norm(matrix, 2))
    if size == 0:
        return StructuredSingularValue(0.0, 0.0, None, True, "zero")
    unit = float(np.exp2(np.round(np.log2(size))))
    inequality = Inequality(space, (matrix / unit)[None])
    level = lowered(inequality, started(inequality))
    witness = worst_delta(structure, inequality, level)
    upper, proven = _proven(matrix / unit, space, level)
    lower = 1 / witness.size if witness else 0.0
    return StructuredSingularValue(
        lower * unit,
        upper * unit,
        witness.matrix(structure) / unit if witness else None,
        proven,
        "bracketed" if witness else "no witness",
    )


def worst_delta(structure: Structure, inequality: Inequality, level: Level) -> Witness | None:
    """Return the smallest Delta that a few searches find for one matrix."""
    M = inequality.M[0]
    still = np.zeros_like(M)
    Dz = inequality.space.matrices(level.x)[2]
    scale = 1 / np.sqrt(np.maximum(np.real(np.diagonal(Dz)), 1e-300))
    scale = scale / scale.max()
    best: Witness | None = None
    for w in directions(inequality, level.square, level.x, _STARTS):
        found = smallest(structure, lambda _: (M, still), w, 0.0, False, scale)
        if found and (best is None or found.size < best.size):
            best = found
        if best and 1 / best.size >= math.sqrt(max(level.square, 0.0)) * (1 - 1e-4):
            break
    return best


def _proven(M: AnyMatrix, space: Space, level: Level) -> tuple[float, bool]:
    """Widen the level until ball arithmetic agrees."""
    beta = math.sqrt(max(level.square, 0.0)) or 1e-12
    for slack in (1e-10, 1e-8, 1e-6, 1e-4):
        upper = beta * (1 + slack)
        weights = Weights.of(space, level.x, upper)
        with precision(_BITS):
            if weights and proves(complex_ball(M), weights):
                return upper, True
    return beta, False


def _complex_matrix(M: Any) -> NDArray[np.complex128]:
    wanted, remedy = "a matrix of finite numbers", "Pass nested lists or a NumPy array."
    try:
        found = np.atleast_2d(np.asarray(M, dtype=complex))
    except (TypeError, ValueError):
        raise invalid("M", described(type(M).__name__), wanted, remedy) from None
    if found.ndim != 2 or 0 in found.shape or not np.isfinite(found).all():
        shown = described(f"an array of shape {found.shape}")
        raise invalid("M", shown, wanted, "Check its shape and entries.")
    return found
