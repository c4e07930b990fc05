"""What effects on inputs and outputs make of signals, and how measured outputs lose it again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.effects.along import lagged
from robustpolish.effects.kind import Timing
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.parts import VELOCITY
from robustpolish.simulation.between import LINEAR, SMOOTH, Lines, between, lines_through
from robustpolish.validation import described, invalid

# How much of the signal may be left over when output effects are put on again; it is rounding.
_LEFT_OVER = 1e-6


def signals(model: MechanicalData, data: xr.Dataset) -> Array:
    """Return the columns of `MechanicalMatrices.signals`, effects on inputs applied.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        Holds every input over ``time``.

    Returns
    -------
    ndarray, shape (samples, signals)
        At the samples.

    Raises
    ------
    InvalidInputError
        If an input is missing.
    """
    return _signals(model, data)[0]


def lines(model: MechanicalData, data: xr.Dataset) -> Lines | None:
    """Return what signals do between the samples, None if all are linear.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        As of :func:`signals`.

    Returns
    -------
    Lines or None
        See :mod:`robustpolish.simulation.between`.
    """
    return _signals(model, data)[1]


def _signals(model: MechanicalData, data: xr.Dataset) -> tuple[Array, Lines | None]:
    """Return the signals at the samples, and between them where one of them is not linear."""
    for name in model.input_names:
        if name not in data:
            raise invalid(
                "data", described(f"no column {name!r}"), "every input", "Check the column names."
            )
    time = np.asarray(data["time"].values, dtype=float)
    m = model.matrices
    columns = [np.asarray(data[name].values, dtype=float) for name in m.force_inputs]
    for signal in m.imposed_signals:
        if signal.name in data:
            columns.append(np.asarray(data[signal.name].values, dtype=float))
        else:
            order = 1 if signal.quantity == VELOCITY else 2
            columns.append(CubicSpline(time, data[signal.source].values)(time, order))
    W = np.column_stack(columns) if columns else np.zeros((time.size, 0))
    timed: dict[int, _Timing] = {}
    for effect in _on(model, "input"):
        timing = effect.definition.timing
        for j, (name, source) in enumerate(zip(m.signals, m.sources, strict=True)):
            if source != effect.at[0]:
                continue
            if timing is None:
                W[:, j] = _changed(effect, W[:, j], time, derivative=name != source)
                continue
            # an imposed motion has a velocity, so that it is smooth
            first = _Timing(LINEAR if j < len(m.force_inputs) else SMOOTH)
            timed[j] = timed.get(j, first).then(Timing(*timing(effect.values)))
    step = (time[-1] - time[0]) / (time.size - 1)
    acting = {j: timing.acting(W[:, j], step) for j, timing in timed.items()}
    for j, (at_samples, _, _) in acting.items():
        W[:, j] = at_samples
    if all(timing.linear for timing in timed.values()):
        return np.ascontiguousarray(W), None
    begin, end = (side.copy() for side in lines_through(W))
    for j, (_, *sides) in acting.items():
        begin[:, j], end[:, j] = sides
    return np.ascontiguousarray(W), Lines(begin, end)


class _Timing(NamedTuple):
    """What a signal is between its samples, how late it acts, and the lags with which it does."""

    order: float
    delay: float = 0.0
    lags: tuple[float, ...] = ()

    def then(self, more: Timing) -> _Timing:
        """Return it with a hold, a delay or a lag more."""
        order = self.order if more.order is None else more.order
        lags = (*self.lags, more.lag) if more.lag > 0 else self.lags
        return _Timing(order, self.delay + more.delay, lags)

    @property
    def linear(self) -> bool:
        """Whether the signal is linear between the samples, if only by a lag."""
        return bool(self.lags) or self._at_once

    @property
    def _at_once(self) -> bool:
        return (self.order, self.delay) == (LINEAR, 0.0)

    def acting(self, u: Array, step: float) -> tuple[Array, Array, Array]:
        """Return a signal as it acts: at the samples, and at both ends of the step after each."""
        if self._at_once:
            at, (begin, end) = u, lines_through(u)
        else:
            at, begin, end = between(u, step, self.order, self.delay)
        for lag in self.lags:
            at = lagged(begin, end, step, lag)
            begin, end = lines_through(at)
        return at, begin, end


def _changed(effect: Effect, signal: Array, time: Array, derivative: bool) -> Array:
    """Return what an effect makes of a signal; a constant that it adds has no derivative."""
    changed = effect.on_signal(signal, time)
    if not derivative:
        return changed
    rest = effect.on_signal(np.zeros(time.size), time)
    twice = effect.on_signal(2 * signal, time) - rest
    if np.max(np.abs(twice - 2 * (changed - rest))) > _LEFT_OVER * np.max(np.abs(twice)):
        raise invalid(
            f"{effect.kind}.at",
            effect.at[0],
            "an input that is a force",
            "Of a motion that an input imposes its velocity would have to change, too.",
        )
    return changed - rest


def measured(model: MechanicalData, outputs: Array, time: Array) -> Array:
    """Return outputs as the sensors show them: with the effects on outputs.

    Parameters
    ----------
    model : MechanicalData
    outputs : ndarray, shape (samples, ny)
    time : ndarray, shape (samples,)
        In s.

    Returns
    -------
    ndarray, shape (samples, ny)
    """
    result = outputs.copy()
    for effect in _on(model, "output"):
        j = model.output_names.index(effect.at[0])
        result[:, j] = effect.on_signal(result[:, j], time)
    return result


def raw_outputs(model: MechanicalData, Y: Array, time: Array) -> Array:
    """Take the effects on outputs out of measured outputs.

    Parameters
    ----------
    model : MechanicalData
    Y : ndarray, shape (samples, ny)
    time : ndarray, shape (samples,)
        In s.

    Returns
    -------
    ndarray, shape (samples, ny)

    Raises
    ------
    InvalidInputError
        If an effect is not linear and sample by sample, apart from a constant.
    """
    effects = _on(model, "output")
    if not effects:
        return Y
    zero = measured(model, np.zeros_like(Y), time)
    gain = measured(model, np.ones_like(Y), time) - zero
    raw = (Y - zero) / np.where(gain == 0, 1.0, gain)
    left_over = np.abs(measured(model, raw, time) - Y) * (gain != 0)
    size = np.max(np.abs(Y) + np.abs(zero), axis=0, initial=0.0)
    for effect in effects:
        j = model.output_names.index(effect.at[0])
        if np.max(left_over[:, j], initial=0.0) > _LEFT_OVER * size[j]:
            raise invalid(
                f"{effect.kind}.on_signal",
                described(f"an effect on {effect.at[0]!r} that measured data cannot be freed of"),
                "each sample times a factor plus a constant",
                "Such an effect can be simulated only.",
            )
    return np.ascontiguousarray(raw)


def _on(model: MechanicalData, domain: str) -> list[Effect]:
    return [effect for effect in model.effects if effect.definition.domain == domain]
