"""A mechanical model with its effects, linearised about a state of rest, for synthesis."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AnyArray, Array, Matrix
from robustpolish.base.checks import closest_name_remedy, described, invalid, one_of
from robustpolish.base.results import Card, Table
from robustpolish.errors import RobustPolishWarning
from robustpolish.machines.mechanical.data import (
    MechanicalData,
    unit_of,
    values,
    with_parameter_values,
)
from robustpolish.machines.mechanical.effect_linearization import (
    add_timing,
    linear_with_effects,
    sensor_gains,
    signal_gains,
    signal_timing,
)
from robustpolish.machines.mechanical.parts import (
    ACCELERATION,
    DISPLACEMENT,
    UNITS,
    VELOCITY,
    MechanicalMatrices,
    Output,
)
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.lft import (
    Lft,
    RealElement,
    UncertainBlock,
    real_element,
    reduce_copies,
)
from robustpolish.plants.uncertain.system import UncertainSystem, close_block
from robustpolish.signals.frequency_response import labelled_response, ratio_unit

# How a mechanical model shows itself.

COLUMNS = ("part", "at", "quantity", "value", "unit")


def mechanical_card(model: MechanicalData) -> Card:
    """List masses, springs, dampers and effects, and the signals that drive and leave a model."""
    rows: list[tuple[Any, ...]] = []
    for dof in model.dofs:
        if dof.name in model.channels:  # no mass, and no motion
            continue
        name = dof.key[-1]
        rows.append((name, dof.name, name, dof.mass, dof.unit))
    parts = [
        (f"{what}[{i}]", what.replace("_", " "), part.between)
        for what in ("spring", "damper", "coupled_inertia")
        for i, part in enumerate(getattr(model, f"{what}s"))
    ]
    parts += [(f"effect[{i}]", e.kind, e.at) for i, e in enumerate(model.effects)]
    numbers = values(model)
    for start, part, at in parts:
        for key in (key for key in numbers if key.startswith(f"{start}.")):
            name = key.removeprefix(f"{start}.")
            rows.append((part, _joined(at), name, float(numbers[key]), unit_of(model, key)))
    signals: list[tuple[Any, ...]] = []
    for item in model.inputs:
        channel = item.imposes and item.on[0] in model.channels
        what = ("", "channel") if channel else (_joined(item.on), item.imposes or "force")
        signals.append(("input", item.name, *what, model.unit_of(item)))
    for out in model.outputs:
        signals.append(("output", out.name, _seen(out), out.quantity, model.unit_of(out)))
    columns = ("signal", "name", "at", "quantity", "unit")
    tables = [Table("", COLUMNS, tuple(rows)), Table("", columns, tuple(signals))]
    if model.spin_frequency is not None:
        tables.append(Table("", (), (("spin [Hz]", model.spin_frequency),)))
    return Card(f"Mechanical model {model.name}".rstrip(), tuple(tables))


def _seen(item: Output) -> str:
    """Return where an output measures, or the sum that it sees."""
    if item.weights is None:
        return _joined(item.of)
    terms = zip(item.weights, item.of, strict=True)
    return " ".join(f"{weight:+.4g} {name}" for weight, name in terms).removeprefix("+")


def _joined(places: tuple[str, ...]) -> str:
    return " - ".join(places)


# The response of a mechanical model over frequency, effects linearised about a state of rest.

_ORDER = {DISPLACEMENT: 0, VELOCITY: 1, ACCELERATION: 2}
_HELD = "input_hold"


def frequency_response(
    model: MechanicalData,
    frequency: ArrayLike,
    operating_point: Mapping[str, float] | None,
    sampling_time: float | None,
) -> xr.DataArray:
    """Return the response; see :meth:`MechanicalModel.frequency_response`."""
    lines = np.asarray(frequency, dtype=float)
    if lines.ndim != 1 or not np.isfinite(lines).all():
        shown = described(f"an array of shape {lines.shape}")
        raise invalid("frequency", shown, "finite numbers in Hz", "Pass a list of frequencies.")
    if not model.inputs or not model.outputs:
        shown = described("a model without inputs or outputs")
        raise invalid("model", shown, "one of each", "Say where it is driven and measured.")
    total, notes = response_values(model, lines, operating_point, sampling_time)
    units = [[ratio_unit(model.unit_of(o), model.unit_of(i)) for i in model.inputs]
             for o in model.outputs]  # fmt: skip
    return labelled_response(
        lines, total, model.output_names, model.input_names, units, notes=notes
    )


def response_values(
    model: MechanicalData,
    lines: Array,
    operating_point: Mapping[str, float] | None = None,
    sampling_time: float | None = None,
) -> tuple[AnyArray, list[str]]:
    """Return the response, shape (lines, outputs, inputs), and notes; nothing is checked."""
    system, notes = linear_system(model, operating_point)
    s = 2j * np.pi * lines
    values = _at(s, *system) * sensor_gains(model)[:, None] * signal_gains(model)
    values = values * signal_timing(model, s)[:, None, :]
    total = _over_inputs(model, values, s)
    total *= _holds(model, s, sampling_time, notes)[:, None, :]
    return total, notes


def linear_system(
    model: MechanicalData, operating_point: Mapping[str, float] | None = None
) -> tuple[tuple[Array, Array, Array, Array], list[str]]:
    """Return A, B, C, D from signals to outputs, and what of the effects has no linear part.

    What effects on signals do is not in it.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RobustPolishWarning)
        A, B, C, D, _ = linear_with_effects(model, operating_point)
    return (A, B, C, D), list(dict.fromkeys(str(item.message) for item in caught))


def _at(s: AnyArray, A: Array, B: Array, C: Array, D: Array) -> AnyArray:
    """Return C (s - A)^-1 B + D, shape (lines, outputs, signals); NaN at an undamped pole."""
    pencil = s[:, None, None] * np.eye(len(A)) - A
    values = np.empty((s.size, *D.shape), dtype=complex)
    try:
        values[:] = C @ np.linalg.solve(pencil, B.astype(complex)[None]) + D
    except np.linalg.LinAlgError:  # a line right on an undamped pole, such as 0 Hz of a free mass
        for k in range(s.size):
            singular = np.linalg.cond(pencil[k]) > 1 / np.finfo(float).eps
            values[k] = np.nan if singular else C @ np.linalg.solve(pencil[k], B) + D
    return values


def _over_inputs(model: MechanicalData, values: AnyArray, s: AnyArray) -> AnyArray:
    """Put the signals of each input together: an imposed motion has its derivatives too."""
    m = model.matrices
    total = np.zeros((*values.shape[:2], len(model.inputs)), dtype=complex)
    forces = len(m.force_inputs)
    for j, item in enumerate(model.inputs):
        if item.imposes is None:
            total[..., j] = values[..., m.force_inputs.index(item.name)]
            continue
        coordinate = model.dof_names.index(item.on[0])
        for k, signal in enumerate(m.imposed_signals, forces):
            if signal.coordinate == coordinate:
                power = _ORDER[signal.quantity] - _ORDER[item.imposes]
                with np.errstate(divide="ignore", invalid="ignore"):
                    factor = s**power * (item.gain / signal.gain)
                total[..., j] += values[..., k] * factor[:, None]
    return total


def _holds(
    model: MechanicalData, s: AnyArray, sampling_time: float | None, notes: list[str]
) -> Array:
    """Return what holding an input between samples does to it, shape (lines, inputs)."""
    factors = np.ones((s.size, len(model.inputs)), dtype=complex)
    for effect in model.effects:
        if effect.kind != _HELD or effect.values["order"] == 3.0:
            continue
        if sampling_time is None:
            notes.append(f"{effect} left out: the sampling time is not known")
            continue
        half = np.imag(s) * sampling_time / 2
        kept = np.sinc(half / np.pi)
        zero_order = kept * np.exp(-1j * half)
        j = model.input_names.index(effect.at[0])
        factors[:, j] *= zero_order if effect.values["order"] == 0.0 else kept**2
    return factors


def linearize(
    model: MechanicalData,
    controls: Sequence[str] | None,
    actuation: Literal["force", "displacement"],
    measured: Literal["outputs", "state", "displacement"],
    operating_point: Mapping[str, float] | None,
) -> GeneralizedPlant:
    """Return the plant; see :meth:`MechanicalModel.linearize`."""
    one_of("actuation", actuation, ("force", "displacement"))
    one_of("measured", measured, ("outputs", "state", "displacement"))
    if not model.free:
        shown = described("a model whose whole motion is imposed")
        raise invalid("model", shown, "a free coordinate", "There is nothing to control.")
    m = model.matrices
    names, nf = model.free, len(model.free)
    A, B, C, D, own = linear_with_effects(model, operating_point)
    disturbances = list(m.signals)
    pushes, chosen, B2, D22 = _controls(model, controls, actuation, A.shape[0])
    B *= signal_gains(model)
    C, D, D22 = (sensor_gains(model)[:, None] * M for M in (C, D, D22))
    if chosen:
        taken = [disturbances.index(name) for name in chosen]
        B2, D22 = np.hstack([B[:, taken], B2]), np.hstack([D[:, taken], D22])
        keep = [i for i, name in enumerate(disturbances) if name not in chosen]
        B, D, disturbances = B[:, keep], D[:, keep], [disturbances[i] for i in keep]
    states = [*names, *(f"d{name}" for name in names), *own]
    inputs = [*disturbances, *chosen]
    A, both, C, through, more = add_timing(
        model, inputs, A, np.hstack([B, B2]), C, np.hstack([D, D22])
    )
    nw = len(disturbances)
    states += more
    order = [i for k in range(nf) for i in (k, nf + k)] + list(range(2 * nf, len(states)))
    A, both, C = A[np.ix_(order, order)], both[order], C[:, order]
    states = [states[i] for i in order]
    position = np.zeros((nf, len(states)))
    position[range(nf), range(0, 2 * nf, 2)] = 1.0
    if measured != "outputs":
        C = np.eye(len(states)) if measured == "state" else position
        through = np.zeros((len(C), both.shape[1]))
        measurements = states if measured == "state" else list(names)
    else:
        measurements = list(model.output_names)
    if not len(C):
        measurements = []
    labels = [f"measured_{name}" for name in measurements]
    units = _units(model, states, labels, measured, actuation, pushes)
    return GeneralizedPlant.from_matrices(
        A,
        both[:, :nw],
        both[:, nw:],
        position,
        C,
        D21=through[:, :nw],
        D22=through[:, nw:],
        states=states,
        disturbances=disturbances,
        controls=[*chosen, *(f"u_{name}" for name in pushes)],
        performance=list(names),
        measurements=labels,
        units=units,
    )


def _controls(
    model: MechanicalData, controls: Sequence[str] | None, actuation: str, n: int
) -> tuple[list[str], list[str], Matrix, Matrix]:
    """Return coordinates and inputs that are controls, and B2 and D22 of the former."""
    wanted = list(model.free) if controls is None else list(controls)
    signals = model.matrices.signals
    known = [*model.free, *signals]
    for name in wanted:
        if name not in known:
            raise invalid("controls", name, f"names among {', '.join(known)}", "Correct it.")
    chosen = [name for name in wanted if name in signals and name not in model.free]
    pushes = [name for name in wanted if name in model.free]
    m, nf = model.matrices, len(model.free)
    B2, D22 = np.zeros((n, len(pushes))), np.zeros((len(model.outputs), len(pushes)))
    for column, name in enumerate(pushes):
        row = model.free.index(name)
        if actuation == "displacement":
            B2[row, column] = 1.0
            continue
        B2[nf : 2 * nf, column] = m.inverse_mass[:, row]
        D22[:, column] = m.Sa[:, m.free] @ m.inverse_mass[:, row]
    return pushes, chosen, B2, D22


def _units(
    model: MechanicalData,
    states: Sequence[str],
    labels: Sequence[str],
    measured: str,
    actuation: str,
    pushes: Sequence[str],
) -> dict[str, str]:
    units: dict[str, str] = {}
    for name in model.free:
        kind = UNITS[model.dof(name).rotational]
        units |= {name: kind["displacement"], f"d{name}": kind["velocity"]}
        if name in pushes:
            units[f"u_{name}"] = kind["force" if actuation == "force" else "velocity"]
    if measured == "outputs":
        units |= {f"measured_{o.name}": model.unit_of(o) for o in model.outputs}
    else:
        units |= {f"measured_{name}": units[name] for name in states if name in units}
    for item in model.inputs:
        units.setdefault(item.name, model.unit_of(item))
    known = {*states, *labels, *model.matrices.signals, *model.free}
    known |= {f"u_{name}" for name in pushes}
    return {name: unit for name, unit in units.items() if name in known}


# A mechanical model with numbers that are known within bounds only, as an uncertain system.

# Size of a singular value, relative, below which it is the rounding of a difference.
_NOTHING = 1e-12
# Before the name of an element in whose place a number made of others is put.
_STAND_IN = "value of "


def uncertain_model(model: MechanicalData, ranges: Mapping[str, Any]) -> UncertainSystem:
    """Return the linear part with uncertain numbers; see :meth:`MechanicalModel.uncertain`.

    Every number enters the forces and outputs linearly, a mass by the acceleration: the force and
    output that come with its change are a few signals that go through its delta.
    """
    if not isinstance(ranges, Mapping):
        remedy = 'Write {"spring[0].stiffness": 0.1} for 10 %.'
        raise invalid("ranges", ranges, "a mapping of keys to ranges", remedy)
    given = dict(ranges)
    numbers = {key: value for key, value in given.items() if isinstance(value, UncertainSystem)}
    model = with_parameter_values(
        model, {key: _nominal(model, key, n) for key, n in numbers.items()}
    )
    elements = [_element(model, key, value) for key, value in given.items()]
    m = model.matrices
    pieces = [_pieces(model, element) for element in elements]
    forces = np.hstack([np.zeros((len(m.coordinates), 0)), *(left[0] for left, _ in pieces)])
    motions = [np.vstack([np.zeros((0, M.shape[1])), *(right[i] for _, right in pieces)])
               for i, M in enumerate((m.Sq, m.Sv, m.Sa))]  # fmt: skip
    deltas, first = forces.shape[1], len(m.force_inputs)
    wider = replace(
        m,
        B=np.hstack([forces, m.B]),
        Sq=np.vstack([motions[0], m.Sq]),
        Sv=np.vstack([motions[1], m.Sv]),
        Sa=np.vstack([motions[2], m.Sa]),
        force_inputs=(*(f"w[{i}]" for i in range(deltas)), *m.force_inputs),
        outputs=(*(f"z[{i}]" for i in range(deltas)), *m.outputs),
    )
    A, B, C, D = wider.first_order()
    if deltas:
        D[deltas:, :deltas] += np.hstack([left[1] for left, _ in pieces])
        D[:deltas, deltas : deltas + first] += np.vstack([right[3] for _, right in pieces])
    copies = np.array([left[0].shape[1] for left, _ in pieces], dtype=int)
    scale, skew = (np.repeat([getattr(e, n) for e in elements], copies) for n in ("slope", "skew"))
    # w = slope delta z / (1 - skew delta), as a fraction of the delta.
    C[:deltas] *= scale[:, None]
    D[:deltas] *= scale[:, None]
    whole = Lft(
        np.block([[A, B[:, :deltas]], [C[:deltas], D[:deltas, :deltas] + np.diag(skew)]]),
        np.vstack([B[:, deltas:], D[:deltas, deltas:]]),
        np.hstack([C[deltas:], D[deltas:, :deltas]]),
        D[deltas:, deltas:],
        m.states,
        tuple(UncertainBlock(_renamed(element, numbers), count)
              for element, count in zip(elements, copies.tolist(), strict=True) if count),
        0,
        m.signals,
        m.outputs,
    )  # fmt: skip
    for key, number in numbers.items():
        whole = _with_number(whole, key, number)
    return UncertainSystem(reduce_copies(whole))


def _nominal(model: MechanicalData, key: str, number: UncertainSystem) -> float:
    """Return the nominal value of a number that is made of others; also refuse a wrong key."""
    _known(model, key)
    if number.shape != (1, 1) or not number.is_static:
        shown = described(f"an uncertain system, {number.shape[0]} x {number.shape[1]}")
        raise invalid(("ranges", key), shown, "an uncertain number", "Make it of uncertain_real.")
    return float(number.matrices.J[0, 0])


def _with_number(whole: Lft, key: str, number: UncertainSystem) -> Lft:
    """Put a number that is made of others in place of one of slope 1."""
    names = [block.element.name for block in whole.blocks]
    if _STAND_IN + key not in names:
        return whole  # it does nothing
    change = number - number.matrices.J
    return close_block(whole, names.index(_STAND_IN + key), change.matrices)


def _renamed(element: RealElement, numbers: Mapping[str, Any]) -> RealElement:
    """Return the element that stands in for a number made of others by a name of its own."""
    own = element.name in numbers
    return replace(element, name=_STAND_IN + element.name) if own else element


def _known(model: MechanicalData, key: str) -> float:
    """Return the value of a number that may be uncertain."""
    known = values(model)
    if key not in known:
        remedy = closest_name_remedy(key, known)
        raise invalid("ranges", key, f"a key of model.parameters: {', '.join(known)}", remedy)
    if key.startswith("effect["):
        shown = described(f"{key}, a number of an effect")
        expected = "numbers of masses, springs, dampers and gains"
        raise invalid("ranges", shown, expected, "Put the linear part of the effect into a spring.")
    imposing = {f"input.{item.name}.gain" for item in model.inputs if item.imposes}
    if key in imposing:
        shown = described(f"{key}, of an imposed motion")
        remedy = "Multiply the system by an uncertain_real."
        raise invalid("ranges", shown, "gains of forces", remedy)
    return known[key]


def _element(model: MechanicalData, key: str, given: Any) -> RealElement:
    """Return the element of a number: a share of it, or its smallest and largest value."""
    nominal = _known(model, key)
    if isinstance(given, UncertainSystem):
        return RealElement(key, nominal, nominal - 1, nominal + 1)  # of slope 1
    if isinstance(given, tuple | list | np.ndarray):
        return real_element(key, nominal, low_high=tuple(given))  # type: ignore
    if not isinstance(given, int | float | np.number) or isinstance(given, bool):
        expected = "a share such as 0.1, (low, high), or an uncertain number"
        raise invalid(("ranges", key), given, expected, "Write 0.1 for 10 %.")
    if nominal == 0:
        shown = described(f"a share of {key}, which is 0")
        raise invalid(("ranges", key), shown, "(low, high)", "Give both ends in its own unit.")
    if key.startswith("dof.") and given >= 1:
        raise invalid(("ranges", key), given, "a share below 1", "A mass stays positive.")
    return real_element(key, nominal, percent=100 * float(given))


def _pieces(
    model: MechanicalData, element: RealElement
) -> tuple[tuple[Matrix, Matrix], tuple[Matrix, Matrix, Matrix, Matrix]]:
    """Return what forces and outputs come with a change of a number, and of what motions."""
    # All matrices are linear in every number: a difference is a derivative.
    step = element.nominal or 1.0
    moved = with_parameter_values(model, {element.name: element.nominal + step}).matrices
    m = model.matrices
    if len(moved.signals) != len(m.signals):
        raise _coupled(element)
    n, outputs = len(m.coordinates), len(m.outputs)
    inputs = m.B.shape[1]
    change = np.zeros((n + outputs, 3 * n + inputs))
    for columns, name, out in ((0, "K", "Sq"), (n, "C", "Sv"), (2 * n, "M", "Sa")):
        change[:n, columns : columns + n] = -_slope(moved, m, name, step)
        change[n:, columns : columns + n] = _slope(moved, m, out, step)
    change[:n, 3 * n :] = _slope(moved, m, "B", step)
    change[m.imposed] = 0.0  # their motion is given, whatever force it takes
    if change[:n, 2 * n + m.imposed].any():
        raise _coupled(element)
    U, sizes, V = np.linalg.svd(change)
    rank = int(np.count_nonzero(sizes > _NOTHING * sizes.max(initial=0.0)))
    left, right = U[:, :rank], sizes[:rank, None] * V[:rank]
    return (left[:n], left[n:]), (
        right[:, :n],
        right[:, n : 2 * n],
        right[:, 2 * n : 3 * n],
        right[:, 3 * n :],
    )


def _coupled(element: RealElement) -> Exception:
    shown = described(f"{element.name}, which couples to an imposed motion")
    return invalid("ranges", shown, "inertias of free coordinates", "Leave it certain.")


def _slope(moved: MechanicalMatrices, m: MechanicalMatrices, name: str, step: float) -> Matrix:
    return (getattr(moved, name) - getattr(m, name)) / step
