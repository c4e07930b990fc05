"""The structured singular value of a matrix, or of a system over all frequencies."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.long_calls import same_bits
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.matrix_value import StructuredSingularValue, matrix_value
from robustpolish.robust.over_frequency import Asked
from robustpolish.robust.reached import critical, nominal_status, outcome, up
from robustpolish.robust.search import EVERYWHERE, GAP, bounds
from robustpolish.robust.structure import Structure, fitting, read_structure
from robustpolish.validation import described, invalid, positive


@same_bits
def structured_singular_value(M: Any, blocks: Any, *, gap: float = GAP) -> StructuredSingularValue:
    r"""Bound the structured singular value of a complex matrix, or its peak of a system.

    It is one over the size of the smallest Delta, block-diagonal as told, that makes I - M Delta
    singular; 0 if there is none. The upper bound is that of scalings D and G [1]_, the lower one
    comes with the Delta that reaches it. Of a system it is the largest value over all
    frequencies, 0 and infinity included: no grid, the upper bound is proven between them too.

    Parameters
    ----------
    M : array_like of complex, control.StateSpace or control.TransferFunction, shape (nz, nw)
        From the outputs w of Delta to its inputs z. A system is continuous or discrete.
    blocks : sequence
        The blocks on the diagonal of Delta, in their order: ``"real"`` or ``("real", copies)`` for
        a real number, repeated on the diagonal; ``"complex"`` or ``("complex", copies)`` for a
        complex one; ``("full", (rows, columns))`` for a full complex matrix, ``("full", n)`` for a
        square one. Rows of MATLAB's ``mussv`` are taken too: ``[-r, 0]``, ``[r, 0]``, ``[r, c]``.
    gap : float, optional
        Relative distance of both bounds of a system that is small enough, as of
        :func:`robust_stability`.

    Returns
    -------
    StructuredSingularValue

    Raises
    ------
    InvalidInputError
        If M is neither a finite matrix nor a system, the blocks do not fit it, or the gap is not
        positive.

    Notes
    -----
    An upper bound of real numbers is not always reached. Nor is one of more than three full
    blocks, but the gap is small in most cases. One real number alone, however often repeated, is
    exact in a system.

    References
    ----------
    .. [1] M. K. H. Fan, A. L. Tits, J. C. Doyle, "Robustness in the presence of mixed parametric
       uncertainty and unmodeled dynamics", IEEE Transactions on Automatic Control 36 (1991) 25-38.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> mu = rp.structured_singular_value([[2, 2], [-1, -1]], ["complex", "complex"])
    >>> round(mu.lower, 4), round(mu.upper, 4), mu.proven
    (3.0, 3.0, True)
    >>> round(rp.structured_singular_value([[2, 2], [-1, -1]], [("full", 2)]).upper, 4)
    3.1623

    Of a system with a resonance at 2 rad/s:

    >>> M = control.ss([[0, 1], [-4, -0.1]], [[0], [1]], [[1, 0]], 0)
    >>> mu = rp.structured_singular_value(M, ["complex"])
    >>> round(mu.lower, 2), mu.upper < 1.002 * mu.lower, round(mu.critical_frequency, 2), mu.proven
    (5.0, True, 2.0, True)
    """
    if isinstance(M, UncertainSystem):
        remedy = "Use robust_stability of a closed loop, or pass its M and blocks."
        raise invalid("M", described("an UncertainSystem"), "a matrix or a certain system", remedy)
    structure, gap = read_structure(blocks), positive("gap", gap)
    if not isinstance(M, control.InputOutputSystem | control.LTI):
        matrix = _complex_matrix(M)
        fitting(matrix.shape, structure)
        return matrix_value(matrix, structure)
    system = as_state_space("M", M)
    fitting((system.noutputs, system.ninputs), structure)
    return _peak(system, structure, gap)


def _peak(system: control.StateSpace, structure: Structure, gap: float) -> StructuredSingularValue:
    """Bound the largest value over all frequencies."""
    nominal = nominal_status(system)
    if nominal != "stable":
        return StructuredSingularValue(math.inf, math.inf, None, False, nominal)
    n, m, p = system.nstates, system.ninputs, system.noutputs
    A, B, C, D = (
        np.asarray(M, dtype=float).reshape(shape)
        for M, shape in (
            (system.A, (n, n)), (system.B, (n, m)), (system.C, (p, n)), (system.D, (p, m))
        )
    )  # fmt: skip
    loop = LoopModel.around((A, B, C, D), system.dt, structure)
    if not loop.acts_back:
        return StructuredSingularValue(0.0, 0.0, None, True, "zero", intervals=EVERYWHERE)
    found = bounds(loop, gap=gap)
    coverage, witness = found.coverage, found.witness
    upper, intervals = coverage.level * loop.gain, loop.in_rad_per_s(coverage.intervals)
    if coverage.complete and upper == 0:  # real numbers of any size leave it regular
        return StructuredSingularValue(0.0, 0.0, None, True, "zero", intervals=intervals)
    proven, lower, delta, frequency = coverage.complete, 0.0, None, math.nan
    if witness is not None:
        lower, frequency = loop.gain / witness.size, loop.omega(loop.frequency(witness.at))
        delta = loop.at_positive(witness.matrix(structure), witness.at) / loop.gain
    upper, status = up(upper) if proven else math.inf, outcome(found, gap)
    asked = Asked(loop, loop.gain, (False,) * len(structure.blocks), critical(loop, found))
    return StructuredSingularValue(
        lower, upper, delta, proven, status, frequency, intervals, _asked=asked
    )


def _complex_matrix(M: Any) -> NDArray[np.complex128]:
    wanted, remedy = "a matrix of finite numbers, or a system", "Pass lists, an array or a system."
    try:
        found = np.atleast_2d(np.asarray(M, dtype=complex))
    except (TypeError, ValueError):
        raise invalid("M", described(type(M).__name__), wanted, remedy) from None
    if found.ndim != 2 or 0 in found.shape or not np.isfinite(found).all():
        shown = described(f"an array of shape {found.shape}")
        raise invalid("M", shown, wanted, "Check its shape and entries.")
    return found
