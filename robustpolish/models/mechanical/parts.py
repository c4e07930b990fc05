"""The parts of a mechanical model, each checked when it is made.

Every message names the part the way the file names it: ``dof.x.mass``,
``spring[0].between`` (the first spring), ``input.F_x.force_on``. The key of the error is the same
as a tuple: ``("dof", "x", "mass")``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.effects import GROUND
from robustpolish.validation import Key, described, invalid, positive

DISPLACEMENT = "displacement"
VELOCITY = "velocity"
ACCELERATION = "acceleration"
FORCE = "force"

# What a file may say, and what it means. The second names are those of rotation.
QUANTITIES = {
    "displacement": DISPLACEMENT,
    "velocity": VELOCITY,
    "acceleration": ACCELERATION,
    "force": FORCE,
    "angle": DISPLACEMENT,
    "angular_velocity": VELOCITY,
    "angular_acceleration": ACCELERATION,
    "torque": FORCE,
}
ROTATIONAL_ONLY = frozenset({"angle", "angular_velocity", "angular_acceleration", "torque"})

_HUGE = 1e100

UNITS = {
    False: {DISPLACEMENT: "m", VELOCITY: "m/s", ACCELERATION: "m/s^2", FORCE: "N"},
    True: {DISPLACEMENT: "rad", VELOCITY: "rad/s", ACCELERATION: "rad/s^2", FORCE: "N m"},
}


@dataclass(frozen=True)
class Dof:
    """A degree of freedom: a mass that moves along one coordinate, or turns about one axis.

    Parameters
    ----------
    name : str
        Name of the coordinate; not ``"ground"``.
    mass : float
        Mass in kg, or moment of inertia in kg m^2 if `rotational`; positive. Zero
        only where an input imposes the motion.
    rotational : bool, optional
        Whether the coordinate is an angle in rad.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.Dof("phi", 0.02, rotational=True).unit
    'kg m^2'
    """

    name: str
    mass: float
    rotational: bool = False

    def __post_init__(self) -> None:
        name = text("dof", self.name)
        if name == GROUND:
            raise invalid(
                ("dof", name), name, "a name other than 'ground'", "Rename the coordinate."
            )
        mass = positive(self.key, number(self.key, self.mass), self.unit, True)
        object.__setattr__(self, "mass", mass)

    @property
    def key(self) -> tuple[str, str, str]:
        """Where its mass or moment of inertia stands in a model."""
        return ("dof", self.name, "inertia" if self.rotational else "mass")

    @property
    def unit(self) -> str:
        """Unit of the mass or moment of inertia."""
        return "kg m^2" if self.rotational else "kg"


@dataclass(frozen=True)
class Spring:
    """A linear spring; it pulls with ``stiffness * (q[between[0]] - q[between[1]])``.

    Parameters
    ----------
    between : (str, str)
        Two coordinates, or one and ``"ground"``.
    stiffness : float
        In N/m, or N m/rad. Zero and negative values are allowed: a refit may
        start at zero, and a magnet is a negative spring.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.Spring(("x", "ground"), 8e4).stiffness
    80000.0
    """

    between: tuple[str, str]
    stiffness: float


@dataclass(frozen=True)
class Damper:
    """A linear damper; it pulls with ``damping * (v[between[0]] - v[between[1]])``.

    Parameters
    ----------
    between : (str, str)
        Two coordinates, or one and ``"ground"``.
    damping : float
        In N s/m, or N m s/rad. Negative values stand for self-excitation.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.Damper(("x", "ground"), 12.0).damping
    12.0
    """

    between: tuple[str, str]
    damping: float


@dataclass(frozen=True)
class CoupledInertia:
    """An inertia that ties the accelerations of two coordinates: a mass matrix off its diagonal.

    Each of the two coordinates is pushed back with ``value`` times the other's acceleration. Of a
    double pendulum in absolute angles that is the lower mass times both lengths; of a pendulum on
    a cart, in kg m, its mass times the distance of its centre.

    Parameters
    ----------
    between : (str, str)
        Two coordinates; one may be a displacement and the other an angle.
    value : float
        In kg between two displacements, kg m^2 between two angles, kg m between one of each; any
        sign, as long as every motion has a positive kinetic energy.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.CoupledInertia(("theta_1", "theta_2"), 0.12).value
    0.12
    """

    between: tuple[str, str]
    value: float


@dataclass(frozen=True)
class Input:
    """A measured signal that drives the model: a force, or an imposed motion.

    Parameters
    ----------
    name : str
        The data column.
    on : (str, str)
        Where a force or torque acts: positive along the first coordinate, and in
        reaction on the second, which is mostly ``"ground"``. For an imposed motion
        the coordinate that is moved, and ``"ground"``.
    imposes : str or None, optional
        None for a force; ``"displacement"``, ``"velocity"`` or ``"acceleration"`` for a
        motion. Velocity and acceleration accompany an imposed displacement and
        spare its differentiation.
    gain : float, optional
        Factor from the column to the force or motion.
    unit : str, optional
        Unit of the column if `gain` converts, such as ``"V"``.

    Examples
    --------
    >>> import robustpolish as rp
    >>> motor = rp.Input("current", ("x", "ground"), gain=35.0, unit="A")  # 35 N/A
    >>> table = rp.Input("table", ("base", "ground"), imposes="displacement")
    >>> motor.gain, table.imposes
    (35.0, 'displacement')
    """

    name: str
    on: tuple[str, str]
    imposes: str | None = None
    gain: float = 1.0
    unit: str | None = None

    def __post_init__(self) -> None:
        name = text("input", self.name)
        argument = ("input", name, "gain")
        gain = number(argument, self.gain)
        if gain == 0:
            raise invalid(argument, self.gain, "a number other than 0", "Leave the input out.")
        object.__setattr__(self, "gain", gain)
        unit_text(("input", name, "unit"), self.unit)


@dataclass(frozen=True)
class Output:
    """A measured signal that the model predicts: a motion, or a force.

    Parameters
    ----------
    name : str
        The data column.
    of : tuple of str
        For a motion the coordinate that is measured, and the one that it is measured
        against (``"ground"`` for the absolute motion); with `weights` any number of coordinates.
        For a force the two ends of the
        connection whose force is measured, positive when the connection pulls the
        first end towards negative coordinates, as a stretched spring to ground does.
    quantity : str, optional
        ``"displacement"`` (default), ``"velocity"``, ``"acceleration"`` or ``"force"``.
    drive : bool, optional
        Only with ``"force"``: the output is the whole force that imposes the motion of
        ``of[0]``, its inertia and all its connections included.
    unit : str, optional
        Unit of the column where the coordinate is measured in another one, such as ``"V"``.
    weights : tuple of float, optional
        What each coordinate of `of` counts for, where a sensor sees a sum of them: a beam's
        sensor sees its modes by their shapes, one at the end of a lever its shift and its turn.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.Output("a_tool", ("tool", "ground"), quantity="acceleration").of
    ('tool', 'ground')
    >>> tip = rp.Output("tip", ("q1", "q2"), weights=(0.8, -0.3))
    >>> tip.weights
    (0.8, -0.3)
    """

    name: str
    of: tuple[str, ...]
    quantity: str = DISPLACEMENT
    drive: bool = False
    unit: str | None = None
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        name = text("output", self.name)
        unit_text(("output", name, "unit"), self.unit)


def imposed_by(inputs: Iterable[Input]) -> frozenset[str]:
    """Return the names of the coordinates whose motion inputs impose."""
    return frozenset(item.on[0] for item in inputs if item.imposes)


def text(argument: str | Key, value: Any) -> str:
    """Return `value` if it is a name: a string that is not blank."""
    if not isinstance(value, str) or not value.strip():
        raise invalid(argument, value, "a name", "Write it as text between quotation marks.")
    if "." in value:
        # python-control reads a dot as a separator of system and signal.
        raise invalid(argument, value, "a name without a dot", "Rename it, also in the data.")
    return value


def unit_text(argument: Key, value: Any) -> None:
    """Refuse a unit that is neither None nor text."""
    if value is not None and (not isinstance(value, str) or not value.strip()):
        raise invalid(argument, value, "a unit", "Write it as text, such as 'V'.")


def number(argument: str | Key, value: Any) -> float:
    """Return `value` as a float; text and true/false are no numbers.

    Sizes beyond any machine are refused, because products of them overflow.
    """
    real = isinstance(value, int | float | np.integer | np.floating)
    if not real or isinstance(value, bool):
        raise invalid(argument, value, "a finite number", "Write a number without quotation marks.")
    if not (value == 0 or 1 / _HUGE < abs(value) < _HUGE):
        want = f"a finite number of a size between {1 / _HUGE:g} and {_HUGE:g}"
        raise invalid(argument, value, want, "Check the value and its unit.")
    return float(value)


def places(argument: Key, value: Any) -> tuple[str, ...]:
    """Return one place or a list of places as a tuple of one or two different names."""
    if isinstance(value, str):
        value = (value,)
    if not isinstance(value, Sequence) or not 1 <= len(value) <= 2:
        raise invalid(argument, value, "one name or a pair of names", "Write ['x', 'ground'].")
    names = tuple(text(argument, item) for item in value)
    if len(set(names)) != len(names):
        raise invalid(argument, described(f"{names[0]!r} twice"), "two ends", "Name the other end.")
    return names


def mass_matrix(dofs: Sequence[Dof], coupled_inertias: Sequence[CoupledInertia]) -> Matrix:
    """Return the mass matrix over all coordinates."""
    names = [dof.name for dof in dofs]
    M = np.diag([dof.mass for dof in dofs])
    for coupled in coupled_inertias:
        i, j = (names.index(end) for end in coupled.between)
        M[i, j] += coupled.value
        M[j, i] += coupled.value
    return M


NO_ENERGY = 1e-9
"""Energy of a motion, as a share of what it would have without couplings, that is none."""


def least_energy(M: Matrix) -> float:
    """Return the least energy of any motion, as a share of what it would have without couplings."""
    size = np.sqrt(np.diag(M))
    if not size.size or np.count_nonzero(M) == size.size:
        return 1.0
    return float(np.linalg.eigvalsh(M / np.outer(size, size))[0])
