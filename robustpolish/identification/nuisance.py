"""What errors of a model's own numbers and of the start leave in the innovations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.linear_observer import LinearObserver
from robustpolish.identification.missing_force import Smoothed, known_forces
from robustpolish.identification.parameters import GAIN_PRIOR, MASS_PRIOR, free_parameters
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_row

Array = NDArray[np.float64]
SPRING_SHARE = 0.1
DAMPER_SHARE = 0.5


def nuisance(
    model: MechanicalModel, observer: LinearObserver, motion: Smoothed, time: Array, dt: float
) -> tuple[Array, Array]:
    """Return innovations left by errors of the model's own numbers and of the start."""
    rows, pairs, forces, ridge = [], [], [], []

    def add(row: Array, pair: tuple[str, ...], force: Array, prior: float) -> None:
        if np.any(force):
            rows.append(row)
            pairs.append(pair)
            forces.append(force)
            ridge.append(prior)

    for spring in model.springs:
        row = port_row(model, spring.between)
        add(row, spring.between, -(row @ motion.q), _ridge(spring.stiffness, SPRING_SHARE))
    for damper in model.dampers:
        row = port_row(model, damper.between)
        add(row, damper.between, -(row @ motion.v), _ridge(damper.damping, DAMPER_SHARE))
    m = model.matrices
    for name in model.free:
        i = model.dof_names.index(name)
        row = port_row(model, (name,))
        add(row, (name, "ground"), -motion.a[i], 1 / (MASS_PRIOR * m.M[i, i]))
    columns = []
    for row, pair, force in zip(rows, pairs, forces, strict=True):
        columns.append(observer.respond(row[None], [pair], force[None, None])[0])
    for j in range(m.B.shape[1]):
        force = np.outer(m.B[:, j], motion.inputs[:, j])
        eye = np.eye(len(m.B))
        ends = [(name, "ground") for name in model.dof_names]
        columns.append(observer.respond(eye, ends, force[None])[0])
        ridge.append(1 / GAIN_PRIOR)
    for column in _effect_columns(model, observer, motion, time, dt):
        columns.append(column)
        ridge.append(0.0)
    starts = observer.respond_start(len(time))[: 2 * len(model.free)]
    columns += list(starts)
    ridge += [0.0] * len(starts)
    if not columns:
        return np.zeros((0, len(time), len(model.outputs))), np.zeros(0)
    return np.stack(columns), np.array(ridge)


def _ridge(value: float, share: float) -> float:
    """Return the inverse of how far a number may be off after the refit.

    Without it, the smoothed motion of masses that are not measured, which follows the missing
    force, could explain that force with an absurd spring or damper.
    """
    return 1 / (share * abs(value)) if value else 0.0


def _effect_columns(
    model: MechanicalModel, observer: LinearObserver, motion: Smoothed, time: Array, dt: float
) -> list[Array]:
    """Return the derivatives of the innovations to the parameters of effects in the model."""
    base = known_forces(model, motion.q, motion.v, time, dt)
    found = []
    for f in free_parameters(model, 1.0):
        if not f.is_effect or base is None:
            continue
        h = 1e-3 * f.scale * (-1 if f.start + 1e-3 * f.scale > f.upper else 1)
        moved = known_forces(
            model.with_parameters({f.key: f.start + h}), motion.q, motion.v, time, dt
        )
        if moved is None or moved.values.shape != base.values.shape:
            continue
        change = (moved.values - base.values) / h
        if np.any(change) and np.isfinite(change).all():
            found.append(observer.respond(base.rows, base.pairs, change[None])[0])
    return found
