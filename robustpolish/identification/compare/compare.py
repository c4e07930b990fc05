"""Hold a model against measured data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, overload

import control
import numpy as np
import pandas as pd
import xarray as xr
from scipy.stats import t as student

from robustpolish.arrays import Array
from robustpolish.identification.compare.comparison import Comparison, OutputError
from robustpolish.identification.compare.horizon import predict
from robustpolish.identification.compare.parameter_band import parameter_band
from robustpolish.identification.frequency.comparison import (
    FrequencyComparison,
    compare_frequency_response,
)
from robustpolish.identification.observer.missing_force import observed_motion
from robustpolish.identification.observer.reproducibility import reproducibility
from robustpolish.identification.observer.run import (
    RecordRun,
    Start,
    StartedPiece,
    fitted_start,
    free_run,
    lengths,
    rest,
    state_sizes,
    visible_sizes,
)
from robustpolish.identification.record import Record, long_enough, record_of
from robustpolish.identification.sanity.warnings import sanity_warnings
from robustpolish.long_calls import same_bits
from robustpolish.measurements import holds_frequency_response
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid, positive


@overload
@same_bits
def compare(
    model: MechanicalModel, data: xr.DataArray | control.FrequencyResponseData
) -> FrequencyComparison: ...


@overload
def compare(
    model: MechanicalModel,
    data: str | Path,
    *,
    window: float | None = ...,
    horizon: float | None = ...,
    standard_errors: Mapping[str, float] | None = ...,
) -> Comparison | FrequencyComparison: ...


@overload
def compare(
    model: MechanicalModel,
    data: xr.Dataset | pd.DataFrame,
    *,
    window: float | None = ...,
    horizon: float | None = ...,
    standard_errors: Mapping[str, float] | None = ...,
) -> Comparison: ...


def compare(
    model: MechanicalModel,
    data: Any,
    *,
    window: float | None = None,
    horizon: float | None = None,
    standard_errors: Mapping[str, float] | None = None,
) -> Comparison | FrequencyComparison:
    """Simulate a model on measured inputs and compare its outputs with the measured ones.

    By default in one free run from an estimated start: the model sees the inputs, never the
    outputs (but for the few numbers of the start). Measured frequency responses are compared
    with those of the model, effects linearised.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame
        Inputs and outputs by the names in the model, in SI units. Or frequency responses, as
        :func:`robustpolish.read_frequency_response` reads and returns them.
    window : float, optional
        Length in s of free runs that start anew, for plants that drift or are chaotic.
    horizon : float, optional
        Predict this far ahead, in s, from a state that an observer estimates from the outputs up
        to then; 0 is one sample ahead. Excludes `window`.
    standard_errors : mapping of str to float, optional
        Standard errors of parameters by their keys in ``model.parameters``; they give the band of
        the simulated outputs, the parameters being taken as independent.

    Returns
    -------
    Comparison
        A FrequencyComparison for frequency responses.

    Raises
    ------
    InvalidInputError
        If a column is missing, in another unit or not finite, time is not uniform, the sampling
        rate is too low for the model's modes, or `window` or `horizon` do not fit the record.

    Notes
    -----
    The fit is 100 (1 - ||y - yhat|| / ||y - mean(y)||), as in MATLAB's ``compare`` (L. Ljung,
    System Identification Toolbox). The band of the RMS error comes from the variance of the mean
    square over blocks, long against the memory of the error.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 4.0)],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> time = np.arange(1000) * 0.01
    >>> decay = np.cos(2 * time)  # a free decay of just this oscillator
    >>> data = xr.Dataset({"x": ("time", decay, {"units": "m"})}, {"time": time})
    >>> print(f"{rp.compare(model, data).fit_percent:.3f} %")
    100.000 %
    """
    if holds_frequency_response(data):
        _over_time_only(window=window, horizon=horizon, standard_errors=standard_errors)
        return compare_frequency_response(model, data)
    if window is not None and horizon is not None:
        raise invalid("horizon", horizon, "either a window or a horizon", "Leave one of them out.")
    record = record_of(model, data)
    run = free_run(model, record)
    notes: list[str] = [str(note) for note in record.data.attrs.get("notes", ())]
    skip = 0
    if horizon is not None:
        method, span = "prediction", positive("horizon", horizon, "s", zero=True)
        simulated, first = predict(run, long_enough(model, record), span)
        pieces = [first]
        skip = int(np.argmin(np.isnan(simulated[:, 0])))  # before the first prediction
    else:
        method, span = ("free run", None) if window is None else ("windows", window)
        pieces = _started(run, record, _stretches(run, record, window))
        simulated = np.concatenate([run.over(piece).outputs for piece in pieces])
    starts = np.array([piece.start.vector for piece in pieces])
    whole = StartedPiece(record, pieces[0].start)
    found = reproducibility(run, whole, simulated, span, horizon is not None)
    if not found.reproducible or found.reason:
        notes.append(found.reason)
    time = record.data["time"]
    run_outputs = _dataset(model, simulated, time)
    free = run_outputs if method == "free run" else None
    notes += sanity_warnings(model, record.data, free)
    errors = {
        item.name: output_error(
            item.name, model.unit_of(item), record.Y[skip:, i], simulated[skip:, i]
        )
        for i, item in enumerate(model.outputs)
    }
    band = None
    if standard_errors:
        widths = parameter_band(model, standard_errors, _again(record, pieces, horizon))
        band = _dataset(model, widths, time)
    return Comparison(
        model=model,
        data=record.data,
        simulated=run_outputs,
        outputs=errors,
        method=method,
        span=span,
        starts=starts,
        reproducibility=found,
        band=band,
        notes=tuple(notes),
    )


def _over_time_only(**given: Any) -> None:
    """Refuse what means nothing for frequency responses."""
    for name, value in given.items():
        if value is not None:
            shown = described(f"{value} for frequency responses")
            raise invalid(name, shown, "a record over time", "Leave it out.")


def _started(
    run: RecordRun, record: Record, stretches: list[tuple[int, int]]
) -> list[StartedPiece]:
    """Return stretches of a record with the starts that suit a model best."""
    model, still = run.model, rest(run.model)
    observed = None if run.linear else observed_motion(model, record)
    linear = run if run.linear else free_run(model.without_effects(), record)
    unmoved = rest(linear.model)
    pieces = []
    for first, last in stretches:
        part, guesses = record.part(first, last), [still]
        # the linear part of a model with effects says something over a short stretch only
        seen = part if run.linear else part.part(0, lengths(part.samples)[0])
        sizes = visible_sizes(linear, seen, unmoved)
        if not run.linear:
            of_linear = fitted_start(linear, seen, [unmoved], sizes)
            guesses.append(Start(of_linear.state, still.internal))
            sizes = state_sizes(model, sizes)
        if observed is not None:
            guesses.append(observed.start(model, first))
        pieces.append(StartedPiece(part, fitted_start(run, part, guesses, sizes)))
    return pieces


def _stretches(run: RecordRun, record: Record, window: float | None) -> list[tuple[int, int]]:
    """First and last sample of each free run; a short rest belongs to the last one."""
    if window is None:
        return [(0, record.samples)]
    length = round(positive("window", window, "s") / record.dt)
    least = rest(run.model).vector.size + 1
    if length < least or length > record.samples:
        raise invalid(
            "window",
            described(f"{window} s, {length} samples"),
            f"{least} to {record.samples} samples of {record.dt:.6g} s",
            "Choose a window of a few periods.",
        )
    edges = [*range(0, record.samples - length + 1, length), record.samples]
    # A rest shorter than half a window would be judged on its start alone.
    if len(edges) > 2 and edges[-1] - edges[-2] > length + length // 2:
        edges.insert(-1, edges[-2] + length)
    return list(pairwise(edges))


def _again(
    record: Record, pieces: Sequence[StartedPiece], horizon: float | None
) -> Callable[[MechanicalModel], Array]:
    """How to simulate a changed model in the same way, from the same starts."""

    def simulate(model: MechanicalModel) -> Array:
        run = free_run(model, record)
        if horizon is not None:
            return predict(run, record, horizon)[0]
        return np.concatenate([run.over(piece).outputs for piece in pieces])

    return simulate


def output_error(name: str, unit: str, measured: Array, simulated: Array) -> OutputError:
    """Return the error figures of one output; they are infinite where the simulation diverged.

    Parameters
    ----------
    name, unit : str
    measured, simulated : ndarray, shape (samples,)

    Returns
    -------
    OutputError
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = (measured - simulated) ** 2
    square = np.where(np.isfinite(square), square, np.inf)
    mean_square = float(np.mean(square))
    rmse = float(np.sqrt(mean_square))
    spread, size = float(np.std(measured)), float(np.sqrt(np.mean(measured**2)))
    low, high = _mean_square_band(square, mean_square)
    return OutputError(
        name=name,
        unit=unit,
        nrmse=rmse / spread if spread > 0 else (0.0 if rmse == 0 else np.inf),
        rmse=rmse,
        band=(low, high),
        relative=rmse / size if size > 0 else (0.0 if rmse == 0 else np.inf),
    )


def _mean_square_band(square: Array, mean: float) -> tuple[float, float]:
    """95 % band of the RMS value, from the scatter of the mean square over long blocks.

    The logarithm of a mean square scatters symmetrically enough; Student's t makes up for the
    small number of blocks.
    """
    blocks = min(20, square.size // 4)
    if blocks < 2 or not np.isfinite(mean) or mean == 0:
        root = float(np.sqrt(mean))
        return root, root
    length = square.size // blocks
    means = square[: blocks * length].reshape(blocks, length).mean(axis=1) / mean
    # Neighbouring blocks that resemble each other count as fewer.
    deviation = means - means.mean()
    total = float(deviation @ deviation)
    alike = float(deviation[1:] @ deviation[:-1]) / total if total > 0 else 0.0
    alike = float(np.clip(alike, 0.0, 0.9))
    spread = float(np.std(means, ddof=1)) / np.sqrt(blocks) * np.sqrt((1 + alike) / (1 - alike))
    width = float(student.ppf(0.975, blocks - 1)) * spread / 2  # half: root of the mean square
    root = float(np.sqrt(mean))
    return root * np.exp(-width), root * np.exp(width)


def _dataset(model: MechanicalModel, values: Array, time: xr.DataArray) -> xr.Dataset:
    return xr.Dataset(
        {
            item.name: ("time", values[:, i], {"units": model.unit_of(item)})
            for i, item in enumerate(model.outputs)
        },
        coords={"time": time},
    )
