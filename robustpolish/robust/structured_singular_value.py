"""The structured singular value of a matrix, or of a system over all frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import described, invalid, positive
from robustpolish.base.results import Card, quantities, tables
from robustpolish.linear.arithmetic.balls import complex_ball, precision
from robustpolish.linear.systems import as_state_space
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.robust import questions, scalings
from robustpolish.robust.bounds import EVERYWHERE, GAP, bounds
from robustpolish.robust.loop_model import DeltaStructure, LoopModel, check_shape, read_structure
from robustpolish.robust.questions import AnalysedLoop, MuOverFrequency
from robustpolish.robust.witness import worst_delta

# The result, and the structured singular value of a matrix.

# Signals from which the lower bound starts: the worst of the upper bound, then mixtures.
_STARTS = 6
_BITS = 160

Status = Literal["bracketed", "wide", "no witness", "zero", "incomplete", "unstable", "marginal"]

_SAYS = tables(__file__)["singular_value"]


@dataclass(frozen=True, eq=False, repr=False)
class StructuredSingularValue(MuOverFrequency):
    """Bounds of the structured singular value of a matrix, or of its peak over all frequencies.

    Attributes
    ----------
    lower, upper : float
        The value lies between: 1 / lower is the size of `witness`, and no Delta below 1 / upper
        makes I - M Delta singular, at any frequency.
    witness : ndarray of complex or None
        A Delta of the structure for which I - M Delta is singular, of a system at
        `critical_frequency`; None if none was found.
    proven : bool
        Whether `upper` was proven in ball arithmetic, of a system for all frequencies.
    status : str
        "bracketed" or "no witness" where there are both bounds or none from below; "zero" where
        no Delta makes it singular. Of a system also "wide" where the bounds are farther apart than
        was asked for, "incomplete" where `upper` was not proven,
        and "unstable" or "marginal", with infinite bounds, where M itself is.
    reason : str
        The status in a sentence.
    critical_frequency : float
        In rad/s, where the witness makes a system singular; nan of a matrix or without a witness.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which `upper` was proven; they cover the axis. None of a
        matrix.

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
    status: Status
    critical_frequency: float = math.nan
    intervals: tuple[tuple[float, float], ...] = ()

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        status: Any = self.status
        return _SAYS.get(status) or questions.status_sentence(status, "above")

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        return self._drawn, (self.lower, self.upper), self.critical_frequency

    def _card(self) -> Card:
        rows = [("at least", self.lower), ("at most", self.upper), ("proven", self.proven)]
        if not math.isnan(self.critical_frequency):
            rows.insert(2, ("critical frequency [rad/s]", self.critical_frequency))
        title = f"Structured singular value: {self.status}"
        return Card(title, (quantities(*rows),), (self.reason,))


def matrix_value(M: AnyMatrix, structure: DeltaStructure) -> StructuredSingularValue:
    """Bound the structured singular value of a matrix that fits the structure.

    Parameters
    ----------
    M : ndarray of complex, shape (nz, nw)
    structure : DeltaStructure

    Returns
    -------
    StructuredSingularValue
    """
    space = scalings.Space(structure)
    size = float(np.linalg.norm(M, 2))
    if size == 0:
        return StructuredSingularValue(0.0, 0.0, None, True, "zero")
    unit = float(np.exp2(np.round(np.log2(size))))
    inequality = scalings.Inequality(space, (M / unit)[None])
    level = scalings.best_scalings(inequality)
    witness = worst_delta(inequality, level, _STARTS)
    upper, proven = level.level or 1e-12, False
    for slack in (1e-10, 1e-8, 1e-6, 1e-4):  # until ball arithmetic agrees
        weights = scalings.BallScalings.of(space, level.x, upper * (1 + slack))
        with precision(_BITS):
            proven = weights is not None and scalings.proves_inequality(
                complex_ball(M / unit), weights
            )
        if proven:
            upper *= 1 + slack
            break
    lower, delta = (1 / witness.size, witness.matrix(structure) / unit) if witness else (0.0, None)
    status = "bracketed" if witness else "no witness"
    return StructuredSingularValue(lower * unit, upper * unit, delta, proven, status)


@single_threaded_blas
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
        check_shape(matrix.shape, structure)
        return matrix_value(matrix, structure)
    system = as_state_space("M", M)
    check_shape((system.noutputs, system.ninputs), structure)
    return _peak(system, structure, gap)


def _peak(
    system: control.StateSpace, structure: DeltaStructure, gap: float
) -> StructuredSingularValue:
    """Bound the largest value over all frequencies."""
    nominal = questions.nominal_status(system)
    if nominal != "stable":
        return StructuredSingularValue(math.inf, math.inf, None, False, nominal)
    loop = LoopModel.around(matrices_of(system), system.dt, structure)
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
    upper = questions.round_up(upper) if proven else math.inf
    status = questions.bound_status(found, gap)
    asked = AnalysedLoop(loop, loop.gain, (), questions.critical_frequency_of(loop, found))
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
