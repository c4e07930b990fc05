"""Constructors of uncertain numbers, dynamics, ellipsoids and state-space systems."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from robustpolish.base.arrays import ROUNDING, SUMMED, Matrix
from robustpolish.base.checks import described, invalid, is_whole, matrix, misfit, one_of, positive
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.plants.uncertain import lft as algebra
from robustpolish.plants.uncertain.system import UncertainSystem, as_uncertain

# Interconnections of operands of any kind.


def feedback(forward: Any, back: Any = 1, sign: int = -1) -> UncertainSystem:
    """Return a closed loop with what is uncertain in it kept.

    Parameters
    ----------
    forward, back : UncertainSystem, control.LTI, array_like or float
        From the input to the output, and from there back.
    sign : {-1, 1}, optional
        Negative feedback by default, as in python-control.

    Returns
    -------
    UncertainSystem

    Raises
    ------
    InvalidInputError
        If the sizes do not fit, or the loop is not well posed.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> gain = rp.uncertain.real("gain", 2.0, percent=50)
    >>> loop = rp.feedback(control.ss([[0.0]], [[1.0]], [[1.0]], 0), gain)
    >>> loop.at({"gain": 3.0}).poles().real
    array([-3.])
    """
    return as_uncertain("forward", forward).feedback(back, sign)


def series(first: Any, *others: Any) -> UncertainSystem:
    """Return systems one after the other, the first one first, as python-control's ``series``.

    Parameters
    ----------
    first : UncertainSystem, control.LTI, array_like or float
        What the input enters.
    *others : UncertainSystem, control.LTI, array_like or float
        What comes after.

    Returns
    -------
    UncertainSystem

    Examples
    --------
    >>> import robustpolish as rp
    >>> gain = rp.uncertain.real("gain", 2.0, percent=50)
    >>> rp.uncertain.series([[1.0], [2.0]], [[3.0, 4.0]], gain).nominal
    22.0
    """
    result = as_uncertain("first", first)
    for other in others:
        result = as_uncertain("others", other) * result
    return result


def parallel(first: Any, *others: Any) -> UncertainSystem:
    """Return the sum of systems.

    Parameters
    ----------
    first : UncertainSystem, control.LTI, array_like or float
    *others : UncertainSystem, control.LTI, array_like or float

    Returns
    -------
    UncertainSystem

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.uncertain.parallel(1.0, rp.uncertain.real("b", 2.0, percent=50)).nominal
    3.0
    """
    result = as_uncertain("first", first)
    for other in others:
        result = result + as_uncertain("others", other)
    return result


def append(first: Any, *others: Any) -> UncertainSystem:
    """Return systems side by side, inputs and outputs in their order.

    Parameters
    ----------
    first : UncertainSystem, control.LTI, array_like or float
    *others : UncertainSystem, control.LTI, array_like or float

    Returns
    -------
    UncertainSystem

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.uncertain.append(1.0, rp.uncertain.real("b", 2.0, percent=50)).nominal
    array([[1., 0.],
           [0., 2.]])
    """
    return as_uncertain("first", first).append(*others)


def lft(upper: Any, lower: Any, nu: int = -1, ny: int = -1) -> UncertainSystem:
    """Return a system whose last signals are closed by another one, with positive sign.

    Parameters
    ----------
    upper : UncertainSystem, control.LTI or array_like
        A generalised plant, for example.
    lower : UncertainSystem, control.LTI, array_like or float
        The controller u = K y.
    nu, ny : int, optional
        Number of inputs and outputs of the plant that are joined; all of the other's by default.

    Returns
    -------
    UncertainSystem

    Raises
    ------
    InvalidInputError
        If there are too few signals, or the loop is not well posed.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 2.0, percent=50)
    >>> rp.uncertain.lft([[0.0, 1.0], [1.0, 0.0]], k).nominal
    2.0
    """
    return as_uncertain("upper", upper).lft(lower, nu, ny)


def uncertain_system(
    A: ArrayLike | Sequence[Any] | UncertainSystem,
    B: ArrayLike | Sequence[Any] | UncertainSystem,
    C: ArrayLike | Sequence[Any] | UncertainSystem,
    D: ArrayLike | Sequence[Any] | UncertainSystem = 0.0,
    dt: float | bool = 0,
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> UncertainSystem:
    """Return the state-space system of matrices whose entries may be uncertain.

    Parameters
    ----------
    A, B, C, D : array_like or UncertainSystem
        Matrices with numbers and uncertain numbers as entries; D of 0 is a matrix of zeros.
    dt : float or True, optional
        Sampling time in s; 0 in continuous time.
    states, inputs, outputs : sequence of str, optional
        Names.

    Returns
    -------
    UncertainSystem
        An element that occurs in several entries is repeated no more often than it has to be.

    Raises
    ------
    InvalidInputError
        If the matrices do not fit, or an entry is dynamic.

    Examples
    --------
    >>> import robustpolish as rp
    >>> m = rp.uncertain.real("m", 2.0, percent=10)
    >>> k = rp.uncertain.real("k", 8.0, percent=20)
    >>> plant = rp.uncertain.system([[0, 1], [-k / m, -0.4 / m]], [[0], [1 / m]], [[1, 0]])
    >>> [(name, block.copies) for name, block in zip(plant.elements, plant.blocks)]
    [('m', 1), ('k', 1)]
    """
    given = {"A": A, "B": _column(B), "C": C}
    parts = {name: as_uncertain(name, value) for name, value in given.items()}
    n, (ny, nu) = parts["A"].shape[0], (parts["C"].shape[0], parts["B"].shape[1])
    zero = not isinstance(D, UncertainSystem) and not np.ndim(D) and D == 0
    parts["D"] = as_uncertain("D", np.zeros((ny, nu)) if zero else D)
    wanted = {"A": (n, n), "B": (n, nu), "C": (ny, n), "D": (ny, nu)}
    for name, part in parts.items():
        if part.shape != wanted[name]:
            shown = described(f"shape {part.shape}")
            raise invalid(name, shown, f"shape {wanted[name]}", "Check its rows and columns.")
        if not part.is_static:
            raise misfit(name, "dynamic entries", "numbers", "Join systems with feedback or lft.")
    whole = _table([[parts["A"], parts["B"]], [parts["C"], parts["D"]]])
    names = tuple(states) if states is not None else tuple(f"x[{i}]" for i in range(n))
    if len(names) != n:
        raise invalid("states", states, f"{n} names", "Name each state.")
    for argument, given, count in (("inputs", inputs, nu), ("outputs", outputs, ny)):
        if given is not None and len(given) != count:
            raise invalid(argument, given, f"{count} names", "Name each signal.")
    return with_states(whole, names, dt, tuple(inputs or ()), tuple(outputs or ()))


def with_states(
    whole: UncertainSystem,
    states: tuple[str, ...],
    dt: float | bool = 0,
    inputs: tuple[str, ...] = (),
    outputs: tuple[str, ...] = (),
) -> UncertainSystem:
    """Return the system of an uncertain matrix [A, B; C, D].

    Parameters
    ----------
    whole : UncertainSystem
        Static.
    states : tuple of str
        Names of its first rows and columns.
    dt : float or True, optional
    inputs, outputs : tuple of str, optional
        Names of the others.
    """
    n, m = len(states), whole.matrices
    F = np.block([[m.J[:n, :n], m.H[:n]], [m.G[:, :n], m.F]])
    G, H = np.vstack([m.J[:n, n:], m.G[:, n:]]), np.hstack([m.J[n:, :n], m.H[n:]])
    system = replace(m, F=F, G=G, H=H, J=m.J[n:, n:], states=states, dt=dt)
    return UncertainSystem(algebra.reduce_copies(system).names(inputs, outputs))


def _column(B: Any) -> Any:
    """Return a list of entries as a column, as python-control reads B."""
    flat = isinstance(B, list | tuple | np.ndarray) and np.ndim(np.array(B, dtype=object)) == 1
    return np.array(B, dtype=object).reshape(-1, 1) if flat else B


def _table(rows: list[list[UncertainSystem]]) -> UncertainSystem:
    """Return blocks as one matrix."""
    heights = [row[0].shape[0] for row in rows]
    widths = [part.shape[1] for part in rows[0]]
    result = as_uncertain("matrix", np.zeros((sum(heights), sum(widths))))
    for i, row in enumerate(rows):
        left = np.eye(sum(heights))[:, sum(heights[:i]) : sum(heights[: i + 1])]
        for j, part in enumerate(row):
            right = np.eye(sum(widths))[sum(widths[:j]) : sum(widths[: j + 1])]
            if 0 not in part.shape:
                result = result + left * part * right
    return result


# `uncertain_ellipsoid`: several real numbers that are known together, as a fit knows them.


@dataclass(frozen=True, eq=False, repr=False)
class Ellipsoid(Displayed, Mapping[str, UncertainSystem]):
    """Numbers p = p0 + L d with ``||d|| <= 1``: a mapping from their names to uncertain numbers.

    Attributes
    ----------
    name : str
        Its directions are called ``name[0]``, ``name[1]``, ...
    centre : mapping of str to float
        The nominal values p0, by name.
    L : ndarray, shape (numbers, directions)
        Change of the numbers per direction.
    confidence : float or None
        That the ellipsoid was made for, if it comes from a covariance.

    Examples
    --------
    >>> import robustpolish as rp
    >>> fit = rp.uncertain.ellipsoid({"k": 10.0, "c": 1.0}, covariance=[[1.0, 0.09], [0.09, 0.01]])
    >>> fit
    Ellipsoid of 2 numbers and 2 directions, with confidence 0.95
      name  centre  range
      k         10  7.552 to 12.45
      c          1  0.7552 to 1.245

    A point of it, by its numbers or by its directions:

    >>> fit.size({"k": 12.0, "c": 1.2}) < 1 < fit.size({"k": 12.0, "c": 0.8})
    True
    >>> fit.directions({"k": 11.0})["ellipsoid[1]"] == 0
    True
    >>> round(fit["c"].at({"k": 11.0}), 3), round(fit.numbers({"ellipsoid[0]": 0.5})["k"], 3)
    (1.09, 11.224)
    """

    name: str
    centre: Mapping[str, float]
    L: Matrix
    confidence: float | None = None

    @property
    def elements(self) -> tuple[algebra.RealElement, ...]:
        """Its directions as uncertain numbers between -1 and 1."""
        own = self._directions
        return tuple(
            algebra.RealElement(name, 0.0, -1.0, 1.0, self.name, own) for name in own.names
        )

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Smallest and largest value of each number: the box around the ellipsoid."""
        sizes = np.linalg.norm(self.L, axis=1)
        return {
            name: (p0 - float(size), p0 + float(size))
            for (name, p0), size in zip(self.centre.items(), sizes, strict=True)
        }

    def numbers(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Return the physical numbers at a point that is told by directions, as witnesses have it.

        Parameters
        ----------
        values : mapping of str to object
            Directions that are not named are 0; other names are passed over.

        Returns
        -------
        dict of str to float
        """
        return algebra.numbers_at(self._directions, values)

    def directions(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the point of some physical numbers, by directions.

        Parameters
        ----------
        values : mapping of str to float
            Also outside the ellipsoid. Numbers that are not named take the values for which the
            point is nearest to the centre: what a fit expects of them.

        Returns
        -------
        dict of str to float

        Raises
        ------
        InvalidInputError
            If a name is unknown, or the numbers are off in a way that the ellipsoid excludes.
        """
        for name in values:
            one_of("values", name, self.centre, "Check its spelling.")
        return algebra.point_of(self._directions, values)

    def size(self, values: Mapping[str, float]) -> float:
        """Return how far out a point of physical numbers is: 1 on the ellipsoid's surface.

        Parameters
        ----------
        values : mapping of str to float
            As :meth:`directions` takes them.

        Returns
        -------
        float
        """
        return float(np.linalg.norm(list(self.directions(values).values())))

    @property
    def _directions(self) -> algebra.Directions:
        names = tuple(f"{self.name}[{i}]" for i in range(self.L.shape[1]))
        slopes = tuple(tuple(row) for row in self.L.tolist())
        return algebra.Directions(names, tuple(self.centre), tuple(self.centre.values()), slopes)

    def __getitem__(self, name: str) -> UncertainSystem:
        row = self.L[list(self.centre).index(name)] if name in self.centre else None
        if row is None:
            raise KeyError(name)
        used, elements = np.flatnonzero(row), self.elements
        F, G = np.zeros((used.size, used.size)), np.ones((used.size, 1))
        blocks = tuple(algebra.UncertainBlock(elements[i], 1) for i in used)
        centre = np.full((1, 1), self.centre[name])
        return UncertainSystem(algebra.Lft(F, G, row[None, used], centre, (), blocks))

    def __iter__(self) -> Iterator[str]:
        return iter(self.centre)

    def __len__(self) -> int:
        return len(self.centre)

    def _card(self) -> Card:
        rows = tuple(
            (name, self.centre[name], f"{low:.4g} to {high:.4g}")
            for name, (low, high) in self.ranges.items()
        )
        numbers, directions = self.L.shape
        sure = "" if self.confidence is None else f", with confidence {self.confidence:g}"
        title = f"Ellipsoid of {numbers} numbers and {directions} directions{sure}"
        return Card(title, (Table("", ("name", "centre", "range"), rows),))


def uncertain_ellipsoid(
    centre: Mapping[str, float],
    shape: ArrayLike | None = None,
    *,
    covariance: ArrayLike | None = None,
    confidence: float = 0.95,
    name: str = "ellipsoid",
) -> Ellipsoid:
    """Return real numbers that are known together, within an ellipsoid.

    Parameters
    ----------
    centre : mapping of str to float
        Nominal values of the numbers, by name.
    shape : array_like, shape (numbers, directions), optional
        L of ``p = p0 + L d``, ``||d|| <= 1``, in the numbers' own units.
    covariance : array_like, shape (numbers, numbers), optional
        Of the errors of the numbers, in place of a shape. It may be singular: then some
        combinations are certain.
    confidence : float, optional
        With a covariance: the probability that a normally distributed point lies inside.
    name : str, optional
        Of the ellipsoid: different ones need different names.

    Returns
    -------
    Ellipsoid
        A mapping: each value is an uncertain number for formulas, matrices and systems. These
        depend on the directions d alone; :meth:`UncertainSystem.numbers` tells a witness in the
        numbers' own units, and :meth:`UncertainSystem.at` takes either.

    Raises
    ------
    InvalidInputError
        If not one of shape and covariance is given, or it does not fit the numbers.

    Notes
    -----
    With a covariance P, ``L L' = q P`` where q is the quantile of the chi-square distribution with
    as many degrees of freedom as P has rank. L is triangular, so that later directions move few
    numbers and occur seldom in what is made of them.

    Examples
    --------
    A spring and a damper of which a fit knows the ratio better than either:

    >>> import robustpolish as rp
    >>> fit = rp.uncertain.ellipsoid({"k": 10.0, "c": 1.0}, covariance=[[1.0, 0.09], [0.09, 0.01]])
    >>> k, c = fit["k"], fit["c"]
    >>> mass = rp.uncertain.system([[0, 1], [-k, -c]], [[0], [1]], [[1, 0]])
    >>> mass.at({"k": 11.0, "c": 1.1}).A[1].round(6)
    array([-11. ,  -1.1])
    >>> [min(machine.A[1].round(2).tolist()) for machine in mass.sample(3, seed=0)]
    [-10.34, -10.45, -11.46]
    """
    if not isinstance(centre, Mapping) or not centre:
        remedy = 'Write {"k": 10.0, "c": 1.0}.'
        raise invalid("centre", centre, "a mapping of names to numbers", remedy)
    values = {
        algebra.checked_name(key): algebra.real_number(key, value) for key, value in centre.items()
    }
    if (shape is None) == (covariance is None):
        shown = described("both" if shape is not None else "neither of them")
        raise invalid("shape", shown, "shape or covariance", "Say how far the numbers may be off.")
    algebra.checked_name(name)
    n = len(values)
    if covariance is None:
        assert shape is not None  # one of both is
        L = matrix("shape", shape, (n, None))
        return Ellipsoid(name, values, L[:, np.linalg.norm(L, axis=0) > 0])
    if not (isinstance(confidence, int | float) and 0 < confidence < 1):
        raise invalid("confidence", confidence, "a share between 0 and 1", "Write 0.95.")
    return Ellipsoid(name, values, _root(matrix("covariance", covariance, (n, n)), confidence),
                     confidence)  # fmt: skip


def _root(P: Matrix, confidence: float) -> Matrix:
    """Return the triangular L of a covariance, in units of each number's own deviation."""
    spread = np.sqrt(np.maximum(np.diagonal(P), 0.0))
    units = np.where(spread > 0, spread, 1.0)
    correlation = P / units / units[:, None]
    remedy = "Check rows and columns: P[i, j] is the mean product of two errors."
    if np.abs(correlation - correlation.T).max() > 1e-9:
        raise invalid("covariance", described("a matrix that is not symmetric"), "one", remedy)
    sizes, axes = np.linalg.eigh((correlation + correlation.T) / 2)
    if sizes.min() < -1e-9:
        shown = described(f"an eigenvalue of {sizes.min():.3g} of the correlations")
        raise invalid("covariance", shown, "a positive semidefinite matrix", remedy)
    # Eigenvalue of a matrix of correlations below which a combination of numbers is certain.
    kept = sizes > ROUNDING
    root = axes[:, kept] * np.sqrt(sizes[kept])
    upper = np.linalg.qr(root.T)[1]
    upper *= np.where(np.diagonal(upper) < 0, -1.0, 1.0)[:, None]
    radius = np.sqrt(chdtri(int(kept.sum()), 1 - confidence)) if kept.any() else 0.0
    lower = upper.T
    sizes = np.linalg.norm(lower, axis=1, keepdims=True)
    # Relative size of an entry of L that is nothing but rounding, and would cost a copy of a
    # direction.
    lower = np.where(np.abs(lower) <= SUMMED * sizes, 0.0, lower)
    return radius * units[:, None] * lower


_unnamed = itertools.count(1)


def uncertain_real(
    name: str,
    nominal: float,
    *,
    percent: float | tuple[float, float] | None = None,
    plus_minus: float | tuple[float, float] | None = None,
    range: tuple[float, float] | None = None,
) -> UncertainSystem:
    """Return a real number that is known within a range.

    Parameters
    ----------
    name : str
        The same name is the same number wherever it occurs.
    nominal : float
        The value to design with, in any unit.
    percent : float or (float, float), optional
        How far the number may be off, in percent of the nominal value: ``40`` is up to 40 % up or
        down, ``(-20, 50)`` from 20 % less to 50 % more.
    plus_minus : float or (float, float), optional
        The same in the number's own unit.
    range : (float, float), optional
        The smallest and the largest value. Of these three, one has to be given.

    Returns
    -------
    UncertainSystem
        A number, 1 x 1; a margin of 1 stands for the whole range. Where the nominal value is not in
        its middle, margins count towards either end by a fraction that has the ends at 1.

    Raises
    ------
    InvalidInputError
        If the nominal value is not inside the range.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 10, percent=40)
    >>> (k * k).at({"k": 14}), (1 / k).nominal, k.elements["k"].low
    (196.0, 0.1, 6.0)
    """
    element = algebra.real_element(
        name, nominal, percent=percent, plus_minus=plus_minus, low_high=range
    )
    return _number(element, element.skew, element.slope, element.nominal)


def uncertain_complex(name: str, nominal: float = 0.0, *, radius: float = 1.0) -> UncertainSystem:
    """Return a complex number that is known within a disc.

    Parameters
    ----------
    name : str
        The same name is the same number wherever it occurs.
    nominal : float, optional
        Centre of the disc; 0 by default.
    radius : float, optional
        Of the disc; 1 by default.

    Returns
    -------
    UncertainSystem
        A number, 1 x 1. Its phase may be any at any frequency, so that it stands for a dynamic
        error of a known gain, too.

    Raises
    ------
    InvalidInputError
        If the radius is not positive, or the centre not real.

    Examples
    --------
    >>> import robustpolish as rp
    >>> gain = rp.uncertain.complex("gain", 1.0, radius=0.2)
    >>> gain.nominal, gain.elements["gain"].radius
    (1.0, 0.2)
    """
    if isinstance(nominal, bool | str) or not np.isrealobj(nominal) or not np.isfinite(nominal):
        want, remedy = "a finite real number", "Put the centre on the real axis."
        raise invalid("nominal", nominal, want, remedy)
    element = algebra.ComplexElement(
        algebra.checked_name(name), float(nominal), positive("radius", radius)
    )
    return _number(element, 0.0, element.radius, element.nominal)


def uncertain_dynamics(
    name: str | int | tuple[int, int], shape: int | tuple[int, int] = (1, 1), *, bound: Any = 1.0
) -> UncertainSystem:
    """Return dynamics of which only a bound on the gain is known.

    Parameters
    ----------
    name : str
        The same name is the same system wherever it occurs. If the shape is given in its place, a
        name of its own is made up.
    shape : int or (int, int), optional
        Outputs and inputs; a number stands for as many of both.
    bound : float, control.LTI or array_like, optional
        Largest gain: a number, or a weight W over frequency such as :func:`weight` makes one. The
        result is W Delta with Delta any stable system of gain at most 1. A weight has one input
        and output, or as many of both as there are outputs.

    Returns
    -------
    UncertainSystem
        With `shape`; in :meth:`UncertainSystem.at` and in witnesses the value is Delta alone.

    Raises
    ------
    InvalidInputError
        If the bound has other sizes.

    Examples
    --------
    A motor whose gain is off by 10 % at rest, and by anything above 100 Hz:

    >>> import control
    >>> import robustpolish as rp
    >>> error = rp.uncertain.dynamics("error", bound=rp.weight(0.1, 100, 3))
    >>> plant = control.ss([[-5.0]], [[1.0]], [[1.0]], 0) * (1 + error)
    >>> plant.shape, plant.nstates, plant.nominal.dcgain().item()
    ((1, 1), 2, 0.2)
    """
    if not isinstance(name, str):
        name, shape = f"dynamics_{next(_unnamed)}", name
    sizes = (shape, shape) if isinstance(shape, int | np.integer) else tuple(shape)
    if len(sizes) != 2 or not all(is_whole(size) and size > 0 for size in sizes):
        raise invalid("shape", shape, "numbers of outputs and inputs", "Write (2, 1).")
    p, q = int(sizes[0]), int(sizes[1])
    element = algebra.DynamicElement(algebra.checked_name(name), (p, q))
    weight = as_uncertain("bound", bound)
    one = (np.zeros((q, p)), np.eye(q), np.eye(p), np.zeros((p, q)))
    delta = algebra.Lft(*one, (), (algebra.UncertainBlock(element, 1),), weight.dt or 0)
    if weight.shape not in ((1, 1), (p, p)):
        shown = described(f"{weight.shape[0]} x {weight.shape[1]}")
        expected = "1 x 1" if p == 1 else f"1 x 1 or {p} x {p}"
        raise invalid("bound", shown, expected, "Weigh the outputs of the dynamics.")
    if not weight.nstates and not weight.blocks and weight.shape == (1, 1):
        positive("bound", weight.matrices.J[0, 0])
    return weight * UncertainSystem(delta)


def _number(element: algebra.Element, own: float, out: float, nominal: float) -> UncertainSystem:
    F, G, H, J = (np.full((1, 1), value) for value in (own, 1.0, out, nominal))
    return UncertainSystem(algebra.Lft(F, G, H, J, (), (algebra.UncertainBlock(element, 1),)))
