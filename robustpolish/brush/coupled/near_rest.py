"""The spinning brush at rest on the surface, and what its contact answers to small changes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import optimize

from robustpolish.arrays import Matrix, Vector
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.physical import rim_contact as rim
from robustpolish.brush.physical.run import contact_constants, rim_points, static_depth
from robustpolish.errors import SolverError

# What the contact depends on near rest, in this order.
PLACE, VELOCITY, AXIS, TURNING = slice(0, 3), slice(3, 6), slice(6, 8), slice(8, 10)
VARIABLES = 10

_FINER = 4  # times the rim points of the coarsest pass: derivatives ask for more than forces
_STEP = 0.001  # share of the static depth over which contact is differentiated
_AT_REST = 1e-8  # moment that counts as none, of the polishing force at the rim
_STEEPEST = 0.04  # square of the cosine of the tilt from which the disc counts as tipped over
_LEANS = ((0.0, 0.0), (0.0, -0.2), (0.2, 0.0), (0.0, 0.2), (-0.2, 0.0))  # first guesses of the tilt

# Untyped on purpose: checkers would read all of scipy's solvers for what it returns.
_root: Any = optimize.root
_brentq: Any = optimize.brentq


@dataclass(frozen=True, eq=False)
class BrushAtRest:
    """The disc turning on the spot, its contact carrying the polishing force and no tilting moment.

    Attributes
    ----------
    parameters : BrushParameters
    place : ndarray, shape (3,)
        Of the ball joint [m].
    axis : ndarray, shape (3,)
        Unit axis of the disc.
    across : ndarray, shape (2, 3)
        Unit vectors across the axis, the first nearest to x; they measure small tilts.
    """

    parameters: BrushParameters
    place: Vector
    axis: Vector
    across: Matrix

    @classmethod
    def at(cls, parameters: BrushParameters, place: Vector, axis: Vector) -> BrushAtRest:
        """Return the disc at any place and axis, whether in balance there or not.

        Parameters
        ----------
        parameters : BrushParameters
        place, axis : ndarray, shape (3,)

        Returns
        -------
        BrushAtRest
        """
        return cls(parameters, place, axis, _across(axis))

    @cached_property
    def load(self) -> Vector:
        """Contact force [N] and tilting moments [N m] at rest, shape (5,)."""
        return self.load_at(np.zeros(VARIABLES))

    def load_at(self, change: Vector) -> Vector:
        """Contact force and moments about `across` near rest.

        Parameters
        ----------
        change : ndarray, shape (10,)
            Of the place [m], of its velocity [m/s], of the axis along `across` [rad], and angular
            velocity along `across` [rad/s].

        Returns
        -------
        ndarray, shape (5,)
            In N and N m.
        """
        tilt, turning = change[AXIS], change[TURNING]
        axis = tilt @ self.across + np.sqrt(1.0 - tilt @ tilt) * self.axis
        # The angular velocity has to be across the tilted axis.
        along = -(turning @ tilt) / np.sqrt(1.0 - tilt @ tilt)
        turns = turning @ self.across + along * self.axis
        p = self.parameters
        load = contact_load(p, self.place + change[PLACE], change[VELOCITY], axis, turns)
        moment = load[rim.MOMENT : rim.MOMENT + 3]
        return np.concatenate([load[:3], self.across @ (moment - (moment @ axis) * axis)])

    @cached_property
    def jacobian(self) -> Matrix:
        """Slope of the load over the ten changes, shape (5, 10): central differences to order 4."""
        p = self.parameters
        depth, _ = static_depth(p)
        rate = np.sqrt(p.polishing_force / depth / p.mass)  # of the contact, in 1/s
        sizes = np.repeat([depth, depth * rate, depth / p.radius, depth * rate / p.radius],
                          [3, 3, 2, 2])  # fmt: skip
        columns = np.empty((5, VARIABLES))
        for j, size in enumerate(_STEP * sizes):
            step = size * np.eye(VARIABLES)[j]
            wide = (self.load_at(step) - self.load_at(-step)) / (2.0 * size)
            narrow = (self.load_at(0.5 * step) - self.load_at(-0.5 * step)) / size
            columns[:, j] = (4.0 * narrow - wide) / 3.0
        return columns

    @property
    def stiffness(self) -> float:
        """Largest static stiffness [N/m] of the contact in any direction, tilts held."""
        return float(np.linalg.norm(self.jacobian[:3, PLACE], 2))

    @property
    def damping(self) -> Vector:
        """Damping [N s/m] of the contact along world x, y and z, from damping and friction."""
        return -np.diagonal(self.jacobian[:3, VELOCITY])


def contact_load(
    parameters: BrushParameters, place: Vector, velocity: Vector, axis: Vector, turning: Vector
) -> Vector:
    """Contact load of the spinning disc at one instant.

    Parameters
    ----------
    parameters : BrushParameters
    place, velocity : ndarray, shape (3,)
        Of the ball joint [m, m/s].
    axis, turning : ndarray, shape (3,)
        Unit axis, and angular velocity across it [rad/s].

    Returns
    -------
    ndarray, shape (LOADS,)
        As `rim_load` fills it.
    """
    nodes = rim.rim_nodes(_FINER * rim_points(parameters))
    load, found = np.zeros(rim.LOADS), rim.scratch(nodes.shape[1])
    constants = contact_constants(parameters)
    rim.rim_load(place, velocity, axis, turning, parameters.spin, constants, nodes, found, load)
    return load


def brush_at_rest(parameters: BrushParameters, x: float, y: float) -> BrushAtRest:
    """Find height and tilt at which the spinning disc rests at a place of the path.

    Parameters
    ----------
    parameters : BrushParameters
    x, y : float
        Of the ball joint [m].

    Returns
    -------
    BrushAtRest

    Raises
    ------
    SolverError
        If none is found.
    """
    p = parameters
    slope_x, slope_y = (float(part) for part in p.surface.gradient(x, y))
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    across = _across(normal)

    def leaning(tilt: Vector) -> BrushAtRest:
        axis = tilt @ across + np.sqrt(max(1.0 - tilt @ tilt, _STEEPEST)) * normal
        axis /= np.linalg.norm(axis)
        place = np.array([x, y, _pressed_height(p, x, y, axis)])
        return BrushAtRest.at(p, place, axis)

    def unbalance(tilt: Vector) -> Vector:
        return leaning(tilt).load[3:] / (p.polishing_force * p.radius)

    for guess in _LEANS:
        answer = _root(unbalance, np.array(guess), tol=1e-13)
        found = leaning(answer.x)
        if np.max(np.abs(answer.fun)) < _AT_REST and answer.x @ answer.x < 1.0 - _STEEPEST:
            return found
    raise SolverError(
        f"The spinning disc finds no rest at x = {x:g} m, y = {y:g} m. Lower the friction, or "
        "choose a flatter place."
    )


def _across(axis: Vector) -> Matrix:
    """Two unit vectors across the axis, the first in the plane of the axis and x."""
    first = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    first /= np.linalg.norm(first)
    return np.asarray(np.stack([first, np.cross(axis, first)]), dtype=float)


def _pressed_height(parameters: BrushParameters, x: float, y: float, axis: Vector) -> float:
    """Height at which a disc of that axis carries the polishing force."""
    size = parameters.radius + parameters.height
    ground = float(parameters.surface.height(x, y))
    still = np.zeros(3)

    def excess(height: float) -> float:
        load = contact_load(parameters, np.array([x, y, height]), still, axis, still)
        return load[2] - parameters.polishing_force

    return float(_brentq(excess, ground - size, ground + 4.0 * size, xtol=1e-18))
