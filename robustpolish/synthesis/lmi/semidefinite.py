"""Semidefinite programs, stated once and solved by any backend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from robustpolish.arrays import Matrix
from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.affine import Affine
from robustpolish.synthesis.lmi.limited import run_limited
from robustpolish.validation import one_of

Integers = NDArray[np.integer]

BACKENDS = ("cvxpy", "picos")
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
    >>> print(round(program.solve("cvxpy").value(t).item(), 6))
    3.0
    """

    def __init__(self, prescaled: bool = False) -> None:
        self._prescaled = prescaled
        self._count = 0
        self._psd: list[Affine] = []
        self._nonnegative: list[Affine] = []
        self._zero: list[Affine] = []
        self._objective: Affine = Affine.of(0.0)

    @property
    def unknowns(self) -> int:
        """Number of scalar variables declared so far."""
        return self._count

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
        n = self._count
        return ConicForm(
            objective=self._objective.widened(n).toarray().ravel(),
            psd=tuple((e.shape[0], e.widened(n), e.constant) for e in self._psd),
            nonnegative=tuple((e.widened(n), e.constant) for e in self._nonnegative),
            zero=tuple((e.widened(n), e.constant) for e in self._zero),
            prescaled=self._prescaled,
        )

    def solve(
        self,
        backend: str = "cvxpy",
        *,
        solver: str | None = None,
        tolerance: float = 1e-9,
        time_limit: float | None = None,
    ) -> SemidefiniteSolution:
        """Solve the program.

        Parameters
        ----------
        backend : {"cvxpy", "picos"}
            Library that talks to the solver.
        solver : str, optional
            A solver of that library; by default Clarabel for cvxpy, CVXOPT for picos.
        tolerance : float, optional
            Relative tolerance passed to the solver.
        time_limit : float, optional
            Seconds. Solvers look at the clock between iterations at best, so that larger programs
            run in a process of their own, which is ended in time.

        Returns
        -------
        SemidefiniteSolution
            Not verified. A solver that fails gives ``x = None``, never an exception.

        Raises
        ------
        InvalidInputError
            If there is no such backend.
        MissingDependencyError
            If the backend is not installed.
        """
        run = _backend(backend)
        form = self.conic_form()
        if not form.finite:
            return SemidefiniteSolution(None, "numbers beyond doubles", 0.0)

        def call() -> tuple[Matrix | None, str]:
            return run(form, solver, tolerance, time_limit)

        clock = Budget()
        quick = backend == "cvxpy" and solver is None and form.objective.size <= _QUICK_UNKNOWNS
        if time_limit is None or quick:
            x, status = call()
        else:
            x, status = run_limited(call, time_limit) or (None, "time limit")
        if x is not None and not np.isfinite(x).all():
            x = None
        return SemidefiniteSolution(x, status, clock.elapsed)

    def _declared(self, shape: tuple[int, int], entries: Integers, numbers: Integers) -> Affine:
        size = shape[0] * shape[1]
        columns = self._count + numbers
        self._count += int(numbers.max(initial=-1)) + 1
        linear = sparse.csr_array(
            (np.ones(entries.size), (entries, columns)), shape=(size, self._count)
        )
        return Affine(shape, np.zeros(size), linear)


@dataclass(frozen=True)
class ProgramSolver:
    """Who solves the programs of one search, and how much work they may be.

    Attributes
    ----------
    backend : {"cvxpy", "picos"}
    solver : str or None
    budget : Budget
    accuracy : float
        Relative tolerance handed to the solver.
    """

    backend: str
    solver: str | None
    budget: Budget
    accuracy: float = 1e-9

    def solve(self, program: SemidefiniteProgram) -> SemidefiniteSolution:
        """Solve a program if work is left; without an answer its x is None."""
        if self.budget.over:
            return SemidefiniteSolution(None, "no work left", 0.0)
        self.budget.spend(_WORK * (1 + (program.unknowns / _ALL_OVERHEAD) ** 3))
        found = program.solve(
            self.backend,
            solver=self.solver,
            tolerance=self.accuracy,
            time_limit=self.budget.seconds_left,
        )
        self.budget.look()
        return found


Run = Callable[[ConicForm, str | None, float, float | None], tuple[Matrix | None, str]]


def _backend(name: str) -> Run:
    # Imported late: picos is optional and GPL, and cvxpy takes a second to load.
    one_of("backend", name, BACKENDS)
    return import_module(f"robustpolish.synthesis.backends.{name}_backend").solve
