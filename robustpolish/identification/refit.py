"""Fit a model's parameters by homotopy on prediction errors.

A nonlinear observer follows the data, first closely, then less and less, until the model
runs freely (Ljung, System Identification, section 7.2; Vyasarayani et al. 2012, Nonlinear
Dynamics 67, 2779-2797, on homotopy in parameter identification). Free-run fits of lightly
damped systems from a distant start end in wrong minima; these do not.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import lmfit
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.evaluation import (
    FREE,
    fitted_starts,
    free_errors,
    full_scale,
    guided_errors,
    motion_along,
    pieces_of,
    reproducible,
    state_scale,
    with_rest,
)
from robustpolish.identification.least_squares import Fit, Piece, Residuals, fit
from robustpolish.identification.observer import Level, Scales
from robustpolish.identification.parameters import FreeParameter, free_parameters, unit_of
from robustpolish.identification.prediction import Predictor
from robustpolish.identification.record import Record, record_of, split
from robustpolish.identification.refitted import Refit
from robustpolish.identification.scales import amplitude_of, scales_of
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]
_TRIAL = 3500
_WINDOWS = 25
_SCREENED = 9000
HOMOTOPY = (Level(1.0), Level(0.1), Level(0.01), FREE)


@dataclass(frozen=True, eq=False)
class Setting:
    """A record prepared for fits: pieces, sizes and smoothed starts.

    Attributes
    ----------
    estimation, trial, held_out, everything : list of Piece
        `trial` is the first part of each estimation piece, for first fits of candidates.
    """

    record: Record
    scales: Scales
    amplitude: float
    state_scale: Array
    estimation: list[Piece]
    trial: list[Piece]
    held_out: list[Piece]
    everything: list[Piece]

    @property
    def dt(self) -> float:
        """Sampling step in s."""
        return self.record.dt

    @property
    def screened(self) -> Record:
        """The contiguous part of the record that is screened: the liveliest."""
        length = min(self.record.samples, _SCREENED)
        power = np.sum((self.record.Y / np.std(self.record.Y, axis=0)) ** 2, axis=1)
        total = np.concatenate([[0.0], np.cumsum(power)])
        starts = np.arange(0, self.record.samples - length + 1, max(1, length // 20))
        begin = int(starts[np.argmax(total[starts + length] - total[starts])])
        return self.record.part(begin, begin + length)


def prepare(model: MechanicalModel, record: Record) -> Setting:
    """Prepare a record for fits of a model and its extensions."""
    scales = scales_of(model, record)
    amplitude = amplitude_of(model, record, scales.bandwidth)
    motion = motion_along(model.without_effects(), record, scales, amplitude)
    parts = split(record.samples, decays=not model.inputs)
    length = record.samples
    if drifts(model, record.samples * record.dt):
        length = max(60, record.samples // _WINDOWS)

    def pieces(ranges: Sequence[tuple[int, int]]) -> list[Piece]:
        return pieces_of(model, record, _windows(ranges, length), motion)

    return Setting(
        record, scales, amplitude, state_scale(model, motion),
        pieces(parts.estimation), pieces([(a, min(b, a + _TRIAL)) for a, b in parts.estimation]),
        pieces(parts.held_out), pieces([(0, record.samples)]),
    )  # fmt: skip


def drifts(model: MechanicalModel, length: float) -> bool:
    """Return whether the linear part integrates over a record of `length` seconds.

    The free run of such a model forgets nothing, so that it is judged in windows.
    """
    if not model.free:
        return False
    A = np.asarray(model.state_space().A, dtype=float)
    return bool(np.min(np.abs(np.linalg.eigvals(A))) * length < 1)


def _windows(ranges: Sequence[tuple[int, int]], length: int) -> list[tuple[int, int]]:
    """Cut sample ranges into windows of about a length."""
    found = []
    for begin, end in ranges:
        count = max(1, round((end - begin) / length))
        marks = np.linspace(begin, end, count + 1).astype(int)
        found += [(int(a), int(b)) for a, b in itertools.pairwise(marks)]
    return found


@dataclass(frozen=True, eq=False)
class Stage:
    """A fitted model and what it does on data that it was not fitted to.

    Attributes
    ----------
    fit : Fit
    free : ndarray, shape (ny,)
        Held-out root mean square error of free runs.
    guided : ndarray, shape (ny,)
        The same of runs that are led a little.
    reproducible : bool
        Whether free runs judge anything.
    """

    fit: Fit
    free: Array
    guided: Array
    reproducible: bool

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        return self.fit.model

    @property
    def error(self) -> Array:
        """Held-out error that judges: free if reproducible, else guided."""
        return self.free if self.reproducible else self.guided


def judge(fitted: Fit, setting: Setting) -> Stage:
    """Measure a fitted model on the held-out pieces."""
    common = (setting.scales, setting.dt, setting.amplitude)
    errors = free_errors(fitted.model, setting.held_out, *common, setting.state_scale)
    guided = guided_errors(fitted.model, setting.held_out, *common)
    steady = reproducible(fitted.model, setting.held_out[0], *common, setting.state_scale)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    return Stage(
        fitted, np.where(np.isfinite(rms), rms, np.inf), np.sqrt(np.mean(guided**2, axis=0)), steady
    )


def homotopy(
    model: MechanicalModel,
    setting: Setting,
    pieces: Sequence[Piece],
    reference: MechanicalModel,
    levels: Sequence[Level] = HOMOTOPY,
    iterations: int = 8,
    held: Sequence[str] = (),
    progress: Callable[[], None] | None = None,
) -> list[Fit]:
    """Fit at falling levels of guidance; return the fit of every stage.

    Parameters
    ----------
    model : MechanicalModel
    setting : Setting
    pieces : sequence of Piece
        What to fit to.
    reference : MechanicalModel
        About which the priors are centred.
    levels : sequence of Level
    iterations : int
        Most steps per stage.
    held : sequence of str
        Keys that stay as they are.
    """
    stages: list[Fit] = []
    current = with_rest(model, pieces)
    for level in levels:
        predictor = Predictor(model, setting.dt, level, setting.scales, setting.amplitude)
        if level.free and current[0].start.vector.size:
            current = fitted_starts(model, current, predictor, setting.state_scale)
        free = [
            f
            for f in free_parameters(model, setting.scales.bandwidth, reference)
            if f.key not in held
        ]
        residuals = Residuals(
            model, current, predictor, free, level.free and current[0].start.vector.size > 0,
            full_scale(model, setting.state_scale),
        )  # fmt: skip
        result = fit(residuals, iterations=iterations, progress=progress)
        if not np.isfinite(result.cost):
            continue
        stages.append(result)
        model = result.model
        if level.free:
            current = list(result.pieces)
    return stages


def best_stage(stages: Sequence[Fit], setting: Setting) -> Stage:
    """Return the stage that predicts the held-out pieces best."""
    judged = [judge(stage, setting) for stage in stages[-2:]]
    if all(s.reproducible for s in judged):
        return min(judged, key=lambda s: float(np.sum(np.log(s.free))))
    return min(judged, key=lambda s: float(np.sum(np.log(s.guided))))


def refit(
    model: MechanicalModel, data: xr.Dataset, progress: Callable[[], None] | None = None
) -> Refit:
    """Fit the parameters of a model, those of its effects included.

    Masses and input gains are known to about 5 % beforehand; data may move them further.

    Parameters
    ----------
    model : MechanicalModel
        Start values; effects that were added without parameters get theirs from screening.
    data : xarray.Dataset
        Inputs and outputs by name over ``time``, SI units.
    progress : callable, optional
        Called after every step.

    Returns
    -------
    Refit

    Raises
    ------
    InvalidInputError
        If columns are missing or the record is too short.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring
    >>> from robustpolish.simulation import linear_response
    >>> def oscillator(k):
    ...     return MechanicalModel(
    ...         [Dof("x", 1.0)], [Spring(("x", "ground"), k)], [Damper(("x", "ground"), 0.4)],
    ...         [Input("F", ("x", "ground"))], [Output("x", ("x", "ground"))])
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
    record = record_of(model, data)
    setting = prepare(model, record)
    started = _with_start_values(model, setting)
    stages = homotopy(started, setting, setting.everything, model, progress=progress)
    if not stages:
        raise ArithmeticError("no stage of the fit ended with finite errors")
    return summarise(stages[-1], record)


def _with_start_values(model: MechanicalModel, setting: Setting) -> MechanicalModel:
    """Give effects that came without parameters those that screening finds."""
    from robustpolish.identification.screening import screen

    effects = list(model.effects)
    for i, effect in enumerate(effects):
        if effect.parameters:
            continue
        others = replace(model, effects=tuple(e for e in effects if e is not effect))
        asked = Effect(effect.kind, effect.at)
        found = screen(others, setting.screened, setting.scales, setting.amplitude, [asked])
        values = found.candidates[0].effect.values if found.candidates else asked.values
        effects[i] = replace(effect, parameters=values)
    return replace(model, effects=tuple(effects))


def summarise(fitted: Fit, record: Record) -> Refit:
    """Return values, bounds and standard errors of a fit."""
    errors = standard_errors(fitted, record)
    parameters = lmfit.Parameters()
    units, undetermined = {}, []
    for f in fitted.free:
        value, error = fitted.model.parameters[f.key], errors[f.key]
        name = lmfit_name(f.key)
        parameters.add(name, value=value, min=f.lower, max=f.upper)
        parameters[name].stderr = error
        units[f.key] = unit_of(fitted.model, f.key)
        if not np.isfinite(error) or error > abs(value) / 3:
            undetermined.append(f.key)
    size = np.std(record.Y, axis=0)
    nrmse = dict(zip(fitted.model.output_names, (fitted.rmse / size).tolist(), strict=True))
    return Refit(fitted.model, parameters, units, nrmse, tuple(undetermined), errors)


def standard_errors(fitted: Fit, record: Record) -> dict[str, float]:
    """Return standard errors, residuals taken as coloured as they are.

    The information is divided by the variance inflation of autocorrelated residuals.
    """
    inflation = max(_inflation(e) for e in (fitted.errors / fitted.sigma).T)
    information = fitted.information
    keep = [j for j in range(len(fitted.free)) if information[j, j] > 0]
    errors = {f.key: np.inf for f in fitted.free}
    if keep:
        block = information[np.ix_(keep, keep)]
        size = np.sqrt(np.diag(block))
        covariance = np.linalg.pinv(block / np.outer(size, size), rcond=1e-12, hermitian=True)
        share = float(np.mean((fitted.errors / fitted.sigma) ** 2))
        for row, j in enumerate(keep):
            f: FreeParameter = fitted.free[j]
            variance = max(covariance[row, row], 0.0) / size[row] ** 2 * inflation * share
            errors[f.key] = float(np.sqrt(variance) * f.scale)
    return errors


def _inflation(e: Array) -> float:
    """Return one plus twice the sum of squared autocorrelations, Bartlett's factor."""
    e = np.nan_to_num(e - np.mean(e))
    power = float(e @ e)
    if power == 0:
        return 1.0
    lags = min(200, len(e) // 10)
    rho = np.array([e[k:] @ e[:-k] for k in range(1, lags)]) / power
    return float(1 + 2 * np.sum(rho**2))


def lmfit_name(key: str) -> str:
    """Return a key as a name that lmfit accepts."""
    return "".join(c if c.isalnum() else "_" for c in key).strip("_")
