"""Normalised coprime factors by Riccati equations, their stability margin, and the nu-gap."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import EPS
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.checks import described, invalid, one_of
from robustpolish.errors import SolverError
from robustpolish.linear.arithmetic.exact import refuse_extreme
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.scaling import border_scale
from robustpolish.linear.systems import as_state_space
from robustpolish.plants.blocks import GivenController, controller_system, matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import exact_delays
from robustpolish.synthesis.problem import matrices
from robustpolish.synthesis.problem.preflight import check_solvability


class Coprime(NamedTuple):
    """A plant in continuous time with the solutions of its two normalised Riccati equations.

    Attributes
    ----------
    plant : SystemMatrices
        A, B, C, D; of a discrete-time plant the image under z = (1 + s) / (1 - s).
    X, Z : ndarray, shape (n, n)
        Of the control and of the filter equation.
    S, R : ndarray
        I + D'D and I + DD'.
    """

    plant: matrices.SystemMatrices
    X: Matrix
    Z: Matrix
    S: Matrix
    R: Matrix

    @property
    def optimal_gamma(self) -> float:
        """The smallest norm of [I; K] (I - G K)^-1 [I, G] over all controllers."""
        product = np.linalg.eigvals(self.X @ self.Z).real if len(self.X) else np.zeros(0)
        return float(np.sqrt(1 + max(product.max(initial=0.0), 0.0)))

    @property
    def state_gain(self) -> Matrix:
        """F, which makes A + BF the state matrix of the right factors."""
        _, B, C, D = self.plant
        return -np.linalg.solve(self.S, D.T @ C + B.T @ self.X)

    def right(self) -> matrices.SystemMatrices:
        """Return [N; M] with G = N M^-1 and N~N + M~M = I."""
        A, B, C, D = self.plant
        F, root = self.state_gain, _inverse_root(self.S)
        return matrices.SystemMatrices(
            A + B @ F, B @ root, np.vstack([C + D @ F, F]), np.vstack([D @ root, root])
        )

    def left(self) -> matrices.SystemMatrices:
        """Return [-M, N] with G = M^-1 N and N N~ + M M~ = I."""
        A, B, C, D = self.plant
        H = -np.linalg.solve(self.R, (B @ D.T + self.Z @ C.T).T).T
        root = _inverse_root(self.R)
        return matrices.SystemMatrices(
            A + H @ C, np.hstack([-H, B + H @ D]), root @ C, np.hstack([-root, root @ D])
        )

    def controller(self, gamma: float) -> matrices.SystemMatrices:
        """Return the central controller of u = K y for a gamma above the optimal one.

        Skogestad, Postlethwaite, "Multivariable Feedback Control", equations (9.65) to (9.71).
        """
        A, B, C, D = self.plant
        F, n = self.state_gain, len(self.X)
        L = (1 - gamma**2) * np.eye(n) + self.X @ self.Z
        into = gamma**2 * np.linalg.solve(L.T, self.Z @ C.T)
        return matrices.SystemMatrices(A + B @ F + into @ (C + D @ F), into, B.T @ self.X, -D.T)


def coprime(plant: GeneralizedPlant) -> Coprime:
    """Solve the normalised Riccati equations of the part of a plant from u to y.

    Parameters
    ----------
    plant : GeneralizedPlant

    Returns
    -------
    Coprime

    Raises
    ------
    InfeasibleError
        If a mode that is not stable is not controllable or not observable; it is named.
    SolverError
        If the equations could not be solved.
    InvalidInputError
        If a discrete-time plant has a pole at z = -1.
    """
    check_solvability(plant).require_stabilisable()
    A, B, C, D = plant.A, plant.B2, plant.C2, plant.D22
    if plant.is_discrete:
        if len(A) and np.linalg.cond(np.eye(len(A)) + A) > 1e12:
            shown = described("a discrete-time plant with a pole at z = -1")
            raise invalid("plant", shown, "one without", "Shift it, or take the continuous plant.")
        A, B, C, D = matrices.cayley(A, B, C, D)
    into, out = np.abs(B).max(axis=1, initial=0), np.abs(C).max(axis=0, initial=0)
    t = border_scale(A, into, out)
    A, B, C = A * t / t[:, None], B / t[:, None], C * t
    S, R = np.eye(B.shape[1]) + D.T @ D, np.eye(len(C)) + D @ D.T
    if max(np.linalg.cond(S), np.linalg.cond(R)) > 1 / EPS:
        raise SolverError(
            "The normalised coprime factors are lost in rounding: the plant passes its inputs on "
            f"directly with gains up to {np.abs(D).max():.3g}. Choose other units for the signals."
        )
    own = A - B @ np.linalg.solve(S, D.T @ C)
    into, out = B @ np.linalg.solve(S, B.T), C.T @ np.linalg.solve(R, C)
    X, Z = matrices.solve_riccati(own, -into, out), matrices.solve_riccati(own.T, -out, into)
    if X is None or Z is None:
        raise SolverError(
            "The Riccati equations of the normalised coprime factors could not be solved: a mode "
            "is almost uncontrollable or unobservable. Reduce the plant to the modes that matter."
        )
    return Coprime(matrices.SystemMatrices(A, B, C, D), X, Z, S, R)


def loop_plant(argument: str, plant: Any) -> GeneralizedPlant:
    """Return a plant whose part from u to y is meant, whatever was given."""
    if not isinstance(plant, GeneralizedPlant):
        G = as_state_space(argument, plant)
        plant = GeneralizedPlant(G, measurements=G.noutputs or 0, controls=G.ninputs or 0)
    if not (plant.nu and plant.ny):
        shown = described(f"{plant.nu} controls and {plant.ny} measurements")
        raise invalid(argument, shown, "at least one of each", "Check controls=, measurements=.")
    refuse_extreme(argument, {name: getattr(plant, name) for name in ("A", "B2", "C2", "D22")})
    return plant


def consistent_matrices(system: control.StateSpace) -> matrices.SystemMatrices:
    """Return the matrices of a system with consistent shapes."""
    return matrices.SystemMatrices(*matrices_of(system))


def _inverse_root(S: Matrix) -> Matrix:
    values, vectors = linalg.eigh(S)
    return vectors / np.sqrt(values) @ vectors.T


# The normalised coprime stability margin of a loop.


def ncf_margin(
    plant: GeneralizedPlant | control.StateSpace | control.TransferFunction,
    controller: GivenController,
    *,
    sign: Literal[1, -1] = 1,
) -> float:
    r"""Return how far a plant may move in the nu-gap without making its loop unstable.

    .. math:: b(G, K) = \left\| \begin{bmatrix} I \\ K \end{bmatrix} (I - G K)^{-1}
              \begin{bmatrix} I & G \end{bmatrix} \right\|_\infty^{-1}

    for a stable loop with u = K y, and 0 for all others. Values above 0.3 are good margins.

    Parameters
    ----------
    plant : GeneralizedPlant, control.StateSpace or control.TransferFunction
        G. Of a generalised plant, the part from its controls to its measurements; its delays count
        as they are.
    controller : control.StateSpace, control.TransferFunction or array_like
        K.
    sign : {1, -1}, optional
        1 for u = K y, the convention here; -1 for u = -K y, that of MATLAB's ``ncfmargin``.

    Returns
    -------
    float
        Between 0 and 1. It depends on the units of u and y, as all of loop shaping.

    Raises
    ------
    InvalidInputError
        If plant and controller do not fit, or the loop is not well posed.

    See Also
    --------
    nu_gap : how far two plants are apart.

    Notes
    -----
    Zhou, Doyle, "Essentials of Robust Control", 1998, chapter 16. Any plant within a nu-gap below
    b(G, K) is stabilised by the same controller.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> G = control.tf([4], [1, -0.001])
    >>> [round(rp.uncertain.ncf_margin(G, k, sign=-1), 4) for k in (1.0, 10.0)]
    [0.7069, 0.0995]
    """
    one_of("sign", sign, (1, -1))
    loop = GeneralizedPlant.from_loop(loop_plant("plant", plant))
    K = controller_system(loop, controller)
    if sign == -1:
        K = -K
    if loop.wiring.lines:
        found = exact_delays(loop, K, "hinf")
        gain = None if found is None else found.gain
        return 1 / gain if gain else 0.0
    norm = hinf_norm(loop.closed_loop(K))
    return 1 / norm.value if norm.stable and math.isfinite(norm.value) else 0.0


# Vinnicombe's gap between two plants: how different they are to a controller.

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
    >>> round(rp.uncertain.nu_gap(G[0], G[1]), 4), round(rp.uncertain.nu_gap(G[0], G[2]), 4)
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
    if not _has_zero_winding(one, other):
        return 1.0
    gap = matrices.in_series(one.right(), other.left())
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


def _has_zero_winding(one: Coprime, other: Coprime) -> bool:
    """Tell whether the determinant has as many zeros as poles to the right of the axis."""
    right, (A, B, C, D) = one.right(), other.right()
    # Its response on the axis is the conjugate transpose.
    para = matrices.SystemMatrices(-A.T, -C.T, B.T, D.T)
    A, B, C, D = matrices.in_series(right, para)
    antistable = len(para.A)
    size = np.linalg.svd(D, compute_uv=False)
    if size[-1] <= 1e-12 * max(size[0], 1.0):
        return False  # zero at infinite frequency
    zeros = np.linalg.eigvals(A - B @ np.linalg.solve(D, C)) if len(A) else np.zeros(0)
    return int((zeros.real > 0).sum()) == antistable
