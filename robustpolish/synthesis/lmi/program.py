"""A stabilising static gain by cone complementarity, for starts that descent does not find.

El Ghaoui, Oustry and AitRami, "A cone complementarity linearization algorithm for static
output-feedback and related problems", IEEE TAC 42 (1997): find P and Q with P Q = I such
that the two projected Lyapunov inequalities hold; trace(P Q) is minimised by solving a
sequence of semidefinite programs, and K follows from P by one more.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing import Pipe
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, sparse

from robustpolish.base.arrays import AnyMatrix, Matrix
from robustpolish.base.budget import Budget
from robustpolish.base.checks import one_of
from robustpolish.errors import MissingDependencyError, RobustPolishError
from robustpolish.synthesis.backends.parent_watch import exit_with_parent
from robustpolish.synthesis.problem.matrices import PlantMatrices, cayley

# Matrices that are affine in the decision variables of a semidefinite program.

# SciPy's stubs make nothing of the shape of a sparse array.
Sparse = Any
_csr: Any = sparse.csr_array


class Affine:
    """A matrix whose entries are affine functions of a vector of variables.

    ``vec(value) = constant + linear @ x``, with the columns stacked. It supports ``+``, ``-``,
    ``*`` and ``/`` by numbers, products with constant matrices from either side and ``.T``, which
    is all that a linear matrix inequality needs; every backend then receives the same numbers.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    constant : ndarray, shape (rows * columns,)
    linear : sparse array, shape (rows * columns, number of variables)
    """

    # Makes NumPy leave ``array @ affine`` and ``array + affine`` to this class.
    __array_ufunc__ = None

    def __init__(self, shape: tuple[int, int], constant: Matrix, linear: Sparse) -> None:
        self.shape = shape
        self.constant = constant
        self.linear = linear

    @classmethod
    def of(cls, value: Affine | ArrayLike) -> Affine:
        """Return `value` itself, or a constant with the value of an array."""
        if isinstance(value, Affine):
            return value
        array = np.atleast_2d(np.asarray(value, dtype=float))
        rows, columns = array.shape
        nothing = _csr((array.size, 0))
        return cls((rows, columns), array.ravel(order="F"), nothing)

    def widened(self, variables: int) -> Sparse:
        """Return `linear` with zero columns for variables declared later."""
        rows, known = self.linear.shape
        if known == variables:
            return self.linear
        csr = self.linear.tocsr()
        return _csr((csr.data, csr.indices, csr.indptr), shape=(rows, variables))

    def at(self, x: Matrix) -> Matrix:
        """Return the value for the variables `x`."""
        known = self.linear.shape[1]
        return np.reshape(self.constant + self.linear @ x[:known], self.shape, order="F")

    @property
    def T(self) -> Affine:
        """The transpose."""
        rows, columns = self.shape
        order = np.arange(rows * columns).reshape(rows, columns, order="F").ravel()
        return Affine((columns, rows), self.constant[order], self.linear.tocsr()[order])

    def __add__(self, other: Affine | ArrayLike) -> Affine:
        other = Affine.of(other)
        if other.shape != self.shape:
            raise ValueError(f"shapes {self.shape} and {other.shape} do not add")
        n = max(self.linear.shape[1], other.linear.shape[1])
        linear = _csr(self.widened(n) + other.widened(n))
        return Affine(self.shape, self.constant + other.constant, linear)

    __radd__ = __add__

    def __neg__(self) -> Affine:
        return Affine(self.shape, -self.constant, _csr(-self.linear))

    def __sub__(self, other: Affine | ArrayLike) -> Affine:
        return self + (-Affine.of(other))

    def __rsub__(self, other: Affine | ArrayLike) -> Affine:
        return Affine.of(other) + (-self)

    def __mul__(self, factor: float) -> Affine:
        return Affine(self.shape, self.constant * factor, _csr(self.linear * factor))

    __rmul__ = __mul__

    def __truediv__(self, divisor: float) -> Affine:
        return self * (1.0 / divisor)

    def __rmatmul__(self, left: ArrayLike) -> Affine:
        left = np.atleast_2d(np.asarray(left, dtype=float))
        if left.shape[1] != self.shape[0]:
            raise ValueError(f"shapes {left.shape} and {self.shape} do not multiply")
        product = sparse.kron(sparse.eye_array(self.shape[1]), left, format="csr")
        return self._mapped((left.shape[0], self.shape[1]), _csr(product))

    def __matmul__(self, right: ArrayLike) -> Affine:
        right = np.atleast_2d(np.asarray(right, dtype=float))
        if right.shape[0] != self.shape[1]:
            raise ValueError(f"shapes {self.shape} and {right.shape} do not multiply")
        product = sparse.kron(right.T, sparse.eye_array(self.shape[0]), format="csr")
        return self._mapped((self.shape[0], right.shape[1]), _csr(product))

    def times(self, matrix: ArrayLike) -> Affine:
        """Return this scalar (a 1 x 1 expression) times a constant matrix."""
        array = np.atleast_2d(np.asarray(matrix, dtype=float))
        column = _csr(array.reshape(-1, 1, order="F"))
        rows, columns = array.shape
        return self._mapped((rows, columns), column)

    @property
    def trace(self) -> Affine:
        """The sum of the diagonal, a 1 x 1 expression."""
        rows = self.shape[0]
        pick = _csr(np.eye(rows).reshape(1, -1))
        return self._mapped((1, 1), pick)

    def _mapped(self, shape: tuple[int, int], by: Sparse) -> Affine:
        return Affine(shape, by @ self.constant, _csr(by @ self.linear))


def block_matrix(rows: Sequence[Sequence[Affine | ArrayLike | None]]) -> Affine:
    """Assemble a matrix of blocks; None is a zero block, beside and below which others stand."""
    blocks = [[None if b is None else Affine.of(b) for b in row] for row in rows]
    heights = [next(b.shape[0] for b in row if b is not None) for row in blocks]
    widths = [
        next(b.shape[1] for b in column if b is not None) for column in zip(*blocks, strict=True)
    ]
    tops, lefts = np.cumsum([0, *heights]), np.cumsum([0, *widths])
    shape = int(tops[-1]), int(lefts[-1])
    result = Affine.of(np.zeros(shape))
    for row, top in zip(blocks, tops[:-1], strict=True):
        for block, left in zip(row, lefts[:-1], strict=True):
            if block is not None:
                r, c = np.indices(block.shape)
                target = ((left + c) * shape[0] + top + r).ravel(order="F")
                place = (np.ones(target.size), (target, np.arange(target.size)))
                by = _csr(place, shape=(shape[0] * shape[1], target.size))
                result = result + block._mapped(shape, by)
    return result


def symmetric_block(upper: Sequence[Sequence[Affine | ArrayLike | None]]) -> Affine:
    """Assemble a symmetric block matrix from its upper triangle.

    Parameters
    ----------
    upper : sequence of sequences
        Row i lists the blocks (i, i), (i, i + 1), ...; None is a zero block.
        The diagonal blocks have to be given and symmetric.

    Returns
    -------
    Affine

    Examples
    --------
    >>> import numpy as np
    >>> symmetric_block([[np.eye(1), [[2.0]]], [[[5.0]]]]).at(np.zeros(0))
    array([[1., 2.],
           [2., 5.]])
    """
    if any(row[0] is None for row in upper):
        raise ValueError("a diagonal block is missing")
    rows = [[None if b is None else Affine.of(b) for b in row] for row in upper]
    below = [[rows[j][i - j] for j in range(i)] for i in range(len(rows))]
    return block_matrix(
        [[b and b.T for b in left] + row for left, row in zip(below, rows, strict=True)]
    )


# Calls that end in time even if the code they call does not.

# Longer waits may exceed what the system's clock can hold.
_A_DAY = 86400.0


def run_with_time_limit(call: Callable[[], Any], seconds: float) -> Any:
    """Run `call` in a process of its own and end it after some seconds.

    Solvers look at the clock between iterations at best, and one iteration on a large
    problem can take minutes. The process ends with this one, too, whatever ends it.

    Parameters
    ----------
    call : callable
        Without arguments; what it returns has to be picklable.
    seconds : float
        Where processes cannot be forked (Windows), `call` runs here and without this limit.

    Returns
    -------
    object or None
        What it returned; None if it was ended or failed.

    Raises
    ------
    RobustPolishError
        If `call` raised it.

    Examples
    --------
    >>> run_with_time_limit(lambda: 6 * 7, 10.0)
    42
    """
    if not hasattr(os, "fork"):
        return call()
    ours, theirs = Pipe(duplex=False)
    watched, life = os.pipe()
    parent = os.getpid()
    with warnings.catch_warnings():
        # Python warns of threads that hold locks; the child computes, answers and ends.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:  # it ends without any clean-up of the parent's
        try:
            ours.close()
            os.close(life)
            os.setpgid(0, 0)
            exit_with_parent(parent, watched)
            try:
                theirs.send(call())
            except RobustPolishError as error:
                theirs.send(error)
        finally:
            os._exit(0)
    theirs.close()
    os.close(watched)
    answer = None
    try:
        with contextlib.suppress(EOFError):
            answer = ours.recv() if ours.poll(min(max(0.0, seconds), _A_DAY)) else None
    finally:
        ours.close()
        # The child and the processes that it started are of its group; one that is ended at once
        # has none yet.
        for kill in (os.killpg, os.kill):
            with contextlib.suppress(ProcessLookupError):
                kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(life)
    if isinstance(answer, RobustPolishError):
        raise answer
    return answer


# Semidefinite programs, stated once and solved by any backend.

Integers = NDArray[np.integer]

# An interior-point iteration on more unknowns takes too long for the clock to be looked at.
_QUICK_UNKNOWNS = 500
# Work of a program in steps: a fixed share, and the cube of its unknowns over those that cost as
# much; iterations number about the same for all.
_WORK = 20.0
_ALL_OVERHEAD = 100.0


@dataclass(frozen=True, eq=False)
class ConicForm:
    """What a backend receives: minimise ``objective @ x``.

    Attributes
    ----------
    objective : ndarray, shape (n,)
    psd : tuple of (int, sparse array, ndarray)
        Size m, G of shape (m * m, n) and h of length m * m: the symmetric matrix whose stacked
        columns are ``G @ x + h`` has to be positive semidefinite.
    nonnegative, zero : tuple of (sparse array, ndarray)
        G and h: ``G @ x + h`` has to be nonnegative, or zero, entry by entry.
    prescaled : bool
        The cones have been scaled by who states the program: solvers should not do it again.
    """

    objective: Matrix
    psd: tuple[tuple[int, sparse.csr_array, Matrix], ...]
    nonnegative: tuple[tuple[sparse.csr_array, Matrix], ...] = ()
    zero: tuple[tuple[sparse.csr_array, Matrix], ...] = ()
    prescaled: bool = False

    @property
    def finite(self) -> bool:
        """Whether no number has left the range of doubles."""
        blocks = [block[-2:] for block in (*self.psd, *self.nonnegative, *self.zero)]
        numbers = [self.objective, *(part for G, h in blocks for part in (G.data, h))]
        return all(bool(np.isfinite(values).all()) for values in numbers)


@dataclass(frozen=True, eq=False)
class SemidefiniteSolution:
    """What a backend returned; nothing in it has been verified.

    Attributes
    ----------
    x : ndarray or None
        The variables; None if the solver gave none.
    status : str
        The solver's own word ("optimal", "infeasible", ...): a hint, no proof.
    elapsed : float
        Seconds.
    """

    x: Matrix | None
    status: str
    elapsed: float

    def value(self, expression: Affine) -> Matrix:
        """Return the value of an expression; not a number where there is no solution."""
        if self.x is None:
            return np.full(expression.shape, np.nan)
        return expression.at(self.x)


class SemidefiniteProgram:
    """Variables, linear matrix inequalities and an objective.

    Inequalities are not strict; a caller that needs strictness asks for a margin,
    and verifies the answer in any case.

    Parameters
    ----------
    prescaled : bool
        Whether the caller has scaled the inequalities; the solver's own scaling would spoil that.

    Examples
    --------
    The largest eigenvalue of a matrix:

    >>> import numpy as np
    >>> program = SemidefiniteProgram()
    >>> t = program.scalar()
    >>> program.positive(t.times(np.eye(2)) - [[1.0, 2.0], [2.0, 1.0]])
    >>> program.minimise(t)
    >>> print(round(ProgramSolver("cvxpy", None, Budget()).solve(program).value(t).item(), 6))
    3.0
    """

    def __init__(self, prescaled: bool = False) -> None:
        self._prescaled = prescaled
        self.unknowns = 0  # scalar variables declared so far
        self._psd: list[Affine] = []
        self._nonnegative: list[Affine] = []
        self._zero: list[Affine] = []
        self._objective: Affine = Affine.of(0.0)

    def matrix(self, rows: int, columns: int, pattern: ArrayLike | None = None) -> Affine:
        """Declare a matrix variable, zero wherever `pattern` is given and false."""
        free = np.ones((rows, columns), bool) if pattern is None else np.asarray(pattern, bool)
        entries = np.flatnonzero(free.ravel(order="F"))
        return self._declared((rows, columns), entries, np.arange(entries.size))

    def scalar(self) -> Affine:
        """Declare a scalar variable, a 1 x 1 expression."""
        return self.matrix(1, 1)

    def symmetric(self, size: int) -> Affine:
        """Declare a symmetric matrix variable."""
        rows, columns = np.tril_indices(size)
        number = np.arange(rows.size)
        off = rows != columns
        entries = np.concatenate([columns * size + rows, (rows * size + columns)[off]])
        return self._declared((size, size), entries, np.concatenate([number, number[off]]))

    def positive(self, expression: Affine) -> None:
        """Require a symmetric expression to be positive semidefinite."""
        self._psd.append((expression + expression.T) * 0.5)

    def nonnegative(self, expression: Affine) -> None:
        """Require every entry to be at least zero."""
        self._nonnegative.append(expression)

    def zero(self, expression: Affine) -> None:
        """Require every entry to be zero."""
        self._zero.append(expression)

    def minimise(self, expression: Affine) -> None:
        """Set the objective, a 1 x 1 expression."""
        self._objective = expression

    def conic_form(self) -> ConicForm:
        """Return the numbers that backends work with."""
        n = self.unknowns
        return ConicForm(
            objective=self._objective.widened(n).toarray().ravel(),
            psd=tuple((e.shape[0], e.widened(n), e.constant) for e in self._psd),
            nonnegative=tuple((e.widened(n), e.constant) for e in self._nonnegative),
            zero=tuple((e.widened(n), e.constant) for e in self._zero),
            prescaled=self._prescaled,
        )

    def _declared(self, shape: tuple[int, int], entries: Integers, numbers: Integers) -> Affine:
        size = shape[0] * shape[1]
        columns = self.unknowns + numbers
        self.unknowns += int(numbers.max(initial=-1)) + 1
        linear = sparse.csr_array(
            (np.ones(entries.size), (entries, columns)), shape=(size, self.unknowns)
        )
        return Affine(shape, np.zeros(size), linear)


# Semidefinite programs through cvxpy: Clarabel by default, others by name.


def solve_by_cvxpy(
    form: ConicForm, solver: str | None, tolerance: float, time_limit: float
) -> tuple[NDArray[np.float64] | None, str]:
    """Solve a conic form; return the variables, or None, and the solver's status."""
    try:
        import cvxpy as cp
    except ImportError as error:
        raise MissingDependencyError(
            "backend: cvxpy is not installed. Install it with `pip install cvxpy clarabel`."
        ) from error

    name = (solver or "CLARABEL").upper()
    one_of("solver", name, cp.installed_solvers())
    x = cp.Variable(form.objective.size)
    constraints: list[Any] = [
        cp.PSD(cp.reshape(G @ x + h, (size, size), order="F")) for size, G, h in form.psd if size
    ]
    constraints += [G @ x + h >= 0 for G, h in form.nonnegative]
    constraints += [G @ x + h == 0 for G, h in form.zero]
    problem = cp.Problem(cp.Minimize(form.objective @ x), constraints)
    with warnings.catch_warnings():
        # "Solution may be inaccurate": the status says so, and callers verify.
        warnings.simplefilter("ignore")
        try:
            problem.solve(
                solver=name,
                ignore_dpp=True,
                **_cvxpy_options(name, tolerance, time_limit, form.prescaled),
            )
        except cp.SolverError as error:
            return None, f"failed: {error}"
    return (None if x.value is None else np.array(x.value)), str(problem.status)


def _cvxpy_options(
    name: str, tolerance: float, time_limit: float, prescaled: bool
) -> dict[str, Any]:
    # SCS knows no infinite time.
    seconds = min(max(time_limit, 1e-3), 1e9)
    if name == "CLARABEL":
        return {
            **dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance),
            # Where progress ends, the last iterate is wanted, not an error: callers verify.
            "reduced_tol_gap_abs": 1e-2,
            "reduced_tol_gap_rel": 1e-2,
            "reduced_tol_feas": 1e-3,
            "max_iter": 200,
            "equilibrate_enable": not prescaled,
            # More threads would add up in another order, and give other bits.
            "max_threads": 1,
            "direct_solve_method": "qdldl",
            "time_limit": seconds,
        }
    if name == "SCS":
        accuracy = {"eps_abs": tolerance, "eps_rel": tolerance}
        return {**accuracy, "max_iters": 100_000, "time_limit_secs": seconds}
    known = ("abstol", "reltol", "feastol") if name == "CVXOPT" else ()
    return dict.fromkeys(known, tolerance)


# Semidefinite programs through picos: CVXOPT by default. Both are GPL, hence optional.


def solve_by_picos(
    form: ConicForm, solver: str | None, tolerance: float, time_limit: float
) -> tuple[NDArray[np.float64] | None, str]:
    """Solve a conic form; return the variables, or None, and the solver's status."""
    try:
        import picos
    except ImportError as error:
        raise MissingDependencyError(
            "backend: picos is not installed. Install it with `pip install picos cvxopt`, "
            "or choose backend='cvxpy'."
        ) from error

    name = (solver or "cvxopt").lower()
    one_of("solver", name, picos.available_solvers())
    x = picos.RealVariable("x", form.objective.size)
    problem = picos.Problem(primals=None, verbosity=0, max_iterations=100)
    for size, G, h in form.psd:
        if not size:
            continue  # nothing is semidefinite
        entries: Any = picos.Constant(sparse.csc_matrix(G)) * x + picos.Constant(h)
        problem.add_constraint(entries.reshaped((size, size)) >> 0)
    for G, h in form.nonnegative:
        problem.add_constraint(picos.Constant(sparse.csc_matrix(G)) * x + picos.Constant(h) >= 0)
    for G, h in form.zero:
        problem.add_constraint(picos.Constant(sparse.csc_matrix(G)) * x + picos.Constant(h) == 0)
    problem.set_objective("min", picos.Constant(form.objective.reshape(1, -1)) * x)
    if math.isfinite(time_limit) and name != "cvxopt":
        problem.options.timelimit = max(1, round(time_limit))
    budget = Budget(seconds=time_limit)
    status = "failed"
    # CVXOPT breaks down, and loses its iterate, where it cannot reach the tolerance; how near to
    # rounding that is differs between processors.
    for eased in (10.0**power * tolerance for power in range(6)):
        for kind in ("abs_prim_fsb", "abs_dual_fsb", "abs_ipm_opt"):
            problem.options[f"{kind}_tol"] = problem.options[f"rel{kind[3:]}_tol"] = eased
        try:
            solution = problem.solve(solver=name)
        except (picos.SolutionFailure, ArithmeticError, ValueError) as error:
            status = f"failed: {error}"
        else:
            if x.value is not None:
                values = np.array(x.value, dtype=float).ravel()
                return values, str(solution.claimedStatus)
            status = str(solution.claimedStatus)
        if budget.late:
            break
    return None, status


# Both libraries are imported late: picos is optional, and cvxpy takes a second to load.
_SOLVE = {"cvxpy": solve_by_cvxpy, "picos": solve_by_picos}
BACKENDS = tuple(_SOLVE)


@dataclass(frozen=True)
class ProgramSolver:
    """Who solves the programs of one search, and how much work they may be.

    Attributes
    ----------
    backend : {"cvxpy", "picos"}
        Library that talks to the solver.
    solver : str or None
        A solver of that library; by default Clarabel for cvxpy, CVXOPT for picos.
    budget : Budget
        Solvers look at the clock between iterations at best, so that larger programs run in a
        process of their own, which is ended in time.
    accuracy : float
        Relative tolerance handed to the solver.
    """

    backend: str
    solver: str | None
    budget: Budget
    accuracy: float = 1e-9

    def solve(self, program: SemidefiniteProgram) -> SemidefiniteSolution:
        """Solve a program if work is left; without an answer its x is None.

        Raises
        ------
        InvalidInputError
            If there is no such backend.
        MissingDependencyError
            If the backend is not installed.
        """
        if self.budget.over:
            return SemidefiniteSolution(None, "no work left", 0.0)
        self.budget.spend(_WORK * (1 + (program.unknowns / _ALL_OVERHEAD) ** 3))
        run = _SOLVE[one_of("backend", self.backend, BACKENDS)]
        form, seconds, clock = program.conic_form(), self.budget.seconds_left, Budget()
        x, status = None, "numbers beyond doubles"
        if form.finite:
            call = partial(run, form, self.solver, self.accuracy, seconds)
            default = self.backend == "cvxpy" and self.solver is None
            if default and form.objective.size <= _QUICK_UNKNOWNS:
                x, status = call()
            else:
                x, status = run_with_time_limit(call, seconds) or (None, "time limit")
        self.budget.update_late()
        known = x is not None and np.isfinite(x).all()
        return SemidefiniteSolution(x if known else None, status, clock.elapsed)


def stabilising_gain(
    loop: PlantMatrices,
    mask: NDArray[np.bool_],
    solver: ProgramSolver,
    decay: float = 1e-3,
    iterations: int = 15,
) -> AnyMatrix | None:
    """Look for a gain that stabilises a scaled plant.

    Parameters
    ----------
    loop : PlantMatrices
        Scaled.
    mask : ndarray of bool, shape (nu, ny)
        Entries of K that are free; the last program alone respects it.
    solver : ProgramSolver
    decay : float
        Decay rate asked for, relative to the unit of time; in discrete time the poles are
        asked into a disk of radius 1 - decay.
    iterations : int
        Largest number of linearisations.

    Returns
    -------
    ndarray of shape (nu, ny) or None
        The last gain that a program proposed, stabilising or not: a start for a
        descent. None if the programs failed.
    """
    # A system from u to y whose stability implies that of the loop with its decay.
    A, B, C, D = loop.A, loop.B2, loop.C2, loop.D22
    if loop.discrete:
        A, B, C, D = cayley(A / (1 - decay), B / (1 - decay), C, D)
    else:
        A = A + decay * (float(np.linalg.norm(A, 2)) or 1.0) * np.eye(len(A))
    n = len(A)
    left, right = linalg.null_space(B.T), linalg.null_space(C)
    P0 = Q0 = np.eye(n)
    gain = None
    for _ in range(iterations):
        program = SemidefiniteProgram()
        P, Q = program.symmetric(n), program.symmetric(n)
        program.positive(symmetric_block([[P, np.eye(n)], [Q]]))
        if left.size:
            S = left.T @ (A @ Q) @ left
            program.positive(-(S + S.T) - np.eye(left.shape[1]) * 1e-3)
        if right.size:
            S = right.T @ (P @ A) @ right
            program.positive(-(S + S.T) - np.eye(right.shape[1]) * 1e-3)
        program.minimise((P @ Q0).trace + (Q @ P0).trace)
        solution = solver.solve(program)
        if solution.x is None:
            break
        P0, Q0 = solution.value(P), solution.value(Q)
        gain = _gain(A, B, C, P0, mask, solver)
        if gain is not None and np.linalg.eigvals(A + B @ gain @ C).real.max() < 0:
            break
    if gain is None or not D.any() or not mask.all():
        return gain
    # It acts on y - D u; with a mask that is a start only.
    inner = np.eye(len(gain)) + gain @ D
    return np.linalg.solve(inner, gain) if np.linalg.cond(inner) < 1e12 else gain


def _gain(
    A: AnyMatrix,
    B: AnyMatrix,
    C: AnyMatrix,
    P: AnyMatrix,
    mask: NDArray[np.bool_],
    solver: ProgramSolver,
) -> AnyMatrix | None:
    """Return the K that makes A'P + PA + PBKC + (PBKC)' as negative as it can be."""
    size = float(np.linalg.norm(P, 2))
    if not np.isfinite(size) or size == 0:
        return None
    P = P / size
    program = SemidefiniteProgram()
    K, t = program.matrix(*mask.shape, pattern=mask), program.scalar()
    S = (P @ B) @ K @ C + P @ A
    program.positive(t.times(np.eye(len(A))) - (S + S.T))
    program.nonnegative(t + 1.0)
    # Keeps K finite where its direction is free.
    bound = program.scalar()
    rows, columns = (bound.times(np.eye(size)) for size in mask.shape)
    program.positive(symmetric_block([[rows, K], [columns]]))
    program.minimise(t + bound * 1e-4)
    solution = solver.solve(program)
    return None if solution.x is None else solution.value(K)
