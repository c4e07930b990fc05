"""State feedback by Riccati equations: LQR for the H2 norm, a game for the H-infinity norm."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    is_regular,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.riccati.equations import (
    solve_lyapunov,
    solve_riccati,
    symplectic_scaling,
)
from robustpolish.synthesis.riccati.gamma import lower_bound
from robustpolish.synthesis.state_feedback.engine import POLICY, StateEngine, StateGain


class RiccatiStateEngine(StateEngine):
    """The linear-quadratic regulator for the H2 norm, a bisection on gamma for H-infinity.

    Regions do not fit into a Riccati equation and are not looked at.
    """

    def search(self, plant: PlantMatrices, budget: Budget) -> StateGain | None:
        """Minimise the norm; see :class:`StateEngine`."""
        if self.norm == "h2":
            budget.spend(POLICY.gain_work(plant.nx))
            F = lqr_gain(plant)
            achieved = state_gain_norm(plant, F, "h2")
            if F is None or not math.isfinite(achieved):
                return None
            step = {"step": "linear-quadratic regulator", "achieved": achieved}
            return StateGain(F, achieved, achieved, history=(step,))
        best, upper, lower = minimise_hinf(plant, POLICY.bracket * self.slack, budget)
        if best is None:
            return None
        history = ({"step": "bisection on gamma", "achieved": upper, "no_gain_found_at": lower},)
        # The gain often grows without limit towards the optimum, so a little is given away.
        # Multiples of the slack at which the Riccati equation is solved in the end: next to the
        # optimum its solution can be too inaccurate to keep its claim.
        for retreat in (1.0, 2.5, 5.0):
            claim = upper * (1 + retreat * self.slack)
            smaller = central_state_gain(plant, claim)
            achieved = state_gain_norm(plant, smaller, "hinf")
            if smaller is not None and achieved <= claim * (1 + 1e-9):
                return StateGain(smaller, max(claim, achieved), achieved, history=history)
        return StateGain(best, upper, state_gain_norm(plant, best, "hinf"), history=history)


def lqr_gain(plant: PlantMatrices) -> Matrix | None:
    """Return the gain that minimises the H2 norm; D12 needs full column rank."""
    return central_state_gain(plant, math.inf)


def central_state_gain(plant: PlantMatrices, gamma: float) -> Matrix | None:
    r"""Return the central state feedback for an H-infinity norm below `gamma`, or None.

    With W = (gamma^2 I - D11' D11)^-1 and N = I + D11 W D11' the worst disturbance is
    eliminated first, because u = F x does not see w; what is left is a Riccati equation in

    .. math:: \tilde A = A + B_1 W D_{11}'C,\quad \tilde B = B_2 + B_1 W D_{11}' D_{12},\quad
              R = D_{12}' N D_{12}

    after Zhou, Doyle, Glover, "Robust and Optimal Control", 1996, section 16.4.
    """
    if plant.nu == 0:
        return np.zeros((0, plant.nx))
    if plant.discrete:
        return _discrete_central_gain(plant, gamma)
    game = _HinfRiccati.of(plant, gamma)
    if game is None:
        return None
    solution = solve_riccati(game.A, game.R, game.Q)
    if solution is None:
        return None
    return -(game.per_x @ _refined(game.A, game.R, game.Q, solution.X) + game.rest)


class _HinfRiccati(NamedTuple):
    """A'X + XA + XRX + Q = 0, and F = -(per_x X + rest)."""

    A: Matrix
    R: Matrix
    Q: Matrix
    per_x: Matrix
    rest: Matrix

    @classmethod
    def of(cls, plant: PlantMatrices, gamma: float) -> _HinfRiccati | None:
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
        step = solve_lyapunov(closed, residual)
        if step is None or not np.isfinite(step).all():
            break
        size, X = smaller, X + step
    return X


def _discrete_central_gain(p: PlantMatrices, gamma: float) -> Matrix | None:
    nw = 0 if math.isinf(gamma) else p.nw
    B1, D11 = p.B1[:, :nw], p.D11[:, :nw]
    B, D = np.hstack([p.B2, B1]), np.hstack([p.D12, D11])
    R = D.T @ D
    R[p.nu :, p.nu :] -= gamma**2 * np.eye(nw) if nw else 0.0
    try:
        X = linalg.solve_discrete_are(p.A, B, p.C1.T @ p.C1, (R + R.T) / 2, s=p.C1.T @ D)
        quadratic = R + B.T @ X @ B
        if nw and np.linalg.eigvalsh(quadratic[p.nu :, p.nu :])[-1] >= 0:
            return None
        return -np.linalg.solve(quadratic, B.T @ X @ p.A + D.T @ p.C1)[: p.nu]
    except (linalg.LinAlgError, ValueError):
        return None


def minimise_hinf(
    plant: PlantMatrices, tolerance: float, budget: Budget
) -> tuple[Matrix | None, float, float]:
    """Bisect on gamma, believing only the norms of loops.

    Parameters
    ----------
    plant : PlantMatrices
        D12 with full column rank.
    tolerance : float
        Relative width of the final bracket.
    budget : Budget
        The bisection ends when it is over.

    Returns
    -------
    F : ndarray or None
        The gain with the smallest norm seen; None if none stabilises.
    upper, lower : float
        Norm achieved by F, and the largest gamma at which no gain was found.
    """
    best = central_state_gain(plant, math.inf)
    upper = state_gain_norm(plant, best, "hinf")
    lower = float(np.linalg.norm(plant.D11, 2)) if plant.D11.size else 0.0
    if not math.isfinite(upper):
        return None, upper, lower
    step = 2.0
    while upper > lower * (1 + tolerance) and not budget.over:
        # Downwards in growing steps until the first failure, then halving the bracket.
        gamma = math.sqrt(upper * lower) if lower > upper / step else upper / step
        step = step**2 if step < 1e8 else step
        budget.spend(POLICY.gain_work(plant.nx))
        F = central_state_gain(plant, gamma)
        achieved = state_gain_norm(plant, F, "hinf")
        # Next to the optimum rounding errors of X can leave a better gain a little above gamma.
        if achieved < upper * (1 - 0.1 * tolerance):
            best, upper = F, achieved
            if upper <= 0:
                break
        else:
            lower = gamma
            step = math.inf
    return best, upper, lower


def state_norm_lower_bound(
    plant: PlantMatrices, norm: str, achieved: float, tolerance: float, budget: Budget
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
    if not is_regular(plant):
        if norm == "hinf" and not plant.discrete:
            found = lower_bound(with_measured_states(plant), POLICY.bracket * tolerance, budget)
            if found is not None and found.proven:
                return min(max(least, found.value), achieved)
        return least
    budget.spend(POLICY.gain_work(plant.nx))
    if norm == "h2":
        optimum = state_gain_norm(plant, lqr_gain(plant), "h2")
        return min(optimum, achieved) if math.isfinite(optimum) else least
    # Zeros on the axis leave every gamma without a solution.
    # A lower bound is looked for below the norm by this share of the tolerance, then by a
    # distance larger by the second factor, and so on.
    share = math.inf if _is_infeasible_at(plant, 2 * achieved) else 0.25 * tolerance
    while share < 1:
        gamma = achieved * (1 - share)
        if gamma <= least:
            break
        budget.spend(POLICY.gain_work(plant.nx))
        if _is_infeasible_at(plant, gamma):
            return gamma
        share *= 1.5
    return least


def _is_infeasible_at(plant: PlantMatrices, gamma: float) -> bool:
    """Return whether there is no X >= 0, and rounding errors leave no doubt about it.

    With the stable subspace of the Hamiltonian matrix spanned by [U; V], X = V inv(U) is positive
    if and only if U'V is, also where U is singular and X infinite.
    """
    if plant.discrete:
        F = _discrete_central_gain(plant, gamma)
        return not state_gain_norm(plant, F, "hinf") <= gamma
    game = _HinfRiccati.of(plant, gamma)
    if game is None:
        return False
    n = plant.nx
    scale, weight = symplectic_scaling(game.A, game.R, game.Q)
    A, R = game.A * scale / scale[:, None], game.R / scale / scale[:, None]
    H = np.block([[A, R * weight], [-(game.Q * scale * scale[:, None]) / weight, -A.T]])
    if not np.isfinite(H).all():
        return False
    schur: Any = linalg.schur(H, output="complex", sort="lhp")
    values: Any = np.diag(schur[0])
    basis, stable = schur[1:]
    # Eigenvalues this near to the imaginary axis, over their size, count as on it: no solution.
    # Just below the optimum they are simple and known to 1e-13; the lightest damping of the
    # bearing is 1e-5.
    level = 1e-10 * np.abs(values) + n * np.finfo(float).eps * np.linalg.norm(H)
    if stable != n or (np.abs(values.real) < level).any():
        return True
    product = basis[:n, :n].conj().T @ basis[n:, :n]
    error = float(np.abs(product - product.conj().T).max())
    least = np.linalg.eigvalsh(product + product.conj().T)[0] / 2
    # A solution counts as not positive if it is so by this many rounding errors, as seen in its
    # asymmetry. Next to an optimum that needs infinite gain only that tells on which side gamma
    # is: the random plants 1 and 3 had "optimal" designs 5e-4 above the optimum.
    return bool(least < -10.0 * max(error, np.finfo(float).eps))
