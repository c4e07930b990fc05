"""A mechanical model with its effects, linearised about a state of rest, for synthesis."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Literal

import control
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.signal import tf2ss

from robustpolish.base.arrays import AnyArray, Array, Matrix
from robustpolish.base.checks import closest_name_remedy, described, invalid, misfit, one_of
from robustpolish.base.results import Card, Table
from robustpolish.errors import RobustPolishWarning
from robustpolish.linear.arithmetic.dual_numbers import plus, times
from robustpolish.linear.systems import named_system, resolvent_response
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import SignalSlope
from robustpolish.machines.mechanical.data import (
    NO_INPUT,
    MechanicalData,
    Model,
    context_values,
    effect_ports,
    unit_of,
    values,
    with_parameter_values,
)
from robustpolish.machines.mechanical.equations import (
    EquationKind,
    Equations,
    linear_part,
    number_unit,
    slopes_at,
)
from robustpolish.machines.mechanical.parts import (
    ACCELERATION,
    DISPLACEMENT,
    UNITS,
    VELOCITY,
    number,
)
from robustpolish.plants.linearization import difference
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain import lft
from robustpolish.plants.uncertain.build import feedback, uncertain_real, with_states
from robustpolish.plants.uncertain.system import UncertainSystem, as_uncertain, close_block
from robustpolish.signals.frequency_response import labelled_response, ratio_unit

# How a mechanical model shows itself.

COLUMNS = ("part", "at", "quantity", "value", "unit")


def mechanical_card(model: MechanicalData) -> Card:
    """List masses, springs, dampers and effects, and the signals that drive and leave a model."""
    # a channel has no mass, and no motion
    own = [name for item in model.equations for name in item.coordinates]
    none = [dof.name for dof in model.dofs if not dof.mass and dof.name in own]
    masses = [dof for dof in model.dofs if dof.name not in (*model.channels, *none)]
    rows = [(dof.key[-1], dof.name, dof.key[-1], dof.mass, dof.unit) for dof in masses]
    parts = [
        (f"{what}[{i}].", what.replace("_", " "), part.between)
        for what in ("spring", "damper", "coupled_inertia", "ratio")
        for i, part in enumerate(getattr(model, f"{what}s"))
    ]
    parts += [(f"effect[{i}].", e.kind, e.at) for i, e in enumerate(model.effects)]
    parts += [(f"feedback[{i}].", "feedback", f.drives) for i, f in enumerate(model.feedback)]
    numbers = values(model)
    rows += [
        (part, " - ".join(at), key.removeprefix(start), float(numbers[key]), unit_of(model, key))
        for start, part, at in parts
        for key in numbers
        if key.startswith(start)
    ]
    rows += [
        ("parameter", "known" if name in item.known else "", name, value, number_unit(item, name))
        for item in model.equations
        for name, value in item.values.items()
    ]
    read = [name for equations in model.equations for name in equations.inputs]
    signals: list[tuple[Any, ...]] = []
    for item in model.inputs:
        channel = item.imposes and item.on[0] in model.channels
        what = ("", "channel") if channel else (" - ".join(item.on), item.imposes or "force")
        what = ("equations", "") if item.name in read else what
        signals.append(("input", item.name, *what, model.unit_of(item)))
    for out in model.outputs:
        seen = " - ".join(out.of)
        if out.weights is not None:
            terms = zip(out.weights, out.of, strict=True)
            seen = " ".join(f"{weight:+.4g} {name}" for weight, name in terms).removeprefix("+")
        signals.append(("output", out.name, seen, out.quantity, model.unit_of(out)))
    columns = ("signal", "name", "at", "quantity", "unit")
    tables = [Table("", COLUMNS, tuple(rows)), Table("", columns, tuple(signals))]
    laws = [] if not read and not own else [model.equations[0].law]
    lines = tuple(laws[0].items()) if laws and not callable(laws[0]) else ()
    tables += [Table("", ("equation of", "formula"), lines)] * bool(lines)
    if model.spin_frequency is not None:
        tables.append(Table("", (), (("spin [Hz]", model.spin_frequency),)))
    return Card(f"Mechanical model {model.name}".rstrip(), tuple(tables))


def state_space(model: MechanicalData) -> control.StateSpace:
    """Return the linear part; see :meth:`MechanicalModel.state_space`."""
    if not any(item.states for item in model.equations):
        return model.matrices.state_space()
    bare, m = replace(model, effects=()), model.matrices
    *matrices, states = linear_with_effects(bare, None)
    return named_system(
        tuple(matrices), 0, m.signals or (NO_INPUT,), m.outputs, (*m.states, *states)
    )


# The slopes of the effects at a state of rest, and what delays and gains do to signals.

_PHASES = 16
_PADE_ORDER = 2
_STAYS = 1e-3
"""Share of the forces that a displacement makes below which another one is none."""


def linear_with_effects(
    model: MechanicalData, operating_point: Mapping[str, float] | None
) -> tuple[Array, Array, Array, Array, list[str]]:
    """Return A, B, C, D from the signals to the outputs, all effects that make forces linearised.

    The forces f and internal states z of the effects are linear in the motion at their ports, and
    the loops from the motion to the forces are closed::

        f  = Fq q + Fv v + Fz z          q = Qs s + Qw w
        z' = Dq q + Dv v + Dz z          v = Vs s + Vw w

    Parameters
    ----------
    model : MechanicalData
    operating_point : mapping of str to float or None
        Displacements at rest; None for the equilibrium.

    Returns
    -------
    A, B, C, D : ndarray
        The effects' states follow the model's.
    states : list of str
        Names of the effects' states.
    """
    model = about(model, operating_point)
    placed, ports, (G, H, (Qs, Qw, Vs, Vw)) = effect_ports(model)
    rest = _rest(model, placed, ports, operating_point)
    slopes = [[np.zeros((0, 0))] * 6]
    for effect, here in zip(placed, ports, strict=True):
        slopes.append(_slopes(model, effect, here @ rest))
    Fq, Fv, Fz, Dq, Dv, Dz = (np.array(block_diag(*parts)) for parts in zip(*slopes, strict=True))
    A, B, C, D = model.matrices.first_order()
    by_s, by_w = Fq @ Qs + Fv @ Vs, Fq @ Qw + Fv @ Vw
    states = [name for item in model.equations for name in item.states]
    states += [
        f"{effect.kind}_{i}_{k + 1}"
        for i, effect in enumerate(placed[len(model.equations) :], 1)
        for k in range(effect.definition.states)
    ]
    return (
        np.block([[A + G @ by_s, G @ Fz], [Dq @ Qs + Dv @ Vs, Dz]]),
        np.vstack([B + G @ by_w, Dq @ Qw + Dv @ Vw]),
        np.hstack([C + H @ by_s, H @ Fz]),
        D + H @ by_w,
        states,
    )


def about(model: Model, operating_point: Mapping[str, float] | None) -> Model:
    """Return a model whose equations of motion have their linear part about this point."""
    for item in model.equations:
        known = {**item.coordinates, **item.states, **item.inputs}
        inside = {key: x for key, x in (operating_point or {}).items() if key in known}
        if inside:
            return replace(model, equations=(replace(item, start={**item.start, **inside}),))
    return model


def _rest(
    model: MechanicalData,
    effects: Sequence[Effect],
    ports: Sequence[Array],
    operating_point: Mapping[str, float] | None,
) -> Array:
    """Return the displacements of all coordinates at rest."""
    names = model.frame.coordinates
    q = np.zeros(len(names))
    if operating_point is not None or model.equations:
        read = [name for item in model.equations for name in (*item.inputs, *item.states)]
        for name, value in (operating_point or {}).items():
            one_of("operating_point", name, (*names, *read), "Correct it.")
            if name in names:
                q[names.index(name)] = number(f"operating_point[{name!r}]", value)
        for item in model.equations:
            at = [names.index(name) for name in item.coordinates]
            q[at] = [item.start.get(name, 0.0) for name in item.coordinates]
            pull = slopes_at(item).f - ((model.matrices.K @ q)[at] - linear_part(item)[2] @ q[at])
            for effect, here in zip(effects[1:], ports[1:], strict=True):
                still = np.r_[here @ q, np.zeros(len(here) + effect.definition.states)]
                pull = pull + (here.T @ _mean_law(model, effect)(still)[: len(here)])[at]
            # what a radian, or the start itself, changes of the forces
            slopes = np.abs(slopes_at(item).by[:, : item.n])
            spread = slopes @ np.maximum(np.abs(q[at]), 1e-3)
            _warn_of_motion(item, pull, spread)
        return q
    m, free = model.matrices, model.matrices.free
    for _ in range(50):
        force, slope = -(m.K @ q), -m.K.copy()
        for effect, here in zip(effects, ports, strict=True):
            kind = effect.definition
            still = np.r_[here @ q, np.zeros(len(here) + kind.states)]
            force += here.T @ _mean_law(model, effect)(still)[: kind.ports]
            slope += here.T @ _slopes(model, effect, here @ q, warn=False)[0] @ here
        pull = force[free]
        typical = np.max(np.abs(m.K @ q), initial=0.0)
        if not pull.any() or np.max(np.abs(pull)) <= 1e-12 * typical:
            break
        q[free] -= np.linalg.lstsq(slope[free][:, free], pull, rcond=1e-12)[0]
    return q if np.isfinite(q).all() else np.zeros(len(names))


def _warn_of_motion(item: Equations, pull: Array, spread: Array) -> None:
    """Say where the machine would not stay at its operating point."""
    for name, force, size in zip(item.coordinates, pull, spread, strict=True):
        if abs(force) > _STAYS * size:
            unit = "N m" if item.coordinates[name] == "rad" else "N"
            warnings.warn(
                f"operating_point is no equilibrium: {force:.4g} {unit} act on {name!r} there. "
                "Give inputs that hold it.",
                RobustPolishWarning,
                stacklevel=6,
            )


def _mean_law(model: MechanicalData, effect: Effect) -> Callable[[Array], Array]:
    """Return forces and rates from motions, velocities and states, averaged over one turn."""
    kind, n, spin = effect.definition, effect.definition.ports, model.spin_frequency
    times = np.arange(_PHASES) / (_PHASES * spin) if spin else np.zeros(1)
    # No time step: laws that blur a jump over what a step can resolve keep the jump.
    p = np.array([*effect.values.values(), *context_values(model, effect, 0.0)])
    law: Any = kind.law  # only effects that make forces come here

    def mean(x: Array) -> Array:
        found = np.zeros((times.size, n + kind.states))
        with np.errstate(all="ignore"):
            for t, row in zip(times, found, strict=True):
                law(t, x[:n], x[n : 2 * n], x[2 * n :], p, row[:n], row[n:])
        return np.mean(found, axis=0)

    return mean


def _slopes(model: MechanicalData, effect: Effect, rest: Array, warn: bool = True) -> list[Array]:
    """Return the slopes Fq, Fv, Fz of the force and Dq, Dv, Dz of the internal rates."""
    if isinstance(effect.definition, EquationKind):
        return _slopes_of_equations(model.equations[0], effect.definition)
    n, law = rest.size, _mean_law(model, effect)
    point = np.concatenate([rest, np.zeros(n + effect.definition.states)])
    table = np.zeros((point.size - n, point.size))
    for j in range(point.size):
        # Wherever the law has a slope at all, so small a step sees it: nothing in mechanics is
        # finer than 1e-12 in SI units, and at zero there is no rounding to fear.
        step = max(1e-12, 1e-7 * abs(point[j]))
        wide, narrow = (difference(law, point, j, h) for h in (step, step / 16))
        jumps = np.abs(narrow) > 4 * np.abs(wide)
        if jumps.any() and warn:
            warnings.warn(
                f"{effect} jumps at rest and has no linear part: left out of the linear model. "
                "Judge the controller by simulating the model with it: "
                "rp.simulate(model, controller, load).",
                RobustPolishWarning,
                stacklevel=6,
            )
        table[:, j] = np.where(jumps, 0.0, wide)
    table[~np.isfinite(table)] = 0.0
    columns = (slice(0, n), slice(n, 2 * n), slice(2 * n, None))
    return [part[:, c] for part in (table[:n], table[n:]) for c in columns]


def _slopes_of_equations(item: Equations, kind: EquationKind) -> list[Array]:
    """Return the slopes of what equations of motion add to their linear part, at their start."""
    here, (_, C, K, B) = slopes_at(item), linear_part(item)
    n, nz = item.n, kind.states
    Fq, Fv = np.zeros((kind.ports, kind.ports)), np.zeros((kind.ports, kind.ports))
    Fz, Dq, Dv = np.zeros((kind.ports, nz)), np.zeros((nz, kind.ports)), np.zeros((nz, kind.ports))
    read = slice(kind.places, kind.places + B.shape[1])
    q, v, z, u = np.split(np.arange(here.by.shape[1]), [n, 2 * n, 2 * n + nz])
    Fq[:n, :n], Fv[:n, :n], Fq[:n, read] = here.by[:, q] + K, here.by[:, v] + C, here.by[:, u] - B
    Fz[:n], Dq[:, :n], Dq[:, read] = here.by[:, z], here.dz_by[:, q], here.dz_by[:, u]
    Dv[:, :n] = here.dz_by[:, v]
    return [Fq, Fv, Fz, Dq, Dv, here.dz_by[:, z]]


def signal_gains(model: MechanicalData) -> Array:
    """Return the factor that effects put on each signal."""
    sources = np.array(model.matrices.sources)
    gains = np.ones(len(sources))
    for effect, slope in _slopes_of_signals(model, "input"):
        gains[sources == effect.at[0]] *= slope.gain
    return gains


def signal_timing(model: MechanicalData, s: AnyArray) -> AnyArray:
    """Return what delays and lags make of each signal at s, shape (s.size, signals)."""
    sources = np.array(model.matrices.sources)
    factors = np.ones((s.size, len(sources)), dtype=complex)
    for effect, slope in _slopes_of_signals(model, "input"):
        late = np.exp(-s * slope.delay) / (1 + s * slope.lag)
        factors[:, sources == effect.at[0]] *= late[:, None]
    return factors


def sensor_gains(model: MechanicalData) -> Array:
    """Return the factor that effects put on each output."""
    gains = np.ones(len(model.outputs))
    for effect, slope in _slopes_of_signals(model, "output"):
        gains[model.output_names.index(effect.at[0])] *= slope.gain
    return gains


def _slopes_of_signals(model: MechanicalData, domain: str) -> Iterator[tuple[Effect, SignalSlope]]:
    """Yield the effects on inputs or outputs, each with what a linear model keeps of it."""
    for effect in model.effects:
        if effect.definition.domain == domain:
            yield effect, effect.definition.signal_slope(effect.values)


def add_timing(
    model: MechanicalData, inputs: Sequence[str], A: Array, B: Array, C: Array, D: Array
) -> tuple[Array, Array, Array, Array, list[str]]:
    """Put lags and second-order Pade approximations of delays before the inputs that have them."""
    names: list[str] = []
    m = model.matrices
    sources = dict(zip(m.signals, m.sources, strict=True))
    for effect, slope in _slopes_of_signals(model, "input"):
        behind = [name for name in m.signals if sources[name] == effect.at[0] and name in inputs]
        filters: dict[str, Any] = {}
        if slope.delay > 0:
            filters["delay"] = control.pade(slope.delay, _PADE_ORDER)
        if slope.lag > 0:
            filters["lag"] = (np.ones(1), np.array([slope.lag, 1.0]))
        for name, (what, transfer) in itertools.product(behind, filters.items()):
            j = inputs.index(name)
            Ap, Bp, Cp, Dp = tf2ss(*transfer)
            column, through = B[:, [j]].copy(), D[:, [j]].copy()
            A = np.block([[A, column @ Cp], [np.zeros((len(Ap), len(A))), Ap]])
            B = np.vstack([B, np.zeros((len(Ap), B.shape[1]))])
            B[:, [j]] = np.vstack([column @ Dp, Bp])
            C, D = np.hstack([C, through @ Cp]), D.copy()
            D[:, [j]] = through @ Dp
            names += [f"{name}_{what}_{k + 1}" for k in range(len(Ap))]
    return A, B, C, D, names


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
    (A, B, C, D), notes = linear_system(model, operating_point)
    s = 2j * np.pi * lines
    values = resolvent_response(A, B, C, D, s)
    values[np.isinf(values)] = np.nan  # on an undamped pole, such as 0 Hz of a free mass
    values = values * sensor_gains(model)[:, None] * signal_gains(model)
    values = values * signal_timing(model, s)[:, None, :]
    # An imposed motion is one input with its derivatives; a force is one signal.
    m = model.matrices
    forces = len(m.force_inputs)
    total = np.zeros((*values.shape[:2], len(model.inputs)), dtype=complex)
    for j, item in enumerate(model.inputs):
        if item.imposes is None:
            total[..., j] = values[..., m.force_inputs.index(item.name)]
            continue
        coordinate = m.coordinates.index(item.on[0])
        for k, signal in enumerate(m.imposed_signals, forces):
            if signal.coordinate == coordinate:
                power = _ORDER[signal.quantity] - _ORDER[item.imposes]
                with np.errstate(divide="ignore", invalid="ignore"):
                    factor = s**power * (item.gain / signal.gain)
                total[..., j] += values[..., k] * factor[:, None]
    for effect in model.effects:  # what holding an input between samples does to it
        if effect.kind != _HELD or effect.values["order"] == 3.0:
            continue
        if sampling_time is None:
            notes.append(f"{effect} left out: the sampling time is not known")
            continue
        half = np.imag(s) * sampling_time / 2
        kept = np.sinc(half / np.pi)
        held = kept * np.exp(-1j * half) if effect.values["order"] == 0.0 else kept**2
        total[..., model.input_names.index(effect.at[0])] *= held[:, None]
    return total, notes


def linear_system(
    model: MechanicalData, operating_point: Mapping[str, float] | None = None
) -> tuple[tuple[Array, Array, Array, Array], list[str]]:
    """Return A, B, C, D from signals to outputs, and what of the effects has no linear part.

    What effects on signals do is not in it.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RobustPolishWarning)
        *system, _ = linear_with_effects(model, operating_point)
    A, B, C, D = system
    return (A, B, C, D), list(dict.fromkeys(str(item.message) for item in caught))


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
    model = about(model, operating_point)
    m, names, nf = model.matrices, model.free, len(model.free)
    wanted = names if controls is None else tuple(controls)
    known = [*names, *m.signals]
    for name in wanted:
        one_of("controls", name, known, "Correct it.")
    chosen = [name for name in wanted if name not in names]  # inputs that become controls
    pushes = [name for name in wanted if name in names]
    A, B, C, D, own = linear_with_effects(model, operating_point)
    # Controls on coordinates: forces, or rates at which displacements are moved.
    B2, D22 = np.zeros((len(A), len(pushes))), np.zeros((len(C), len(pushes)))
    rows = [names.index(name) for name in pushes]
    if actuation == "displacement":
        B2[rows, range(len(rows))] = 1.0
    else:
        B2[nf : 2 * nf] = m.inverse_mass[:, rows]
        D22 += m.Sa[:, m.free] @ m.inverse_mass[:, rows]
    gains = sensor_gains(model)[:, None]
    order = [i for i, name in enumerate(m.signals) if name not in chosen]
    nw = len(order)
    order += [m.signals.index(name) for name in chosen]
    inputs = [m.signals[i] for i in order]
    both = np.hstack([(B * signal_gains(model))[:, order], B2])
    through = gains * np.hstack([D[:, order], D22])
    A, both, C, through, more = add_timing(model, inputs, A, both, gains * C, through)
    rates = [f"d{name}" for name in names]
    states = [name for pair in zip(names, rates, strict=True) for name in pair] + own + more
    order = [i for k in range(nf) for i in (k, nf + k)] + list(range(2 * nf, len(states)))
    A, both, C = A[np.ix_(order, order)], both[order], C[:, order]
    position = np.zeros((nf, len(states)))
    position[range(nf), range(0, 2 * nf, 2)] = 1.0
    seen: Sequence[str] = model.output_names
    if measured != "outputs":
        C, seen = (np.eye(len(states)), states) if measured == "state" else (position, names)
        through = np.zeros((len(C), both.shape[1]))
    units: dict[str, str] = {}
    for name in names:
        kind = UNITS[model.dof(name).rotational]
        units |= {name: kind[DISPLACEMENT], f"d{name}": kind[VELOCITY]}
        if name in pushes:
            units[f"u_{name}"] = kind["force" if actuation == "force" else VELOCITY]
    units |= {name: unit for item in model.equations for name, unit in item.states.items()}
    outputs = {o.name: model.unit_of(o) for o in model.outputs} if measured == "outputs" else units
    units |= {f"measured_{name}": outputs[name] for name in seen if name in outputs}
    units |= {i.name: model.unit_of(i) for i in model.inputs if i.name not in units}
    return GeneralizedPlant.from_matrices(
        A,
        both[:, :nw],
        both[:, nw:],
        position,
        C,
        D21=through[:, :nw],
        D22=through[:, nw:],
        states=states,
        disturbances=inputs[:nw],
        controls=[*chosen, *(f"u_{name}" for name in pushes)],
        performance=list(names),
        measurements=[f"measured_{name}" for name in seen],
        units=units,
    )


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
    if model.equations:
        return _uncertain_equations(model, ranges)
    numbers = {key: value for key, value in ranges.items() if isinstance(value, UncertainSystem)}
    known = {key: _uncertain_value(model, key) for key in (*numbers, *ranges)}
    for key, value in numbers.items():
        if value.shape != (1, 1) or not value.is_static:
            shown = described(f"an uncertain system, {value.shape[0]} x {value.shape[1]}")
            remedy = "Make it of uncertain_real."
            raise invalid(("ranges", key), shown, "an uncertain number", remedy)
        known[key] = float(value.matrices.J[0, 0])
    model = with_parameter_values(model, {key: known[key] for key in numbers})
    elements = [_element(key, known[key], value) for key, value in ranges.items()]
    m = model.matrices
    n, first = len(m.coordinates), len(m.force_inputs)
    pieces = [_derivative(model, element) for element in elements]
    left = np.hstack([np.zeros((n + len(m.outputs), 0)), *(piece[0] for piece in pieces)])
    right = np.vstack([np.zeros((0, 3 * n + first)), *(piece[1] for piece in pieces)])
    deltas = len(right)
    wider = replace(
        m,
        B=np.hstack([left[:n], m.B]),
        Sq=np.vstack([right[:, :n], m.Sq]),
        Sv=np.vstack([right[:, n : 2 * n], m.Sv]),
        Sa=np.vstack([right[:, 2 * n : 3 * n], m.Sa]),
        force_inputs=(*(f"w[{i}]" for i in range(deltas)), *m.force_inputs),
        outputs=(*(f"z[{i}]" for i in range(deltas)), *m.outputs),
    )
    A, B, C, D = wider.first_order()
    D[deltas:, :deltas] += left[n:]
    D[:deltas, deltas : deltas + first] += right[:, 3 * n :]
    copies = np.array([len(rows) for _, rows in pieces], dtype=int)
    scale = np.repeat([element.slope for element in elements], copies)
    skew = np.repeat([element.skew for element in elements], copies)
    # w = slope delta z / (1 - skew delta), as a fraction of the delta.
    C[:deltas] *= scale[:, None]
    D[:deltas] *= scale[:, None]
    # A number made of others is put in the place of a stand-in of slope 1.
    names = [_STAND_IN + e.name if e.name in numbers else e.name for e in elements]
    blocks = [
        lft.UncertainBlock(replace(element, name=name), count)
        for element, name, count in zip(elements, names, copies.tolist(), strict=True)
        if count
    ]
    whole = lft.Lft(
        np.block([[A, B[:, :deltas]], [C[:deltas], D[:deltas, :deltas] + np.diag(skew)]]),
        np.vstack([B[:, deltas:], D[:deltas, deltas:]]),
        np.hstack([C[deltas:], D[deltas:, :deltas]]),
        D[deltas:, deltas:],
        m.states,
        tuple(blocks),
        0,
        m.signals,
        m.outputs,
    )
    for key, value in numbers.items():
        names = [block.element.name for block in whole.blocks]
        if _STAND_IN + key in names:  # otherwise it does nothing
            change = (value - value.matrices.J).matrices
            whole = close_block(whole, names.index(_STAND_IN + key), change)
    return UncertainSystem(lft.reduce_copies(whole))


def _uncertain_equations(model: MechanicalData, ranges: Mapping[str, Any]) -> UncertainSystem:
    """Return the linear part of a model with equations whose parameters are uncertain."""
    item, m = model.equations[0], model.matrices
    base: dict[str, Any] = {**item.values}
    if model.imposed:
        shown, want = described("equations beside an imposed motion"), "inputs of the equations"
        raise invalid("ranges", shown, want, "Let the equations read the motion.")
    for key, given in ranges.items():
        keys = [f"parameter.{name}" for name in base]
        if key not in keys:
            remedy = closest_name_remedy(key, keys)
            raise invalid("ranges", key, f"one of {', '.join(keys)}", remedy)
        name = key.partition(".")[2]
        number = given
        if not isinstance(given, UncertainSystem):
            told = _element(key, base[name], given)
            number = uncertain_real(key, base[name], range=(told.low, told.high))
        base[name] = number
    here, n, nz, free = slopes_at(item, base), item.n, len(item.states), len(m.free)
    bare = copy(model)  # all that is certain
    vars(bare).update(equations=())
    vars(bare).pop("matrices", None)
    rest, width = bare.matrices, 2 * free + nz
    at = [m.coordinates.index(name) for name in item.coordinates]
    read = [width + m.force_inputs.index(name) for name in item.inputs]
    gains = [source.gain for name in item.inputs for source in model.inputs if source.name == name]
    M = rest.M.astype(object)
    rates = np.zeros((free + nz, width + m.B.shape[1]), dtype=object)
    rates[:free, : 2 * free], rates[:free, width:] = -np.hstack([rest.K, rest.C]), rest.B
    rates[:free, read] = 0.0
    columns = [*at, *(free + i for i in at), *range(2 * free, width), *read]
    factors = [1.0] * (2 * n + nz) + gains
    for row, by in zip((*at, *range(free, free + nz)), (*here.by, *here.dz_by), strict=True):
        for column, factor, slope in zip(columns, factors, by, strict=True):
            rates[row, column] = plus(rates[row, column], times(factor, slope))
    for i, j in itertools.product(range(n), range(n)):
        M[at[i], at[j]] = plus(M[at[i], at[j]], here.M[i, j])
    known = np.array([[float(np.squeeze(getattr(x, "nominal", x))) for x in row] for row in M])
    inverse = feedback(np.linalg.inv(known), as_uncertain("M", M.tolist()) - known)
    a = inverse * as_uncertain("rates", rates[:free].tolist())
    below = as_uncertain("rates", rates[free:].tolist()) if nz else 0.0
    seen = np.hstack([m.Sq, m.Sv, np.zeros((len(m.Sq), rates.shape[1] - 2 * free))])
    still = np.vstack([np.eye(2 * free, rates.shape[1])[free:], np.zeros_like(rates, float), seen])
    places = np.eye(len(still))
    into = places[:, free : 2 * free].copy()  # accelerations are rates, and are measured
    into[width:] += m.Sa
    whole = still + into * a
    if nz:
        whole = whole + places[:, 2 * free : width] * below
    return with_states(whole, (*m.states, *item.states), 0, m.signals, m.outputs)


def _uncertain_value(model: MechanicalData, key: str) -> float:
    """Return the value of a number that may be uncertain."""
    known = values(model)
    if key not in known:
        remedy = closest_name_remedy(key, known)
        raise invalid("ranges", key, f"a key of model.parameters: {', '.join(known)}", remedy)
    if key.startswith(("effect[", "ratio[")):
        shown = described(f"{key}, a number of {'an effect' if key[0] == 'e' else 'a ratio'}")
        expected = "numbers of masses, springs, dampers and gains"
        remedy = "Put the linear part of the effect into a spring."
        if key[0] == "r":  # it enters squared
            remedy = "Compare models with_parameters of the ratio's smallest and largest value."
        raise invalid("ranges", shown, expected, remedy)
    if key in {f"input.{item.name}.gain" for item in model.inputs if item.imposes}:
        remedy = "Multiply the system by an uncertain_real."
        raise misfit("ranges", f"{key}, of an imposed motion", "gains of forces", remedy)
    return known[key]


def _element(key: str, nominal: float, given: Any) -> lft.RealElement:
    """Return the element of a number: a share of it, or its smallest and largest value."""
    if isinstance(given, UncertainSystem):
        return lft.RealElement(key, nominal, nominal - 1, nominal + 1)  # of slope 1
    if isinstance(given, tuple | list | np.ndarray):
        return lft.real_element(key, nominal, low_high=tuple(given))  # type: ignore
    if not isinstance(given, int | float | np.number) or isinstance(given, bool):
        expected = "a share such as 0.1, (low, high), or an uncertain number"
        raise invalid(("ranges", key), given, expected, "Write 0.1 for 10 %.")
    if nominal == 0:
        shown = described(f"a share of {key}, which is 0")
        raise invalid(("ranges", key), shown, "(low, high)", "Give both ends in its own unit.")
    if key.startswith("dof.") and given >= 1:
        raise invalid(("ranges", key), given, "a share below 1", "A mass stays positive.")
    return lft.real_element(key, nominal, percent=100 * float(given))


def _derivative(model: MechanicalData, element: lft.RealElement) -> tuple[Matrix, Matrix]:
    """Return the derivative of forces and outputs by a number, as a product of few columns.

    The rows of the right factor are over displacements, velocities, accelerations and inputs.
    """
    # All matrices are linear in every number: a difference is a derivative.
    step = element.nominal or 1.0
    m = model.matrices
    moved = with_parameter_values(model, {element.name: element.nominal + step}).matrices
    n = len(m.coordinates)
    change = np.zeros((n + len(m.outputs), 3 * n + len(m.force_inputs)))
    coupled = len(moved.signals) != len(m.signals)
    if not coupled:

        def slope(name: str) -> Matrix:
            return (getattr(moved, name) - getattr(m, name)) / step

        change[:n] = np.hstack([-slope("K"), -slope("C"), -slope("M"), slope("B")])
        change[n:, : 3 * n] = np.hstack([slope("Sq"), slope("Sv"), slope("Sa")])
        change[m.imposed] = 0.0  # their motion is given, whatever force it takes
        coupled = change[:n, 2 * n + m.imposed].any()
    if coupled:
        shown = described(f"{element.name}, which couples to an imposed motion")
        raise invalid("ranges", shown, "inertias of free coordinates", "Leave it certain.")
    U, sizes, V = np.linalg.svd(change)
    rank = int(np.count_nonzero(sizes > _NOTHING * sizes.max(initial=0.0)))
    return U[:, :rank], sizes[:rank, None] * V[:rank]
