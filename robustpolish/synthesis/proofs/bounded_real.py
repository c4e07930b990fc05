"""What is proven of a closed loop: its poles, its norm, and the matrices that show both."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import flint
import numpy as np
from scipy import linalg
from scipy.linalg import lapack as _lapack

from robustpolish.base.arrays import AGREE, EPS, NOTHING, SAME, AnyArray, Array, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import Ball, BallSystem, bounded_real, is_definite
from robustpolish.linear.arithmetic.exact import size
from robustpolish.linear.norms.modal_peak import Peak, modal_form
from robustpolish.linear.stability import eigensystem
from robustpolish.linear.systems import Realisation, hamiltonian, resolvent_response
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import balancing_scale, solve_lyapunov, solve_riccati

# Estimates.


# The H-infinity norm of a stable loop in plain doubles, where a proof follows.
#
# What it promises is a gain that the loop reaches, up to rounding: no upper bound, no look at the
# stability of the loop, which has to be known. :func:`robustpolish.hinf_norm` promises a
# bracket around the norm, proven, and infinity for unstable systems; it takes longer. The inner
# steps of a search, and large loops whose bound is proven in ball arithmetic afterwards, can do
# without.

_LEVEL_STEPS = 12
_MOST_SEEDS = 80
# From more states on modal coordinates are quicker than Hamiltonian matrices.
_MODAL = 40
# Brackets this narrow, relative, settle a norm in modal coordinates; up to the second width their
# peak is where the Hamiltonian matrix starts from, one step instead of a look at every resonance.
_WIDEST, _WIDEST_START = 1e-4, 1e-2


class EstimatedNorm(NamedTuple):
    """A gain that is reached, where, and whether nothing larger is in sight.

    ``settled`` is whether the Hamiltonian matrix shows no larger gain than ``value``. Doubles
    cannot tell for norms that are tiny beside the gains that cancel in them. ``frequency`` is
    in rad/s.
    """

    value: float
    frequency: float
    settled: bool


def estimate_norm(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, tolerance: float = 1e-6
) -> EstimatedNorm:
    """Estimate the norm of a stable continuous-time system.

    Parameters
    ----------
    A, B, C, D : ndarray
    tolerance : float
        Relative; beyond 40 states rounding errors may leave 1e-4.

    Returns
    -------
    EstimatedNorm

    Notes
    -----
    Bruinsma and Steinbuch, Systems & Control Letters 14 (1990) 287-293.
    """
    scale = state_scale(A, B, C)
    model = Realisation(A * scale / scale[:, None], B / scale[:, None], C * scale, D, False)
    peak = _modal_peak(model, tolerance) if len(A) > _MODAL else None
    seeds = np.array([np.inf])
    if peak is not None:
        seeds = np.array([peak.frequency])
    elif A.size:
        seeds = np.append(_resonances(np.linalg.eigvals(model.A)), seeds)
    norm, where = _highest_gain(model, seeds)
    if peak is not None and peak.upper <= (1 + _WIDEST) * peak.gain:
        return EstimatedNorm(norm, where, abs(norm - peak.gain) <= _WIDEST * norm)
    if norm == 0 or not np.isfinite(norm) or not A.size:
        return EstimatedNorm(norm, where, bool(np.isfinite(norm)))
    for _ in range(_LEVEL_STEPS):
        crossings = _level_crossings(model, norm * (1 + tolerance))
        if crossings is None or not crossings.size:
            return EstimatedNorm(norm, where, crossings is not None)
        middle = np.concatenate([crossings, (crossings[1:] + crossings[:-1]) / 2])
        higher, there = _highest_gain(model, middle)
        if higher <= norm * (1 + tolerance):
            # Eigenvalues that only look as if they were on the axis.
            return EstimatedNorm(norm, where, crossings.size <= 2)
        norm, where = higher, there
    return EstimatedNorm(norm, where, False)


def _modal_peak(model: Realisation, tolerance: float) -> Peak | None:
    """Find the peak in modal coordinates; None where rounding errors leave it wide open."""
    if not model.D.size or model.D.size > model.states:
        return None
    from robustpolish.linear.norms.modal_peak import modal_peak

    form = modal_form(model, eigensystem(model.A), False)
    if form is None or not form.stable:
        return None
    return modal_peak(form, tolerance, max(tolerance, _WIDEST_START))


def _highest_gain(model: Realisation, frequencies: Array) -> tuple[float, float]:
    """Return the largest gain at some frequencies, and where; infinite if one of them is a pole."""
    if not model.D.size:
        return 0.0, 0.0
    found = responses(model.A, model.B, model.C, model.D, frequencies)
    if not np.isfinite(found).all():
        return np.inf, 0.0
    gains = np.linalg.svd(found, compute_uv=False)[:, 0]
    best = int(np.argmax(gains))
    return float(gains[best]), float(frequencies[best])


def state_scale(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Balance the states by powers of two, with all inputs and all outputs as one more state."""
    into, out = np.linalg.norm(B, axis=1), np.linalg.norm(C, axis=0)
    return balancing_scale(np.block([[A, into[:, None]], [out[None, :], np.zeros((1, 1))]]))[:-1]


def _resonances(poles: Any) -> Array:
    """Return the frequencies at which poles may peak, the least damped ones first."""
    size = np.abs(poles)
    damping = -poles.real / np.where(size > 0, size, 1)
    order = np.argsort(damping)[:_MOST_SEEDS]
    peaks = size * np.sqrt(np.clip(1 - 2 * damping**2, 0, None))
    found = [np.zeros(1), np.abs(poles.imag)[order], size[order], peaks[order]]
    return np.unique(np.concatenate(found))


def _level_crossings(model: Realisation, gamma: float) -> Array | None:
    """Return the frequencies at which a singular value equals gamma; None beyond doubles."""
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return None
    values: Any = np.linalg.eigvals(H)
    level = 1e-7 * np.abs(values) + 1e-13 * np.linalg.norm(H)
    return np.unique(np.abs(values.imag[np.abs(values.real) <= level]))


# The closed loop of a plant and any controller, in ball arithmetic: an enclosure of the exact one.

lapack: Any = _lapack
BITS = 240
"""Precision of the balls; more where that does not suffice for a proof."""
# More states than this are solved for in doubles and refined: at most so often, as long as each
# step is that much smaller than the one before, until one is so small beside the solution.
_REFINEMENTS, _PROGRESS = 12, 1e-3


def enclose_loop(plant: GeneralizedPlant, controller: Any, bits: int = BITS) -> BallSystem:
    """Connect u = K y without rounding errors and scale the loop's states by powers of two.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace
    bits : int
        Precision of the enclosure.

    Raises
    ------
    ZeroDivisionError
        If I - Dk D22 cannot be shown to be nonsingular.
    """
    with balls.precision(bits):
        A, B, C, D = BallSystem.closed_loop(plant, controller)
        scale = state_scale(*map(balls.midpoint, (A, B, C)))
        given, shown = np.ones(B.ncols()), np.ones(C.nrows())
        A, B = balls.scaled(A, 1 / scale, scale), balls.scaled(B, 1 / scale, given)
        return BallSystem(A, B, balls.scaled(C, shown, scale), D, scale)


def cayley(loop: BallSystem, bits: int = BITS) -> BallSystem:
    """Map a discrete-time loop to a continuous one of the same stability and H-infinity norm.

    Raises
    ------
    ZeroDivisionError
        If A + I is singular, in which case the loop is not stable.
    """
    with balls.precision(bits):
        return loop.continuous()


def gain_at(loop: BallSystem, frequency: float) -> float:
    """Return the largest singular value at a frequency in rad/s, with the bits in force."""
    try:
        return float(np.linalg.norm(balls.midpoint(loop.response(frequency, _refined_solution)), 2))
    except ZeroDivisionError:
        return math.inf


def _output_size(loop: BallSystem) -> float:
    """Return how large C'C is beside A, which P is likely to be."""
    A, _, C, _ = loop.doubles
    return float(np.linalg.norm(C) ** 2 / np.linalg.norm(A)) or 1.0


def _shifted_terms(loop: BallSystem, alpha: float, output: float = 1.0) -> tuple[Ball, Ball, Ball]:
    """Return the terms of the Riccati equation of the loop with A + alpha, and a little output."""
    A, R, Q = loop.riccati_terms()
    shift = balls.identity(A.nrows()) * flint.arb(float(alpha))
    return A + shift, R, Q + shift * flint.arb(float(0.1 * output))


def angle(frequency: float, step: float | None) -> float:
    """Return where a frequency in rad/s lies on the axis of the loop that :func:`cayley` gives."""
    return frequency if step is None else math.tan(min(frequency * step, math.pi) / 2)


def rate(angle: float, step: float | None) -> float:
    """Return the frequency in rad/s that lies there."""
    return angle if step is None else 2 * math.atan(angle) / step


def rounding_level(loop: BallSystem, cancelled: float = 0.0) -> float:
    """Return the size of a norm that rounding errors in doubles can feign.

    That is the unit roundoff times the gain that the loop would have if nothing cancelled;
    an exactly vanishing transfer matrix computes to something below it. `cancelled` is the size of
    what may have cancelled in C already, where the loop was closed.
    """
    A, B, C, D = loop.doubles
    poles = np.abs(np.linalg.eigvals(A)) if A.size else np.zeros(0)
    slowest = poles.min() if poles.size else 0.0
    seen = np.linalg.norm(C) + cancelled
    gain = np.linalg.norm(B) * seen / slowest if slowest > 0 else 0.0
    return float(10 * EPS * max(A.shape[0], 1) * (gain + np.linalg.norm(D)))


def _refined_solution(M: Ball, B: Ball) -> Ball:
    """Solve M X = B in doubles and refine X with the bits in force; in balls where that stalls.

    On many states it takes a small part of the time of a solution in balls.
    """
    if M.nrows() <= LARGE or not B.ncols():
        return M.solve(B)
    factors, pivots, singular = lapack.zgetrf(balls.midpoint(M))
    X, rest, before = flint.acb_mat(B.nrows(), B.ncols()), B, math.inf
    for _ in range(_REFINEMENTS):
        step = lapack.zgetrs(factors, pivots, balls.midpoint(rest))[0]
        size = float(np.linalg.norm(step))
        if singular or not size <= _PROGRESS * before:
            break
        X = (X + flint.acb_mat(X.nrows(), X.ncols(), step.ravel().tolist())).mid()
        if size <= NOTHING * float(np.linalg.norm(balls.midpoint(X))):
            return X
        rest, before = B - M * X, size
    return M.solve(B)


# The peak of a loop's gain and a matrix that proves it, in long arithmetic where doubles fail.

_STEPS = 12
_TOLERANCE = 1e-5
# Eigenvalues of the Hamiltonian nearer to the axis than this, relative, count as crossings: the
# bits resolve far less, and a peak as narrow as double precision can hold keeps farther away.
_ON_AXIS = 1e-28
# Seconds that eigenvalues of a matrix with one row take; they grow with the cube.
_EIGENVALUES = 2e-6
# Each step of the doubling algorithm looks twice as far ahead: it takes as many as the ratio of
# fastest and slowest rate has bits, and more where the bound is near the norm and for the accuracy.
_MORE_STEPS = 20


def precise_peak(loop: BallSystem, start: float) -> tuple[float, float]:
    """Climb to the largest gain of a stable continuous-time loop, without rounding it.

    The two-step iteration of Bruinsma and Steinbuch (Systems & Control Letters 14, 1990, 287-293).

    Parameters
    ----------
    loop : BallSystem
    start : float
        A frequency to start from, rad/s; may be infinite.

    Returns
    -------
    gain, frequency : float
        The gain that the loop has at this frequency, a lower bound of its norm and as a rule
        within 1e-5 of it. An upper bound takes a proof.
    """
    with balls.precision(BITS):
        gain, where = _highest(loop, {0.0, math.inf, start})
        for _ in range(_STEPS):
            if not 0 < gain < math.inf:
                break
            found = _crossings(loop, gain * (1 + _TOLERANCE))
            higher, there = _highest(loop, {(a + b) / 2 for a, b in pairwise(found)} | set(found))
            if higher <= gain * (1 + _TOLERANCE):
                break
            gain, where = higher, there
    return gain, where


def _highest(loop: BallSystem, frequencies: Iterable[float]) -> tuple[float, float]:
    return max(((gain_at(loop, x), x) for x in frequencies), default=(0.0, 0.0))


def _crossings(loop: BallSystem, gamma: float) -> list[float]:
    """Return the frequencies at which a singular value equals gamma, ascending."""
    H = balls.hamiltonian(*loop.over(flint.arb(gamma)).riccati_terms())
    check_deadline(_EIGENVALUES * H.nrows() ** 3)
    values = flint.acb_mat(H.mid()).eig(algorithm="approx")
    near = [value for value in values if abs(value.real.mid()) <= abs(value).mid() * _ON_AXIS]
    return sorted({abs(float(value.imag.mid())) for value in near})


def precise_riccati_solution(loop: BallSystem) -> Ball | None:
    """Solve the bounded-real Riccati equation, where a tiny shift of the poles will do.

    Midpoints of balls serve as long floating-point numbers in the structure-preserving doubling
    algorithm (Chu, Fan, Lin, Linear Algebra Appl. 396, 2005, 55-80).

    Returns
    -------
    flint.arb_mat or None
        None where it does not converge: the norm is not below one, or the bits are too few.
    """
    n = loop.A.nrows()
    poles: Any = np.linalg.eigvals(balls.midpoint(loop.A))
    slowest, fastest = float(np.abs(poles).min()), float(np.abs(poles).max())
    if not slowest > 0:
        return None
    damping = max(-float(poles.real.max()), 1e-15 * slowest)
    shift = slowest * 2.0 ** (-flint.ctx.prec // 3)
    A, R, Q = (M.mid() for M in _shifted_terms(loop, shift, _output_size(loop)))
    one, rate = balls.identity(n), flint.arb(math.sqrt(slowest * fastest))
    try:
        resolvent = (A - one * rate).inv().mid()
        core = (A - one * rate - R * resolvent.transpose() * Q).mid().inv().mid()
        E = one + core * (rate * 2)
        R = (resolvent * R * core.transpose() * (rate * 2)).mid()
        Q = (core.transpose() * Q * resolvent * (rate * 2)).mid()
        for _ in range(math.ceil(math.log2(fastest / damping)) + _MORE_STEPS):
            check_deadline()
            W = (one - R * Q).mid().inv().mid()
            EW = (E * W).mid()
            more = (E.transpose() * Q * (W * E)).mid()
            R, Q, E = (R + EW * R * E.transpose()).mid(), (Q + more).mid(), (EW * E).mid()
            change, now = (size(balls.midpoint(M)) for M in (more, Q))
            if not now < math.inf:
                return None
            if change <= 1e-60 * now:
                return balls.symmetric(Q).mid()
    except ZeroDivisionError:
        pass
    return None


# Proofs of stability and of norm bounds, checked in ball arithmetic.
#
# A proof is a symmetric P > 0 that satisfies a strict matrix inequality, the bounded-real one for
# the H-infinity norm (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
# 1994, section 2.7.3), the Gramian one for the H2 norm (section 6.3.2). P is found in doubles, or
# with more bits; nothing is assumed about how good it is, only the check counts. Discrete-time
# loops are mapped by the Cayley transformation, which keeps stability, the H-infinity norm and P
# itself.

Kind = Literal["bounded_real", "gramian", "lyapunov"]
SLACK = (1e-5, 2e-4, 9e-4)
"""How far above a computed norm, relative, the bounds lie that are tried, in this order."""
# From so many states on the tightest is left out, because a trial takes long.
LARGE = 60
_PASSES = 3


@dataclass(frozen=True, eq=False)
class NormProof:
    """A matrix that proves stability and a bound on the norm.

    Attributes
    ----------
    kind : {"bounded_real", "gramian", "lyapunov"}
        The inequality that P satisfies strictly.
    bound : float
        The proven upper bound on the norm. A "lyapunov" proof tells stability only: infinite,
        or zero if no disturbance reaches any output.
    P : ndarray, shape (n, n)
        The matrix, in the coordinates of `transformation`, rounded to doubles.
    transformation : ndarray, shape (n, n)
        T of T x, the coordinates in which P is near the identity; x are the loop's states.
    bits : int
        Least precision of the ball arithmetic of the check.
    """

    kind: Kind
    bound: float
    P: Matrix
    transformation: Matrix
    bits: int = BITS


class ProvenNorm(NamedTuple):
    """A proof, and the norm with the frequency of its peak in rad/s, computed again if need be."""

    proof: NormProof | None
    achieved: float
    frequency: float | None


def prove_computed_norm(
    loop: BallSystem, rounded: BallSystem, level: float, step: float | None
) -> ProvenNorm | None:
    """Compute the H-infinity norm in doubles and bracket it by a gain and a proof in balls.

    Parameters
    ----------
    loop : BallSystem
    rounded : BallSystem
        The same, connected in doubles. If rounding adds something to the norm, it counts; more
        than 1e-6 of it, more or less, is left to a closer look.
    level : float
        Norms below it cannot be told from zero in doubles.
    step : float or None
        Sampling time; None for a continuous-time loop.

    Returns
    -------
    Proven or None
        A proof that the loop is stable with a norm between the one returned, but for 1e-6 of it,
        and the bound. None where doubles do not settle it, or no such proof is found.
    """
    try:
        loop, rounded = (M if step is None else cayley(M) for M in (loop, rounded))
    except ZeroDivisionError:  # a pole at -1
        return None
    seen = []
    for each in (loop, rounded):
        matrices = each.doubles
        if 0 in matrices[3].shape or not all(np.isfinite(M).all() for M in matrices):
            return None
        seen.append(estimate_norm(*matrices, SAME))
    exact, other = seen
    if not (exact.settled and other.settled):
        return None
    with balls.precision(BITS):
        gain = gain_at(loop, exact.frequency)
    # How well, relative, what doubles find and what the enclosed loop has must agree to be
    # believed.
    if not (level < gain < np.inf and abs(other.value - gain) <= AGREE * gain):
        return None
    achieved, frequency = max((gain, exact.frequency), (other.value, other.frequency))
    slack = SLACK[loop.A.nrows() > LARGE]
    proof = prove_hinf(loop, achieved * (1 + slack), slack)
    return proof and ProvenNorm(proof, achieved, rate(frequency, step))


def prove_stability(loop: BallSystem, bits: int | None = None) -> NormProof | None:
    """Prove that a continuous-time loop is stable by a Lyapunov matrix.

    Parameters
    ----------
    loop : BallSystem
    bits : int, optional
        As for :func:`prove_hinf`.
    """
    n = loop.A.nrows()
    silent = replace(loop, B=balls.zeros(n, 0), C=balls.zeros(0, n), D=balls.zeros(0, 0))
    with balls.precision(bits or BITS):
        found = _proof_at_unit_norm(silent, 0.5, bits)
    return None if found is None else _proof("lyapunov", np.inf, found, loop)


def prove_hinf(
    loop: BallSystem, bound: float, slack: float = 1e-4, bits: int | None = None
) -> NormProof | None:
    """Prove that a continuous-time loop is stable with an H-infinity norm below `bound`.

    Parameters
    ----------
    loop : BallSystem
    bound : float
    slack : float
        By how much `bound` is expected to lie above the norm, relative; sets the margin
        of strictness that is tried in doubles.
    bits : int, optional
        Find P with so many bits, which takes longer and proves what doubles leave open. In
        doubles by default.
    """
    if not np.isfinite(bound):
        return None
    if bound <= 0:
        return _prove_zero(loop)
    with balls.precision(bits or BITS):
        unit = loop.over(flint.arb(float(bound)))
        gap = balls.identity(loop.B.ncols()) - unit.D.transpose() * unit.D
        found = _proof_at_unit_norm(unit, slack, bits) if is_definite(gap) else None
    return None if found is None else _proof("bounded_real", bound, found, loop)


def _proof_at_unit_norm(
    loop: BallSystem, slack: float, bits: int | None
) -> tuple[Matrix, Ball] | None:
    """Return coordinates T and a P in them that proves the norm of `loop` to be below one."""
    n = loop.A.nrows()
    if n == 0:
        return np.zeros((0, 0)), balls.zeros(0, 0)
    if bits is None:
        trials = _candidates(loop, slack)
    else:
        found = precise_riccati_solution(loop)
        trials = [] if found is None else [(np.eye(n), found, loop)]
    for T, P, turned in trials:
        if is_definite(bounded_real(P, *turned, 1)) and is_definite(P):  # pyright: ignore[reportCallIssue]
            return T, P
    return None


def _candidates(loop: BallSystem, slack: float) -> Iterator[tuple[Matrix, Ball, BallSystem]]:
    """Yield coordinates T, a P in them that should be bounded real at gamma = 1, and the loop in T.

    P solves the Riccati equation of the loop with all poles shifted to the right by a part
    of the stability margin, which leaves -2 alpha P, a margin in proportion to P. The coordinates
    are those in which the last P was the identity: solving again in them makes that margin visible
    in doubles however ill-conditioned P is in the given ones.
    """
    A, _, C, _ = loop.doubles
    n = A.shape[0]
    margin = -float(np.linalg.eigvals(A).real.max(initial=-np.inf))
    if n == 0 or margin <= 0:
        return
    output = _output_size(loop)
    shares = (0.3,) if n > LARGE else (0.3, 0.01)
    for alpha in (share * slack * margin for share in shares):
        extra = 1e-6 * alpha * output * np.eye(n)
        start = solve_lyapunov(A + alpha * np.eye(n), C.T @ C + extra)
        T = np.eye(n) if start is None else _identity_coordinates(start)
        for _ in range(_PASSES):
            try:
                into = balls.ball(T)
                turned = loop.transformed(into, into.inv())
            except ZeroDivisionError:
                break
            terms = _shifted_terms(turned, alpha)
            X = solve_riccati(*map(balls.midpoint, terms))
            if X is None:
                break
            values = np.linalg.eigvalsh(X)
            if values[0] > 1e-12 * values[-1]:
                yield T, _refined(X, *terms), turned
            T = _identity_coordinates(X) @ T


def _identity_coordinates(P: Matrix) -> Matrix:
    """Return an upper triangular T with T'T = P, as far as P is positive definite in doubles."""
    values, vectors = np.linalg.eigh(P)
    values = np.maximum(values, max(values[-1], np.finfo(float).tiny) * 1e-14)
    return np.linalg.qr(np.sqrt(values)[:, None] * vectors.T)[1]


def _refined(X: Matrix, A: Ball, R: Ball, Q: Ball) -> Ball:
    """Remove the rounding errors of a Riccati solution by a step of Newton's method."""
    P = balls.ball(X)
    residual = balls.symmetric(P * A) * flint.arb(2) + P * R * P + Q
    step = solve_lyapunov(balls.midpoint(A + R * P), balls.midpoint(residual))
    return P if step is None else balls.symmetric(P + balls.ball(step)).mid()


def _prove_zero(loop: BallSystem) -> NormProof | None:
    """Prove a norm of zero where D and all Markov parameters C A^k B vanish exactly."""
    with balls.precision(BITS):
        if balls.magnitude(loop.D).any():
            return None
        reached = loop.B
        for _ in range(max(loop.A.nrows(), 1)):
            if balls.magnitude(loop.C * reached).any():
                return None
            reached = loop.A * reached
    proof = prove_stability(loop)
    return None if proof is None else replace(proof, bound=0.0)


def prove_h2(
    loop: BallSystem, discrete: bool, slack: float = 1e-4, bits: int | None = None
) -> NormProof | None:
    """Prove that a loop is stable and bound its H2 norm by its controllability Gramian.

    Parameters
    ----------
    loop : BallSystem
    discrete : bool
        Whether it is a discrete-time loop; it is mapped here, its Gramian stays the same.
    slack : float
        By how much the bound may lie above the norm, relative.
    bits : int, optional
        As for :func:`prove_hinf`.
    """
    n = loop.A.nrows()
    with balls.precision(bits or BITS):
        energy = loop.D * loop.D.transpose()
        if not discrete and balls.magnitude(energy).any():
            return None
        flow = cayley(loop, bits or BITS) if discrete else loop
        dual = BallSystem(
            flow.A.transpose(),
            balls.zeros(n, 0),
            flow.B.transpose(),
            balls.zeros(flow.B.ncols(), 0),
            1 / loop.scale,
        )
        found = _proof_at_unit_norm(dual, slack, bits)
        if found is None:
            return None
        if n:
            T, X = found
            output = loop.C * balls.ball(T).transpose()
            energy += output * X * output.transpose()
        square = flint.arb(energy.trace() if energy.nrows() else 0)
        return _proof("gramian", float(square.sqrt().upper()) * (1 + 1e-15), found, dual)


def _proof(kind: Kind, bound: float, found: tuple[Matrix, Ball], loop: BallSystem) -> NormProof:
    """Note a proof in the loop's own states."""
    T, P = found
    return NormProof(kind, bound, balls.midpoint(P), T / loop.scale)


# The tightest bound that can be proven for a loop, at the least expense.

TIGHT = 1e-3
"""How far above the computed norm, relative, the proven bound of a valid certificate may lie."""
# Numbers of bits that are tried.
_PRECISIONS = (BITS, 2 * BITS, 4 * BITS, 8 * BITS)
# The square of the bits times the third power of the states, which sets the time of a precise
# proof: some seconds for 24 states with all the bits, 40 states with 480, or 100 with 240.
_MOST_WORK = 240**2 * 100**3

Enclose = Callable[[int], BallSystem]


def tightest_proof(
    enclose: Enclose,
    norm: Literal["hinf", "h2"],
    achieved: float,
    frequency: float | None,
    claimed: float | None,
    step: float | None,
) -> ProvenNorm:
    """Prove the smallest bound that can be proven; stability alone if no bound can.

    P is sought in doubles first. Where that proves no bound near the norm, the H-infinity norm is
    computed once more without rounding the loop, and P is sought with more and more bits.

    Parameters
    ----------
    enclose : callable
        Returns the loop, enclosed with a number of bits.
    norm : {"hinf", "h2"}
    achieved : float
        The norm that was computed.
    frequency : float or None
        Where it peaks, in rad/s.
    claimed : float or None
        A bound that would do as well.
    step : float or None
        Sampling time; None for a continuous-time loop.
    """

    def flow(bits: int) -> BallSystem:
        return enclose(bits) if step is None else cayley(enclose(bits), bits)

    try:
        loop = flow(BITS)
    except ZeroDivisionError:  # a pole at -1
        return ProvenNorm(None, achieved, frequency)
    states, discrete = loop.A.nrows(), step is not None
    precisions = [bits for bits in _PRECISIONS if bits**2 * states**3 <= _MOST_WORK]
    if norm == "h2":
        # Where nothing comes through, both norms vanish; a Gramian would leave a little.
        found = prove_hinf(loop, 0.0) if achieved == 0 else None
        found = found or _first(prove_h2(enclose(BITS), discrete, slack) for slack in SLACK)
        if found is None or found.bound > achieved * (1 + TIGHT):
            found = _first(prove_h2(enclose(b), discrete, bits=b) for b in precisions) or found
    else:
        tried = SLACK[states > LARGE :]
        found = _first(prove_hinf(loop, achieved * (1 + slack), slack) for slack in tried)
        if found is None and precisions:
            gain, where = precise_peak(loop, angle(frequency or 0.0, step))
            if gain > achieved:
                achieved, frequency = gain, rate(where, step)
            bound = achieved * (1 + SLACK[-1])
            found = _first(prove_hinf(flow(bits), bound, bits=bits) for bits in precisions)
        found = found or _first(_relaxed_proof(loop, achieved, claimed))
    if found is None:
        found = prove_stability(loop) or _first(prove_stability(flow(b), b) for b in precisions)
    return ProvenNorm(found, achieved, frequency)


def _first(proofs: Iterable[NormProof | None]) -> NormProof | None:
    for proof in proofs:
        if proof is not None:
            return proof
        check_deadline()
    return None


def _relaxed_proof(
    loop: BallSystem, achieved: float, claimed: float | None
) -> Iterator[NormProof | None]:
    """Try the bound that was claimed, and those below which doubles see nothing but rounding."""
    if claimed is not None and claimed > achieved * (1 + SLACK[-1]):
        yield prove_hinf(loop, claimed, min(0.1, claimed / achieved - 1) if achieved else 0.1)
    level = rounding_level(loop)
    if achieved <= level:
        for factor in (1.0, 1e3):
            yield prove_hinf(loop, level * factor, 0.1)


# The frequency response of a loop at many frequencies, from one Schur form of its state matrix.
#
# With A triangular a frequency takes n^2 steps instead of n^3.


# For more frequencies at once the Schur form pays.
_FEW = 4


def responses(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Vector) -> AnyArray:
    """Return D + C (i x - A)^-1 B at every frequency x.

    Parameters
    ----------
    A, B, C, D : ndarray
    frequencies : ndarray, shape (k,)
        In rad/s; they may be infinite.

    Returns
    -------
    ndarray of complex, shape (k, p, m)
        Not finite at a pole.
    """
    n, k, m = len(A), len(frequencies), B.shape[1]
    finite = np.isfinite(frequencies)
    if k <= _FEW:
        few = np.tile(D.astype(complex), (k, 1, 1))
        few[finite] = resolvent_response(A, B, C, D, 1j * frequencies[finite])
        return few
    found: Any = linalg.schur(A, output="complex") if n else (A, A)
    triangle, Q = found
    inverse = np.zeros((n, k), complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse[:, finite] = 1 / (1j * frequencies[finite] - np.diag(triangle)[:, None])
        # (i x - triangle) X = into, from the last state to the first at all frequencies at once.
        into, X = np.conj(Q.T) @ B, np.zeros((n, k * m), complex)
        for i in range(n - 1, -1, -1):
            row = triangle[i, i + 1 :] @ X[i + 1 :]
            X[i] = ((row.reshape(k, m) + into[i]) * inverse[i][:, None]).ravel()
        return D + (C @ Q) @ X.reshape(n, k, m).transpose(1, 0, 2)
