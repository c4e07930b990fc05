"""The peak of the gain with a bracket, proven in exact arithmetic or estimated in double."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isqrt, lcm
from typing import Any

import numpy as np
import scipy.linalg as sla
from flint import arb, fmpq, fmpq_mat, fmpq_poly, fmpz_mat, fmpz_poly
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import Array, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic.balls import joined_rows
from robustpolish.linear.arithmetic.powers_of_two import bracket
from robustpolish.linear.arithmetic.rational import ExactModel, fraction, identity, transfer
from robustpolish.linear.arithmetic.realisation import Realisation, rescaled
from robustpolish.linear.delayed_systems import resolvent_response
from robustpolish.linear.eigen import EPS, Eigensystem, eigensystem
from robustpolish.linear.norms.modal_form import modal_form
from robustpolish.linear.stability import positive_roots

# The frequencies at which a singular value equals a given gain, in exact arithmetic.


def gain_crossings(model: ExactModel, square: fmpq) -> list[fmpq]:
    """Return the frequencies x >= 0 at which a singular value of G is the root of `square`.

    The Hamiltonian matrix (continuous time) or the symplectic pencil (discrete
    time) has an eigenvalue on the stability boundary at just these
    frequencies. Its characteristic polynomial is even; as a polynomial in x^2
    it is computed without rounding, so an empty list is a proof.

    Parameters
    ----------
    model : ExactModel
        No pole of it may lie on the stability boundary.
    square : fmpq
        Square of the gain, above that of D.

    Returns
    -------
    list of fmpq
        Ascending, each to about 128 bits.
    """
    if model.discrete or any(entry != 0 for entry in model.D.entries()):
        polynomial = _pencil_polynomial(model, square)
    else:
        polynomial = _hamiltonian_polynomial(model, square)
    return sorted(_square_root(root.real.mid().fmpq()) for root, _ in positive_roots(polynomial))


def _square_root(value: fmpq) -> fmpq:
    """Return the root to 100 bits or more."""
    shift = 200
    while value != 0 and (int(value.p) << shift) // int(value.q) < 1 << 220:
        shift += 200
    return fmpq(isqrt((int(value.p) << shift) // int(value.q)), 1 << (shift // 2))


def _hamiltonian_polynomial(model: ExactModel, square: fmpq) -> fmpz_poly:
    A = model.A
    n = model.states
    top = (model.B * model.B.transpose()) / square
    bottom = model.C.transpose() * model.C
    rows = [A.table()[i] + top.table()[i] for i in range(n)]
    rows += [
        [-entry for entry in row] + [-A[j, i] for j in range(n)]
        for i, row in enumerate(bottom.table())
    ]
    coefficients = fmpq_mat(rows).charpoly().numer().coeffs()
    return fmpz_poly([(-1) ** k * int(c) for k, c in enumerate(coefficients[::2])])


def _pencil_polynomial(model: ExactModel, square: fmpq) -> fmpz_poly:
    """Interpolate the determinant of the extended pencil from its values at s = 0, 1, 2, ..."""
    constant, slope = _pencil(model, square)
    n = model.states
    values = []
    for k in range(n + 1):
        check_deadline()
        values.append(fmpq((constant + slope * k).det()))
    nodes = [-k * k for k in range(n + 1)]  # x^2 = -s^2
    for level in range(1, n + 1):  # divided differences
        for i in range(n, level - 1, -1):
            values[i] = (values[i] - values[i - 1]) / (nodes[i] - nodes[i - level])
    polynomial = fmpq_poly([0])
    for value, node in zip(reversed(values), reversed(nodes), strict=True):
        polynomial = polynomial * fmpq_poly([-node, 1]) + value
    return fmpz_poly(polynomial.numer().coeffs())


def _pencil(model: ExactModel, square: fmpq) -> tuple[fmpz_mat, fmpz_mat]:
    """Return integer matrices whose combination `constant + s slope` is singular at crossings.

    The unknowns are state, co-state, input and output; in discrete time the
    rows of the states are multiplied by 1 - s after z = (1 + s)/(1 - s).
    """
    A, B, C, D = model.A, model.B, model.C, model.D
    n, m, p = model.states, B.ncols(), C.nrows()
    one, zero = identity(n), fmpq_mat
    At, Ct, Bt = A.transpose(), C.transpose(), B.transpose()
    if model.discrete:
        states = [[A - one, zero(n, n), B, zero(n, p)], [zero(n, n), one - At, zero(n, m), -Ct]]
        slopes = [[-A - one, zero(n, n), -B, zero(n, p)], [zero(n, n), -one - At, zero(n, m), -Ct]]
    else:
        states = [[A, zero(n, n), B, zero(n, p)], [zero(n, n), -At, zero(n, m), -Ct]]
        slopes = [
            [-one, zero(n, n), zero(n, m), zero(n, p)],
            [zero(n, n), -one, zero(n, m), zero(n, p)],
        ]
    outputs = [
        [C, zero(p, n), D, -identity(p)],
        [zero(m, n), Bt, identity(m) * (-square), D.transpose()],
    ]
    still = [
        [zero(p, n), zero(p, n), zero(p, m), zero(p, p)],
        [zero(m, n), zero(m, n), zero(m, m), zero(m, p)],
    ]
    return _whole_rows(joined_rows(states + outputs), joined_rows(slopes + still))


def _whole_rows(first: list[list[fmpq]], second: list[list[fmpq]]) -> tuple[fmpz_mat, fmpz_mat]:
    """Clear the denominators row by row, with the same factor in both matrices."""
    whole: tuple[list, list] = ([], [])
    for one, two in zip(first, second, strict=True):
        common = lcm(*(int(entry.q) for entry in one + two))
        for target, row in zip(whole, (one, two), strict=True):
            target.append([int(entry.p) * (common // int(entry.q)) for entry in row])
    return fmpz_mat(whole[0]), fmpz_mat(whole[1])


# A basis in which an inequality's matrix is near diagonal and of order one, for the solver.


@dataclass(frozen=True, eq=False)
class ModalModel:
    """A system in modal coordinates, x = basis * (modal x).

    Attributes
    ----------
    A, B, C, D : ndarray
        Matrices in these coordinates.
    basis : ndarray, shape (n, n)
    weights : ndarray, shape (n,)
        Inverse roots of twice each mode's decay rate: multiplied from both sides they
        make A^T K + K A of the size of K.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    basis: Matrix
    weights: Matrix

    def back(self, K: Matrix) -> Matrix:
        """Map the matrix of a quadratic form in modal coordinates back, exactly symmetric."""
        inverse = np.linalg.inv(self.basis)
        K = inverse.T @ K @ inverse
        return (K + K.T) / 2


def modal_model(model: Realisation) -> ModalModel:
    """Choose the real modal basis, or the unit basis where that is ill conditioned."""
    basis, rates, pairs = _modal_basis(model.A)
    weights = 1 / np.sqrt(2 * rates)
    basis = basis * _even(np.linalg.solve(basis, model.B), model.C @ basis, weights, pairs)
    A = np.linalg.solve(basis, model.A @ basis)
    B, C = np.linalg.solve(basis, model.B), model.C @ basis
    return ModalModel(A, B, C, model.D, basis, weights)


def rebased(model: ModalModel, K: Matrix) -> ModalModel:
    """Change to the coordinates in which K is the identity, after a first solution."""
    try:
        basis = np.linalg.inv(np.linalg.cholesky(K)).T
    except np.linalg.LinAlgError:
        return model
    step = np.linalg.solve(model.basis, basis)
    A = np.linalg.solve(step, model.A @ step)
    rates = np.maximum(-np.diag(A), 1e-12 * np.abs(A).max())
    B, C = np.linalg.solve(step, model.B), model.C @ step
    return ModalModel(A, B, C, model.D, basis, 1 / np.sqrt(2 * rates))


def _even(B: Matrix, C: Matrix, weights: Matrix, pairs: list[int]) -> Matrix:
    """Return factors of the basis that make inputs and outputs act alike on each mode."""
    reach, show = np.linalg.norm(B, axis=1) * weights, np.linalg.norm(C, axis=0) * weights
    for i in pairs:  # both vectors of a pair share their factor
        reach[i : i + 2] = np.linalg.norm(reach[i : i + 2])
        show[i : i + 2] = np.linalg.norm(show[i : i + 2])
    return np.sqrt(np.maximum(reach, 1e-3) / np.maximum(show, 1e-3))


def _modal_basis(A: Matrix) -> tuple[Matrix, Matrix, list[int]]:
    n = A.shape[0]
    plain = np.eye(n), np.ones(n), []
    values, vectors = np.linalg.eig(A)
    columns, rates, pairs = [], [], []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
            rates.append(abs(value.real))
        elif value.imag > 0:
            pairs.append(len(columns))
            columns += [vector.real, vector.imag]
            rates += [abs(value.real)] * 2
    basis = np.array(columns).T if n else np.zeros((0, 0))
    if n == 0 or not np.linalg.cond(basis) < 1e8 or min(rates) <= 0:
        return plain
    return basis, np.array(rates), pairs


# The peak of the gain in double precision: quick, good for a start, with an honest error bar.


def cayley(model: Realisation) -> Realisation:
    """Map a discrete system by z = (1 + s)/(1 - s), which keeps its gains; others stay."""
    if not model.discrete or model.states == 0:
        return model
    one = np.eye(model.states)
    factors = sla.lu_factor(model.A + one, check_finite=False)
    B = sla.lu_solve(factors, model.B, check_finite=False)
    return Realisation(
        sla.lu_solve(factors, model.A - one, check_finite=False),
        math.sqrt(2) * B,
        math.sqrt(2) * sla.lu_solve(factors, model.C.T, trans=1, check_finite=False).T,
        model.D - model.C @ B,
        False,
    )


def gains(model: Realisation, frequencies: Vector) -> Vector:
    """Return the largest singular value at each frequency x, s = i x; infinity is allowed."""
    result = np.empty(len(frequencies))
    if model.states == 0:
        return np.full(len(frequencies), float(np.linalg.norm(model.D, 2)))
    finite = np.isfinite(frequencies)
    result[~finite] = np.linalg.norm(model.D, 2)
    x = frequencies[finite]
    for start in range(0, x.size, 64):  # bounds the memory for large systems
        part = x[start : start + 64]
        G = resolvent_response(*model.matrices.values(), 1j * part)  # pyright: ignore[reportCallIssue]
        G[~np.isfinite(G).all(axis=(1, 2))] = 0.0  # a pole on the axis to rounding
        where = np.flatnonzero(finite)[start : start + 64]
        result[where] = np.linalg.svd(G, compute_uv=False)[:, 0]
    return result


def largest_response(model: Realisation) -> float:
    """Return the largest gain at the poles' frequencies, a rough size of the norm."""
    if 0 in model.D.shape:
        return 0.0
    return float(gains(model, _seeds(np.linalg.eigvals(model.A).astype(complex))).max())


def peak(
    model: Realisation, poles: NDArray[np.complex128], tolerance: float
) -> tuple[float, float]:
    """Climb to the largest gain by the two-step iteration of Bruinsma and Steinbuch.

    Returns
    -------
    frequency, gain : float
        Not certified: crossings that rounding hides are missed.
    """
    seeds = _seeds(poles)
    values = gains(model, seeds)
    best = int(values.argmax())
    frequency, gain = float(seeds[best]), float(values[best])
    for _ in range(30):
        if gain == 0:
            break
        crossings = _crossings(model, gain * (1 + tolerance))
        if crossings.size == 0:
            break
        trial = np.concatenate([crossings, 0.5 * (crossings[1:] + crossings[:-1])])
        values = gains(model, trial)
        best = int(values.argmax())
        if values[best] <= gain:
            break
        done = values[best] <= gain * (1 + tolerance)
        frequency, gain = float(trial[best]), float(values[best])
        if done:
            break
    return frequency, gain


def _seeds(poles: NDArray[np.complex128]) -> Vector:
    radius = np.abs(poles)
    damping = np.divide(poles.real, radius, out=np.ones_like(radius), where=radius > 0)
    resonance = radius * np.sqrt(np.clip(1 - 2 * damping**2, 0, None))
    return np.unique(np.concatenate([[0.0, np.inf], radius, np.abs(poles.imag), resonance]))


@np.errstate(over="ignore", invalid="ignore")
def hamiltonian(model: Realisation, gamma: float) -> Array | None:
    """Return the matrix whose imaginary eigenvalues are crossings; None at the gain of D.

    Entries beyond doubles are infinite.
    """
    A, B, C, D = model.A, model.B, model.C, model.D
    if not D.any():
        return np.block([[A, B @ B.T / gamma], [-(C.T @ C) / gamma, -A.T]])
    R = gamma * gamma * np.eye(B.shape[1]) - D.T @ D
    try:
        X = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
    except np.linalg.LinAlgError:
        return None
    RDC, RB = X[:, : A.shape[0]], X[:, A.shape[0] :]
    closed = A + B @ RDC
    return np.block([[closed, gamma * B @ RB], [-(C.T @ (C + D @ RDC)) / gamma, -closed.T]])


@np.errstate(over="ignore", invalid="ignore")  # what has no size has no near eigenvalues
def _crossings(model: Realisation, gamma: float) -> Vector:
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return np.empty(0)
    eigenvalues = np.linalg.eigvals(H)
    near = np.abs(eigenvalues.real) <= 1e-7 * np.abs(eigenvalues) + 100 * EPS * np.linalg.norm(H)
    return np.unique(np.abs(eigenvalues.imag[near]))


def bounds_gain(model: Realisation, gamma: float) -> bool:
    """Say whether the Hamiltonian has no imaginary eigenvalue, rounding errors considered."""
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return False
    spectrum = eigensystem(H)
    return bool((np.abs(spectrum.values.real) > spectrum.errors).all())


EXACT_FIRST = 6
"""Up to so many coupled states the proof is exact from the start: nothing is as quick."""
EXACT_ALWAYS = 40
"""Up to so many the bracket is as narrow as is asked for, which exact arithmetic grants."""
EXACT_AT_MOST = 80
"""Up to so many exact arithmetic is used where nothing else proves a bound."""
# Widths of brackets that are accepted from modal coordinates: beyond EXACT_ALWAYS, beyond
# EXACT_AT_MOST where nothing else would prove any, and of estimates, which the Hamiltonian test
# could narrow.
_WIDE, _WIDEST, _ESTIMATED = 1e-6, 1e-2, 1e-6
# Gains of so many signals per state are quicker by the Hamiltonian matrix.
_SIGNALS = 4

# Crossings whose frequencies differ by more than this factor are far apart.
_FAR = 4
_MOST_BETWEEN = 12
_MOST_CLIMBING = 24


@dataclass(frozen=True)
class Peak:
    """The peak of a stable system's gain, in the units of its rescaled matrices.

    Attributes
    ----------
    frequency : float
        In the variable x of :class:`ExactModel`.
    gain, lower, upper : float
        The gain there, and bounds of the true peak.
    proof : str
        How the upper bound was found.
    """

    frequency: float
    gain: float
    lower: float
    upper: float
    proof: str

    def in_units(self, model: Realisation) -> Peak:
        """Come back from the scaled units of `model`."""
        known = bracket(self.gain, self.lower, self.upper, model.gain)
        return Peak(self.frequency * model.time, *known, self.proof)


def certified_peak(
    model: Realisation,
    tolerance: float,
    exact: bool,
    exact_model: ExactModel | None = None,
    spectrum: Eigensystem | None = None,
) -> Peak:
    """Find and bracket the peak of a stable, rescaled system.

    The `spectrum` of its A is taken if it is at hand. An `exact_model` takes its place where the
    doubles are rounded.
    """
    spectrum = spectrum or eigensystem(model.A)
    if exact_model is None and model.states > (EXACT_FIRST if exact else 1):
        found = _modal(model, spectrum, tolerance, exact)
        if found is not None:
            return found
    search = replace(model, time=1.0, gain=1.0)
    poles = spectrum.values
    if model.discrete:
        search = rescaled(cayley(search))
        poles = np.linalg.eigvals(search.A).astype(complex)
    frequency, gain = peak(search, poles, tolerance)
    if not exact or model.states > EXACT_ALWAYS:
        found = _estimated(search, frequency, gain, tolerance)
        found = found.in_units(search)
        if not exact or found.upper <= (1 + max(tolerance, 1e-6)) * found.lower:
            return found
        if model.states > EXACT_AT_MOST:
            return _sharper_below(model, found)
    return _proven(exact_model or ExactModel.of(model), frequency * search.time, tolerance)


def _modal(model: Realisation, spectrum: Eigensystem, tolerance: float, exact: bool) -> Peak | None:
    """Bracket the peak in modal coordinates; None where these are too ill conditioned."""
    if model.D.size > _SIGNALS * model.states:
        return None
    form = modal_form(model, spectrum, exact)
    if form is None or not form.stable:
        return None
    # Imports Numba, which takes as long as all the rest together.
    from robustpolish.linear.norms.modal_peak import modal_peak

    widest = _WIDE if model.states <= EXACT_AT_MOST else _WIDEST
    if not exact:
        widest = _ESTIMATED
    elif model.states <= EXACT_ALWAYS:
        widest = tolerance
    found = modal_peak(form, tolerance, max(tolerance, widest))
    if found is None:
        return None
    text = "every frequency covered, rounding errors enclosed"
    if not exact:
        text = "every frequency covered, within the rounding errors of double precision"
    return Peak(found.frequency, found.gain, found.lower, found.upper, text)


def _proven(model: ExactModel, start: float, tolerance: float) -> Peak:
    """Raise the gain by exact crossings until the upper bound has none."""
    at = fraction(start) if math.isfinite(start) else None
    gain = _gain(model, at)
    if gain == 0 and model.is_zero():
        return Peak(0.0, 0.0, 0.0, 0.0, "the transfer function is zero")
    trial: list[fmpq | None] = [fmpq(0), None]
    touching: list[fmpq] = []
    far = False
    trial += [fmpq(k, k + 2) for k in range(1, 2 * model.states + 3)] if gain == 0 else []
    for _ in range(100):  # every pass raises the gain by more than the tolerance; few are needed
        check_deadline()
        values = [_gain(model, x) for x in trial]
        best = int(np.argmax(values))
        if values[best] > gain:
            gain, at = values[best], trial[best]
        elif touching:  # the gain only touches the last bound, at a crossing
            values = [_gain(model, x) for x in touching]
            gain, at = max(values), touching[int(np.argmax(values))]
        upper = gain * (1 + tolerance)
        found = gain_crossings(model, fraction(upper) ** 2)
        if not found:
            for a, b in pairwise(touching):
                if far and at is not None and a <= at <= b:
                    at, gain = _higher(model, at, gain, _climbed(model, a, b))
            return _bracketed(model, at, gain, upper)
        spans = list(pairwise(found))
        far = far or any(_far_apart(a, b) for a, b in spans)
        trial = [fmpq(0), None, *(x for a, b in spans for x in _between(a, b))]
        if model.states > EXACT_FIRST and len(spans) == 1:
            trial.append(_climbed(model, *spans[0]))
        touching = found
    return replace(_bracketed(model, at, gain, math.inf), proof="the search did not settle")


def _far_apart(low: fmpq, high: fmpq) -> bool:
    return low > 0 and high > _FAR * low


def _higher(model: ExactModel, at: fmpq, gain: float, other: fmpq) -> tuple[fmpq, float]:
    """Return the frequency of the larger gain with it.

    A search that began far away ends as soon as its bracket is narrow, not at the top of the peak.
    """
    there = _gain(model, other)
    return (other, there) if there > gain else (at, gain)


def _between(low: fmpq, high: fmpq) -> list[fmpq]:
    """Return the middle of two crossings, and if they are far apart one frequency per octave.

    The gain peaks somewhere between them. Halving an interval that spans decades comes near zero
    by an octave per pass, and a pass costs a determinant per state.
    """
    middle = [(low + high) / 2]
    if not _far_apart(low, high):
        return middle
    bottom, octaves = float(arb(low)), math.log2(float(arb(high)) / float(arb(low)))
    count = min(math.ceil(octaves), _MOST_BETWEEN)
    return middle + [
        fraction(bottom * 2.0 ** (octaves * k / (count + 1))) for k in range(1, count + 1)
    ]


def _climbed(model: ExactModel, low: fmpq, high: fmpq) -> fmpq:
    """Climb between two crossings, for gains take far less time than determinants."""
    ends = [math.log(max(float(arb(end)), 1e-300)) for end in (low, high)]
    found: Any = minimize_scalar(
        lambda x: -_gain(model, fraction(math.exp(x))),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-7 * (ends[1] - ends[0]), "maxiter": _MOST_CLIMBING},
    )
    return fraction(math.exp(found.x))


def _bracketed(model: ExactModel, at: fmpq | None, gain: float, upper: float) -> Peak:
    rounding = 4 * EPS * (model.B.ncols() + model.C.nrows())
    frequency = math.inf if at is None else float(arb(at))
    return Peak(frequency, gain, gain * (1 - rounding), upper, "no crossing, in exact arithmetic")


def _sharper_below(model: Realisation, found: Peak) -> Peak:
    """Evaluate the gain in ball arithmetic where doubles leave it uncertain."""
    at = fraction(found.frequency) if math.isfinite(found.frequency) else None
    gain = _gain(ExactModel.of(model), at)
    upper = found.upper if found.upper > gain else math.inf
    return replace(found, gain=gain, lower=gain * (1 - 1e-14), upper=upper)


def _gain(model: ExactModel, x: fmpq | None) -> float:
    G, scale = transfer(model, x)
    return float(np.linalg.norm(G, 2)) * scale


def _estimated(model: Realisation, frequency: float, gain: float, tolerance: float) -> Peak:
    """Widen the bracket until the Hamiltonian test in double precision is beyond doubt."""
    error = _evaluation_error(model, frequency)
    lower = gain * max(0.0, 1 - error)
    widths = [w for w in (tolerance, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.1) if w >= tolerance]
    for width in widths:
        upper = gain * (1 + width + error)
        if gain > 0 and bounds_gain(model, upper):
            text = "no crossing within the rounding errors of double precision"
            return Peak(frequency, gain, lower, upper, text)
    return Peak(frequency, gain, lower, math.inf, "double precision proves no upper bound")


def _evaluation_error(model: Realisation, frequency: float) -> float:
    """Estimate the relative error of the gain from the spread of the resolvent."""
    if not math.isfinite(frequency) or model.states == 0:
        return 10 * EPS
    singular = np.linalg.svd(
        1j * frequency * np.eye(model.states) - model.A, compute_uv=False, hermitian=False
    )
    if singular[-1] == 0:
        return 1.0
    return 10 * EPS * math.sqrt(model.states) * float(singular[0] / singular[-1])
