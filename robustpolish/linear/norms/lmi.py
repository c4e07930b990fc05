"""The norms by linear matrix inequalities, an independent check on the Hamiltonian ones.

Equations (10.15), (10.17), (10.44) and (10.45) of the thesis, with -gamma^2 I where its
(10.16) prints a plus sign. The solver's matrix is not trusted: whether it satisfies
the inequalities strictly is decided in exact arithmetic.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import control
import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import described, invalid, one_of
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic.rational import ExactModel, fraction, rational
from robustpolish.linear.arithmetic.realisation import Realisation, power_of_two, realisation
from robustpolish.linear.norms.peak import ModalModel, largest_response, modal_model, rebased
from robustpolish.linear.proofs.bounded_real import bounded_real
from robustpolish.linear.proofs.definite import is_definite
from robustpolish.linear.scaling import Scaling, equilibrating_scales, in_units, parts_with_indices

# The thesis's analysis inequalities, handed to a solver in a basis that suits it.

Equation = Literal["10.15", "10.17", "10.44", "10.45"]


@dataclass(frozen=True, eq=False)
class LmiSolution:
    """What the solver says: K in the coordinates of the system, gamma and the status."""

    K: NDArray[np.float64] | None
    gamma: float
    status: str


def minimise_gamma(model: ModalModel, equation: Equation) -> LmiSolution:
    """Find the smallest gamma for which the inequality has a solution."""
    import cvxpy as cp  # late: importing takes a second, and only these checks need it

    bound: Any = cp.Variable(nonneg=True)
    K, constraints = _constraints(model, equation, bound, cp.Constant(0.0))
    answer, status = _solved(cp.Problem(cp.Minimize(bound), constraints), K, model)
    gamma = math.nan if answer is None else _gamma(equation, float(bound.value))
    return LmiSolution(answer, gamma, status)


def interior_solution(model: ModalModel, equation: Equation, gamma: float) -> LmiSolution:
    """Find K that satisfies the inequality for a given gamma with the largest margin."""
    import cvxpy as cp  # late, as above

    bound = cp.Constant(gamma**2 if equation in ("10.17", "10.44") else gamma)
    margin: Any = cp.Variable()
    K, constraints = _constraints(model, equation, bound, margin)
    constraints.append(margin <= 1)
    answer, status = _solved(cp.Problem(cp.Maximize(margin), constraints), K, model)
    return LmiSolution(answer, gamma, status)


def _gamma(equation: Equation, bound: float) -> float:
    return math.sqrt(max(bound, 0.0)) if equation in ("10.17", "10.44") else bound


def _constraints(
    model: ModalModel, equation: Equation, bound: Any, margin: Any
) -> tuple[Any, list]:
    """Return K and the constraints, the state rows weighted so that all modes count alike."""
    import cvxpy as cp  # late, as above

    A, B, C, D = model.A, model.B, model.C, model.D
    n, m, p = A.shape[0], B.shape[1], C.shape[0]
    E = np.diag(model.weights)
    K: Any = cp.Variable((n, n), symmetric=True)
    rows, KB, Ct = E @ (A.T @ K + K @ A) @ E, E @ K @ B, E @ C.T
    constraints: list[Any] = []
    if equation == "10.15":
        inequality = rows
        constraints.append(K << np.eye(n))
    elif equation == "10.17":
        inequality = cp.bmat(
            [[rows, KB, Ct], [KB.T, -bound * np.eye(m), D.T], [Ct.T, D, -np.eye(p)]]
        )
    elif equation == "10.44":
        corner = KB + Ct @ D
        inequality = cp.bmat([[rows + Ct @ Ct.T, corner], [corner.T, D.T @ D - bound * np.eye(m)]])
    else:
        Z: Any = cp.Variable((p, p), symmetric=True)
        inequality = cp.bmat([[rows, KB], [KB.T, -bound * np.eye(m)]])
        constraints += [cp.bmat([[K, C.T], [C, Z]]) >> 0, cp.trace(Z) <= bound - margin * 1e-3]
    size = inequality.shape[0]
    constraints += [(inequality + inequality.T) / 2 + margin * np.eye(size) << 0, K >> 0]
    return K, constraints


def _solved(problem: Any, K: Any, model: ModalModel) -> tuple[NDArray[np.float64] | None, str]:
    import cvxpy as cp  # late, as above

    status = ""
    for decompose in (False, True):  # another path to the optimum, where one breaks off
        try:
            with warnings.catch_warnings():  # an inaccurate answer is checked like any other
                warnings.simplefilter("ignore")
                problem.solve(solver=cp.CLARABEL, chordal_decomposition_enable=decompose)
        except cp.SolverError as error:
            status = f"solver failed: {error}"
            continue
        if K.value is not None and np.isfinite(K.value).all():
            return model.back(np.asarray(K.value)), str(problem.status)
        status = str(problem.status)
    return None, status


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
        raise invalid(
            "system",
            described(f"a discrete system, dt = {system.dt}"),
            "a continuous one",
            "Use hinf_norm or h2_norm, which take both.",
        )
    K: Matrix | None = np.zeros((model.states, model.states))
    combined = math.hypot if equation == "10.45" else max
    found = [(indices, _LmiProblem.of(part)) for part, indices in parts_with_indices(model)]
    checks = [problem.solved(equation) for _, problem in found]
    value = combined(0.0, *(check.value for check in checks))
    for (indices, _), check in zip(found, checks, strict=True):
        if check.matrix is None or K is None:
            K = None
        elif indices:  # the H2 inequality of a part holds with K / gamma, whatever gamma
            share = value / check.value if equation == "10.45" and 0 < value < math.inf else 1.0
            K[np.ix_(indices, indices)] = check.matrix * share
    return LmiCheck(
        value,
        K,
        all(check.verified for check in checks),
        _optimum(combined, [check.optimum for check in checks]),
        equation,
        next((check.status for check in checks if not check.verified), "optimal"),
    )


def _optimum(combined: Callable[..., float], optima: list[float]) -> float:
    return math.nan if any(map(math.isnan, optima)) else combined(0.0, *optima)


@dataclass(frozen=True, eq=False)
class _LmiProblem:
    """A system in even units, in a modal basis for the solver and exactly for the proof."""

    scales: Scaling
    modal: ModalModel
    exact: ExactModel

    @classmethod
    def of(cls, model: Realisation) -> _LmiProblem:
        p, m = model.D.shape
        scales = equilibrating_scales(model, [np.arange(m)], [np.arange(p)])
        guess = largest_response(in_units(model, scales))
        scales = replace(scales, outputs=scales.outputs * power_of_two(guess))
        scaled = in_units(model, scales)
        return cls(scales, modal_model(scaled), ExactModel.of(scaled))

    def solved(self, equation: Equation) -> LmiCheck:
        """Minimise gamma, step back from the optimum until K is a proof."""
        if equation == "10.15":
            return self._lyapunov()
        if 0 in self.modal.D.shape:  # no norm to bound, only stability to prove
            return replace(self._lyapunov(), equation=equation)
        unit, weight = self._units(equation)
        best = minimise_gamma(self.modal, equation)
        if best.K is None:
            return LmiCheck(math.inf, None, False, math.nan, equation, best.status)
        bases = [self.modal, rebased(self.modal, best.K)]
        for back_off, basis in product((1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2), bases):
            gamma = best.gamma * (1 + back_off)
            inside = interior_solution(basis, equation, gamma)
            if inside.K is not None and proves_lmi(self.exact, equation, inside.K, gamma):
                K = self._physical(inside.K, weight)
                return LmiCheck(gamma * unit, K, True, best.gamma * unit, equation, best.status)
        K = self._physical(best.K, weight)
        return LmiCheck(math.inf, K, False, best.gamma * unit, equation, best.status)

    def _lyapunov(self) -> LmiCheck:
        """Find K for (10.15)."""
        found = interior_solution(self.modal, "10.15", 1.0)
        proven = found.K is not None and proves_lmi(self.exact, "10.15", found.K, 1.0)
        K = None if found.K is None else self._physical(found.K, 1.0)
        value = 0.0 if proven else math.inf
        return LmiCheck(value, K, proven, math.nan, "10.15", found.status)

    def _units(self, equation: Equation) -> tuple[float, float]:
        """Return the unit of gamma and the factor of T^-1 K T^-1 in the given units."""
        u, y = (float(s[0]) if s.size else 1.0 for s in (self.scales.inputs, self.scales.outputs))
        if equation == "10.45":
            return y / u * math.sqrt(self.scales.time), y / u / math.sqrt(self.scales.time)
        return y / u, y**2 / self.scales.time

    def _physical(self, K: Matrix, weight: float) -> Matrix:
        T = self.scales.state
        return weight * K / T / T[:, None]
