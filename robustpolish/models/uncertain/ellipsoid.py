"""`uncertain_ellipsoid`: several real numbers that are known together, as a fit knows them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from robustpolish.arrays import Matrix
from robustpolish.display import Card, Displayed, Table
from robustpolish.models.uncertain.elements import (
    Block,
    Directions,
    RealElement,
    checked_name,
    real_number,
)
from robustpolish.models.uncertain.groups import numbers_at, point_of
from robustpolish.models.uncertain.lft import Lft
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.validation import described, invalid, matrix

# Eigenvalue of a matrix of correlations below which a combination of numbers is certain.
_CERTAIN = 1e-12
# Relative size of an entry of L that is nothing but rounding, and would cost a copy of a direction.
_ROUNDING = 1e-14


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
    >>> fit = rp.uncertain_ellipsoid({"k": 10.0, "c": 1.0}, covariance=[[1.0, 0.09], [0.09, 0.01]])
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
    def elements(self) -> tuple[RealElement, ...]:
        """Its directions as uncertain numbers between -1 and 1."""
        own = self._directions
        return tuple(RealElement(name, 0.0, -1.0, 1.0, self.name, own) for name in own.names)

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
        return numbers_at(self._directions, values)

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
            if name not in self.centre:
                expected = f"names among {', '.join(self.centre)}"
                raise invalid("values", name, expected, "Check its spelling.")
        return point_of(self._directions, values)

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
    def _directions(self) -> Directions:
        names = tuple(f"{self.name}[{i}]" for i in range(self.L.shape[1]))
        slopes = tuple(tuple(row) for row in self.L.tolist())
        return Directions(names, tuple(self.centre), tuple(self.centre.values()), slopes)

    def __getitem__(self, name: str) -> UncertainSystem:
        row = self.L[list(self.centre).index(name)] if name in self.centre else None
        if row is None:
            raise KeyError(name)
        used, elements = np.flatnonzero(row), self.elements
        return UncertainSystem(
            Lft(
                np.zeros((used.size, used.size)),
                np.ones((used.size, 1)),
                row[None, used],
                np.full((1, 1), self.centre[name]),
                (),
                tuple(Block(elements[i], 1) for i in used),
            )
        )

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
    >>> fit = rp.uncertain_ellipsoid({"k": 10.0, "c": 1.0}, covariance=[[1.0, 0.09], [0.09, 0.01]])
    >>> k, c = fit["k"], fit["c"]
    >>> mass = rp.uncertain_system([[0, 1], [-k, -c]], [[0], [1]], [[1, 0]])
    >>> mass.at({"k": 11.0, "c": 1.1}).A[1].round(6)
    array([-11. ,  -1.1])
    >>> [min(machine.A[1].round(2).tolist()) for machine in mass.sample(3, seed=0)]
    [-10.34, -10.45, -11.46]
    """
    if not isinstance(centre, Mapping) or not centre:
        remedy = 'Write {"k": 10.0, "c": 1.0}.'
        raise invalid("centre", centre, "a mapping of names to numbers", remedy)
    values = {checked_name(key): real_number(key, value) for key, value in centre.items()}
    if (shape is None) == (covariance is None):
        shown = described("both" if shape is not None else "neither of them")
        raise invalid("shape", shown, "shape or covariance", "Say how far the numbers may be off.")
    checked_name(name)
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
    kept = sizes > _CERTAIN
    root = axes[:, kept] * np.sqrt(sizes[kept])
    upper = np.linalg.qr(root.T)[1]
    upper *= np.where(np.diagonal(upper) < 0, -1.0, 1.0)[:, None]
    radius = np.sqrt(chdtri(int(kept.sum()), 1 - confidence)) if kept.any() else 0.0
    lower = upper.T
    sizes = np.linalg.norm(lower, axis=1, keepdims=True)
    lower = np.where(np.abs(lower) <= _ROUNDING * sizes, 0.0, lower)
    return radius * units[:, None] * lower
