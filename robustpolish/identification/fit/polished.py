"""A fit of whole runs that is followed to its minimum, along narrow valleys too.

Laws of damping, or a spring and a pendulum, may do nearly the same: the steps of
:mod:`.least_squares` are damped, so that they crawl along such a valley and stop where they still
fall a little. A trust region (Branch, Coleman and Li 1999, SIAM J. Sci. Comput. 21, 1-23) does not.

A force that jumps as the motion reverses is a second obstacle. A run of fixed steps sees on which
step a reversal falls, no more, and as a function of the numbers its errors are a staircase whose
local slopes lead nowhere. Over the speed that is gained in one step the jump may as well be round.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from robustpolish.arrays import Array
from robustpolish.identification.fit.homotopy import residuals_of
from robustpolish.identification.fit.least_squares import Fit, unfitted
from robustpolish.identification.fit.parameters import turns_over_gently
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_rows

_WIDTH = "width"
_SETTLED = 1e-5
_RUNS = 30
_AT_BOUND = 1e-6
"""What is as good as a lower bound, in the units in which a fit counts."""


def rounded(model: MechanicalModel, prepared: PreparedRecord) -> MechanicalModel:
    """Return the model with jumps of friction rounded over the speed that a step gains.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    """
    substeps = prepared.runner(model).substeps
    effects = []
    for effect in model.effects:
        if effect.definition.sharp and effect.values.get(_WIDTH) == 0.0:
            v = (port_rows(model, effect) @ prepared.motion_before.v)[0]
            gained = float(np.sqrt(np.mean(np.diff(v) ** 2))) / substeps
            effect = effect.with_values({**effect.parameters, _WIDTH: gained})
        effects.append(effect)
    return replace(model, effects=tuple(effects))


def speeds_of_turns(model: MechanicalModel) -> frozenset[str]:
    """Return the keys of the speeds over which those dry frictions turn over that jump."""
    return frozenset(
        f"effect[{i}].{effect.definition.turns_over}"
        for i, effect in enumerate(model.effects)
        if effect.definition.turns_over and not turns_over_gently(effect)
    )


def sharpened(
    fitted: Fit, before: MechanicalModel, prepared: PreparedRecord, reference: MechanicalModel
) -> Fit:
    """Return the fit of a rounded model with the widths of jumps that it had before.

    Parameters
    ----------
    fitted : Fit
    before : MechanicalModel
        With the same effects.
    prepared : PreparedRecord
    reference : MechanicalModel
        About which the priors are centred.
    """
    effects = []
    for effect, old in zip(fitted.model.effects, before.effects, strict=True):
        if old.values.get(_WIDTH) == 0.0:
            effect = effect.with_values({**effect.parameters, _WIDTH: 0.0})
        effects.append(effect)
    model = replace(fitted.model, effects=tuple(effects))
    return unfitted(residuals_of(model, fitted.pieces, prepared, reference))


def polished(fitted: Fit, prepared: PreparedRecord, reference: MechanicalModel) -> Fit:
    """Return a fit to the same pieces at its minimum.

    Parameters
    ----------
    fitted : Fit
        Where to begin.
    prepared : PreparedRecord
    reference : MechanicalModel
        About which the priors are centred.
    """
    here = residuals_of(fitted.model, fitted.pieces, prepared, reference)
    sizes = here.start_sizes if here.start_sizes is not None else np.ones(0)
    starts = np.array([piece.start.vector for piece in here.pieces])
    x0 = here.within(np.array([f.start / f.scale for f in here.free]))
    p, shape, sigma = x0.size, (len(here.pieces), sizes.size), np.maximum(fitted.rmse, 1e-300)

    def parts(z: Array) -> tuple[Array, Array]:
        return z[:p], z[p:].reshape(shape) * sizes if sizes.size else starts

    @lru_cache(maxsize=1)  # derivatives are asked for where the errors were
    def errors_at(z: bytes) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):
            found = here.errors(*parts(np.frombuffer(z)))
        return np.nan_to_num(found, nan=_LOST, posinf=_LOST, neginf=-_LOST)

    def errors(z: Array) -> Array:
        return errors_at(z.tobytes())

    def residuals(z: Array) -> Array:
        x = z[:p]
        prior = [(x - here.centre) * here.prior, here.joint @ x]
        return np.concatenate([np.clip(errors(z) / sigma, -_LOST, _LOST).ravel(), *prior])

    def derivatives(z: Array) -> Array:
        now = errors(z)
        columns = [np.nan_to_num(each / sigma) for each in here.columns(*parts(z), now)]
        J = np.zeros((now.size, z.size))
        for j, column in enumerate(columns[:p]):
            J[:, j] = column.ravel()
        ny = now.shape[1]
        for i, column in enumerate(columns[p:]):
            for k, (a, b) in enumerate(zip(here.offsets[:-1], here.offsets[1:], strict=True)):
                J[a * ny : b * ny, p + k * sizes.size + i] = column[a:b].ravel()
        priors = np.zeros((p + len(here.joint), z.size))
        priors[:p, :p] = np.diag(here.prior)
        priors[p:, :p] = here.joint
        return np.vstack([J, priors])

    free = np.full(starts.size if sizes.size else 0, np.inf)
    low, high = np.concatenate([here.lower, -free]), np.concatenate([here.upper, free])
    inside = (starts / sizes).ravel() if sizes.size else np.zeros(0)
    begin = np.clip(np.concatenate([x0, inside]), low, high)
    slopes: Any = derivatives
    found = least_squares(
        residuals,
        begin,
        slopes,
        bounds=(low, high),
        x_scale="jac",
        ftol=_SETTLED,
        max_nfev=_RUNS,
    )
    x, at = parts(found.x)
    x = np.where(
        x - here.lower < _AT_BOUND, here.lower, x
    )  # steps end within bounds, never on them
    pieces = here.started(at) if sizes.size else list(here.pieces)
    best = unfitted(residuals_of(here.model_at(x), pieces, prepared, reference))
    return best if np.sum(np.log(best.rmse)) < np.sum(np.log(fitted.rmse)) else fitted


_LOST = 1e6
"""What an error counts at most, in those of the fit at its beginning: a run that diverged."""
