"""The parts of a mechanical model, each checked when it is made.

Every message names the part the way the file names it: ``dof.x.mass``,
``spring[0].between`` (the first spring), ``input.F_x.force_on``. The key of the error is the same
as a tuple: ``("dof", "x", "mass")``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import Key, described, instance_of, invalid, one_of, positive
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import GROUND
from robustpolish.plants.blocks import named_system

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
            remedy = "Rename the coordinate."
            raise invalid(("dof", name), name, "a name other than 'ground'", remedy)
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


CONNECTIONS: dict[str, tuple[type, str]] = {
    "coupled_inertia": (CoupledInertia, "value"),
    "spring": (Spring, "stiffness"),
    "damper": (Damper, "damping"),
}
"""What lies between two coordinates, by its name in keys and files: its class and its number. The
fields of a model have these names in the plural."""


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


# Checks that concern the parts of a mechanical model together, not one part alone.

_KINDS: Mapping[str, type] = {
    "dofs": Dof,
    "springs": Spring,
    "dampers": Damper,
    "inputs": Input,
    "outputs": Output,
    "effects": Effect,
    "coupled_inertias": CoupledInertia,
}


def checked_fields(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a model, checked against each other, lists turned into tuples.

    Parameters
    ----------
    given : mapping
        The fields of `MechanicalData` by name.

    Returns
    -------
    dict

    Raises
    ------
    InvalidInputError
        See `MechanicalData`; its key says where.
    """
    found = {name: _tuple_of(name, given[name], kind) for name, kind in _KINDS.items()}
    dofs = {dof.name: dof for dof in found["dofs"]}
    _check_names(found["dofs"], found["inputs"], found["outputs"])
    spin = given["spin_frequency"]
    if spin is not None:
        spin = positive("spin_frequency", number("spin_frequency", spin), "Hz")
    if not isinstance(given["name"], str):
        raise invalid("name", given["name"], "text", "Write it between quotation marks.")
    found["springs"] = _connections("spring", "stiffness", found["springs"], dofs)
    found["dampers"] = _connections("damper", "damping", found["dampers"], dofs)
    found["inputs"] = tuple(_input(item, dofs) for item in found["inputs"])
    _check_imposed_motions(found["inputs"], dofs)
    moved = imposed_by(found["inputs"])
    found["coupled_inertias"] = _coupled(found["coupled_inertias"], dofs)
    check_inertias(found["dofs"], found["coupled_inertias"], moved)
    found["outputs"] = tuple(_output(item, dofs, moved) for item in found["outputs"])
    signals = {key: [i.name for i in found[f"{key}s"]] for key in ("input", "output")}
    for i, effect in enumerate(found["effects"]):
        _check_place(("effect", i, "at"), effect, dofs, signals, moved)
    design = instance_of("design", given["design"], Mapping, "a mapping", "Write {key: value}.")
    return {**found, "spin_frequency": spin, "name": given["name"], "design": dict(design)}


def _tuple_of(attribute: str, given: Any, kind: type) -> tuple[Any, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise invalid(attribute, given, f"a list of {kind.__name__}", "Put it in a list.")
    items = tuple(given)
    for item in items:
        if not isinstance(item, kind):
            raise invalid(attribute, item, f"a {kind.__name__}", f"Use {kind.__name__}(...).")
    return items


def _check_names(dofs: Sequence[Dof], inputs: Sequence[Input], outputs: Sequence[Output]) -> None:
    if not dofs:
        raise invalid("dof", described("no degree of freedom"), "one or more", "Add [dof.x].")
    if not outputs:
        raise invalid("output", described("no output"), "one or more", "Add an [[output]].")
    ins, outs = [item.name for item in inputs], [item.name for item in outputs]
    for what, names in (
        ("dof", [dof.name for dof in dofs]),
        ("input", ins),
        ("output", outs),
        ("input and output", [*{*ins}, *{*outs}]),
    ):
        for name, count in Counter(names).items():
            if count > 1:
                shown, key = described(f"{count} of this name"), (what.split()[0], name)
                raise invalid(f"{what} {name!r}", shown, "one", "Rename it.", key)
    for dof in dofs:
        for taken in (f"{dof.name}_dot", f"d{dof.name}"):
            if any(other.name == taken for other in dofs):
                want = f"another name: this is what the velocity of {dof.name!r} is called"
                raise invalid(("dof", taken), taken, want, "Rename it.")


def _connections(what: str, key: str, items: Any, dofs: Mapping[str, Dof]) -> tuple[Any, ...]:
    checked = []
    for i, item in enumerate(items):
        pair = _pair((what, i, "between"), item.between, dofs)
        checked.append(type(item)(pair, number((what, i, key), getattr(item, key))))
    return tuple(checked)


def _coupled(items: Any, dofs: Mapping[str, Dof]) -> tuple[CoupledInertia, ...]:
    checked = []
    for i, item in enumerate(items):
        argument = ("coupled_inertia", i, "between")
        names = places(argument, item.between)
        if len(names) != 2:
            raise invalid(argument, item.between, "two coordinates", "Name the other one.")
        for name in names:
            if name == GROUND:
                remedy = "Add it to the mass of the other one."
                raise invalid(argument, name, "a coordinate: the ground does not move", remedy)
            _check_coordinate(argument, name, dofs)
        value = number(("coupled_inertia", i, "value"), item.value)
        checked.append(CoupledInertia((names[0], names[1]), value))
    return tuple(checked)


def check_inertias(
    dofs: Sequence[Dof], coupled: Sequence[CoupledInertia], moved: Collection[str]
) -> None:
    """Refuse a mass matrix of the free coordinates with which some motion has no energy.

    Parameters
    ----------
    dofs : sequence of Dof
    coupled : sequence of CoupledInertia
    moved : collection of str
        Names of the coordinates whose motion is imposed.
    """
    for dof in dofs:
        if dof.mass == 0 and dof.name not in moved:
            remedy = "Only a coordinate with imposed motion may have none."
            raise invalid(dof.key, dof.mass, f"a number above 0 {dof.unit}", remedy)
    free = [dof for dof in dofs if dof.name not in moved]
    names = {dof.name for dof in free}
    inside = [item for item in coupled if names.issuperset(item.between)]
    if not inside or least_energy(mass_matrix(free, inside)) > NO_ENERGY:
        return
    masses = {dof.name: dof.mass for dof in free}
    ratios = [abs(c.value) / np.sqrt(masses[c.between[0]] * masses[c.between[1]]) for c in inside]
    worst = int(np.argmax(ratios))
    item = inside[worst]
    most = float(np.sqrt(masses[item.between[0]] * masses[item.between[1]]))
    a, b = item.between
    alone = ratios[worst] >= 1
    raise invalid(
        ("coupled_inertia", coupled.index(item), "value"),
        item.value,
        f"less than {most:.6g}, the root of the product of the inertias of {a} and {b}: every "
        "motion needs a positive kinetic energy" if alone else
        "a positive kinetic energy of every motion; with the other coupled inertias some has none",
        f"Correct it, or the inertias; that of {a} contains whatever moves with it.",
    )  # fmt: skip


def _pair(argument: Key, value: Any, dofs: Mapping[str, Dof]) -> tuple[str, str]:
    """Return two ends of one kind of motion, of which the first is a coordinate."""
    names = places(argument, value)
    if len(names) != 2:
        raise invalid(argument, value, "two ends", "Add 'ground' or another coordinate.")
    first, second = names
    for name in names:
        if name not in dofs and name != GROUND:
            known = ", ".join([*dofs, GROUND])
            raise invalid(argument, name, f"one of {known}", "Check the spelling or add the dof.")
    if GROUND not in names and dofs[first].rotational != dofs[second].rotational:
        shown = described(f"{first!r} and {second!r}, one in m and one in rad")
        remedy = "Connect masses with masses and inertias with inertias."
        raise invalid(argument, shown, "two coordinates of one unit", remedy)
    return first, second


def _check_coordinate(argument: Key, name: str, dofs: Mapping[str, Dof]) -> None:
    if name not in dofs:
        remedy = "Check the spelling or add the dof."
        raise invalid(argument, name, f"one of {', '.join(dofs)}", remedy)


def _input(item: Input, dofs: Mapping[str, Dof]) -> Input:
    argument = ("input", item.name)
    on = places(argument, item.on)
    _check_coordinate(argument, on[0], dofs)
    on = _pair(argument, (*on, GROUND)[:2], dofs)
    imposes = item.imposes
    if imposes is not None:
        imposes = QUANTITIES.get(imposes, imposes)
        one_of((*argument, "quantity"), imposes, (DISPLACEMENT, VELOCITY, ACCELERATION))
        if on[1] != GROUND:
            raise invalid(argument, on, "one coordinate", "Impose the motion of one coordinate.")
    return Input(item.name, on, imposes, item.gain, item.unit)


def _check_imposed_motions(inputs: Sequence[Input], dofs: Mapping[str, Dof]) -> None:
    motions: dict[tuple[str, str], Input] = {}
    for item in inputs:
        if item.imposes is None:
            continue
        if (item.on[0], item.imposes) in motions:
            one, key = f"one imposed {item.imposes}", ("input", item.name, "motion_of")
            raise invalid("motion_of", item.on[0], one, "Remove the other input.", key)
        motions[item.on[0], item.imposes] = item
    for (name, quantity), item in motions.items():
        if (name, DISPLACEMENT) not in motions:
            shown = described(f"{quantity} of {name!r} only")
            want = "its displacement too"
            remedy = "Add an input for the displacement; velocity and acceleration go with it."
            raise invalid("motion_of", shown, want, remedy, ("input", item.name, "motion_of"))
    imposed = imposed_by(inputs)
    for item in inputs:
        if item.imposes is None and item.on[0] in imposed:
            shown = described(f"a force on {item.on[0]!r}, whose motion is imposed")
            remedy = "Remove it: it changes nothing."
            raise invalid(("input", item.name), shown, "a force on a free coordinate", remedy)


def _output(item: Output, dofs: Mapping[str, Dof], imposed: frozenset[str]) -> Output:
    argument = ("output", item.name)
    quantity = QUANTITIES.get(item.quantity, item.quantity)
    one_of((*argument, "quantity"), quantity, (DISPLACEMENT, VELOCITY, ACCELERATION, FORCE))
    if item.weights is not None:
        return _sum(argument, item, quantity, dofs)
    of = places(argument, item.of)
    _check_coordinate(argument, of[0] if of[0] != GROUND else of[-1], dofs)
    of = _pair(argument, (*of, GROUND)[:2], dofs)
    rotational = dofs[of[0] if of[0] != GROUND else of[1]].rotational
    if item.quantity in ROTATIONAL_ONLY and not rotational:
        shown = described(f"{item.quantity!r} of {of[0]!r}, which has a mass")
        remedy = f"Write quantity = {quantity!r}, or give the coordinate an inertia."
        raise invalid((*argument, "quantity"), shown, "a quantity of translation", remedy)
    if item.drive and (quantity != FORCE or of[0] not in imposed):
        shown = described(f"the driving force of {of[0]!r}, whose motion no input imposes")
        remedy = "Write of = ['x', 'ground'] for the force in a connection."
        raise invalid((*argument, "of"), shown, "a pair of ends or an imposed coordinate", remedy)
    return Output(item.name, of, quantity, item.drive, item.unit)


def _sum(argument: Key, item: Output, quantity: str, dofs: Mapping[str, Dof]) -> Output:
    """Check an output that sees several coordinates."""
    weights = item.weights
    fits = isinstance(weights, Sequence) and not isinstance(item.of, str)
    if not fits or not weights or len(weights) != len(item.of) or len({*item.of}) != len(item.of):
        want = "one number for each coordinate, each named once"
        remedy = "Write measures = { q1 = 0.8, q2 = -0.3 }."
        raise invalid((*argument, "weights"), described(f"{weights} for {item.of}"), want, remedy)
    for name in item.of:
        _check_coordinate(argument, name, dofs)
    found = tuple(number((*argument, "weights"), weight) for weight in weights)
    if not any(found):
        raise invalid((*argument, "weights"), weights, "one that is not 0", "Correct them.")
    turning = {dofs[name].rotational for name in item.of}
    if quantity == FORCE or (len(turning) > 1 and item.unit is None):
        what = "a force" if quantity == FORCE else "coordinates in m and in rad"
        raise invalid(
            argument,
            described(f"a sum of {what}"),
            "a sum of motions of one kind, or with a unit of its own",
            "Give unit = 'm' if the weights convert." if quantity != FORCE else "Measure a motion.",
        )
    if item.quantity in ROTATIONAL_ONLY and turning != {True}:
        expected = "a quantity of translation"
        raise invalid((*argument, "quantity"), item.quantity, expected, f"Write {quantity!r}.")
    return Output(item.name, tuple(item.of), quantity, False, item.unit, found)


def _check_place(
    argument: Key,
    effect: Effect,
    dofs: Mapping[str, Dof],
    signals: Mapping[str, Sequence[str]],
    moved: Collection[str],
) -> None:
    kind = effect.definition
    known = signals.get(kind.domain, [*dofs, GROUND])
    for name in effect.at:
        if name not in known:
            listed = ", ".join(known) or f"the {kind.domain}s, of which there are none"
            raise invalid(argument, name, f"one of {listed}", f"{kind.title} acts there.")
    for name, unit in kind.channels:
        if name not in moved:
            shown = described(f"an effect that reads {name!r}, which no input imposes")
            remedy = f"Add it with model.with_channel({name!r}, {unit!r})."
            raise invalid(argument, shown, f"a coordinate {name} with an input in {unit}", remedy)
    turning = {dofs[name].rotational for name in effect.at if name in dofs}
    if kind.domain == "pair" and len(turning) > 1:
        remedy = "Do not mix masses and inertias."
        raise invalid(argument, effect.at, "two coordinates of one unit", remedy)


# Mass, damping and stiffness matrices of a mechanical model, and its state space.

NO_INPUT = "no_input"


_Four = tuple[Matrix, Matrix, Matrix, Matrix]


class ImposedSignal(NamedTuple):
    """A signal that imposes displacement, velocity or acceleration of a coordinate.

    Attributes
    ----------
    name : str
        Of the signal; a data column, or what the derivative of one is called.
    coordinate : int
        Position of the coordinate that is moved.
    quantity : str
    gain : float
    source : str
        Name of the input that the signal is, or that it is a derivative of.
    """

    name: str
    coordinate: int
    quantity: str
    gain: float
    source: str


@dataclass(frozen=True, eq=False)
class MechanicalMatrices:
    """The linear part of a mechanical model over its n coordinates.

    ::

        M q'' + C q' + K q = B u
        y = Sq q + Sv q' + Sa q''

    The rows of a force output are in Sq and Sv (and Sa for a driving force). Rows and
    columns of imposed coordinates are kept: `free` and `imposed` hold the positions.

    Attributes
    ----------
    M, C, K : ndarray, shape (n, n)
        Mass, damping and stiffness matrix.
    B : ndarray, shape (n, nu)
        Signals of the force inputs to forces on the coordinates, gains included.
    Sq, Sv, Sa : ndarray, shape (ny, n)
        Displacements, velocities and accelerations to outputs.
    free, imposed : ndarray of int
        Positions of the free and of the imposed coordinates.
    coordinates, force_inputs, outputs : tuple of str
        Names of the rows and columns.
    imposed_signals : tuple of ImposedSignal
        The columns that impose a motion, in the order of the state space's inputs after the
        forces. A derivative that no input gives is that of the displacement's column, and has
        its gain.
    """

    M: Matrix
    C: Matrix
    K: Matrix
    B: Matrix
    Sq: Matrix
    Sv: Matrix
    Sa: Matrix
    free: NDArray[np.intp]
    imposed: NDArray[np.intp]
    coordinates: tuple[str, ...]
    force_inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    imposed_signals: tuple[ImposedSignal, ...]

    @cached_property
    def inverse_mass(self) -> Matrix:
        """Accelerations of the free coordinates from forces on them, ``inv(M[free, free])``.

        Fits ask for it again and again; it is read-only.
        """
        block = self.M[self.free][:, self.free]
        masses = np.diag(block)
        if np.count_nonzero(block) == masses.size:
            found = np.diag(1 / masses)  # as exact as the masses
        else:
            size = np.sqrt(masses)
            found = np.linalg.inv(block / np.outer(size, size)) / np.outer(size, size)
        found.flags.writeable = False
        return found

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the state space's inputs: forces, then imposed motions."""
        return (*self.force_inputs, *(signal.name for signal in self.imposed_signals))

    @property
    def sources(self) -> tuple[str, ...]:
        """Name of the input behind each signal: a derivative belongs to its displacement."""
        return (*self.force_inputs, *(signal.source for signal in self.imposed_signals))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: free displacements, then their velocities."""
        names = [self.coordinates[i] for i in self.free]
        return (*names, *(f"{name}_dot" for name in names))

    @cached_property
    def motion_map(self) -> _Four:
        """Lq, Lv, and Rq, Rv: the linear motions from states and signals, read-only.

        ``q = Lq s + Rq w`` and ``q' = Lv s + Rv w`` with the states s and the signals w.
        """
        n, nf, nw = len(self.coordinates), len(self.free), len(self.signals)
        Lq, Lv = np.zeros((n, 2 * nf)), np.zeros((n, 2 * nf))
        Lq[self.free, np.arange(nf)] = 1
        Lv[self.free, nf + np.arange(nf)] = 1
        Rq, Rv = np.zeros((n, nw)), np.zeros((n, nw))
        for part, quantity in ((Rq, DISPLACEMENT), (Rv, VELOCITY)):
            for column, row, gain in self._imposed_columns(quantity):
                part[row, column] = gain
        for part in (Lq, Lv, Rq, Rv):
            part.flags.writeable = False
        return Lq, Lv, Rq, Rv

    def first_order(self) -> _Four:
        """Return A, B, C, D of the first-order form, from `signals` to `outputs`."""
        A, B, C, D = (part.copy() for part in self._first_order)
        return A, B, C, D

    @cached_property
    def _first_order(self) -> _Four:
        Lq, Lv, Rq, Rv = self.motion_map
        n, nf, nw = len(self.coordinates), len(self.free), len(self.signals)
        force = np.hstack([self.B, np.zeros((n, nw - self.B.shape[1]))])
        inverse_mass = self.inverse_mass
        acceleration_s, acceleration_w = np.zeros((n, 2 * nf)), np.zeros((n, nw))
        for column, row, gain in self._imposed_columns(ACCELERATION):
            acceleration_w[row, column] = gain
        imposed = self.M[self.free][:, self.imposed] @ acceleration_w[self.imposed]
        pushed = (force - self.K @ Rq - self.C @ Rv)[self.free] - imposed
        acceleration_s[self.free] = -inverse_mass @ (self.K @ Lq + self.C @ Lv)[self.free]
        acceleration_w[self.free] = inverse_mass @ pushed
        return (
            np.vstack([Lv[self.free], acceleration_s[self.free]]),
            np.vstack([np.zeros((nf, nw)), acceleration_w[self.free]]),
            self.Sq @ Lq + self.Sv @ Lv + self.Sa @ acceleration_s,
            self.Sq @ Rq + self.Sv @ Rv + self.Sa @ acceleration_w,
        )

    def state_space(self) -> control.StateSpace:
        """Return the system from the signals to the outputs.

        python-control knows no system with states and outputs but without inputs; a model that
        decays freely gets an input ``"no_input"`` that does nothing.
        """
        A, B, C, D = self.first_order()
        signals = self.signals
        if not signals:
            B, D, signals = np.zeros((len(A), 1)), np.zeros((len(C), 1)), (NO_INPUT,)
        return named_system((A, B, C, D), 0, signals, self.outputs, self.states)

    def _imposed_columns(self, quantity: str) -> list[tuple[int, int, float]]:
        """Column of the signals, coordinate and gain of each imposed motion of one quantity."""
        first = len(self.force_inputs)
        return [
            (first + i, signal.coordinate, signal.gain)
            for i, signal in enumerate(self.imposed_signals)
            if signal.quantity == quantity
        ]


def incidence(names: Sequence[str], pair: Sequence[str]) -> Matrix:
    """Return the row that gives the relative displacement of a pair from all coordinates."""
    row = np.zeros(len(names))
    for name, sign in zip(pair, (1.0, -1.0), strict=False):
        if name in names:
            row[names.index(name)] += sign
    return row


def assemble(
    dofs: Sequence[Dof],
    springs: Sequence[Spring],
    dampers: Sequence[Damper],
    inputs: Sequence[Input],
    outputs: Sequence[Output],
    coupled_inertias: Sequence[CoupledInertia] = (),
) -> MechanicalMatrices:
    """Build the matrices of checked parts, without effects."""
    names = tuple(dof.name for dof in dofs)
    n = len(names)
    M = mass_matrix(dofs, coupled_inertias)
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for spring in springs:
        row = incidence(names, spring.between)
        K += spring.stiffness * np.outer(row, row)
    for damper in dampers:
        row = incidence(names, damper.between)
        C += damper.damping * np.outer(row, row)
    forces = [item for item in inputs if item.imposes is None]
    B = np.array([item.gain * incidence(names, item.on) for item in forces]).reshape(-1, n).T
    Sq, Sv, Sa = (np.zeros((len(outputs), n)) for _ in range(3))
    for i, item in enumerate(outputs):
        row = incidence(names, item.of) if item.weights is None else np.zeros(n)
        for name, weight in zip(item.of, item.weights or (), strict=False):
            row[names.index(name)] = weight
        if item.quantity == DISPLACEMENT:
            Sq[i] = row
        elif item.quantity == VELOCITY:
            Sv[i] = row
        elif item.quantity == ACCELERATION:
            Sa[i] = row
        elif item.drive:
            k = names.index(item.of[0])
            Sq[i], Sv[i], Sa[i] = K[k], C[k], M[k]
        else:
            ends = set(item.of)
            Sq[i] = row * sum(s.stiffness for s in springs if set(s.between) == ends)
            Sv[i] = row * sum(d.damping for d in dampers if set(d.between) == ends)
    moved = imposed_by(inputs)
    imposed = np.array([i for i, name in enumerate(names) if name in moved], dtype=np.intp)
    free = np.array([i for i, name in enumerate(names) if name not in moved], dtype=np.intp)
    return MechanicalMatrices(
        M=M, C=C, K=K, B=B, Sq=Sq, Sv=Sv, Sa=Sa, free=free, imposed=imposed,
        coordinates=names,
        force_inputs=tuple(item.name for item in forces),
        outputs=tuple(item.name for item in outputs),
        imposed_signals=tuple(
            _imposed_signals(inputs, names, imposed.tolist(), np.vstack([Sa, M[free]]))
        ),
    )  # fmt: skip


def _imposed_signals(
    inputs: Sequence[Input], names: Sequence[str], imposed: Sequence[int], used: Matrix
) -> list[ImposedSignal]:
    taken = {item.name for item in inputs}
    signals = []
    for i in imposed:
        given = {item.imposes: item for item in inputs if item.imposes and item.on[0] == names[i]}
        base = given[DISPLACEMENT]
        wanted = [(DISPLACEMENT, base.name), (VELOCITY, f"{base.name}_dot")]
        if used[:, i].any():  # by an output, or by what an inertia couples to it
            wanted.append((ACCELERATION, f"{base.name}_ddot"))
        for quantity, label in wanted:
            item = given.get(quantity, base)
            label = item.name if quantity in given else label
            while quantity not in given and label in taken:
                label += "_"  # another input has this name already
            signals.append(ImposedSignal(label, i, quantity, item.gain, item.name))
    return signals
