"""The norms by linear matrix inequalities, an independent check on the Hamiltonian ones.

Equations (10.15), (10.17), (10.44) and (10.45) of the thesis, with -gamma^2 I where its
(10.16) prints a plus sign. The solver's matrix is not trusted: whether it satisfies
the inequalities strictly is decided in exact arithmetic.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import control
import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import invalid, misfit, one_of
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic.balls import bounded_real, is_definite
from robustpolish.linear.arithmetic.exact import ExactModel, fraction, power_of_two, rational
from robustpolish.linear.norms.hinf import largest_response
from robustpolish.linear.scaling import equilibrating_scales, in_units, parts_with_indices
from robustpolish.linear.systems import Realisation, realisation

Equation = Literal["10.15", "10.17", "10.44", "10.45"]
_OF_SQUARES = ("10.17", "10.44")
"""Equations that hold the square of gamma."""

# The thesis's analysis inequalities, handed to a solver in a basis in which their matrices are near
# diagonal and of order one.


@dataclass(frozen=True, eq=False)
class _Modal:
    """A system in coordinates x = basis * (its own x).

    `weights` are inverse roots of twice each coordinate's decay rate: multiplied from both sides
    they make A^T K + K A of the size of K.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    basis: Matrix
    weights: Matrix

    @classmethod
    def of(cls, model: Realisation) -> _Modal:
        """Choose the real modal basis, or the unit basis where that is ill conditioned."""
        n, pairs = model.states, []
        values, vectors = np.linalg.eig(model.A)
        columns, rates = [], []
        for value, vector in zip(values, vectors.T, strict=True):
            if value.imag == 0:
                columns.append(vector.real)
                rates.append(abs(value.real))
            elif value.imag > 0:
                pairs.append(len(columns))
                columns += [vector.real, vector.imag]
                rates += [abs(value.real)] * 2
        basis, rates = np.array(columns).reshape(n, n).T, np.array(rates)
        if not (n and np.linalg.cond(basis) < 1e8 and rates.min() > 0):
            basis, rates, pairs = np.eye(n), np.ones(n), []
        # Factors of the basis make inputs and outputs act alike on each mode.
        weights = 1 / np.sqrt(2 * rates)
        reach = np.linalg.norm(np.linalg.solve(basis, model.B), axis=1) * weights
        show = np.linalg.norm(model.C @ basis, axis=0) * weights
        for i in pairs:  # both vectors of a pair share their factor
            reach[i : i + 2] = np.linalg.norm(reach[i : i + 2])
            show[i : i + 2] = np.linalg.norm(show[i : i + 2])
        even = np.sqrt(np.maximum(reach, 1e-3) / np.maximum(show, 1e-3))
        basis = np.asarray(basis * even, dtype=float)
        A, B, C = _moved(model.A, model.B, model.C, basis)
        return cls(A, B, C, model.D, basis, weights)

    def rebased(self, K: Matrix) -> _Modal:
        """Change to the coordinates in which K is the identity, after a first solution."""
        try:
            basis: Any = np.linalg.inv(np.linalg.cholesky(K)).T
        except np.linalg.LinAlgError:
            return self
        A, B, C = _moved(self.A, self.B, self.C, np.linalg.solve(self.basis, basis))
        rates = np.maximum(-np.diag(A), 1e-12 * np.abs(A).max())
        return _Modal(A, B, C, self.D, basis, 1 / np.sqrt(2 * rates))

    def solved(
        self, equation: Equation, gamma: float | None = None
    ) -> tuple[Matrix | None, float, str]:
        """Find the smallest gamma, or for a given one the K with the largest margin.

        Returns
        -------
        K : ndarray or None
            In the coordinates of the system, exactly symmetric.
        gamma : float
        status : str
        """
        import cvxpy as cp  # late: importing takes a second, and only these checks need it

        squared = equation in _OF_SQUARES
        bound: Any = cp.Variable(nonneg=True)
        margin: Any = cp.Constant(0.0)
        if gamma is not None:
            bound, margin = cp.Constant(gamma**2 if squared else gamma), cp.Variable()
        A, B, C, D = self.A, self.B, self.C, self.D
        (p, m), n, E = D.shape, len(A), np.diag(self.weights)
        K: Any = cp.Variable((n, n), symmetric=True)
        # The state rows are weighted so that all modes count alike.
        rows, KB, Ct = E @ (A.T @ K + K @ A) @ E, E @ K @ B, E @ C.T
        constraints: list[Any] = [K >> 0] if gamma is None else [K >> 0, margin <= 1]
        if equation == "10.15":
            inequality = rows
            constraints.append(K << np.eye(n))
        elif equation == "10.17":
            inequality = cp.bmat(
                [[rows, KB, Ct], [KB.T, -bound * np.eye(m), D.T], [Ct.T, D, -np.eye(p)]]
            )
        elif equation == "10.44":
            corner, below = KB + Ct @ D, D.T @ D - bound * np.eye(m)
            inequality = cp.bmat([[rows + Ct @ Ct.T, corner], [corner.T, below]])
        else:
            Z: Any = cp.Variable((p, p), symmetric=True)
            inequality = cp.bmat([[rows, KB], [KB.T, -bound * np.eye(m)]])
            constraints += [cp.bmat([[K, C.T], [C, Z]]) >> 0, cp.trace(Z) <= bound - margin * 1e-3]
        size = inequality.shape[0]
        constraints.append((inequality + inequality.T) / 2 + margin * np.eye(size) << 0)
        goal = cp.Minimize(bound) if gamma is None else cp.Maximize(margin)
        problem, status = cp.Problem(goal, constraints), ""
        for decompose in (False, True):  # another path to the optimum, where one breaks off
            try:
                with warnings.catch_warnings():  # an inaccurate answer is checked like any other
                    warnings.simplefilter("ignore")
                    problem.solve(solver=cp.CLARABEL, chordal_decomposition_enable=decompose)
            except cp.SolverError as error:
                status = f"solver failed: {error}"
                continue
            status = str(problem.status)
            if K.value is not None and np.isfinite(K.value).all():
                inverse = np.linalg.inv(self.basis)
                found = inverse.T @ np.asarray(K.value) @ inverse
                least = float(bound.value)
                least = math.sqrt(max(least, 0.0)) if squared else least
                return (found + found.T) / 2, least if gamma is None else gamma, status
        return None, math.nan, status


def _moved(A: Matrix, B: Matrix, C: Matrix, basis: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return A, B and C in the coordinates of a basis."""
    moved: Any = np.linalg.solve(basis, A @ basis), np.linalg.solve(basis, B), C @ basis
    return moved


# Does a given matrix satisfy the strict inequality? Decided in rational arithmetic.


def proves_lmi(system: ExactModel, equation: Equation, K: NDArray, gamma: float) -> bool:
    """Say whether K > 0 satisfies the equation with this gamma, without rounding.

    All are the bounded-real inequality: (10.17) has its Schur complement, (10.15) no signals, and
    (10.45) no outputs, with gamma in the place of its square.
    """
    X, bound = rational(K), fraction(gamma)
    A, B, C, D = system.A, system.B, system.C, system.D
    n, m = A.nrows(), B.ncols()
    if equation == "10.15":
        seen = fmpq_mat(n, 0), fmpq_mat(0, n), fmpq_mat(0, 0)
    elif equation == "10.45":
        seen = B, fmpq_mat(0, n), fmpq_mat(0, m)
    else:
        seen, bound = (B, C, D), bound * bound
    if not (is_definite(X) and is_definite(bounded_real(X, A, *seen, bound))):
        return False
    if equation != "10.45":
        return True
    least = C * X.solve(C.transpose())  # the least trace of Z, approached from above
    return bool(sum((least[i, i] for i in range(C.nrows())), fmpq(0)) < bound)


@dataclass(frozen=True, eq=False, repr=False)
class LmiCheck(Displayed):
    """What a linear matrix inequality says about a system.

    Attributes
    ----------
    value : float
        Upper bound of the norm for which `matrix` is a proof; infinite without one. For
        (10.15) it is 0 if the proof holds.
    matrix : ndarray, shape (n, n), or None
        K, in the units of the system.
    verified : bool
        Whether K, as scaled, satisfies the strict inequalities exactly.
    optimum : float
        The solver's own optimum, unproven; nan if it found none.
    equation : str
        Number of the equation in the thesis.
    status : str
        The solver's status.
    """

    value: float
    matrix: Matrix | None
    verified: bool
    optimum: float
    equation: str
    status: str

    def __bool__(self) -> bool:
        return self.verified

    def _card(self) -> Card:
        rows = (
            ("proven bound", self.value),
            ("verified exactly", self.verified),
            ("solver's optimum", self.optimum),
            ("solver's status", self.status),
        )
        return Card(f"Linear matrix inequality {self.equation}", (quantities(*rows),))


def lyapunov_lmi(system: control.StateSpace) -> LmiCheck:
    r"""Prove stability by K = K^T > 0 with A^T K + K A < 0 (10.15).

    Parameters
    ----------
    system : control.StateSpace
        Continuous.

    Returns
    -------
    LmiCheck
        True in a condition if the proof holds. False proves nothing: K may not
        exist, or the solver may not have found it.

    Raises
    ------
    InvalidInputError
        If the system is discrete, no ``StateSpace`` or not finite.

    Examples
    --------
    >>> import control
    >>> from robustpolish.linear import lyapunov_lmi
    >>> bool(lyapunov_lmi(control.ss([[0, 1], [-2, -1]], [[0], [1]], [[1, 0]], 0)))
    True
    """
    return _checked(system, "10.15")


def hinf_norm_lmi(
    system: control.StateSpace, *, equation: Literal["10.17", "10.44"] = "10.17"
) -> LmiCheck:
    r"""Bound the H-infinity norm by the smallest gamma that the bounded real lemma allows.

    Parameters
    ----------
    system : control.StateSpace
        Continuous.
    equation : {"10.17", "10.44"}, optional
        The form with three block rows and K > 0, or the one with two, where K > 0 follows
        if A is stable (it is demanded here too, so that the proof includes stability).

    Returns
    -------
    LmiCheck
        `value` exceeds the norm by 1e-6 or so, more where the solver strains.

    Raises
    ------
    InvalidInputError
        If the system is discrete, no ``StateSpace`` or not finite.

    Examples
    --------
    >>> import control
    >>> from robustpolish.linear import hinf_norm_lmi
    >>> check = hinf_norm_lmi(control.ss([[-2.0]], [[1.0]], [[1.0]], 0))
    >>> check.verified, round(check.value, 4)
    (True, 0.5)
    """
    one_of("equation", equation, ("10.17", "10.44"))
    return _checked(system, equation)


def h2_norm_lmi(system: control.StateSpace) -> LmiCheck:
    r"""Bound the H2 norm by the smallest gamma that (10.45) allows.

    The optimum is the norm itself, not its square.

    Parameters
    ----------
    system : control.StateSpace
        Continuous, with D = 0.

    Returns
    -------
    LmiCheck

    Raises
    ------
    InvalidInputError
        If the system is discrete, no ``StateSpace``, not finite, or D is not zero.

    Examples
    --------
    >>> import control
    >>> from robustpolish.linear import h2_norm_lmi
    >>> round(h2_norm_lmi(control.ss([[-2.0]], [[1.0]], [[1.0]], 0)).value, 4)
    0.5
    """
    if realisation("system", system).D.any():
        raise invalid("system.D", system.D, "zero", "In continuous time the H2 norm is infinite.")
    return _checked(system, "10.45")


def _checked(system: control.StateSpace, equation: Equation) -> LmiCheck:
    """Solve each decoupled part and put the proofs together."""
    model = realisation("system", system)
    if model.discrete:
        remedy = "Use hinf_norm or h2_norm, which take both."
        shown = f"a discrete system, dt = {model.source.dt}"
        raise misfit("system", shown, "a continuous one", remedy)
    K: Matrix | None = np.zeros((model.states, model.states))
    combined = math.hypot if equation == "10.45" else max
    found = parts_with_indices(model)
    checks = [_part_check(part, equation) for part, _ in found]
    value = combined(0.0, *(check.value for check in checks))
    for (_, indices), check in zip(found, checks, strict=True):
        if check.matrix is None or K is None:
            K = None
        elif indices:  # the H2 inequality of a part holds with K / gamma, whatever gamma
            share = value / check.value if equation == "10.45" and 0 < value < math.inf else 1.0
            K[np.ix_(indices, indices)] = check.matrix * share
    optima = [check.optimum for check in checks]
    return LmiCheck(
        value,
        K,
        all(check.verified for check in checks),
        math.nan if any(map(math.isnan, optima)) else combined(0.0, *optima),
        equation,
        next((check.status for check in checks if not check.verified), "optimal"),
    )


def _part_check(model: Realisation, equation: Equation) -> LmiCheck:
    """Minimise gamma in even units, step back from the optimum until K is a proof, exactly."""
    p, m = model.D.shape
    scales = equilibrating_scales(model, [np.arange(m)], [np.arange(p)])
    guess = largest_response(in_units(model, scales))[1]
    scales = replace(scales, outputs=scales.outputs * power_of_two(guess))
    scaled = in_units(model, scales)
    modal, exact, T = _Modal.of(scaled), ExactModel.of(scaled), scales.state
    if equation == "10.15" or 0 in (p, m):  # no norm to bound, only stability to prove
        K, _, status = modal.solved("10.15", 1.0)
        proven = K is not None and proves_lmi(exact, "10.15", K, 1.0)
        K = None if K is None else K / T / T[:, None]
        return LmiCheck(0.0 if proven else math.inf, K, proven, math.nan, equation, status)
    # The unit of gamma, and the factor of T^-1 K T^-1 in the given units.
    unit = float(scales.outputs[0] / scales.inputs[0])
    weight = float(scales.outputs[0]) ** 2 / scales.time
    if equation == "10.45":
        unit, weight = unit * math.sqrt(scales.time), unit / math.sqrt(scales.time)
    best, optimum, status = modal.solved(equation)
    if best is None:
        return LmiCheck(math.inf, None, False, math.nan, equation, status)
    value, K = math.inf, best
    bases = [modal, modal.rebased(best)]
    for back_off, basis in product((1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2), bases):
        gamma = optimum * (1 + back_off)
        inside = basis.solved(equation, gamma)[0]
        if inside is not None and proves_lmi(exact, equation, inside, gamma):
            value, K = gamma * unit, inside
            break
    K = weight * K / T / T[:, None]
    return LmiCheck(value, K, math.isfinite(value), optimum * unit, equation, status)
