"""State feedback by Riccati equations: LQR for the H2 norm, a game for the H-infinity norm."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem
from robustpolish.synthesis.riccati.equations import solve_lyapunov, solve_riccati

Matrix = NDArray[np.float64]

_NEWTON_STEPS = 3


def lqr_gain(problem: StateFeedbackProblem) -> Matrix | None:
    """Return the gain that minimises the H2 norm; D12 needs full column rank."""
    return game_gain(problem, math.inf)


def game_gain(problem: StateFeedbackProblem, gamma: float) -> Matrix | None:
    r"""Return the central state feedback for an H-infinity norm below `gamma`, or None.

    With W = (gamma^2 I - D11' D11)^-1 and N = I + D11 W D11' the worst disturbance is
    eliminated first, because u = F x does not see w; what is left is a Riccati equation in

    .. math:: \tilde A = A + B_1 W D_{11}'C,\quad \tilde B = B_2 + B_1 W D_{11}' D_{12},\quad
              R = D_{12}' N D_{12}

    after Zhou, Doyle, Glover, "Robust and Optimal Control", 1996, section 16.4.
    """
    p = problem
    if p.nu == 0:
        return np.zeros((0, p.nx))
    if p.discrete:
        return _discrete_game_gain(p, gamma)
    if math.isinf(gamma):
        W = np.zeros((p.B1.shape[1],) * 2)
    else:
        gap = gamma**2 * np.eye(p.B1.shape[1]) - p.D11.T @ p.D11
        if np.linalg.eigvalsh(gap).min(initial=math.inf) <= 0:
            return None
        W = np.linalg.inv(gap)
    N = np.eye(p.C.shape[0]) + p.D11 @ W @ p.D11.T
    worst = p.B1 @ W @ p.D11.T
    A, B = p.A + worst @ p.C, p.B2 + worst @ p.D12
    R, S = p.D12.T @ N @ p.D12, p.D12.T @ N @ p.C
    try:
        factor = linalg.cho_factor(R)
    except linalg.LinAlgError:
        return None
    RinvS, RinvB = linalg.cho_solve(factor, S), linalg.cho_solve(factor, B.T)
    drift, quadratic = A - B @ RinvS, p.B1 @ W @ p.B1.T - B @ RinvB
    constant = p.C.T @ N @ p.C - S.T @ RinvS
    solution = solve_riccati(drift, quadratic, constant)
    if solution is None:
        return None
    return -(RinvB @ _refined(drift, quadratic, constant, solution.X) + RinvS)


def _refined(A: Matrix, R: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    """Return the solution of A'X + XA + XRX + Q = 0 after Newton steps that help."""
    size = math.inf
    for _ in range(_NEWTON_STEPS):
        closed = A + R @ X
        residual = A.T @ X + X @ closed + Q
        residual = (residual + residual.T) / 2
        smaller = float(np.linalg.norm(residual))
        if not smaller < 0.5 * size:
            break
        if not (np.linalg.eigvals(closed).real < 0).all():
            break
        step = solve_lyapunov(closed, residual)
        if step is None or not np.isfinite(step).all():
            break
        size, X = smaller, X + step
    return X


def _discrete_game_gain(p: StateFeedbackProblem, gamma: float) -> Matrix | None:
    nw = 0 if math.isinf(gamma) else p.B1.shape[1]
    B1, D11 = p.B1[:, :nw], p.D11[:, :nw]
    B, D = np.hstack([p.B2, B1]), np.hstack([p.D12, D11])
    R = D.T @ D
    R[p.nu :, p.nu :] -= gamma**2 * np.eye(nw) if nw else 0.0
    try:
        X = linalg.solve_discrete_are(p.A, B, p.C.T @ p.C, (R + R.T) / 2, s=p.C.T @ D)
        quadratic = R + B.T @ X @ B
        if nw and np.linalg.eigvalsh(quadratic[p.nu :, p.nu :])[-1] >= 0:
            return None
        return -np.linalg.solve(quadratic, B.T @ X @ p.A + D.T @ p.C)[: p.nu]
    except (linalg.LinAlgError, ValueError):
        return None


def minimise_hinf(
    problem: StateFeedbackProblem,
    tolerance: float,
    out_of_time: Callable[[], bool],
) -> tuple[Matrix | None, float, float]:
    """Bisect on gamma, believing only the norms of loops.

    Parameters
    ----------
    problem : StateFeedbackProblem
        D12 with full column rank.
    tolerance : float
        Relative width of the final bracket.
    out_of_time : callable
        Ends the search early when it returns true.

    Returns
    -------
    F : ndarray or None
        The gain with the smallest norm seen; None if none stabilises.
    upper, lower : float
        Norm achieved by F, and the largest gamma at which no gain was found.
    """
    best = game_gain(problem, math.inf)
    upper = problem.achieved(best, "hinf")
    lower = float(np.linalg.norm(problem.D11, 2)) if problem.D11.size else 0.0
    if not math.isfinite(upper):
        return None, upper, lower
    step = 2.0
    while upper > lower * (1 + tolerance) and not out_of_time():
        # Downwards in growing steps until the first failure, then halving the bracket.
        gamma = math.sqrt(upper * lower) if lower > upper / step else upper / step
        step = step**2 if step < 1e8 else step
        F = game_gain(problem, gamma)
        achieved = problem.achieved(F, "hinf")
        # Next to the optimum rounding errors of X can leave a better gain a little above gamma.
        if achieved < upper * (1 - 0.1 * tolerance):
            best, upper = F, achieved
            if upper <= 0:
                break
        else:
            lower = gamma
            step = math.inf
    return best, upper, lower
