"""Vinnicombe's gap between two plants: how different they are to a controller."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from robustpolish.analysis import hinf_norm
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.loop_shaping.coprime import Coprime, coprime, in_series, loop_plant
from robustpolish.synthesis.problem.matrices import SystemMatrices
from robustpolish.validation import described, invalid

Plant = GeneralizedPlant | control.StateSpace | control.TransferFunction


def nu_gap(first: Plant, second: Plant) -> float:
    r"""Return the nu-gap of two plants: 0 if they are the same to every loop, 1 if none fits both.

    With normalised coprime factors, right [N; M] of the first and left of the second,

    .. math:: \delta_\nu = \| \tilde N_2 M_1 - \tilde M_2 N_1 \|_\infty \quad\text{if}\quad
              \det (N_2^\sim N_1 + M_2^\sim M_1)

    has no zero on the axis and does not turn about 0 along it, and 1 otherwise. Neither is done on
    a grid: the norm is that of a stable system, proven by :func:`robustpolish.hinf_norm`, and the
    turns are counted by the zeros of the determinant on the right.

    Parameters
    ----------
    first, second : GeneralizedPlant, control.StateSpace or control.TransferFunction
        Plants with the same numbers of inputs and outputs, of any order, stable or not, both
        continuous or both discrete with one sampling time. Of a generalised plant, the part from
        its controls to its measurements.

    Returns
    -------
    float
        Between 0 and 1. A controller with :func:`ncf_margin` above it for the first plant
        stabilises the second, and its margin there is smaller by at most as much, as angles
        (arcsines) add up.

    Raises
    ------
    InvalidInputError
        If the plants do not fit each other, or one has delays.
    InfeasibleError
        If a mode that is not stable is not controllable or not observable.

    Notes
    -----
    Vinnicombe, "Frequency domain uncertainty and the graph topology", IEEE Trans. Automatic
    Control 38 (1993) 1371-1383; "Uncertainty and Feedback", 2001, definition 3.1.

    Examples
    --------
    Stable or not hardly matters to a fast loop; a further lag does:

    >>> import control
    >>> import robustpolish as rp
    >>> G = [control.tf([100], den) for den in ([2, 1], [2, -1], [1, 2, 1])]
    >>> round(rp.nu_gap(G[0], G[1]), 4), round(rp.nu_gap(G[0], G[2]), 4)
    (0.02, 0.8988)
    """
    P1, P2 = _plant("first", first), _plant("second", second)
    if (P1.nu, P1.ny) != (P2.nu, P2.ny):
        raise invalid(
            "second",
            described(f"{P2.nu} inputs and {P2.ny} outputs"),
            f"{P1.nu} and {P1.ny} like the first",
            "Compare plants of the same signals.",
        )
    if P1.dt != P2.dt and P1.nx and P2.nx:
        shown = described(f"sampling time {P2.dt}")
        raise invalid("second", shown, f"{P1.dt} like the first", "Discretise one of them.")
    one, other = coprime(P1), coprime(P2)
    if not _turns_nowhere(one, other):
        return 1.0
    gap = in_series(one.right(), other.left())
    value = hinf_norm(control.StateSpace(*gap, 0, remove_useless_states=False)).value
    return float(min(value, 1.0))


def _plant(argument: str, given: Any) -> GeneralizedPlant:
    plant = loop_plant(argument, given)
    if plant.wiring.lines:
        shown = described("a plant with delays")
        raise invalid(
            argument, shown, "one without", "Take plant.without_delays(), its Pade model."
        )
    return plant


def _turns_nowhere(one: Coprime, other: Coprime) -> bool:
    """Tell whether the determinant has as many zeros as poles to the right of the axis."""
    right, para = one.right(), _adjoint(other.right())
    A, B, C, D = in_series(right, para)
    antistable = len(para.A)
    size = np.linalg.svd(D, compute_uv=False)
    if size[-1] <= 1e-12 * max(size[0], 1.0):
        return False  # zero at infinite frequency
    zeros = np.linalg.eigvals(A - B @ np.linalg.solve(D, C)) if len(A) else np.zeros(0)
    return int((zeros.real > 0).sum()) == antistable


def _adjoint(system: SystemMatrices) -> SystemMatrices:
    """Return the system whose response on the axis is the conjugate transpose."""
    A, B, C, D = system
    return SystemMatrices(-A.T, -C.T, B.T, D.T)
