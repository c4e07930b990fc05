"""What any export writes of a controller: matrices, names, units, limits, and words about it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np

from robustpolish.arrays import Matrix, Vector
from robustpolish.validation import invalid


@dataclass(frozen=True, eq=False)
class CodeSpec:
    """A controller as other programs see it.

    Attributes
    ----------
    controller : control.StateSpace
        Discrete; u[k] = K y[k].
    period, delay : float
        In s.
    units : mapping of str to str
        Of the signals that have one.
    limits : (ndarray, ndarray) or None
        Lowest and highest controls.
    feedback : ndarray, shape (nk, nu)
        L of the anti-windup; zero if there is none.
    about : tuple of str
        Sentences on plant, filter and certificate.
    """

    controller: control.StateSpace
    period: float
    delay: float
    units: Mapping[str, str]
    limits: tuple[Vector, Vector] | None
    feedback: Matrix
    about: tuple[str, ...]

    @property
    def matrices(self) -> dict[str, Matrix]:
        """A, B, C, D and L by name."""
        K = self.controller
        named = {"A": K.A, "B": K.B, "C": K.C, "D": K.D, "L": self.feedback}
        return {name: np.array(M, dtype=float) for name, M in named.items()}

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of y, in order."""
        return tuple(self.controller.input_labels)

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of u, in order."""
        return tuple(self.controller.output_labels)

    def with_unit(self, name: str) -> str:
        """Return a name followed by its unit."""
        unit = self.units.get(name, "")
        return f"{name} [{unit}]" if unit else name


_KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union
    unsigned void volatile while main
    """.split()  # noqa: SIM905 a list of forty words in quotation marks is hard to read
)


def identifier(name: str) -> str:
    """Return a name if it can be one in C and in MATLAB.

    Raises
    ------
    InvalidInputError
        If it cannot.
    """
    fits = isinstance(name, str) and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,47}", name)
    if not fits or name in _KEYWORDS:
        want = "a letter, then letters, digits and underscores, no word of C"
        raise invalid("name", name, want, 'Choose one such as "controller".')
    return name


def target(path: str | os.PathLike[str], name: str, suffix: str) -> Path:
    """Return the file for a path: itself if it ends so, or the file of that name in the folder."""
    place = Path(path)
    return place if place.suffix == suffix else place / f"{name}{suffix}"
