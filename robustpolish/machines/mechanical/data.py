"""The data of a mechanical model: its parts, checked, with names, units, matrices and numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, TypeVar

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import Array, Matrix
from robustpolish.base.checks import invalid, one_of
from robustpolish.linear.systems import named_system
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import GROUND, Motion
from robustpolish.machines.mechanical.equations import (
    EquationKind,
    Equations,
    context,
    effect_of,
    linear_part,
    number_unit,
    with_numbers,
)
from robustpolish.machines.mechanical.feedback import Feedback, check_feedback
from robustpolish.machines.mechanical.parts import (
    ACCELERATION,
    CONNECTIONS,
    DISPLACEMENT,
    FORCE,
    UNITS,
    VELOCITY,
    CoupledInertia,
    Damper,
    Dof,
    Frame,
    Input,
    Output,
    Ratio,
    Spring,
    check_inertias,
    checked_fields,
    connection_number,
    frame_of,
    imposed_by,
    mass_matrix,
)

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
    def _imposed(self) -> dict[str, Matrix]:
        """Displacements, velocities and accelerations that the signals impose, by quantity."""
        shape, first = (len(self.coordinates), len(self.signals)), len(self.force_inputs)
        found = {name: np.zeros(shape) for name in (DISPLACEMENT, VELOCITY, ACCELERATION)}
        for column, signal in enumerate(self.imposed_signals, first):
            found[signal.quantity][signal.coordinate, column] = signal.gain
        return found

    @cached_property
    def motion_map(self) -> _Four:
        """Lq, Lv, and Rq, Rv: the linear motions from states and signals, read-only.

        ``q = Lq s + Rq w`` and ``q' = Lv s + Rv w`` with the states s and the signals w.
        """
        free = np.eye(len(self.coordinates))[:, self.free]
        Lq, Lv = np.hstack([free, 0 * free]), np.hstack([0 * free, free])
        found = Lq, Lv, self._imposed[DISPLACEMENT], self._imposed[VELOCITY]
        for part in found:
            part.flags.writeable = False
        return found

    def first_order(self) -> _Four:
        """Return A, B, C, D of the first-order form, from `signals` to `outputs`."""
        A, B, C, D = (part.copy() for part in self._first_order)
        return A, B, C, D

    @cached_property
    def _first_order(self) -> _Four:
        Lq, Lv, Rq, Rv = self.motion_map
        force = np.zeros_like(Rq)
        force[:, : len(self.force_inputs)] = self.B
        inverse_mass = self.inverse_mass
        acceleration_s, acceleration_w = np.zeros_like(Lq), self._imposed[ACCELERATION].copy()
        imposed = self.M[self.free][:, self.imposed] @ acceleration_w[self.imposed]
        pushed = (force - self.K @ Rq - self.C @ Rv)[self.free] - imposed
        acceleration_s[self.free] = -inverse_mass @ (self.K @ Lq + self.C @ Lv)[self.free]
        acceleration_w[self.free] = inverse_mass @ pushed
        return (
            np.vstack([Lv[self.free], acceleration_s[self.free]]),
            np.vstack([np.zeros_like(pushed), acceleration_w[self.free]]),
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


def _read(model: MechanicalData, equations: Equations) -> list[int]:
    """Return which of the force inputs equations read, in their order."""
    forces = [item.name for item in model.inputs if item.imposes is None]
    return [forces.index(name) for name in equations.inputs]


def _assemble(model: MechanicalData) -> MechanicalMatrices:
    """Build the matrices of a model, without effects."""
    frame = model.frame
    names, n = frame.coordinates, len(frame.coordinates)
    M = mass_matrix(model.dofs, model.coupled_inertias, frame)
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for spring in model.springs:
        row = frame.row(spring.between)
        K += spring.stiffness * np.outer(row, row)
    for damper in model.dampers:
        row = frame.row(damper.between)
        C += damper.damping * np.outer(row, row)
    forces = [item for item in model.inputs if item.imposes is None]
    B = np.array([item.gain * frame.row(item.on) for item in forces]).reshape(-1, n).T
    for item in model.equations:
        at = [names.index(name) for name in item.coordinates]
        own, columns = linear_part(item), _read(model, item)
        for matrix, part in zip((M, C, K), own, strict=False):
            matrix[np.ix_(at, at)] += part
        B[:, columns] = 0.0
        B[np.ix_(at, columns)] = own[3] * [forces[j].gain for j in columns]
    Sq, Sv, Sa = (np.zeros((len(model.outputs), n)) for _ in range(3))
    for i, item in enumerate(model.outputs):
        row = frame.row(item.of) if item.weights is None else np.zeros(n)
        for name, weight in zip(item.of, item.weights or (), strict=False):
            row += weight * frame.row((name,))
        if item.quantity != FORCE:
            {DISPLACEMENT: Sq, VELOCITY: Sv, ACCELERATION: Sa}[item.quantity][i] = row
        elif item.drive:
            k = names.index(item.of[0])
            Sq[i], Sv[i], Sa[i] = K[k], C[k], M[k]
        else:
            ends = set(item.of)
            Sq[i] = row * sum(s.stiffness for s in model.springs if set(s.between) == ends)
            Sv[i] = row * sum(d.damping for d in model.dampers if set(d.between) == ends)
    moved = np.array([name in model.imposed for name in names])
    free = np.flatnonzero(~moved)
    signals: list[ImposedSignal] = []
    for i in np.flatnonzero(moved).tolist():
        given = {x.imposes: x for x in model.inputs if x.imposes and x.on[0] == names[i]}
        base = given[DISPLACEMENT]
        wanted = [(DISPLACEMENT, ""), (VELOCITY, "_dot")]
        if Sa[:, i].any() or M[free, i].any():  # an output or a coupled inertia asks for it
            wanted.append((ACCELERATION, "_ddot"))
        for quantity, suffix in wanted:
            source = given.get(quantity, base)
            label = source.name if quantity in given else f"{base.name}{suffix}"
            while quantity not in given and label in model.input_names:
                label += "_"  # another input has this name already
            signals.append(ImposedSignal(label, i, quantity, source.gain, source.name))
    return MechanicalMatrices(
        M=M, C=C, K=K, B=B, Sq=Sq, Sv=Sv, Sa=Sa, free=free, imposed=np.flatnonzero(moved),
        coordinates=names,
        force_inputs=tuple(item.name for item in forces),
        outputs=model.output_names,
        imposed_signals=tuple(signals),
    )  # fmt: skip


@dataclass(frozen=True, repr=False)
class MechanicalData:
    """What a `MechanicalModel` consists of; see there for the fields.

    Whatever is computed from a model, shown or written of it, is a function of this class.
    """

    dofs: tuple[Dof, ...] = ()
    springs: tuple[Spring, ...] = ()
    dampers: tuple[Damper, ...] = ()
    inputs: tuple[Input, ...] = ()
    outputs: tuple[Output, ...] = ()
    effects: tuple[Effect, ...] = ()
    spin_frequency: float | None = None
    name: str = ""
    coupled_inertias: tuple[CoupledInertia, ...] = ()
    design: Mapping[str, Any] = field(default_factory=dict, hash=False)
    ratios: tuple[Ratio, ...] = ()
    equations: tuple[Equations, ...] = ()
    feedback: tuple[Feedback, ...] = ()

    def __post_init__(self) -> None:
        for name, value in checked_fields(vars(self)).items():
            object.__setattr__(self, name, value)
        forces = {item.name: item.imposes is None for item in self.inputs}
        loops = check_feedback(tuple(self.feedback), forces, self.output_names)
        object.__setattr__(self, "feedback", loops)

    @cached_property
    def frame(self) -> Frame:
        """Which coordinates the equations of motion have, and how all places follow from them."""
        connections = (*self.springs, *self.dampers)
        return frame_of(self.dofs, self.ratios, connections, imposed_by(self.inputs))

    @cached_property
    def matrices(self) -> MechanicalMatrices:
        """Mass, damping and stiffness matrices, and the rows of the outputs; no effects."""
        return _assemble(self)

    def __getstate__(self) -> dict[str, Any]:
        # The cached matrices are made anew where they are needed.
        return {key: value for key, value in self.__dict__.items() if key != "matrices"}

    @property
    def dof_names(self) -> tuple[str, ...]:
        """Names of all degrees of freedom."""
        return tuple(dof.name for dof in self.dofs)

    @property
    def imposed(self) -> tuple[str, ...]:
        """Names of the coordinates whose motion an input imposes."""
        moved = imposed_by(self.inputs)
        return tuple(name for name in self.frame.coordinates if name in moved)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the coordinates that are no motion but a measured signal, which effects read.

        An input imposes them in a unit of its own, such as V, and nothing holds them.
        """
        parts = (*self.springs, *self.dampers, *self.ratios)
        held = {name for part in parts for name in part.between}
        held |= {name for output in self.outputs for name in output.of}
        return tuple(
            item.on[0]
            for item in self.inputs
            if item.imposes == DISPLACEMENT and item.on[0] not in held and item.gain == 1
            and item.unit not in (None, UNITS[self.is_rotational(item.on)][DISPLACEMENT])
        )  # fmt: skip

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the coordinates that move by the equations of motion."""
        moved = imposed_by(self.inputs)
        return tuple(name for name in self.frame.coordinates if name not in moved)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs: data columns."""
        return tuple(item.name for item in self.inputs)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs: data columns."""
        return tuple(item.name for item in self.outputs)

    @property
    def commands(self) -> tuple[str, ...]:
        """Names of what the feedback commands, loop by loop."""
        return tuple(name for loop in self.feedback for name in loop.drives)

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the inputs that a feedback commands."""
        return tuple(name for name in self.input_names if name in self.commands)

    @property
    def references(self) -> tuple[str, ...]:
        """Names of the columns that the feedback reads beside outputs."""
        asked = dict.fromkeys(name for loop in self.feedback for name in loop.columns)
        return tuple(name for name in asked if name not in self.commands)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what drives the model and its loops in a record: inputs, then references."""
        free = (name for name in self.input_names if name not in self.commands)
        return tuple(dict.fromkeys((*free, *self.references)))

    def dof(self, name: str) -> Dof:
        """Return the degree of freedom with this name.

        Parameters
        ----------
        name : str

        Returns
        -------
        Dof
        """
        return self.dofs[self.dof_names.index(name)]

    def is_rotational(self, at: Sequence[str]) -> bool:
        """Return whether a place is an angle; where a ratio joins its ends, whether the first is.

        Parameters
        ----------
        at : sequence of str
            Names of coordinates, or "ground".

        Returns
        -------
        bool
        """
        ends = self.frame.measured_at(at)
        return any(dof.rotational for dof in self.dofs if dof.name in ends)

    def unit_of(self, item: Input | Output) -> str:
        """Return the SI unit of an input or output of this model, before its gain.

        Parameters
        ----------
        item : Input or Output

        Returns
        -------
        str
        """
        if item.unit is not None:
            return item.unit
        if isinstance(item, Input):
            return UNITS[self.is_rotational(item.on)][item.imposes or "force"]
        return UNITS[self.is_rotational(item.of)][item.quantity]


# The numbers of a model, each by a key such as "spring[0].stiffness".

Model = TypeVar("Model", bound=MechanicalData)


def _numbers(model: MechanicalData) -> Iterator[tuple[str, float, str, int, str]]:
    """Yield each number: its key, its value, the field of the model, which part, its name there."""
    bare = {name for item in model.equations for name in item.coordinates}
    for i, dof in enumerate(model.dofs):
        if dof.mass or dof.name not in bare:
            yield ".".join(dof.key), dof.mass, "dofs", i, "mass"
    for what, (_, name, _) in CONNECTIONS.items():
        for i, part in enumerate(getattr(model, f"{what}s")):
            yield f"{what}[{i}].{name}", getattr(part, name), f"{what}s", i, name
    for i, item in enumerate(model.inputs):
        yield f"input.{item.name}.gain", item.gain, "inputs", i, "gain"
    for i, effect in enumerate((*model.equations, *model.effects), -len(model.equations)):
        where = "effects" if i >= 0 else "equations"
        for name, value in effect.values.items():
            yield (
                f"effect[{i}].{name}" if i >= 0 else f"parameter.{name}",
                value,
                where,
                max(i, 0),
                name,
            )
    for i, loop in enumerate(model.feedback):
        for name, value in loop.numbers().items():
            yield f"feedback[{i}].{name}", value, "feedback", i, name


def values(model: MechanicalData) -> dict[str, float]:
    """Every number of the model by its key."""
    return {key: value for key, value, *_ in _numbers(model)}


def with_parameter_values(model: Model, changes: Mapping[str, float]) -> Model:
    """Return `model` with the numbers of `changes` instead of its own."""
    known = {key: (now, at, i, name) for key, now, at, i, name in _numbers(model)}
    # fits ask thousands of times a second: what stays is neither made nor checked again
    new: dict[tuple[str, int], dict[str, float]] = {}
    for key, value in changes.items():
        one_of("values", key, known, "It has to be a key of model.parameters.")
        present, field_name, i, name = known[key]
        if type(value) is not float or value != present:
            new.setdefault((field_name, i), {})[name] = value
    found = copy(model)
    parts: dict[str, list[Any]] = {where: list(getattr(model, where)) for where, _ in new}
    for (where, i), numbers in new.items():
        if where[:-1] in CONNECTIONS:  # these parts check no numbers themselves
            numbers = {key: connection_number(where[:-1], i, v) for key, v in numbers.items()}
        part = parts[where][i]
        if isinstance(part, Effect):
            parts[where][i] = part.with_parameters(**numbers)
        elif isinstance(part, Equations):
            parts[where][i] = with_numbers(part, numbers)
        elif isinstance(part, Feedback):
            parts[where][i] = part.with_numbers(numbers)
        else:
            parts[where][i] = replace(part, **numbers)
    vars(found).update({where: tuple(items) for where, items in parts.items()})
    vars(found)["design"] = dict(model.design)
    if "ratios" in parts:
        del vars(found)["frame"]
    check_inertias(
        found.dofs, found.coupled_inertias, found.frame, imposed_by(found.inputs), found.equations
    )
    if "matrices" in vars(model) and parts.keys() <= {"effects", "feedback"}:
        vars(found)["matrices"] = model.matrices
    return found


# Least energy, as a share of that without couplings, that a fit leaves every motion.
_LEFT = 1e-3


def definite_coupling_share(model: MechanicalData, changes: Mapping[str, float]) -> float:
    """Return the share of all coupled inertias with which every motion has a kinetic energy.

    Parameters
    ----------
    model : MechanicalData
    changes : mapping of str to float
        Numbers instead of the model's own.

    Returns
    -------
    float
        1 if they can stay as they are.
    """
    new = {**values(model), **changes}
    dofs = [replace(dof, mass=new[".".join(dof.key)]) for dof in model.dofs]
    coupled = [
        replace(item, value=new[f"coupled_inertia[{k}].value"])
        for k, item in enumerate(model.coupled_inertias)
    ]
    here = [model.frame.coordinates.index(name) for name in model.free]
    M, D = (mass_matrix(dofs, part, model.frame)[here][:, here] for part in (coupled, ()))
    size = np.sqrt(np.diag(D))
    least = float(np.min(np.linalg.eigvalsh((M - D) / np.outer(size, size)), initial=0.0))
    return min(1.0, (1 - _LEFT) / -least) if least < 0 else 1.0


def unit_of(model: MechanicalData, key: str) -> str:
    """Return the SI unit of the number with a key of :func:`values`."""
    where, i, name = next((at, i, n) for k, _, at, i, n in _numbers(model) if k == key)
    part = getattr(model, where)[i]
    if where == "feedback":
        return _feedback_unit(model, part, name)
    if where in ("dofs", "inputs"):
        return part.unit if where == "dofs" else "1"
    if where == "effects":
        return effect_unit(model, part, name)
    if where == "equations":
        return number_unit(part, name)
    units = CONNECTIONS[where[:-1]][2]
    if where in ("springs", "dampers"):
        return units[model.is_rotational(part.between)]
    first, second = (model.is_rotational((end,)) for end in part.between)
    return units[first + second if where != "ratios" else (1 + first) * (first != second)]


def _feedback_unit(model: MechanicalData, loop: Feedback, name: str) -> str:
    """Return the unit of a number of a loop; of inner commands none is known."""
    units = {item.name: model.unit_of(item) for item in (*model.inputs, *model.outputs)}
    command = units.get(loop.drives[0], "1")
    of, _, which = name.rpartition(".")
    if which in ("lag", "delay"):
        return "s"
    if not of:
        return command if which == "limit" else f"{command}/s"
    compound = " " in units[of] or "/" in units[of]
    per = f"({units[of]})" if compound else units[of]
    forms = {"gain": "{0}/{1}", "integral": "{0}/({1} s)", "derivative": "{0} s/{1}"}
    return forms[which].format(command, per)


def effect_unit(model: MechanicalData, effect: Effect, name: str) -> str:
    """Return the SI unit of a parameter of an effect at its place in a model."""
    parameter = effect.definition.parameter(name)
    if parameter.dimension == "signal":
        signals = (*model.inputs, *model.outputs)
        return model.unit_of(next(item for item in signals if item.name == effect.at[0]))
    at = effect.at
    if effect.definition.domain == "path":
        at = next(item.on for item in model.inputs if item.name == at[0])
    return parameter.unit(model.is_rotational(at))


# Where effects pull on a mechanical model, and what they need to know of it.

_Pair = tuple[str, ...]
_SENSOR = "."
_PortMatrices = tuple[Array, Array, tuple[Array, Array, Array, Array]]


def port_row(model: MechanicalData, at: tuple[str, ...]) -> Array:
    """Return the row that gives the relative displacement at a pair from all coordinates."""
    return model.frame.row(at)


def port_rows(model: MechanicalData, effect: Effect) -> Array:
    """Return one row per port of an effect, read-only."""
    return _rows(model.frame, tuple(port_pairs(effect)))


@lru_cache(maxsize=256)
def _rows(frame: Frame, pairs: tuple[_Pair, ...]) -> Array:
    found = np.array([frame.row(pair) for pair in pairs])
    found.flags.writeable = False
    return found


def port_pairs(effect: Effect) -> list[_Pair]:
    """Return the two ends of each port of an effect."""
    definition = effect.definition
    channels = [(name, GROUND) for name, _ in definition.channels]
    if isinstance(definition, EquationKind):
        channels = [(GROUND, GROUND)] * definition.size[1]  # inputs are no places
    if definition.domain == "pair":
        return [effect.at, *channels]
    if definition.domain == "path":
        return [(_SENSOR, f"{_SENSOR}{effect.at[1]}")]  # no coordinate has such a name
    return [*((name, GROUND) for name in effect.at), *channels]


def port_matrices(
    m: MechanicalMatrices, outputs: Sequence[Output], rows: Array, pairs: Sequence[_Pair]
) -> _PortMatrices:
    """Return G, H and the motion map of forces along `rows` of the coordinates.

    `pairs` names the ends of each row; a force output between the same ends measures the
    force there.
    """
    Lq, Lv, Rq, Rv = m.motion_map
    acceleration = m.inverse_mass @ rows.T[m.free]
    G = np.vstack([np.zeros_like(acceleration), acceleration])
    H = m.Sa[:, m.free] @ acceleration
    for i, output in enumerate(outputs):
        for j, pair in enumerate(pairs):
            if pair == (_SENSOR, f"{_SENSOR}{output.name}"):
                H[i, j] = 1.0
        if output.quantity == FORCE and output.drive:
            H[i] -= rows[:, m.coordinates.index(output.of[0])]
        elif output.quantity == FORCE:
            for j, pair in enumerate(pairs):
                if set(pair) == set(output.of):
                    H[i, j] -= 1.0 if pair[0] == output.of[0] else -1.0
    return G, H, (rows @ Lq, rows @ Rq, rows @ Lv, rows @ Rv)


def effect_ports(model: MechanicalData) -> tuple[list[Effect], tuple[Array, ...], _PortMatrices]:
    """Return the effects that make forces, a row per port of each, and their `port_matrices`."""
    effects = [effect for _, effect in dynamic_effects(model)]
    pairs = tuple(tuple(port_pairs(effect)) for effect in effects)
    rows, (G, H, (Qs, Qw, Vs, Vw)) = _ports_at(model.matrices, model.frame, model.outputs, pairs)
    first, Qw = 0, Qw.copy()
    for effect in effects:
        columns = read_by(model, effect)
        behind = first + effect.definition.ports - len(columns)
        Qw[range(behind, behind + len(columns)), columns] = _gains(model)[columns]
        first += effect.definition.ports
    return effects, rows, (G, H, (Qs, Qw, Vs, Vw))


def read_by(model: MechanicalData, effect: Effect) -> list[int]:
    """Return which force inputs the last ports of an effect read."""
    if isinstance(effect.definition, EquationKind):
        return equation_inputs(model, model.equations[0])
    if effect.definition.domain == "path":
        return [model.matrices.force_inputs.index(effect.at[0])]
    return []


def equation_inputs(model: MechanicalData, equations: Equations) -> list[int]:
    """Return the force inputs as the law of equations has them: those that they read first."""
    first = _read(model, equations)
    return first + [j for j in range(model.matrices.B.shape[1]) if j not in first]


def _gains(model: MechanicalData) -> Array:
    return np.array([item.gain for item in model.inputs if item.imposes is None])


@lru_cache(maxsize=32)
def _ports_at(
    m: MechanicalMatrices,
    frame: Frame,
    outputs: tuple[Output, ...],
    pairs: tuple[tuple[_Pair, ...], ...],
) -> tuple[tuple[Array, ...], _PortMatrices]:
    """Return the rows and matrices of effects at these places; fits vary their numbers only."""
    rows = tuple(_rows(frame, each) for each in pairs)
    stacked = np.vstack([np.zeros((0, len(m.coordinates))), *rows])
    return rows, port_matrices(m, outputs, stacked, [pair for each in pairs for pair in each])


def dynamic_effects(model: MechanicalData) -> list[tuple[int, Effect]]:
    """Return the effects that make forces, with their positions in the model.

    Before them is what the linear part of equations of motion leaves, at -1.
    """
    found = [(i, e) for i, e in enumerate(model.effects) if e.definition.law is not None]
    for item in model.equations:
        names, free = model.frame.coordinates, model.free
        others = (*free, *(name for name in names if name not in free))
        others = tuple(name for name in others if name not in item.coordinates)
        count = model.matrices.B.shape[1]
        found.insert(0, (-1, effect_of(item, others, len(free), count)))
    return found


def connected(model: MechanicalData, *, signals: bool = False) -> list[set[str]]:
    """Return the chains of a model: coordinates that springs, dampers, ratios and effects join.

    With `signals` an input that pushes two coordinates and an output that sees several join them.
    """
    groups = [{name} for name in model.dof_names if name not in model.channels]
    joints = [p.between for what in CONNECTIONS for p in getattr(model, f"{what}s")]
    joints += [e.at for e in model.effects]
    joints += [tuple(item.coordinates) for item in model.equations]
    if signals:
        joints += [*(i.on for i in model.inputs), *(o.of for o in model.outputs)]
        for loop in model.feedback:
            seen, names = (
                {*loop.drives, *(t.of for t in loop.terms)},
                (*model.inputs, *model.outputs),
            )
            places = (p.on if isinstance(p, Input) else p.of for p in names if p.name in seen)
            joints.append(tuple(end for place in places for end in place))
    for joint in joints:
        ends = {name for name in joint if name in model.dof_names}
        touched = [g for g in groups if g & ends]
        if len(touched) > 1:
            groups = [g for g in groups if not g & ends] + [set().union(*touched)]
    return groups


def linear_model(model: Model) -> Model:
    """Return a model without effects, its equations of motion as their linear part.

    It is for runs of observers: no file can hold it.
    """
    if not model.equations:
        return replace(model, effects=()) if model.effects else model
    found = copy(model)
    vars(found).update(effects=(), equations=(), matrices=model.matrices)
    return found


def inertia_of(model: MechanicalData, turning: bool) -> float:
    """Return the sum of all masses, or of all inertias that turn, equations of motion included."""
    known = sum(dof.mass for dof in model.dofs if dof.rotational == turning)
    for item in model.equations:
        diagonal = np.diag(linear_part(item)[0]).tolist()
        units = item.coordinates.values()
        known += sum(
            x for x, unit in zip(diagonal, units, strict=True) if (unit == "rad") == turning
        )
    return known


def heaviest(model: MechanicalData) -> dict[str, Dof]:
    """Return for each coordinate the mass that counts most: data show the sum of those it moves."""
    tied = model.frame.multiples
    rising = sorted(model.dofs, key=lambda dof: dof.mass * tied[dof.name][1] ** 2)
    most = {tied[dof.name][0]: dof for dof in rising}
    return {name: most[name] for name in model.frame.coordinates}


def context_values(model: MechanicalData, effect: Effect, step: float) -> list[float]:
    """Return what an effect's law needs to know of the model, in the order it asked for."""
    if not effect.definition.context:
        return []
    found = context_of(model, effect.at, step, effect)
    return [found[name] for name in effect.definition.context]


def context_of(
    model: MechanicalData, at: tuple[str, ...], step: float, effect: Effect | None = None
) -> Mapping[str, float]:
    """Return what effects at a place may ask of their model, see `EffectKind.context`."""
    if effect is not None and isinstance(effect.definition, EquationKind):
        item, order = model.equations[0], [model.frame.coordinates.index(name) for name in at]
        columns = equation_inputs(model, item)
        gains, own = _gains(model)[columns], linear_part(item)
        B = np.hstack([own[3], np.zeros((item.n, len(columns) - len(item.inputs)))])
        whole = replace(model.matrices, B=model.matrices.B[:, columns] / gains)
        given = context(item, (*own[:3], B), whole, np.array(order))
        return dict(zip(effect.definition.context, given, strict=True))
    ends = {*at, "ground"} if len(at) == 1 else set(at)
    stiffness = sum(s.stiffness for s in model.springs if set(s.between) == ends)
    # how easily the place gives way to equal forces on its ends
    pushed = model.frame.row(at)[model.matrices.free]
    inverse_mass = float(np.diag(model.matrices.inverse_mass) @ pushed**2)
    found = {
        "clearance": 0.0,
        "spring_stiffness": float(stiffness),
        "spin_frequency": 2 * np.pi * (model.spin_frequency or 0.0),
        "mobility": step * inverse_mass,
        "step": step,
    }
    seen = next((o.quantity for o in model.outputs if o.name == at[-1]), DISPLACEMENT)
    found["derivative"] = float(_DERIVATIVES.get(seen, 0))
    for effect in model.effects:
        if set(effect.at) == ends:
            for name, parameter in effect.definition.gives:
                found[name] = found.get(name, 0.0) + effect.values[parameter]
    return found


_DERIVATIVES = {VELOCITY: 1, ACCELERATION: 2}
_REMEDIES = {
    "spring_stiffness": "Add rp.Spring({at}, k) first.",
    "spin_frequency": "Build the model with spin_frequency=, in Hz.",
}


def refuse_idle(model: MechanicalData, effect: Effect) -> None:
    """Refuse an effect that lacks in the model what it works through."""
    needed, at = effect.definition.idle_without, effect.at
    # elastic friction at the same place takes the clearance for its own
    others = (e for e in model.effects if "clearance" in e.definition.context)
    if not needed or any(set(e.at) == set(at) for e in others):
        return
    if not context_of(model, at, 0.0)[needed]:
        what = f"{needed.replace('_', ' ')} there, without which it does nothing"
        raise invalid((effect.kind, "at"), at, what, _REMEDIES[needed].format(at=at))


def motion_at(
    model: MechanicalData,
    effect: Effect,
    time: Array,
    q: Array,
    v: Array,
    step: float = 0.0,
    inputs: Array | None = None,
) -> Motion:
    """Return what an effect sees of a motion at its place.

    Parameters
    ----------
    model : MechanicalData
    effect : Effect
    time : ndarray, shape (samples,)
    q, v : ndarray, shape (coordinates, samples)
        Displacements and velocities of all coordinates.
    step : float, optional
        Time step that a law has to resolve; along a known motion it is none.
    inputs : ndarray, shape (samples, signals), optional
        Which equations of motion and paths read.
    """
    rows = port_rows(model, effect)
    seen, columns = rows @ q, read_by(model, effect)
    if columns and inputs is not None:
        seen[-len(columns) :] = (inputs[:, columns] * _gains(model)[columns]).T
    return Motion(time, seen, rows @ v, context_of(model, effect.at, step, effect))
