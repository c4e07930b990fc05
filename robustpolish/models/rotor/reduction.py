"""Bases of few motions that describe a rotor as its ports see it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from scipy.linalg import null_space

from robustpolish.arrays import Matrix
from robustpolish.models.rotor.second_order import SecondOrder
from robustpolish.models.rotor.whirl import eigen_whirl
from robustpolish.validation import described, invalid

Method = Literal["modal", "static", "craig_bampton"]
METHODS: tuple[Method, ...] = ("modal", "static", "craig_bampton")
_NEW = 1e-9
"""A deflection that adds less than this to the motions before it, as a share, is left out."""
_SAME_SHAPE = 1e-6
"""The same of modes: the two halves of a round orbit are one shape, up to rounding."""


def reduction_basis(
    system: SecondOrder, ports: Matrix, modes: int, method: Method, speed: float
) -> tuple[Matrix, ...]:
    """Return a basis for each plane, shape (coordinates, kept).

    Parameters
    ----------
    system : SecondOrder
    ports : ndarray, shape (ports, coordinates)
        Rows of the displacements at which forces act and motion is seen.
    modes : int
        How many dynamic shapes of each of x and y to keep.
    method : {"modal", "static", "craig_bampton"}
        The lowest modes alone; with the deflections under a force at each port, which makes
        the static gain exact; or these with the lowest modes of the rotor held at its ports.
    speed : float
        At which the modes are taken, in rad/s: gyroscopic moments bend forward whirl otherwise
        than backward, so that a rotor that spins needs twice as many shapes.

    Returns
    -------
    tuple of ndarray

    Raises
    ------
    InvalidInputError
        If deflections are asked for where nothing holds the rotor.

    References
    ----------
    Craig and Bampton (1968), Coupling of substructures for dynamic analyses, AIAA Journal 6,
    1313-1319; Rubin (1975), AIAA Journal 13, 995-1006, for modes with static deflections.
    """
    each = modes * 2 // len(system.planes)
    bases: list[Matrix] = []
    whirling = _whirl_shapes(system, 2 * modes, speed) if speed else np.zeros((len(system.mass), 0))
    for part in system.parts:
        own = ports[:, part][np.abs(ports[:, part]).max(axis=1) > 0]
        size = part.stop - part.start
        plane = system.projected(np.eye(len(system.mass))[:, part])
        if method == "craig_bampton":
            held = null_space(own) if len(own) else np.eye(size)
            dynamic = held @ plane.projected(held).normal_modes[1][:, :each]
        elif speed:
            dynamic = whirling[part]
        else:
            dynamic = plane.normal_modes[1][:, :each]
        static = np.zeros((size, 0)) if method == "modal" else _deflections(plane, own)
        kept = _independent(plane.mass, dynamic, np.zeros((size, 0)), _SAME_SHAPE)
        bases.append(_independent(plane.mass, static, kept, _NEW))
    return tuple(bases)


def _whirl_shapes(system: SecondOrder, count: int, speed: float) -> Matrix:
    """Return the motions, in and out of phase, of the lowest undamped whirl modes at a speed."""
    none, K = np.zeros_like(system.mass), (system.stiffness + system.stiffness.T) / 2
    undamped = replace(system, damping=none, circulatory=none, stiffness=K)
    vectors = eigen_whirl(undamped, speed)[1][: len(system.state_scale), :count]
    motions = (system.normal_modes[1] / system.state_scale) @ vectors
    return np.hstack([motions.real, motions.imag])


def _deflections(plane: SecondOrder, ports: Matrix) -> Matrix:
    if plane.normal_modes[0].min(initial=np.inf) == 0:
        raise invalid(
            "method",
            described("deflections under steady forces"),
            "'modal' for a rotor that nothing holds",
            "Add a bearing, or write method='modal'.",
        )
    found: Any = np.linalg.solve(plane.stiffness, ports.T)
    return found


def _independent(mass: Matrix, motions: Matrix, before: Matrix, least: float) -> Matrix:
    """Return `before` and the motions, made orthogonal and of unit mass (Gram and Schmidt)."""
    kept = list(before.T)
    sizes = np.sqrt(np.einsum("ij,ij->j", motions, mass @ motions))
    for motion, size in zip(motions.T, sizes, strict=True):
        if size <= least * sizes.max():
            continue
        own = motion / size
        for _ in range(2):  # the second time takes out what rounding left
            for other in kept:
                own = own - other * (other @ mass @ own)
        left = np.sqrt(own @ mass @ own)
        if left > least:
            kept.append(own / left)
    return np.column_stack(kept)
