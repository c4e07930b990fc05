"""What is minimised, under which requirements, over which free numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import Vector
from robustpolish.synthesis.nonsmooth.parametrisations import Parametrisation


@dataclass(frozen=True, eq=False)
class ActivePiece:
    """One smooth piece of a measure: its value and its gradient over K.

    Attributes
    ----------
    value : float
    gradient : ndarray, shape of K
    frequency : float or None
        Where the piece is active, for a norm: rad/s, or rad per sample.
    """

    value: float
    gradient: Matrix
    frequency: float | None = None


class Measure(Protocol):
    """A function of K as the maximum of smooth pieces; no pieces means infinite."""

    @property
    def work(self) -> float:
        """Work of one evaluation: 1 for the H-infinity norm of a small loop."""
        ...

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the pieces within `width` (relative) of the largest, the largest first."""
        ...


@dataclass(frozen=True, eq=False)
class Requirement:
    """measure(K) <= bound as a function that has to be at most 0.

    With r = measure / bound that function is r - 1 up to the bound and log(r) beyond, which is
    smooth, finite at 0 and grows slowly where a start is far off.

    Attributes
    ----------
    measure : Measure
    bound : float or None
        Positive bound of a positive measure; None for a measure that has to be negative.
    """

    measure: Measure
    bound: float | None

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the pieces of the scaled function, which has to be at most 0."""
        found = self.measure.pieces(K, width, frequencies)
        if self.bound is None:
            return found
        return [_bounded(piece, self.bound) for piece in found]


def _bounded(piece: ActivePiece, bound: float) -> ActivePiece:
    ratio = piece.value / bound
    value, slope = (ratio - 1, 1.0) if ratio <= 1 else (float(np.log(ratio)), 1 / ratio)
    return ActivePiece(value, piece.gradient * (slope / bound), piece.frequency)


def _logarithm(piece: ActivePiece) -> ActivePiece:
    if piece.value <= np.finfo(float).tiny * max(1.0, np.abs(piece.gradient).max(initial=0.0)):
        return ActivePiece(float(np.log(np.finfo(float).tiny)), 0 * piece.gradient, piece.frequency)
    return ActivePiece(float(np.log(piece.value)), piece.gradient / piece.value, piece.frequency)


@dataclass(frozen=True, eq=False)
class Model:
    """Values and gradients over the free numbers at one point.

    Attributes
    ----------
    values, slopes : ndarray, shapes (m,), (m, n)
        Pieces of the objective's logarithm; the largest is the objective.
    frequencies : tuple of float or None
    excess, excess_slopes : ndarray, shapes (p,), (p, n)
        Pieces of the requirements; all have to be at most 0.
    """

    values: Vector
    slopes: Matrix
    frequencies: tuple[float | None, ...]
    excess: Vector
    excess_slopes: Matrix

    @property
    def objective(self) -> float:
        """Logarithm of the objective."""
        return float(self.values.max())

    @property
    def violation(self) -> float:
        """How far the worst requirement is missed; 0 if none is."""
        return float(max(0.0, self.excess.max(initial=0.0)))


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise the logarithm of a measure of K(theta) under requirements.

    The logarithm makes every tolerance relative and leaves the minimiser where it is.

    Attributes
    ----------
    parametrisation : Parametrisation
    objective : Measure
    requirements : tuple of Requirement
    ceiling : float
        Gains with a larger entry count as infinitely bad: what they would promise
        could not be verified in double precision.
    """

    parametrisation: Parametrisation
    objective: Measure
    requirements: tuple[Requirement, ...] = ()
    ceiling: float = np.inf

    @cached_property
    def work(self) -> float:
        """Work of one evaluation."""
        return self.objective.work + sum(r.measure.work for r in self.requirements)

    def model(
        self, theta: Vector, width: float = 0.0, frequencies: Sequence[float] = ()
    ) -> Model | None:
        """Evaluate all pieces at `theta`; None where the objective is infinite."""
        K = self.parametrisation.gain(theta)
        if not np.abs(K).max(initial=0.0) <= self.ceiling:
            return None
        found = [_logarithm(p) for p in self.objective.pieces(K, width, frequencies)]
        if not found:
            return None
        excess: list[ActivePiece] = []
        for requirement in self.requirements:
            pieces = requirement.pieces(K, width, frequencies)
            if not pieces:
                return None
            excess.extend(pieces)
        back = self.parametrisation.back
        n = len(theta)
        return Model(
            np.array([p.value for p in found]),
            np.array([back(theta, p.gradient) for p in found]).reshape(len(found), n),
            tuple(p.frequency for p in found),
            np.array([p.value for p in excess]),
            np.array([back(theta, p.gradient) for p in excess]).reshape(len(excess), n),
        )

    def penalised(self, theta: Vector, weight: float) -> tuple[float, Vector]:
        """Objective plus `weight` times the worst violation, with one subgradient."""
        model = self.model(theta)
        if model is None:
            return np.inf, np.zeros_like(theta)
        best = int(np.argmax(model.values))
        value, slope = float(model.values[best]), model.slopes[best]
        if model.violation > 0:
            worst = int(np.argmax(model.excess))
            value += weight * model.violation
            slope = slope + weight * model.excess_slopes[worst]
        return value, slope
