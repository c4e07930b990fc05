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
from typing import Any

import numpy as np

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import Key, described, instance_of, invalid, misfit, one_of, positive
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import GROUND
from robustpolish.machines.mechanical.equations import Equations, linear_part

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
    axis : str, optional
        Direction along which it moves or about which it turns, such as ``"x"``. No spring, damper
        or friction is sought between coordinates of different axes; without axes between all.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.Dof("phi", 0.02, rotational=True).unit
    'kg m^2'
    """

    name: str
    mass: float
    rotational: bool = False
    axis: str = ""

    def __post_init__(self) -> None:
        name = text("dof", self.name)
        if name == GROUND:
            remedy = "Rename the coordinate."
            raise invalid(("dof", name), name, "a name other than 'ground'", remedy)
        mass = positive(self.key, number(self.key, self.mass), self.unit, True)
        object.__setattr__(self, "mass", mass)
        if self.axis:
            text(("dof", name, "axis"), self.axis)

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
    >>> rp.machines.CoupledInertia(("theta_1", "theta_2"), 0.12).value
    0.12
    """

    between: tuple[str, str]
    value: float


@dataclass(frozen=True)
class Ratio:
    """A pulley, screw, rack, gear or lever: ``q[between[0]]`` is ``value * q[between[1]]``.

    A spring, damper, effect, force or sensor between the two acts on the difference
    ``q[between[0]] - value * q[between[1]]``, in units of the first: a belt in N/m. Without a
    spring or damper between them the two move as one.

    Parameters
    ----------
    between : (str, str)
        Two coordinates; one may be a displacement and the other an angle.
    value : float
        How far the first moves by one of the second: the radius of a pulley, or the lead of a
        screw by 2 pi, in m/rad; of gears the teeth of the second by those of the first, of levers
        the arms. Negative where it moves the other way.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 12.0), rp.Dof("phi", 1e-3, rotational=True)],
    ...     ratios=[rp.Ratio(("x", "phi"), 0.02)],
    ...     inputs=[rp.Input("T", "phi")], outputs=[rp.Output("x", "x")],
    ... )
    >>> model.free, model.matrices.M, model.matrices.B
    (('x',), array([[14.5]]), array([[50.]]))
    """

    between: tuple[str, str]
    value: float


CONNECTIONS: dict[str, tuple[type, str, tuple[str, ...]]] = {
    "ratio": (Ratio, "value", ("1", "m/rad", "rad/m")),
    "coupled_inertia": (CoupledInertia, "value", ("kg", "kg m", "kg m^2")),
    "spring": (Spring, "stiffness", ("N/m", "N m/rad", "N m/rad")),
    "damper": (Damper, "damping", ("N s/m", "N m s/rad", "N m s/rad")),
}
"""What lies between two coordinates, by its name in keys and files: its class, its number, and the
unit of that if none, one or both of the coordinates are angles (of a ratio: if they are alike, the
second or the first is an angle). The fields of a model have these names in the plural."""


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
        _check_unit(("input", name, "unit"), self.unit)


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
        _check_unit(("output", name, "unit"), self.unit)


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


def _check_unit(argument: Key, value: Any) -> None:
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


def quantity_of(where: Key, value: Any, force: bool = True) -> str:
    """Return the quantity that a name such as "angular_velocity" means."""
    known = [name for name, kind in QUANTITIES.items() if force or kind != FORCE]
    return QUANTITIES[one_of((*where, "quantity"), value, known)]


_Multiples = Mapping[str, tuple[str, float]]


@dataclass(frozen=True, eq=False)
class Frame:
    """How the motion at all places follows from the coordinates of the equations of motion.

    Attributes
    ----------
    coordinates : tuple of str
        The degrees of freedom without those that rigid ratios tie to one of them.
    multiples : mapping
        Of each degree of freedom the coordinate that it is a multiple of, and the factor.
    ratios : mapping
        By their ends.
    travels : mapping
        How far each degree of freedom moves where those that ratios join to it move with it, and
        the first of them by one: sizes of unlike coordinates are comparable as shares of it.
    """

    coordinates: tuple[str, ...]
    multiples: _Multiples
    ratios: Mapping[frozenset[str], Ratio]
    travels: Mapping[str, float]

    def row(self, at: Sequence[str]) -> Matrix:
        """Return the row that gives the displacement at a place from all coordinates."""
        weights, ratio = (1.0, -1.0), self.ratios.get(frozenset(at))
        if ratio is not None:
            forwards = at[0] == ratio.between[0]
            weights = (1.0, -ratio.value) if forwards else (ratio.value, -1.0)
        row = np.zeros(len(self.coordinates))
        for name, weight in zip(at, weights, strict=False):
            if name in self.multiples:
                coordinate, factor = self.multiples[name]
                row[self.coordinates.index(coordinate)] += weight * factor
        return row

    @cached_property
    def rows(self) -> Matrix:
        """One row for each degree of freedom."""
        return np.array([self.row((name,)) for name in self.multiples])

    @cached_property
    def sizes(self) -> Matrix:
        """The travel of each coordinate."""
        return np.array([self.travel((name,)) for name in self.coordinates])

    def measured_at(self, at: Sequence[str]) -> Sequence[str]:
        """Return the ends whose unit a place has: the first one's where a ratio joins them."""
        ratio = self.ratios.get(frozenset(at))
        return at if ratio is None else ratio.between[:1]

    def travel(self, at: Sequence[str]) -> float:
        """Return how far a place moves, see `travels`; 1 at a signal."""
        return max((self.travels.get(name, 0.0) for name in self.measured_at(at)), default=0) or 1.0


def frame_of(
    dofs: Sequence[Dof],
    ratios: Sequence[Ratio],
    connections: Iterable[Spring | Damper],
    moved: Collection[str],
) -> Frame:
    """Return the frame of a model; a ratio is rigid if no connection lies between its ends.

    Of what rigid ratios tie together the coordinate is the one that an input imposes, or else the
    first of the degrees of freedom.

    Raises
    ------
    InvalidInputError
        If rigid ratios close a ring, or tie two imposed motions.
    """
    elastic = {frozenset(part.between) for part in connections}
    rigid = [ratio for ratio in ratios if frozenset(ratio.between) not in elastic]
    names = [dof.name for dof in dofs]
    tied = _multiples(sorted(names, key=lambda name: name not in moved), rigid)
    coordinates = tuple(name for name in names if tied[name][0] == name)
    if len(rigid) != len(names) - len(coordinates):
        key = ("ratio", ratios.index(rigid[-1]), "between")
        shown = described("rigid ratios that close a ring")
        remedy = "Leave one out, or put a spring between its ends."
        raise invalid(key, shown, "one way from a coordinate to another", remedy)
    for name in moved:
        if name not in coordinates:
            shown = described(f"{name!r} and {tied[name][0]!r}, which rigid ratios tie")
            raise invalid("motion_of", shown, "one imposed motion", "Remove the other input.")
    travels = _multiples([dof.name for dof in sorted(dofs, key=lambda d: d.rotational)], ratios)
    return Frame(
        coordinates,
        {name: tied[name] for name in names},
        {frozenset(ratio.between): ratio for ratio in ratios},
        {name: abs(factor) for name, (_, factor) in travels.items()},
    )


def _multiples(order: Sequence[str], ratios: Sequence[Ratio]) -> _Multiples:
    """Return for each name the first one that ratios join it to, and the factor from that."""
    found: dict[str, tuple[str, float]] = {}
    for first in order:
        if first in found:
            continue
        found[first], reached = (first, 1.0), [first]
        for name in reached:  # grows
            for ratio in ratios:
                one, other = ratio.between
                ahead, factor = (other, 1 / ratio.value) if name == one else (one, ratio.value)
                if name in ratio.between and ahead not in found:
                    found[ahead] = (first, factor * found[name][1])
                    reached.append(ahead)
    return found


def mass_matrix(
    dofs: Sequence[Dof], coupled_inertias: Sequence[CoupledInertia], frame: Frame
) -> Matrix:
    """Return the mass matrix over all coordinates: ``T' M T`` with all motions ``T q``."""
    names = [dof.name for dof in dofs]
    M = np.diag([dof.mass for dof in dofs])
    for coupled in coupled_inertias:
        i, j = (names.index(end) for end in coupled.between)
        M[i, j] += coupled.value
        M[j, i] += coupled.value
    return frame.rows.T @ M @ frame.rows


# Checks that concern the parts of a mechanical model together, not one part alone.

_NO_ENERGY = 1e-9
"""Energy of a motion, as a share of what it would have without couplings, that is none."""
_KINDS: Mapping[str, type] = {
    "dofs": Dof,
    "springs": Spring,
    "dampers": Damper,
    "inputs": Input,
    "outputs": Output,
    "effects": Effect,
    "coupled_inertias": CoupledInertia,
    "ratios": Ratio,
    "equations": Equations,
}
_Joined = dict[frozenset[str], bool]
"""Pairs with a ratio, and whether it is rigid."""


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
    found: dict[str, Any] = {}
    for name, kind in _KINDS.items():
        items = given[name]
        if isinstance(items, str) or not isinstance(items, Iterable):
            raise invalid(name, items, f"a list of {kind.__name__}", "Put it in a list.")
        found[name] = tuple(items)
        for item in found[name]:
            if not isinstance(item, kind):
                raise invalid(name, item, f"a {kind.__name__}", f"Use {kind.__name__}(...).")
    _add_what_equations_move(found)
    dofs = {dof.name: dof for dof in found["dofs"]}
    signals = {key: [item.name for item in found[f"{key}s"]] for key in ("input", "output")}
    _check_names([dof.name for dof in found["dofs"]], signals["input"], signals["output"])
    spin = given["spin_frequency"]
    if spin is not None:
        found["spin_frequency"] = positive("spin_frequency", number("spin_frequency", spin), "Hz")
    if not isinstance(given["name"], str):
        raise invalid("name", given["name"], "text", "Write it between quotation marks.")
    joined: _Joined = {}
    for what in CONNECTIONS:
        items = enumerate(found[f"{what}s"])
        found[f"{what}s"] = tuple(_connection(what, i, item, dofs, joined) for i, item in items)
    found["inputs"] = tuple(_input(item, dofs, joined) for item in found["inputs"])
    _check_imposed_motions(found["inputs"])
    moved = imposed_by(found["inputs"])
    connections = (*found["springs"], *found["dampers"])
    found["frame"] = frame_of(found["dofs"], found["ratios"], connections, moved)
    check_inertias(
        found["dofs"], found["coupled_inertias"], found["frame"], moved, found["equations"]
    )
    found["outputs"] = tuple(_output(item, dofs, joined, moved) for item in found["outputs"])
    for i, effect in enumerate(found["effects"]):
        _check_place(("effect", i, "at"), effect, dofs, joined, signals, moved)
    design = instance_of("design", given["design"], Mapping, "a mapping", "Write {key: value}.")
    return {**found, "design": dict(design)}


def _add_what_equations_move(found: dict[str, Any]) -> None:
    """Add the coordinates and inputs that equations have and nobody else declared."""
    if len(found["equations"]) > 1:
        shown = described(f"{len(found['equations'])} sets of equations")
        raise invalid("equations", shown, "one", "Put them together: they may share coordinates.")
    for item in found["equations"]:
        dofs = {dof.name: dof for dof in found["dofs"]}
        inputs = {given.name: given for given in found["inputs"]}
        for name, unit in item.coordinates.items():
            dof = dofs.get(name) or Dof(name, 0.0, rotational=unit == "rad")
            if dof.rotational != (unit == "rad"):
                has = "an inertia" if dof.rotational else "a mass"
                shown = described(f"{name!r} in {unit} with {has}")
                raise invalid(("equation", name), shown, "one kind of motion", "Correct one.")
            found["dofs"] += (dof,) * (name not in dofs)
        for name, unit in item.inputs.items():
            given = inputs.get(name) or Input(
                name, (next(iter(item.coordinates)), GROUND), unit=unit
            )
            if given.imposes:
                shown, want = described(f"{name!r}, which imposes a motion"), "an input by a name"
                raise invalid(("input", name), shown, f"{want} of its own", "Rename it.")
            found["inputs"] += (given,) * (name not in inputs)


def _check_names(dofs: Sequence[str], inputs: Sequence[str], outputs: Sequence[str]) -> None:
    if not dofs:
        raise invalid("dof", described("no degree of freedom"), "one or more", "Add [dof.x].")
    if not outputs:
        raise invalid("output", described("no output"), "one or more", "Add an [[output]].")
    both = [*{*inputs}, *{*outputs}]
    for what, names in zip(
        ("dof", "input", "output", "input and output"), (dofs, inputs, outputs, both), strict=True
    ):
        for name, count in Counter(names).items():
            if count > 1:
                shown, key = described(f"{count} of this name"), (what.split()[0], name)
                raise invalid(f"{what} {name!r}", shown, "one", "Rename it.", key)
    for name in dofs:
        for taken in {f"{name}_dot", f"d{name}"}.intersection(dofs):
            want = f"another name: this is what the velocity of {name!r} is called"
            raise invalid(("dof", taken), taken, want, "Rename it.")


def _ends(
    argument: Key,
    value: Any,
    dofs: Mapping[str, Dof],
    joined: _Joined,
    both: str = "",
    alike: bool = True,
) -> tuple[str, str]:
    """Return two different ends; one alone is against the ground unless `both` are expected."""
    given = (value,) if isinstance(value, str) else value
    if not isinstance(given, Sequence) or not 1 <= len(given) <= 2:
        raise invalid(argument, value, "one name or a pair of names", "Write ['x', 'ground'].")
    if both and len(given) == 1:
        raise invalid(argument, value, both, "Name the other one.")
    first, second = (text(argument, item) for item in (*given, GROUND)[:2])
    if first == second:
        raise invalid(argument, described(f"{first!r} twice"), "two ends", "Name the other end.")
    for name in (first, second):
        one_of(argument, name, (*dofs, GROUND), "Check the spelling or add the dof.")
    turning = {dofs[name].rotational for name in (first, second) if name != GROUND}
    pair = frozenset((first, second))
    if alike and len(turning) > 1 and pair not in joined:
        shown = described(f"{first!r} and {second!r}, one in m and one in rad")
        remedy = f"Name the ratio: [[ratio]] between = [{first!r}, {second!r}] with its value."
        raise invalid(argument, shown, "two coordinates of one unit, or with a ratio", remedy)
    if not both and joined.get(pair):
        shown = described(f"{first!r} and {second!r}, which a rigid ratio ties")
        want, remedy = "two ends that can move apart", "Put a spring between them."
        raise invalid(argument, shown, want, remedy)
    return first, second


def _connection(what: str, i: int, item: Any, dofs: Mapping[str, Dof], joined: _Joined) -> Any:
    """Return what lies between checked ends; ratios come first, and their ends into `joined`."""
    where, ratio = (what, i, "between"), isinstance(item, Ratio)
    coordinates = ratio or isinstance(item, CoupledInertia)
    both = "two coordinates" if coordinates else "two ends, one of which may be 'ground'"
    ends = _ends(where, item.between, dofs, joined, both, not coordinates)
    if coordinates and GROUND in ends:
        want, remedy = "a coordinate: the ground does not move", "Name the coordinate that does."
        raise invalid(where, GROUND, want, remedy)
    pair = frozenset(ends)
    if ratio and pair in joined:
        shown = described(f"{ends[0]!r} and {ends[1]!r} twice")
        raise invalid(where, shown, "one ratio between two coordinates", "Remove the other one.")
    if ratio or (pair in joined and not coordinates):
        joined[pair] = ratio
    return type(item)(ends, connection_number(what, i, getattr(item, CONNECTIONS[what][1])))


def connection_number(what: str, i: int, value: Any) -> float:
    """Return the checked number of the i-th spring, damper, coupled inertia or ratio."""
    where = (what, i, CONNECTIONS[what][1])
    if what == "ratio" and value == 0:
        raise invalid(where, value, "a number other than 0", "Leave the ratio out.")
    return number(where, value)


def check_inertias(
    dofs: Sequence[Dof],
    coupled: Sequence[CoupledInertia],
    frame: Frame,
    moved: Collection[str],
    equations: Sequence[Equations] = (),
) -> None:
    """Refuse a mass matrix of the free coordinates with which some motion has no energy.

    Parameters
    ----------
    dofs : sequence of Dof
    coupled : sequence of CoupledInertia
    frame : Frame
    moved : collection of str
        Names of the coordinates whose motion is imposed.
    equations : sequence of Equations, optional
        Which add inertias of their own.
    """
    for item in equations:
        names = [*item.coordinates]
        wrong = [x for x in names if x in moved or x not in frame.coordinates]
        if wrong:
            shown = described(f"an equation of {wrong[0]!r}, which an input or a ratio moves")
            remedy = "Leave out the input or the ratio, or the equation."
            raise invalid(("equation", wrong[0]), shown, "a free coordinate", remedy)
        here = [frame.coordinates.index(name) for name in names]
        M = mass_matrix(dofs, (), frame)[here][:, here] + linear_part(item)[0]
        size = np.sqrt(np.maximum(np.diag(M), 0.0))
        if np.all(size > 0) and np.linalg.eigvalsh(M / np.outer(size, size))[0] > _NO_ENERGY:
            moved = {*moved, *names}
            continue
        shown = described(f"the singular mass matrix {M.tolist()} of {', '.join(names)}")
        want = "a positive one at the start: every motion needs a kinetic energy"
        raise invalid(("equation", names[0]), shown, want, "Check signs of the accelerations.")
    heavy = {frame.multiples[dof.name][0] for dof in dofs if dof.mass}
    for dof in dofs:
        if dof.mass == 0 and frame.multiples[dof.name][0] not in {*heavy, *moved}:
            remedy = "Only a coordinate with imposed motion may have none."
            raise invalid(dof.key, dof.mass, f"a number above 0 {dof.unit}", remedy)
    free = [name for name in frame.coordinates if name not in moved]
    ties = {name: tie for name, tie in frame.multiples.items() if tie[0] in free}
    inside = [item for item in coupled if ties.keys() >= {*item.between}]
    if not inside:
        return
    here = [frame.coordinates.index(name) for name in free]
    M = mass_matrix(dofs, inside, frame)[here][:, here]
    size = np.sqrt(np.diag(mass_matrix(dofs, (), frame))[here])
    if np.linalg.eigvalsh(M / np.outer(size, size))[0] > _NO_ENERGY:
        return
    root = {name: float(size[free.index(to)]) / abs(by) for name, (to, by) in ties.items()}
    most = [root[a] * root[b] for a, b in (item.between for item in inside)]
    ratios = [abs(item.value) / root for item, root in zip(inside, most, strict=True)]
    worst = int(np.argmax(ratios))
    item, (a, b) = inside[worst], inside[worst].between
    raise invalid(
        ("coupled_inertia", coupled.index(item), "value"),
        item.value,
        f"less than {most[worst]:.6g}, the root of the product of the inertias of {a} and {b}: "
        "every motion needs a positive kinetic energy" if ratios[worst] >= 1 else
        "a positive kinetic energy of every motion; with the other coupled inertias some has none",
        f"Correct it, or the inertias; that of {a} contains whatever moves with it.",
    )  # fmt: skip


def _input(item: Input, dofs: Mapping[str, Dof], joined: _Joined) -> Input:
    argument = ("input", item.name)
    on = _ends(argument, item.on, dofs, joined)
    if on[0] == GROUND:
        remedy = "Name the coordinate that it acts on first."
        raise invalid(argument, on[0], f"one of {', '.join(dofs)}", remedy)
    imposes = item.imposes
    if imposes is not None:
        imposes = quantity_of(argument, imposes, force=False)
        if on[1] != GROUND:
            raise invalid(argument, on, "one coordinate", "Impose the motion of one coordinate.")
    return Input(item.name, on, imposes, item.gain, item.unit)


def _check_imposed_motions(inputs: Sequence[Input]) -> None:
    motions: dict[tuple[str, str], Input] = {}
    for item in inputs:
        if (
            item.imposes is not None
            and motions.setdefault((item.on[0], item.imposes), item) is not item
        ):
            one, key = f"one imposed {item.imposes}", ("input", item.name, "motion_of")
            raise invalid("motion_of", item.on[0], one, "Remove the other input.", key)
    for (name, quantity), item in motions.items():
        if (name, DISPLACEMENT) not in motions:
            shown, want = f"{quantity} of {name!r} only", "its displacement too"
            remedy = "Add an input for the displacement; velocity and acceleration go with it."
            raise misfit("motion_of", shown, want, remedy, ("input", item.name, "motion_of"))
    for item in inputs:
        if item.imposes is None and (item.on[0], DISPLACEMENT) in motions:
            shown = described(f"a force on {item.on[0]!r}, whose motion is imposed")
            remedy = "Remove it: it changes nothing."
            raise invalid(("input", item.name), shown, "a force on a free coordinate", remedy)


def _output(
    item: Output, dofs: Mapping[str, Dof], joined: _Joined, imposed: frozenset[str]
) -> Output:
    argument, weights = ("output", item.name), item.weights
    quantity = quantity_of(argument, item.quantity)
    if weights is not None:
        weights = _weights(argument, item, dofs)
    of = _ends(argument, item.of, dofs, joined) if weights is None else tuple(item.of)
    turning = {dofs[name].rotational for name in of if name != GROUND}
    if weights is not None and (quantity == FORCE or (len(turning) > 1 and item.unit is None)):
        shown, remedy = "a force", "Measure a motion."
        if quantity != FORCE:
            shown, remedy = "coordinates in m and in rad", "Give unit = 'm' if the weights convert."
        want = "a sum of motions of one kind, or with a unit of its own"
        raise invalid(argument, described(f"a sum of {shown}"), want, remedy)
    if item.quantity in ROTATIONAL_ONLY and turning != {True}:
        shown = described(f"{item.quantity!r} of {of[0]!r}, which has a mass")
        remedy = f"Write quantity = {quantity!r}, or give the coordinate an inertia."
        raise invalid((*argument, "quantity"), shown, "a quantity of translation", remedy)
    if item.drive and (quantity != FORCE or of[0] not in imposed):
        shown = described(f"the driving force of {of[0]!r}, whose motion no input imposes")
        remedy = "Write of = ['x', 'ground'] for the force in a connection."
        raise invalid((*argument, "of"), shown, "a pair of ends or an imposed coordinate", remedy)
    return Output(item.name, of, quantity, item.drive, item.unit, weights)


def _weights(argument: Key, item: Output, dofs: Mapping[str, Dof]) -> tuple[float, ...]:
    """Return the weights of an output that sees several coordinates, checked."""
    weights, where = item.weights, (*argument, "weights")
    fits = isinstance(weights, Sequence) and not isinstance(item.of, str)
    if not fits or not weights or len(weights) != len(item.of) or len({*item.of}) != len(item.of):
        shown, want = f"{weights} for {item.of}", "one number for each coordinate, each named once"
        raise misfit(where, shown, want, "Write measures = { q1 = 0.8, q2 = -0.3 }.")
    for name in item.of:
        one_of(argument, name, dofs, "Check the spelling or add the dof.")
    found = tuple(number(where, weight) for weight in weights)
    if not any(found):
        raise invalid(where, weights, "one that is not 0", "Correct them.")
    return found


def _check_place(
    argument: Key,
    effect: Effect,
    dofs: Mapping[str, Dof],
    joined: _Joined,
    signals: Mapping[str, Sequence[str]],
    moved: Collection[str],
) -> None:
    kind = effect.definition
    ends = [signals.get(kind.domain, [*dofs, GROUND])] * len(effect.at)
    if kind.domain == "path":
        ends = [signals["input"], signals["output"]]
    for name, known in zip(effect.at, ends, strict=True):
        if name not in known:
            listed = ", ".join(known) or f"the {kind.domain}s, of which there are none"
            raise invalid(argument, name, f"one of {listed}", f"{kind.title} acts there.")
    for name, unit in kind.channels:
        if name not in moved:
            shown = described(f"an effect that reads {name!r}, which no input imposes")
            remedy = f"Add it with model.with_channel({name!r}, {unit!r})."
            raise invalid(argument, shown, f"a coordinate {name} with an input in {unit}", remedy)
    if kind.domain == "pair":
        _ends(argument, effect.at, dofs, joined)
