"""The elements of which uncertain systems are made: numbers and dynamics within bounds."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from robustpolish.models.uncertain.elements import (
    Block,
    ComplexElement,
    DynamicElement,
    Element,
    checked_name,
    real_element,
)
from robustpolish.models.uncertain.lft import Lft
from robustpolish.models.uncertain.system import UncertainSystem, as_uncertain
from robustpolish.validation import described, invalid, is_whole, positive

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
    >>> k = rp.uncertain_real("k", 10, percent=40)
    >>> (k * k).at({"k": 14}), (1 / k).nominal, k.elements["k"].low
    (196.0, 0.1, 6.0)
    """
    element = real_element(name, nominal, percent=percent, plus_minus=plus_minus, low_high=range)
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
    >>> gain = rp.uncertain_complex("gain", 1.0, radius=0.2)
    >>> gain.nominal, gain.elements["gain"].radius
    (1.0, 0.2)
    """
    if isinstance(nominal, bool | str) or not np.isrealobj(nominal) or not np.isfinite(nominal):
        raise invalid(
            "nominal", nominal, "a finite real number", "Put the centre on the real axis."
        )
    element = ComplexElement(checked_name(name), float(nominal), positive("radius", radius))
    return _number(element, 0.0, element.radius, element.nominal)


def uncertain_dynamics(
    name: str | int | tuple[int, int],
    shape: int | tuple[int, int] = (1, 1),
    *,
    bound: Any = 1.0,
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
    >>> error = rp.uncertain_dynamics("error", bound=rp.weight(0.1, 100, 3))
    >>> plant = control.ss([[-5.0]], [[1.0]], [[1.0]], 0) * (1 + error)
    >>> plant.shape, plant.nstates, plant.nominal.dcgain().item()
    ((1, 1), 2, 0.2)
    """
    if not isinstance(name, str):
        name, shape = f"dynamics_{next(_unnamed)}", name
    sizes = (shape, shape) if isinstance(shape, int | np.integer) else tuple(shape)
    if len(sizes) != 2 or not all(_is_size(size) for size in sizes):
        raise invalid("shape", shape, "numbers of outputs and inputs", "Write (2, 1).")
    p, q = int(sizes[0]), int(sizes[1])
    element = DynamicElement(checked_name(name), (p, q))
    weight = as_uncertain("bound", bound)
    delta = Lft(
        np.zeros((q, p)), np.eye(q), np.eye(p), np.zeros((p, q)), (), (Block(element, 1),),
        weight.dt or 0,
    )  # fmt: skip
    if weight.shape not in ((1, 1), (p, p)):
        shown = described(f"{weight.shape[0]} x {weight.shape[1]}")
        expected = "1 x 1" if p == 1 else f"1 x 1 or {p} x {p}"
        raise invalid("bound", shown, expected, "Weigh the outputs of the dynamics.")
    if not weight.nstates and not weight.blocks and weight.shape == (1, 1):
        positive("bound", weight.matrices.J[0, 0])
    return weight * UncertainSystem(delta)


def _is_size(size: Any) -> bool:
    return is_whole(size) and size > 0


def _number(element: Element, own: float, out: float, nominal: float) -> UncertainSystem:
    one = np.ones((1, 1))
    return UncertainSystem(Lft(own * one, one, out * one, nominal * one, (), (Block(element, 1),)))
