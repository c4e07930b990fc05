"""Regulators by Riccati equations: LQR, the game of the H-infinity norm, and LQG by duality."""

from __future__ import annotations

import math
import warnings
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import EPS, SAME
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, step_cost
from robustpolish.errors import InfeasibleError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem import matrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.preflight import Status
from robustpolish.synthesis.riccati.gamma import LowerBound, lower_bound, reduced_riccati_pair

# Final width of the bisection on gamma over the slack that is given away afterwards.
_BRACKET = 1e-2


@dataclass(frozen=True, eq=False)
class StateGain:
    """A gain F of u = F x with a norm that was computed from its loop, and how it was found.

    Attributes
    ----------
    F : ndarray, shape (nu, nx)
    claimed, achieved : float
        What the search promises, and what the loop has.
    lower_bound : float
        No gain has a smaller norm; 0 says nothing.
    status : str
        As in :class:`robustpolish.results.Design`; a search that minimises a norm says
        "suboptimal", because only the lower bound can tell that it is "optimal".
    history : tuple of dict
        One entry per step.
    """

    F: Matrix
    claimed: float
    achieved: float
    lower_bound: float = 0.0
    status: Status = "suboptimal"
    history: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True)
class StateEngine(ABC):
    """One way to minimise a norm over state feedbacks.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    tolerance : float
        Relative; a share of it is given away for a smaller gain.
    regions : tuple of PoleRegion
        Where the poles have to lie, in the plant's unit of time.
    backend, solver : str, str or None
        Who solves the inequalities, be it only those of a bound on the gain.
    """

    norm: Norm
    tolerance: float = 1e-4
    regions: tuple[PoleRegion, ...] = ()
    backend: str = "cvxpy"
    solver: str | None = None

    @abstractmethod
    def search(self, plant: matrices.PlantMatrices, budget: Budget) -> StateGain | None:
        """Minimise the norm of a scaled plant whose D12 has full column rank.

        Parameters
        ----------
        plant : PlantMatrices
            Its states are taken as measured.
        budget : Budget
            The search ends when it is over.

        Returns
        -------
        StateGain or None
            None if no stabilising gain was found.
        """

    @property
    def slack(self) -> float:
        """Relative distance from the optimum that is given away for a smaller gain.

        The gain often grows without limit towards the optimum (force actuation, H-infinity: 1.7e8
        at 2e-5 from the optimum).
        """
        return 0.2 * self.tolerance


class RiccatiStateEngine(StateEngine):
    """The linear-quadratic regulator for the H2 norm, a bisection on gamma for H-infinity.

    Regions do not fit into a Riccati equation and are not looked at.
    """

    def search(self, plant: matrices.PlantMatrices, budget: Budget) -> StateGain | None:
        """Minimise the norm; see :class:`StateEngine`."""
        if self.norm == "h2":
            budget.spend(step_cost(2 * plant.nx))
            F = central_state_gain(plant, math.inf)
            achieved = matrices.state_gain_norm(plant, F, "h2")
            if F is None or not math.isfinite(achieved):
                return None
            step = {"step": "linear-quadratic regulator", "achieved": achieved}
            return StateGain(F, achieved, achieved, history=(step,))
        best = central_state_gain(plant, math.inf)
        upper = matrices.state_gain_norm(plant, best, "hinf")
        lower = float(np.linalg.norm(plant.D11, 2)) if plant.D11.size else 0.0
        if best is None or not math.isfinite(upper):
            return None
        # Bisection on gamma, which believes only the norms of loops.
        step, width = 2.0, _BRACKET * self.slack
        while upper > lower * (1 + width) and not budget.over:
            # Downwards in growing steps until the first failure, then halving the bracket.
            gamma = math.sqrt(upper * lower) if lower > upper / step else upper / step
            step = step**2 if step < 1e8 else step
            budget.spend(step_cost(2 * plant.nx))
            F = central_state_gain(plant, gamma)
            achieved = matrices.state_gain_norm(plant, F, "hinf")
            # Next to the optimum rounding errors of X can leave a better gain a little above gamma.
            if F is None or not achieved < upper * (1 - 0.1 * width):
                lower, step = gamma, math.inf
                continue
            best, upper = F, achieved
            if upper <= 0:
                break
        history = ({"step": "bisection on gamma", "achieved": upper, "no_gain_found_at": lower},)
        # The gain often grows without limit towards the optimum, so a little is given away.
        # Multiples of the slack at which the Riccati equation is solved in the end: next to the
        # optimum its solution can be too inaccurate to keep its claim.
        for retreat in (1.0, 2.5, 5.0):
            claim = upper * (1 + retreat * self.slack)
            smaller = central_state_gain(plant, claim)
            achieved = matrices.state_gain_norm(plant, smaller, "hinf")
            if smaller is not None and achieved <= claim * (1 + 1e-9):
                return StateGain(smaller, max(claim, achieved), achieved, history=history)
        return StateGain(
            best, upper, matrices.state_gain_norm(plant, best, "hinf"), history=history
        )


def central_state_gain(plant: matrices.PlantMatrices, gamma: float) -> Matrix | None:
    r"""Return the central state feedback for an H-infinity norm below `gamma`, or None.

    With an infinite `gamma` it is the linear-quadratic regulator, which minimises the H2 norm.

    With W = (gamma^2 I - D11' D11)^-1 and N = I + D11 W D11' the worst disturbance is
    eliminated first, because u = F x does not see w; what is left is a Riccati equation in

    .. math:: \tilde A = A + B_1 W D_{11}'C,\quad \tilde B = B_2 + B_1 W D_{11}' D_{12},\quad
              R = D_{12}' N D_{12}

    after Zhou, Doyle, Glover, "Robust and Optimal Control", 1996, section 16.4.
    """
    if plant.nu == 0:
        return np.zeros((0, plant.nx))
    if plant.discrete:
        found = discrete_regulator(plant, gamma)
        return None if found is None else found[0]
    game = _HinfRiccati.of(plant, gamma)
    X = None if game is None else matrices.solve_riccati(game.A, game.R, game.Q)
    if game is None or X is None:
        return None
    return -(game.per_x @ _refined(game.A, game.R, game.Q, X) + game.rest)


class _HinfRiccati(NamedTuple):
    """A'X + XA + XRX + Q = 0, and F = -(per_x X + rest)."""

    A: Matrix
    R: Matrix
    Q: Matrix
    per_x: Matrix
    rest: Matrix

    @classmethod
    def of(cls, plant: matrices.PlantMatrices, gamma: float) -> _HinfRiccati | None:
        """Return the equation; None up to the norm of D11, and where a control has no price."""
        p = plant
        if math.isinf(gamma):
            W = np.zeros((p.nw,) * 2)
        else:
            gap = gamma**2 * np.eye(p.nw) - p.D11.T @ p.D11
            if np.linalg.eigvalsh(gap).min(initial=math.inf) <= 0:
                return None
            W = np.linalg.inv(gap)
        N = np.eye(p.nz) + p.D11 @ W @ p.D11.T
        worst = p.B1 @ W @ p.D11.T
        A, B = p.A + worst @ p.C1, p.B2 + worst @ p.D12
        R, S = p.D12.T @ N @ p.D12, p.D12.T @ N @ p.C1
        try:
            factor = linalg.cho_factor(R)
        except linalg.LinAlgError:
            return None
        RinvS, RinvB = linalg.cho_solve(factor, S), linalg.cho_solve(factor, B.T)
        drift, quadratic = A - B @ RinvS, p.B1 @ W @ p.B1.T - B @ RinvB
        constant = p.C1.T @ N @ p.C1 - S.T @ RinvS
        return cls(drift, quadratic, constant, RinvB, RinvS)


def _refined(A: Matrix, R: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    """Return the solution of A'X + XA + XRX + Q = 0 after Newton steps that help."""
    size = math.inf
    # Refinements of a Riccati solution; more do not help doubles.
    for _ in range(3):
        closed = A + R @ X
        residual = A.T @ X + X @ closed + Q
        residual = (residual + residual.T) / 2
        smaller = float(np.linalg.norm(residual))
        if not smaller < 0.5 * size:
            break
        if not (np.linalg.eigvals(closed).real < 0).all():
            break
        step = matrices.solve_lyapunov(closed, residual)
        if step is None or not np.isfinite(step).all():
            break
        size, X = smaller, X + step
    return X


def discrete_regulator(
    p: matrices.PlantMatrices, gamma: float
) -> tuple[Matrix, Matrix, Matrix] | None:
    """Return the central gain in discrete time, X, and the weight of u and w, D'D + B'XB."""
    nw = 0 if math.isinf(gamma) else p.nw
    B, D = np.hstack([p.B2, p.B1[:, :nw]]), np.hstack([p.D12, p.D11[:, :nw]])
    R = D.T @ D
    R[p.nu :, p.nu :] -= gamma**2 * np.eye(nw) if nw else 0.0
    with warnings.catch_warnings():
        # An ill-conditioned answer shows in the norm of the loop.
        warnings.simplefilter("ignore")
        try:
            X = linalg.solve_discrete_are(p.A, B, p.C1.T @ p.C1, (R + R.T) / 2, s=p.C1.T @ D)
            weight = R + B.T @ X @ B
            if nw and np.linalg.eigvalsh(weight[p.nu :, p.nu :])[-1] >= 0:
                return None
            return -np.linalg.solve(weight, B.T @ X @ p.A + D.T @ p.C1)[: p.nu], X, weight
        except (linalg.LinAlgError, ValueError):
            return None


def state_norm_lower_bound(
    plant: matrices.PlantMatrices, norm: str, achieved: float, tolerance: float, budget: Budget
) -> float:
    """Return a norm that no stabilising state feedback falls below.

    For the H2 norm it is that of the regulator; for the H-infinity norm a gamma at which the
    Riccati equation has no solution X >= 0, beyond doubt, as near below `achieved` as can be told.
    Where a control has no price, the equation is reduced to the states that none sets at will; the
    H2 norm and discrete time have D11 alone, which no feedback changes.

    Parameters
    ----------
    plant : PlantMatrices
    norm : {"hinf", "h2"}
    achieved : float
        The norm of the best gain known.
    tolerance : float
        Relative: a bound this near is looked for first.
    budget : Budget

    Returns
    -------
    float
    """
    direct = plant.D11 if norm == "hinf" or plant.discrete else np.zeros((0, 0))
    least = float(np.linalg.norm(direct, 2 if norm == "hinf" else None)) if direct.size else 0.0
    least = min(least, achieved)
    if not math.isfinite(achieved):
        return least
    if not matrices.is_regular(plant):
        if norm == "hinf" and not plant.discrete:
            found = lower_bound(matrices.with_measured_states(plant), _BRACKET * tolerance, budget)
            if found is not None and found.proven:
                return min(max(least, found.value), achieved)
        return least
    budget.spend(step_cost(2 * plant.nx))
    if norm == "h2":
        optimum = matrices.state_gain_norm(plant, central_state_gain(plant, math.inf), "h2")
        return min(optimum, achieved) if math.isfinite(optimum) else least
    # Zeros on the axis leave every gamma without a solution.
    # A lower bound is looked for below the norm by this share of the tolerance, then by a
    # distance larger by the second factor, and so on.
    share = math.inf if _is_infeasible_at(plant, 2 * achieved) else 0.25 * tolerance
    while share < 1:
        gamma = achieved * (1 - share)
        if gamma <= least:
            break
        budget.spend(step_cost(2 * plant.nx))
        if _is_infeasible_at(plant, gamma):
            return gamma
        share *= 1.5
    return least


def _is_infeasible_at(plant: matrices.PlantMatrices, gamma: float) -> bool:
    """Return whether there is no X >= 0, and rounding errors leave no doubt about it.

    With the stable subspace of the Hamiltonian matrix spanned by [U; V], X = V inv(U) is positive
    if and only if U'V is, also where U is singular and X infinite.
    """
    if plant.discrete:
        F = central_state_gain(plant, gamma)
        return not matrices.state_gain_norm(plant, F, "hinf") <= gamma
    game = _HinfRiccati.of(plant, gamma)
    if game is None:
        return False
    n = plant.nx
    H, _, _ = matrices.balanced_hamiltonian(game.A, game.R, game.Q)
    if not np.isfinite(H).all():
        return False
    schur: Any = linalg.schur(H, output="complex", sort="lhp")
    values: Any = np.diag(schur[0])
    basis, stable = schur[1:]
    # Eigenvalues this near to the imaginary axis, over their size, count as on it: no solution.
    # Just below the optimum they are simple and known to 1e-13; the lightest damping of the
    # bearing is 1e-5.
    level = 1e-10 * np.abs(values) + n * EPS * np.linalg.norm(H)
    if stable != n or (np.abs(values.real) < level).any():
        return True
    product = basis[:n, :n].conj().T @ basis[n:, :n]
    error = float(np.abs(product - product.conj().T).max())
    least = np.linalg.eigvalsh(product + product.conj().T)[0] / 2
    # A solution counts as not positive if it is so by this many rounding errors, as seen in its
    # asymmetry. Next to an optimum that needs infinite gain only that tells on which side gamma
    # is: the random plants 1 and 3 had "optimal" designs 5e-4 above the optimum.
    return bool(least < -10.0 * max(error, EPS))


# The H2 optimum of output feedback (LQG): a regulator of the plant and one of its dual; and the
# infimum of singular problems.

_HOW = "by Riccati equations in double precision"


def cancel_feedthrough(plant: matrices.PlantMatrices) -> tuple[matrices.PlantMatrices, Matrix]:
    """Close a static controller that makes the feedthrough from w to z zero; return it as well.

    Raises
    ------
    InfeasibleError
        If none does, so that the H2 norm of every loop is infinite.
    """
    P = plant
    F = np.zeros((P.B2.shape[1], P.C2.shape[0]))
    if plant.discrete or not P.D11.any():
        return plant, F
    F = -np.linalg.pinv(P.D12, rcond=1e-12) @ P.D11 @ np.linalg.pinv(P.D21, rcond=1e-12)
    rest = P.D11 + P.D12 @ F @ P.D21
    # How much of D11 may be left, relative, where a static controller cancels it.
    if np.abs(rest).max() > SAME * np.abs(P.D11).max():
        raise no_finite_h2_norm()
    return P.with_inner_loop(F).replace(D11=np.zeros_like(P.D11)), F


def no_finite_h2_norm() -> InfeasibleError:
    """Return the error for a feedthrough that passes white noise whatever the controller does."""
    return InfeasibleError(
        "The H2 norm of every loop is infinite: no controller cancels the feedthrough D11 from "
        "w to z. Filter w or z so that D11 vanishes, or use norm='hinf'."
    )


def h2_lower_bound(plant: matrices.PlantMatrices) -> LowerBound | None:
    """Bound the H2 norm of every stabilising controller's loop from below.

    Stoorvogel, "The singular H2 control problem", Automatica 28 (1992) 627-631: the square of the
    infimum is tr(B1' X B1) + tr((A'X + XA + C1'C1) Y), X and Y as for the H-infinity norm with
    gamma = infinity.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, without D22, and without D11 if continuous.

    Returns
    -------
    LowerBound or None
        None where the equations have no solution in double precision.
    """
    if plant.discrete:
        K = lqg(plant)
        if K is None:
            return None
        return LowerBound(float(h2_norm(control.StateSpace(*matrices.close(plant, K), True))), _HOW)
    P, halves = plant, reduced_riccati_pair(plant)
    if halves is None:
        return None
    X, Y = halves.control.solve(np.inf), halves.measurement.solve(np.inf)
    if X is None or Y is None:
        return None
    square = np.trace(P.B1.T @ X @ P.B1) + np.trace((P.A.T @ X + X @ P.A + P.C1.T @ P.C1) @ Y)
    return LowerBound(float(np.sqrt(max(square, 0.0))), _HOW)


def lqg(plant: matrices.PlantMatrices) -> matrices.Controller | None:
    """Return the optimal controller of a regular plant; None if it is not regular.

    Zhou, Doyle, Glover, "Robust and Optimal Control" (1996), theorem 14.7, in continuous time. In
    discrete time the measurement of the same instant is used: Chen and Francis,
    "Optimal Sampled-Data Control Systems" (1995), section 6.6.
    """
    P = plant
    if plant.discrete:
        gain, estimate = (discrete_regulator(half, np.inf) for half in (P, P.dual))
        if gain is None or estimate is None:
            return None
        (F, X, R), (Lt, Y, St) = gain, estimate
        if max(np.linalg.cond(R), np.linalg.cond(St)) > 1e14:
            return None
        F0 = -np.linalg.solve(R, P.B2.T @ X @ P.B1 + P.D12.T @ P.D11)
        L0 = np.linalg.solve(St, (F @ Y @ P.C2.T + F0 @ P.D21.T).T).T
        A = P.A + P.B2 @ F + Lt.T @ P.C2 - P.B2 @ L0 @ P.C2
        return matrices.Controller(A, -(Lt.T - P.B2 @ L0), F - L0 @ P.C2, L0)
    F, Lt = _regulator(P), _regulator(P.dual)
    if F is None or Lt is None:
        return None
    A = P.A + P.B2 @ F + Lt.T @ P.C2
    return matrices.Controller(A, -Lt.T, F, np.zeros((P.nu, P.ny)))


def _regulator(plant: matrices.PlantMatrices) -> Matrix | None:
    """Return the gain of the regulator, where every control has a price to working accuracy."""
    s = np.linalg.svd(plant.D12, compute_uv=False)
    if plant.nz < plant.nu or not s.size or s[-1] < 1e-10 * max(s[0], 1.0):
        return None
    F = central_state_gain(plant, np.inf)
    return F if F is not None and matrices.stabilises(plant, F) else None


# State feedback that keeps the disturbances from z altogether, where there is one.


# Singular values below it are zero: the matrices are scaled.
_RANK = 1e-10


def output_nulling_gain(p: matrices.PlantMatrices) -> Matrix | None:
    """Return a stabilising F with which w does not reach z; None if there is none.

    Notes
    -----
    Within the largest subspace V that a control u = U v keeps while z stays zero, the part that is
    stabilised with what is free in u has to hold B1 (H. L. Trentelman, A. A. Stoorvogel,
    M. Hautus, Control Theory for Linear Systems, 2001, chapters 4 to 7).
    """
    if p.D11.any():
        return None
    A, B, V = p.A, p.B2, np.eye(p.nx)
    while True:  # x is kept if some u leads it back into V, with z = 0
        out, free = _leaving(p, V)
        kept = _range(V @ _null(np.hstack([out, free]))[: V.shape[1]])
        if kept.shape[1] == V.shape[1]:
            break
        V = kept
    U = N = inner = entry = V
    for _ in range(2):
        out, free = _leaving(p, V)
        U, N = -np.linalg.pinv(free, rcond=_RANK) @ out, _null(free)
        inner, entry = V.T @ (A @ V + B @ U), V.T @ B @ N
        good = (lambda s: abs(s) < 1 - _RANK) if p.discrete else (lambda s: s.real < -_RANK)
        found: Any = linalg.schur(inner, output="complex", sort=good)
        steps = [entry]
        for _ in range(V.shape[1] - 1):
            steps.append(inner @ steps[-1] / max(float(np.linalg.norm(inner, 2)), 1e-300))
        slow = found[1][:, : found[2]]
        stabilised = _range(V @ _range(np.hstack([*steps, slow.real, slow.imag])))
        if stabilised.shape[1] == V.shape[1]:
            break
        V = stabilised
    if not V.size or np.linalg.norm(p.B1 - V @ (V.T @ p.B1)) > _RANK * np.linalg.norm(p.B1):
        return None
    W = _null(V.T)
    try:
        within = U + N @ _stabilising_gain(inner, entry, p.discrete)
        beyond = _stabilising_gain(W.T @ A @ W, W.T @ B, p.discrete)
    except np.linalg.LinAlgError:
        return None
    return within @ V.T + beyond @ W.T


def _leaving(p: matrices.PlantMatrices, V: Matrix) -> tuple[Matrix, Matrix]:
    """Return what of x in V, and of u, leaves V or shows in z."""
    W = _null(V.T)
    return np.vstack([W.T @ p.A @ V, p.C1 @ V]), np.vstack([W.T @ p.B2, p.D12])


def _stabilising_gain(A: Matrix, B: Matrix, discrete: bool) -> Matrix:
    if not A.size or not B.size:
        return np.zeros((B.shape[1], len(A)))
    Q, R = np.eye(len(A)), np.eye(B.shape[1])
    if discrete:
        X = linalg.solve_discrete_are(A, B, Q, R)
        return -np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A)
    return -B.T @ linalg.solve_continuous_are(A, B, Q, R)


def _null(M: Matrix) -> Matrix:
    return linalg.null_space(M, rcond=_RANK) if len(M) else np.eye(M.shape[1])


def _range(M: Matrix) -> Matrix:
    return linalg.orth(M, rcond=_RANK) if M.size else M[:, :0]
