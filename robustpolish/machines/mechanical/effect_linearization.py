"""The slopes of the physical effects of a model at a state of rest."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import control
import numpy as np
from scipy.linalg import block_diag
from scipy.signal import tf2ss

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import invalid
from robustpolish.errors import RobustPolishWarning
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import SignalSlope
from robustpolish.machines.mechanical.data import MechanicalData, context_values, effect_ports
from robustpolish.machines.mechanical.parts import number
from robustpolish.plants.linearization import difference

_PHASES = 16
_PADE_ORDER = 2


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
    placed, ports, (G, H, (Qs, Qw, Vs, Vw)) = effect_ports(model)
    rest = _rest(model, placed, ports, operating_point)
    slopes = [[np.zeros((0, 0))] * 6]
    for effect, here in zip(placed, ports, strict=True):
        slopes.append(_slopes(model, effect, here @ rest))
    Fq, Fv, Fz, Dq, Dv, Dz = (np.array(block_diag(*parts)) for parts in zip(*slopes, strict=True))
    A, B, C, D = model.matrices.first_order()
    by_s, by_w = Fq @ Qs + Fv @ Vs, Fq @ Qw + Fv @ Vw
    states = [
        f"{effect.kind}_{i}_{k + 1}"
        for i, effect in enumerate(placed, 1)
        for k in range(effect.definition.states)
    ]
    return (
        np.block([[A + G @ by_s, G @ Fz], [Dq @ Qs + Dv @ Vs, Dz]]),
        np.vstack([B + G @ by_w, Dq @ Qw + Dv @ Vw]),
        np.hstack([C + H @ by_s, H @ Fz]),
        D + H @ by_w,
        states,
    )


def _rest(
    model: MechanicalData,
    effects: Sequence[Effect],
    ports: Sequence[Array],
    operating_point: Mapping[str, float] | None,
) -> Array:
    """Return the displacements of all coordinates at rest."""
    names = model.dof_names
    q = np.zeros(len(names))
    if operating_point is not None:
        for name, value in operating_point.items():
            if name not in names:
                raise invalid("operating_point", name, f"one of {', '.join(names)}", "Correct it.")
            q[names.index(name)] = number(f"operating_point[{name!r}]", value)
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
                "Judge the controller by simulating the model with it.",
                RobustPolishWarning,
                stacklevel=6,
            )
        table[:, j] = np.where(jumps, 0.0, wide)
    table[~np.isfinite(table)] = 0.0
    columns = (slice(0, n), slice(n, 2 * n), slice(2 * n, None))
    return [part[:, c] for part in (table[:n], table[n:]) for c in columns]


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
