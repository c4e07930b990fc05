"""Eigenvalues and stability, decided without rounding where rounding could matter."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Literal

import control
import numpy as np
import scipy.linalg as sla
import xarray as xr
from flint import acb, arb, fmpq_mat, fmpz_poly
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack as _lapack

from robustpolish.base.arrays import EPS, Matrix
from robustpolish.base.checks import described, invalid, matrix, positive, square
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.linear.arithmetic.exact import (
    EXACT_STATES,
    ExactModel,
    rational,
    reachable,
    rescaled,
)
from robustpolish.linear.scaling import decoupled_blocks, equilibrating_scales, in_units
from robustpolish.linear.systems import Realisation, realisation
from robustpolish.plots.charts import plot_bars
from robustpolish.plots.poles import plot_poles

# Eigenvalues in double precision with their errors and the share of each state.


lapack: Any = _lapack


@dataclass(frozen=True, eq=False)
class Eigensystem:
    """Eigenvalues of a matrix and what their vectors tell.

    Attributes
    ----------
    values : ndarray of complex, shape (n,)
    errors : ndarray of float, shape (n,)
        Generous estimates of the rounding errors, by first-order perturbation theory: ten
        times the backward error of the QR algorithm over the cosine between left and
        right eigenvector. Large where eigenvalues are nearly multiple.
    right, left : ndarray of complex, shape (n, n)
        Right and left eigenvectors in the columns.
    """

    values: NDArray[np.complex128]
    errors: NDArray[np.float64]
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]

    @property
    def shares(self) -> NDArray[np.float64]:
        """Part of each state (row) in each mode (column), whatever the units of the states.

        It is rounded, so that the first of equal states leads.
        """
        shares = np.abs(self.left.conj() * self.right)
        vanishing = shares.sum(axis=0) <= np.finfo(float).tiny  # defective: orthogonal vectors
        shares[:, vanishing] = np.abs(self.right[:, vanishing])
        return np.round(shares / shares.sum(axis=0), 3)


def eigensystem(M: NDArray[np.float64]) -> Eigensystem:
    """Compute the eigenvalues of a square matrix and what belongs to them."""
    n = M.shape[0]
    if n == 0:
        none = np.empty((0, 0), complex)
        return Eigensystem(np.empty(0, complex), np.empty(0), none, none)
    real, imag, left, right, failed = lapack.dgeev(M, lwork=_lapack_workspace(n))
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues did not converge")
    from robustpolish.linear.arithmetic.even_units import complex_eigenpairs

    backward = 10 * EPS * math.sqrt(n) * math.sqrt(np.vdot(M, M))
    values, cosines, left, right = complex_eigenpairs(real, imag, left.T, right.T)
    with np.errstate(divide="ignore"):
        return Eigensystem(values, backward / cosines, right.T, left.T)


@lru_cache
def _lapack_workspace(n: int) -> int:
    """Return the working memory with which LAPACK is quickest."""
    return int(lapack.dgeev_lwork(n)[0])


def pair_text(value: complex) -> str:
    """Return a real eigenvalue, or a complex pair, as text."""
    if value.imag == 0:
        return f"{value.real:.6g}"
    return f"{value.real:.6g} +/- {abs(value.imag):.6g}j"


# Poles by exact arithmetic: the characteristic polynomial in integers, its roots isolated.
#
# That decides what double precision cannot: on which side of the stability boundary a
# pole lies. At twelve states it costs a millisecond.


def poles_by_side(A: fmpq_mat, discrete: bool) -> list[tuple[complex, int]]:
    """Return the eigenvalues with -1, 0 or 1 for inside, on and beyond the stability boundary."""
    return _sided(fmpz_poly(A.charpoly().numer().coeffs()), discrete)


def unreachable_poles(A: fmpq_mat, B: fmpq_mat, discrete: bool) -> list[tuple[complex, bool]]:
    """Return the eigenvalues that B does not reach, and whether each is strictly stable."""
    reached, _, _ = reachable(A, B, fmpq_mat(0, A.nrows()))
    if reached.nrows() == A.nrows():
        return []
    rest = A.charpoly() // reached.charpoly() if reached.nrows() else A.charpoly()
    sided = _sided(fmpz_poly(rest.numer().coeffs()), discrete)
    return [(pole, side < 0) for pole, side in sided]


def _sided(polynomial: fmpz_poly, discrete: bool) -> list[tuple[complex, int]]:
    """Return the roots with -1, 0 or 1 for inside, on and beyond the stability boundary."""
    n = polynomial.degree()
    if discrete:  # (1 - s)^n p((1 + s)/(1 - s)): roots at z = -1 go to infinity, the degree tells
        up, down, coefficients = fmpz_poly([1, 1]), fmpz_poly([1, -1]), polynomial.coeffs()
        terms = (up**k * down ** (n - k) * c for k, c in enumerate(coefficients))
        polynomial = sum(terms, fmpz_poly([0]))
    sided = [(complex(-1), 0)] * (n - polynomial.degree())
    if polynomial.degree() == 0:
        return sided
    mirrored = fmpz_poly([(-1) ** k * int(c) for k, c in enumerate(polynomial.coeffs())])
    symmetric = polynomial.gcd(mirrored)  # holds every root on the axis, and pairs around it
    # Those on the axis: zero, and positive roots of the even or odd polynomial in x = -s^2.
    coefficients = symmetric.coeffs()
    zeros = next(k for k, c in enumerate(coefficients) if c != 0)
    even = fmpz_poly([(-1) ** k * int(c) for k, c in enumerate(coefficients[zeros::2])])
    on_axis = zeros + 2 * sum(times for _, times in positive_roots(even))
    bits, roots = 64, []
    while True:  # until only these have no sign in their real parts
        with precision(bits):
            roots = isolated_roots(polynomial)
        if sum(times for root, times in roots if root.real.contains(0)) == on_axis:
            break
        bits *= 2
    for root, times in roots:
        where = complex(root)
        side = int(root.real > 0) - int(root.real < 0)
        pole = where if side else 1j * where.imag
        if discrete and pole != 1:
            pole = (1 + pole) / (1 - pole)
        sided += [(pole, side)] * times
    return sided


def eigenvalues(A: fmpq_mat) -> list[complex]:
    """Return the eigenvalues of a rational matrix, each part to double precision."""
    polynomial = fmpz_poly(A.charpoly().numer().coeffs())
    bits = 128
    while True:
        with precision(bits):
            roots = isolated_roots(polynomial)
            if bits > 4096 or all(_sharp(root.real) and _sharp(root.imag) for root, _ in roots):
                return [complex(root) for root, times in roots for _ in range(times)]
        bits *= 2


def _sharp(value: arb) -> bool:
    """Say whether a part of an eigenvalue is known to double precision or is exactly zero."""
    return value.rel_accuracy_bits() >= 56 or value == 0


def isolated_roots(polynomial: fmpz_poly) -> list[tuple[acb, int]]:
    """Return disjoint balls around the roots, with multiplicities, at the precision in force."""
    roots: Any = polynomial.complex_roots()  # the library's stub forgets the multiplicities
    return roots


def positive_roots(polynomial: fmpz_poly) -> list[tuple[acb, int]]:
    """Isolate the real roots at or above zero of a polynomial with integer coefficients."""
    if polynomial.degree() <= 0:
        return []
    coefficients = polynomial.coeffs()
    zeros = next(k for k, c in enumerate(coefficients) if c != 0)
    found: list[tuple[acb, int]] = [(acb(0), zeros)] if zeros else []
    rest = fmpz_poly(coefficients[zeros:])
    bits = 128
    while True:
        with precision(bits):
            roots = isolated_roots(rest) if rest.degree() > 0 else []
        real = [(root, times) for root, times in roots if root.imag == 0]
        if not any(root.real.contains(0) for root, _ in real):
            return found + [(root, times) for root, times in real if root.real > 0]
        bits *= 2


COUNTED_STATES = 150
"""Largest number of coupled states whose poles are counted in exact arithmetic."""


@dataclass(frozen=True, repr=False)
class Stability(Displayed):
    """On which side of the stability boundary the poles lie.

    Attributes
    ----------
    verdict : {"stable", "marginal", "unstable"}
        Marginal: none beyond the boundary, but at least one on it.
    pole : complex or None
        The pole nearest to the boundary or farthest beyond it, in rad/s (in
        discrete time without unit); None without states.
    margin : float
        Its distance from the boundary, positive inside: the negative real part
        in rad/s, or one less the magnitude.
    exact : bool
        Whether it took exact arithmetic to decide.
    reason : str
        The verdict in a sentence.
    poles : ndarray of complex
        All poles, to be drawn; the verdict does not rest on them.
    discrete : bool
        Whether the unit circle is the boundary.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rp.linear.stability(control.ss([[-2.0]], [[1.0]], [[1.0]], 0))
    stable
      nearest pole  -2 rad/s
      margin        2 rad/s
      exact         no
      all poles are strictly stable
    """

    verdict: Literal["stable", "marginal", "unstable"]
    pole: complex | None
    margin: float
    exact: bool
    reason: str
    poles: NDArray[np.complex128] = field(
        default_factory=lambda: np.zeros(0, complex), compare=False
    )
    discrete: bool = False

    def __bool__(self) -> bool:
        return self.verdict == "stable"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the poles with the boundary of stability.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.linear.stability(rp.air_bearing().open_loop).plot().get_ylabel()
        'frequency [kHz]'
        """
        return plot_poles({"poles": self.poles}, ax=ax, discrete=self.discrete)

    def _card(self) -> Card:
        unit = "" if self.discrete else " rad/s"
        rows = (
            ("nearest pole", None if self.pole is None else _shown(self.pole, self.discrete)),
            ("margin", f"{self.margin:.6g}{unit}"),
            ("exact", self.exact),
        )
        return Card(self.verdict, (quantities(*rows),), (self.reason,))


def stability(system: control.StateSpace) -> Stability:
    r"""Decide whether all poles are strictly stable.

    Poles whose distance from the imaginary axis (the unit circle) is within
    reach of rounding are counted again in exact rational arithmetic, so the
    answer is right for the matrix as it is stored, at any scale.

    Parameters
    ----------
    system : control.StateSpace, or any other system
        Continuous or discrete: a transfer function, a system of scipy.signal, a MechanicalModel.

    Returns
    -------
    Stability
        True in a condition if, and only if, the system is strictly stable.

    Raises
    ------
    InvalidInputError
        If it is no system or has entries that are not finite.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> oscillator = control.ss([[0, 1], [-1, -2e-12]], [[0], [1]], [[1, 0]], 0)
    >>> bool(rp.linear.stability(oscillator))
    True
    >>> rp.linear.stability(control.ss([[0.0]], [[1.0]], [[1.0]], 0)).reason
    'pole 0 rad/s on the imaginary axis'
    """
    model = rescaled(realisation("system", system))
    spectrum = eigensystem(model.A)
    poles = spectrum.values * model.time
    return replace(stability_of(model, spectrum), poles=poles, discrete=model.discrete)


def stability_of(model: Realisation, spectrum: Eigensystem | None = None) -> Stability:
    """Decide it for rescaled matrices; the `spectrum` of A is taken if it is at hand."""
    spectrum = spectrum or eigensystem(model.A)
    poles, errors = spectrum.values, spectrum.errors
    if poles.size == 0:
        return Stability("stable", None, np.inf, False, "there are no states")
    margins = 1 - np.abs(poles) if model.discrete else -poles.real
    worst = int(margins.argmin())
    pole, margin = complex(poles[worst]) * model.time, float(margins[worst]) * model.time
    clear = np.count_nonzero(np.abs(margins) > errors)
    if clear == margins.size or (margins < -errors).any():
        verdict = "stable" if margin > 0 else "unstable"
        return Stability(verdict, pole, margin, False, _sentence(verdict, pole, model.discrete))
    if model.states > COUNTED_STATES:
        text = f"pole {_shown(pole, model.discrete)} too near the boundary to decide: not trusted"
        return Stability("marginal", pole, margin, False, text)
    return _exactly(model)


def unstable_poles(A: NDArray[np.float64]) -> int | None:
    """Count the eigenvalues right of the axis; None if one lies on it, or may in a large matrix.

    Those within reach of rounding are counted in exact arithmetic.
    """
    n = len(A)
    model = rescaled(Realisation(A, np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, 0)), False))
    spectrum = eigensystem(model.A)
    if (np.abs(spectrum.values.real) > spectrum.errors).all():
        return int(np.count_nonzero(spectrum.values.real > 0))
    if model.states > COUNTED_STATES:
        return None
    sides = [side for _, side in poles_by_side(rational(model.A), discrete=False)]
    return None if 0 in sides else sides.count(1)


def _exactly(model: Realisation) -> Stability:
    A = rational(model.A)
    sided = poles_by_side(A, model.discrete)
    worst = max(side for _, side in sided)
    verdict: Any = ("marginal", "unstable", "stable")[worst]
    margin = 0.0
    if worst:
        pole, margin = _least_margin(A, model.discrete)
    else:
        pole = next(p for p, side in sided if not side)
    pole, margin = pole * model.time, margin * model.time
    text = _sentence(verdict, pole, model.discrete)
    text += ", decided in exact arithmetic" if worst < 0 else ""
    return Stability(verdict, pole, margin, True, text)


def _least_margin(A: fmpq_mat, discrete: bool) -> tuple[complex, float]:
    """Return the pole of least margin and that margin, to double precision; none is on the edge."""
    polynomial, bits = fmpz_poly(A.charpoly().numer().coeffs()), 128
    while True:
        with precision(bits):
            found = [
                (1 - abs(root) if discrete else -root.real, root)
                for root, _ in isolated_roots(polynomial)
            ]
            margin, pole = min(found, key=lambda each: float(each[0]))
            if _sharp(margin) and all(other > 0 or margin < 0 for other, _ in found):
                return complex(pole), float(margin)
        bits *= 2


def stable_part(model: Realisation, verdict: Stability) -> ExactModel | None:
    """Return what inputs and outputs see of a marginal system, if that is strictly stable."""
    if model.states > EXACT_STATES or not verdict.exact:
        return None
    seen = ExactModel.of(model).minimal()
    stable = all(side < 0 for _, side in poles_by_side(seen.A, model.discrete))
    return seen if stable else None


def _sentence(verdict: str, pole: complex, discrete: bool) -> str:
    if verdict == "stable":
        return "all poles are strictly stable"
    axis = "on the unit circle" if discrete else "on the imaginary axis"
    beyond = "outside the unit circle" if discrete else "in the right half-plane"
    return f"pole {_shown(pole, discrete)} {axis if verdict == 'marginal' else beyond}"


def _shown(pole: complex, discrete: bool) -> str:
    sign = "+" if pole.imag > 0 else "-"
    imaginary = f" {sign} {abs(pole.imag):.6g}j" if pole.imag else ""
    return f"{pole.real:.6g}{imaginary}{'' if discrete else ' rad/s'}"


def square_root(M: Matrix, floor: float = 0.0) -> Matrix:
    """Return R with R R' = M, symmetric, eigenvalues raised to a share of the largest."""
    values, vectors = np.linalg.eigh((M + M.T) / 2)
    return vectors * np.sqrt(np.maximum(values, floor * values[-1:]))


def lyapunov_solution(A: Matrix, Q: Matrix, discrete: bool) -> Matrix:
    """Return X = X' with A X + X A' + Q = 0, or A X A' - X + Q = 0 in discrete time."""
    with warnings.catch_warnings():  # bad conditioning shows in the residual
        warnings.simplefilter("ignore")
        solve = sla.solve_discrete_lyapunov if discrete else sla.solve_continuous_lyapunov
        X = solve(A, Q if discrete else -Q)
    return (X + X.T) / 2


# Controllability and observability: which modes cannot be moved or seen, and how nearly.


Kind = Literal["controllability", "observability"]


@dataclass(frozen=True)
class ModeTest:
    """The Popov-Belevitch-Hautus test at one eigenvalue.

    Attributes
    ----------
    eigenvalue : complex
        In rad/s, or in discrete time without unit; of a pair the one with positive
        imaginary part.
    distance : float
        Size of a relative change of the scaled matrices (A, B) or (A, C) that makes a
        mode near this eigenvalue deficient: the smallest singular value of (A - lambda I, B),
        minimised over lambda around here, over their norm.
    state : str
        The state that takes the largest part in the mode.
    deficient : bool
        Whether no input moves the mode (no output sees it), exactly or to rounding.
    stable : bool
        Whether the mode dies out by itself, beyond doubt.
    """

    eigenvalue: complex
    distance: float
    state: str
    deficient: bool
    stable: bool


@dataclass(frozen=True, repr=False)
class PbhTest(Displayed):
    """Result of :func:`controllability` or :func:`observability`; true if no mode is deficient.

    Attributes
    ----------
    kind : {"controllability", "observability"}
    modes : tuple of ModeTest
        All modes, the most nearly deficient first.
    distance : float
        The smallest of their distances, an upper bound of the distance to the nearest
        deficient system; infinite without states.
    deficient : tuple of ModeTest
        Those that cannot be moved or seen.
    harmful : tuple of ModeTest
        The deficient ones that are not stable: they rule stabilising (detecting) out.
    reason : str
        The finding in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.linear.observability([[-1, 0], [0, -2]], [[0, 1]], states=["drift", "v"])
    not observable: -1 (state drift)
      eigenvalue  state  distance  lacking  stable
      -1          drift         0  yes      yes
      -2          v           ...  no       yes
    """

    kind: Kind
    modes: tuple[ModeTest, ...]

    @property
    def distance(self) -> float:
        """Smallest distance of all modes."""
        return min((mode.distance for mode in self.modes), default=np.inf)

    @property
    def deficient(self) -> tuple[ModeTest, ...]:
        """The modes that no input moves, or no output sees."""
        return tuple(mode for mode in self.modes if mode.deficient)

    @property
    def harmful(self) -> tuple[ModeTest, ...]:
        """The deficient modes that are not stable."""
        return tuple(mode for mode in self.deficient if not mode.stable)

    @property
    def reason(self) -> str:
        """The finding in a sentence."""
        adjective = "controllable" if self.kind == "controllability" else "observable"
        if not self.deficient:
            near = f"; the nearest that is not is {self.distance:.2g} away" if self.modes else ""
            return f"{adjective}{near}"
        listed = ", ".join(
            f"{pair_text(m.eigenvalue)} (state {m.state}{'' if m.stable else ', not stable'})"
            for m in self.deficient
        )
        return f"not {adjective}: {listed}"

    def __bool__(self) -> bool:
        return not self.deficient

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each mode's distance from being deficient; a mode at distance zero has no bar.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.linear.controllability([[-1, 0], [0, -2]], [[0], [1]]).plot().get_ylabel()
        'mode'
        """
        inputs = self.kind == "controllability"
        name = f"relative distance from being un{'controllable' if inputs else 'observable'}"
        labels = [f"{mode.state}, {pair_text(mode.eigenvalue)}" for mode in self.modes]
        where = {"mode": labels}
        distance = [mode.distance for mode in self.modes]
        lacking = [mode.deficient for mode in self.modes]
        return plot_bars(
            xr.DataArray(distance, where, "mode", name=name),
            xr.DataArray(lacking, where, "mode"),
            ax,
            meaning=("moved by an input", "moved by none") if inputs
            else ("seen by an output", "seen by none"),
        )  # fmt: skip

    def _card(self) -> Card:
        columns = ("eigenvalue", "state", "distance", "lacking", "stable")
        rows = tuple(
            (pair_text(mode.eigenvalue), mode.state, mode.distance, mode.deficient, mode.stable)
            for mode in self.modes
        )
        return Card(self.reason, (Table("", columns, rows),))


@dataclass(frozen=True, repr=False)
class Feasibility(Displayed):
    """Result of :func:`is_stabilizable` or :func:`is_detectable`; true if it is.

    Attributes
    ----------
    possible : bool
    modes : tuple of ModeTest
        The modes that rule it out.
    reason : str
        The finding in a sentence.
    test : PbhTest
        The test of all modes.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.linear.is_stabilizable([[1, 0], [0, -2]], [[0], [1]])
    not stabilisable: no input moves 1 (state x[0])
      eigenvalue  state  distance  lacking  stable
      1           x[0]          0  yes      no
      -2          x[1]        ...  no       yes
    """

    possible: bool
    modes: tuple[ModeTest, ...]
    reason: str
    test: PbhTest

    def __bool__(self) -> bool:
        return self.possible

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each mode's distance from being deficient, as :meth:`PbhTest.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.linear.is_detectable([[-1, 0], [0, 2]], [[0, 1]]).plot().get_ylabel()
        'mode'
        """
        return self.test.plot(ax)

    def _card(self) -> Card:
        return Card(self.reason, self.test._card().tables)


# Distance of each mode from being unreachable, and which modes are.


def _mode_tests(
    model: Realisation, names: Sequence[str], tolerance: float | None
) -> Iterator[ModeTest]:
    """Test the pair (A, B) mode by mode, block by block."""
    for block in decoupled_blocks(model.A, model.B, np.zeros((0, model.states))):
        n, m = len(block.states), len(block.inputs)
        if n:
            A = model.A[np.ix_(block.states, block.states)]
            B = model.B[np.ix_(block.states, block.inputs)]
            part = Realisation(A, B, np.zeros((0, n)), np.zeros((0, m)), model.discrete)
            # Units of states, time and of each input do not change what is reachable.
            part = in_units(part, equilibrating_scales(part, [np.array([i]) for i in range(m)], []))
            yield from _block_tests(part, [names[i] for i in block.states], tolerance)


def _block_tests(
    model: Realisation, names: Sequence[str], tolerance: float | None
) -> Iterator[ModeTest]:
    A, B, n = model.A, model.B, model.states
    spectrum = eigensystem(A)
    values = spectrum.values
    size = float(np.linalg.norm(np.hstack([A, B]), 2))
    limit = (100 * n * EPS if tolerance is None else tolerance) * size
    margins = 1 - np.abs(values) if model.discrete else -values.real
    matched: dict[int, tuple[complex, bool]] = {}
    sides: dict[int, tuple[complex, bool]] = {}
    if n <= EXACT_STATES:
        matched = _matched(values, unreachable_poles(rational(A), rational(B), model.discrete))
        if (np.abs(margins) <= spectrum.errors).any():
            poles = poles_by_side(rational(A), model.discrete)
            sides = _matched(values, [(pole, side < 0) for pole, side in poles])
    for i, value in enumerate(values):
        if value.imag < 0:
            continue
        distance = _distance(A, B, values, i)
        deficient = distance <= limit
        stable = bool(margins[i] > spectrum.errors[i])
        if i in matched:
            value, stable = matched[i]
            distance, deficient = 0.0, True
        elif i in sides:
            stable = sides[i][1]
        relative = distance / size if size else 0.0
        state = names[int(spectrum.shares[:, i].argmax())]
        yield ModeTest(complex(value) * model.time, relative, state, deficient, stable)


def _matched(
    values: NDArray[np.complex128], exact: list[tuple[complex, bool]]
) -> dict[int, tuple[complex, bool]]:
    """Assign each exact eigenvalue to the nearest computed one that is left."""
    free = set(range(len(values)))
    matched = {}
    for pole, stable in exact:
        nearest = min(free, key=lambda i: abs(values[i] - pole))
        free.remove(nearest)
        matched[nearest] = (pole, stable)
    return matched


def _distance(
    A: NDArray[np.float64], B: NDArray[np.float64], values: NDArray[np.complex128], which: int
) -> float:
    """Minimise the smallest singular value of (A - x I, B) over x near one eigenvalue.

    For the left singular vector u at x, the best x is u* A u: it can
    only lessen the norm of u* (A - x I, B), so every step is downhill. It
    ends where another eigenvalue becomes the nearest.
    """
    n = A.shape[0]
    x, best = complex(values[which]), np.inf
    for _ in range(30):
        pencil = np.hstack([A - x * np.eye(n), B])
        u, s, _ = np.linalg.svd(pencil, full_matrices=False)
        smallest = float(s[-1])
        if smallest >= best * (1 - 1e-3):
            return min(best, smallest)
        best = smallest
        x = complex(u[:, -1].conj() @ A @ u[:, -1])
        if np.abs(values - x).min() < abs(values[which] - x):
            break
    return best


# The public tests.


def controllability(
    system: control.StateSpace | ArrayLike,
    B: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> PbhTest:
    r"""Test every mode for controllability, with its distance from losing it.

    States, time and inputs are scaled first, so the verdicts do not depend on units and
    the distances depend on them little (more where states are barely coupled). A
    mode is deficient if exact arithmetic finds it outside the reachable subspace, or if its
    distance is within the tolerance. The distance is minimised over
    complex lambda by alternating between the smallest singular vector of
    (A - lambda I, B) and the best lambda for it, which never increases it; the global
    minimum may be smaller [1]_.

    Parameters
    ----------
    system : control.StateSpace or array_like, shape (n, n)
        A system, or its matrix A.
    B : array_like, shape (n, m), optional
        Only with a matrix A.
    states : sequence of str, optional
        Names, only with a matrix A.
    dt : float or True, optional
        Sampling time, only with a matrix A: 0 is continuous time.
    tolerance : float, optional
        Distance up to which a mode counts as deficient; 100 n times the rounding unit by
        default.

    Returns
    -------
    PbhTest

    Raises
    ------
    InvalidInputError
        If the shapes do not fit, an entry is not finite or the number of names is wrong.

    References
    ----------
    .. [1] R. Eising, "Between controllable and uncontrollable", Systems & Control
       Letters 4 (1984) 263-264.

    Examples
    --------
    >>> import robustpolish as rp
    >>> test = rp.linear.controllability([[1, 0], [0, -2]], [[0], [1]], states=["drift", "v"])
    >>> test.reason
    'not controllable: 1 (state drift, not stable)'
    """
    return _test("controllability", system, B, states, dt, tolerance)


def observability(
    system: control.StateSpace | ArrayLike,
    C: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> PbhTest:
    """Test every mode for observability, with its distance from losing it.

    The dual of :func:`controllability`: the same for A and C transposed.

    Parameters
    ----------
    system : control.StateSpace or array_like, shape (n, n)
        A system, or its matrix A.
    C : array_like, shape (p, n), optional
        Only with a matrix A.
    states, dt, tolerance
        As for :func:`controllability`.

    Returns
    -------
    PbhTest

    Raises
    ------
    InvalidInputError
        If the shapes do not fit, an entry is not finite or the number of names is wrong.

    Examples
    --------
    >>> import robustpolish as rp
    >>> A = [[0, 1], [0, 0]]
    >>> bool(rp.linear.observability(A, [[1, 0]])), bool(rp.linear.observability(A, [[0, 1]]))
    (True, False)
    """
    return _test("observability", system, C, states, dt, tolerance)


def is_stabilizable(
    system: control.StateSpace | ArrayLike,
    B: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> Feasibility:
    """Say whether inputs can stabilise the system; if not, which modes forbid it.

    Parameters
    ----------
    system, B, states, dt, tolerance
        As for :func:`controllability`.

    Returns
    -------
    Feasibility
        True in a condition if every mode that is not strictly stable can be moved.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.linear.is_stabilizable([[1, 0], [0, -2]], [[0], [1]], states=["drift", "v"]).reason
    'not stabilisable: no input moves 1 (state drift)'
    """
    return _feasible(controllability(system, B, states=states, dt=dt, tolerance=tolerance))


def is_detectable(
    system: control.StateSpace | ArrayLike,
    C: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> Feasibility:
    """Say whether outputs show every mode that is not stable; if not, which they miss.

    Parameters
    ----------
    system, C, states, dt, tolerance
        As for :func:`observability`.

    Returns
    -------
    Feasibility
        True in a condition if every mode that is not strictly stable is seen.

    Examples
    --------
    >>> import robustpolish as rp
    >>> bool(rp.linear.is_detectable([[-1, 0], [0, 2]], [[0, 1]]))
    True
    """
    return _feasible(observability(system, C, states=states, dt=dt, tolerance=tolerance))


def _feasible(test: PbhTest) -> Feasibility:
    inputs = test.kind == "controllability"
    word, lack = ("stabilisable", "no input moves") if inputs else ("detectable", "no output sees")
    if not test.harmful:
        return Feasibility(True, (), word, test)
    listed = ", ".join(f"{pair_text(m.eigenvalue)} (state {m.state})" for m in test.harmful)
    return Feasibility(False, test.harmful, f"not {word}: {lack} {listed}", test)


def _test(kind: Kind, system, signals, states, dt, tolerance) -> PbhTest:
    inputs = kind == "controllability"
    other = "B" if inputs else "C"
    if signals is None or isinstance(system, control.LTI):
        if signals is not None:
            text = f"a matrix beside a system, which has its own {other}"
            raise invalid(other, described(text), "None", "Pass either a system or two matrices.")
        given = realisation("system", system)
        A, signals, discrete = given.A, given.B if inputs else given.C, given.discrete
        names = list(given.source.state_labels)
    else:
        A = square("A", system)
        n, discrete = len(A), bool(dt)
        names = [f"x[{i}]" for i in range(n)] if states is None else list(states)
        if len(names) != n:
            raise invalid("states", names, f"{n} names", "Give one name per state.")
        signals = matrix(other, signals, (n, None) if inputs else (None, n))
    if tolerance is not None:
        tolerance = positive("tolerance", tolerance, zero=True)
    A, B = (A, signals) if inputs else (A.T, signals.T)
    none = np.zeros((0, len(A))), np.zeros((0, B.shape[1]))
    found = _mode_tests(Realisation(A, B, *none, discrete), names, tolerance)
    return PbhTest(kind, tuple(sorted(found, key=lambda mode: mode.distance)))
