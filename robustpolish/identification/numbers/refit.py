"""Fit a model's parameters to a record, those of its effects included."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import lmfit
import numpy as np

from robustpolish.identification.compare.record_errors import record_errors
from robustpolish.identification.compare.simulated import free_run_error, free_runs
from robustpolish.identification.findings.refitted import Refit
from robustpolish.identification.fit.homotopy import homotopy, rms_over
from robustpolish.identification.fit.least_squares import (
    Fit,
    Residuals,
    covariance_of,
    errors_from,
    unfitted,
)
from robustpolish.identification.fit.long_records import taken
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.fit.prepared import PreparedRecord, prepare
from robustpolish.identification.frequency.fit import refit_frequency_response
from robustpolish.identification.numbers.warned import warned
from robustpolish.identification.policy import POLICY, Policy
from robustpolish.identification.record import long_enough, record_of
from robustpolish.identification.sanity.moved import moved_numbers
from robustpolish.identification.screening.screen import screen
from robustpolish.long_calls import same_bits, working
from robustpolish.measurements import holds_frequency_response
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.data import unit_of


@same_bits
def refit(
    model: MechanicalModel,
    data: Any,
    progress: Callable[[], None] | None = None,
    *,
    _policy: Policy = POLICY,
) -> Refit:
    """Fit the parameters of a model, those of its effects included.

    Masses and input gains are known to about 5 % beforehand; data may move them further.
    Of a long record as many samples are used as the fastest motion, the forces and the error ask
    for, or a part of it; ``notes`` of the result says so.

    Parameters
    ----------
    model : MechanicalModel
        Start values; effects that were added without parameters get theirs from screening.
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        Inputs and outputs by name over ``time``, SI units. Several records have the numbers of the
        machine in common and each a start of its own; phases are those at time 0 of every record,
        see :func:`robustpolish.diagnose`. Or frequency responses, as
        :func:`robustpolish.read_frequency_response` reads and returns them: the linear part is
        fitted to them, effects linearised.
    progress : callable, optional
        Called after every step.

    Returns
    -------
    Refit

    Raises
    ------
    InvalidInputError
        If columns are missing or a record is too short; if there is no record, or several that
        differ in their channels.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import robustpolish as rp
    >>> from robustpolish.simulation import linear_response
    >>> def oscillator(k):
    ...     return rp.MechanicalModel(
    ...         [rp.Dof("x", 1.0)],
    ...         [rp.Spring(("x", "ground"), k)],
    ...         [rp.Damper(("x", "ground"), 0.4)],
    ...         [rp.Input("F", ("x", "ground"))], [rp.Output("x", ("x", "ground"))])
    >>> t = np.arange(2000) * 0.01
    >>> rng = np.random.default_rng(0)
    >>> force, noise = rng.standard_normal(t.size), 1e-3 * rng.standard_normal(t.size)
    >>> x = linear_response(oscillator(25.0).state_space(), t, force[:, None]).outputs[:, 0]
    >>> data = xr.Dataset({"F": ("time", force), "x": ("time", x + noise)}, coords={"time": t})
    >>> fitted = refit(oscillator(22.0), data)
    >>> m, k = (fitted.model.parameters[n] for n in ("dof.x.mass", "spring[0].stiffness"))
    >>> bool(abs(k / m - 25) < 0.1)
    True
    """
    if holds_frequency_response(data):
        with working("Refitting"):
            found = refit_frequency_response(model, data, progress)
        moved = moved_numbers(model.parameters, found.model.parameters)
        return replace(found, notes=tuple(moved))
    fewer = taken(model, long_enough(model, record_of(model, data)), _policy)
    model, prepared = fewer.model, prepare(fewer.model, fewer.record, _policy)
    started = _with_start_values(model, prepared)
    spans = prepared.spans(prepared.everything)
    with working("Refitting"):
        last = _policy.follows(prepared.record.Y.size)
        fits = homotopy(
            started, prepared, prepared.everything, model, spans, progress=progress, last=last
        )
        best = _no_worse(fits[-2:][::-1], [model, started], prepared)
        found = _summarised(best, prepared)
        records = record_errors(found.model, free_runs(found.model, fewer.record))
    notes = (*fewer.notes, *warned(started, found.model, prepared))
    return replace(found, model=fewer.as_given(found.model), notes=notes, records=records)


def _no_worse(
    fits: Sequence[Fit], starts: Sequence[MechanicalModel], prepared: PreparedRecord
) -> Fit:
    """Return the first fit that runs no worse than the starts do, or the best start as it is.

    A fit goes by starts of its own, by priors, and by the likelihood, which may give up a little of
    a loud output for a quiet one.
    """
    models = [fitted.model for fitted in fits] + list(starts)
    errors = _run_errors(models, prepared)
    of_fits, of_starts = errors[: len(fits)], errors[len(fits) :]
    for fitted, error in zip(fits, of_fits, strict=True):
        if error <= min(of_starts):
            return fitted
    best = starts[int(np.argmin(of_starts))]
    if not np.isfinite(min(of_starts)):
        raise ArithmeticError("no stage of the fit ended with finite errors")
    _, pieces = prepared.closest_runs(best, prepared.everything)
    free = free_parameters(best, prepared.scales.bandwidth, prepared.policy, starts[0])
    sizes = prepared.sizes(best) if pieces[0].start.vector.size else None
    return unfitted(Residuals(best, pieces, prepared.runner(best), free, sizes))


def _run_errors(models: Sequence[MechanicalModel], prepared: PreparedRecord) -> list[float]:
    """Return the mean square of relative errors of free runs, over windows if no run repeats."""
    size = np.std(prepared.record.Y, axis=0)
    size = np.where(size > 0, size, 1.0)
    runs = [free_run_error(model, prepared.record) for model in models]
    if all(calm or not np.isfinite(error).all() for error, calm in runs):
        found = [error for error, _ in runs]
    else:
        found = [rms_over(model, prepared, prepared.windows) for model in models]
    return [float(np.mean((error / size) ** 2)) for error in found]


def _with_start_values(model: MechanicalModel, prepared: PreparedRecord) -> MechanicalModel:
    """Give effects that came without parameters those that screening finds."""
    effects = list(model.effects)
    for i, effect in enumerate(effects):
        if effect.parameters:
            continue
        others = replace(model, effects=tuple(e for e in effects if e is not effect))
        found = screen(others, prepared, [effect])
        values = found.candidates[0].effect.values if found.candidates else effect.values
        effects[i] = effect.with_values(values)
    return replace(model, effects=tuple(effects))


def _summarised(fitted: Fit, prepared: PreparedRecord) -> Refit:
    """Return values, bounds and standard errors of a fit."""
    covariance = covariance_of(fitted)
    errors = errors_from(covariance)
    parameters = lmfit.Parameters()
    units, undetermined = {}, []
    for f in fitted.free:
        value, error = fitted.model.parameters[f.key], errors[f.key]
        name = lmfit_name(f.key)
        parameters.add(name, value=value, min=f.lower, max=f.upper)
        parameters[name].stderr = error
        units[f.key] = unit_of(fitted.model, f.key)
        if not np.isfinite(error) or error > prepared.policy.undetermined * abs(value):
            undetermined.append(f.key)
    size = np.std(prepared.record.Y, axis=0)
    nrmse = dict(zip(fitted.model.output_names, (fitted.rmse / size).tolist(), strict=True))
    return Refit(fitted.model, parameters, units, nrmse, tuple(undetermined), errors, covariance)


def lmfit_name(key: str) -> str:
    """Return a key as a name that lmfit accepts."""
    return "".join(c if c.isalnum() else "_" for c in key).strip("_")
