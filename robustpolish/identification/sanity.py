"""Plausibility checks of a record, a model and a fit: signs, units, clipping, dropouts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.signal import csd, welch

from robustpolish.base.arrays import Vector
from robustpolish.base.results import tables
from robustpolish.identification.record import poles_of
from robustpolish.machines.loop import followed
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import ACCELERATION, FORCE, Output
from robustpolish.machines.simulation import simulate_model
from robustpolish.signals.raw import clipped_plateaus, marked_runs, sampling_time

# Thresholds of warnings; a false alarm costs more than one that is missing.

# Samples of exactly one value that make a dropout: fewer come about by chance where a converter is
# coarse.
_HELD = 5
# Times the largest step nearby that a signal jumps when a dropout ends. One that was held for five
# steps at full speed jumps by six of them; one that stopped by itself, as a mass in friction does,
# by one.
_JUMP = 3.0
# Share of a channel in stretches of one value beyond which it is held, coarse or stuck by nature.
_HELD_SHARE = 0.2
# Correlation of neighbouring samples below which a displacement is no motion, but noise: a mass
# moves on from one sample to the next.
_WHITE = 0.2
# Samples below which nothing is said of noise, signs and units.
_FEWEST_SAMPLES = 200
# Stretches that spectra are averaged over: enough for a coherence, few enough for lines that are
# narrow against the modes.
_AVERAGES = 7
# From which coherence a line is taken to follow from the inputs; of lines of noise one in 500 does.
_COHERENT = 0.8
# Share of the largest power that a line of the model needs: what is less is leakage.
_EXCITED = 1e-5
# Such lines that have to speak for a sign or a unit, and times the lowest how far they have to
# reach. Between the resonance of a machine and that of its model, where the stiffness is wrong, one
# swings against the other with nothing wrong with the sign.
_LINES, _BAND = 8, 3.0
# Share of them that have to be turned, within 45 degrees, and the factor that half of the gains
# have to lie within: between two resonances they run from nothing to infinity.
_REVERSED, _STEADY = 0.8, 1.7
# Factor by which the ratio of amplitudes may miss a power of a thousand, as stiffnesses are
# guessed, and that for 57.3 and 9.81, which a guess might be off by.
_TOLERANCES = {"near": 2.5, "close": 1.08}
# Factor that half of the lines have to lie within, for a ratio to be one of units.
_SCATTER = 3.0
# Distance of outputs that have changed places from the model, in the logarithm, below which they
# fit, and times that, by which they have to be further away as they are.
_CROSSED, _STRAIGHT = 0.3, 3.0
# Times the spread of an output that its mean may lie from the model's.
_MEAN = 3.0
# Factor by which a fit may change a mass, a stiffness or a gain, 1.5 decades, and a damping, which
# is guessed to a decade at best; and that by which a change may miss one that units would make.
_NO_DAMPING = 1e-9
_MOVED, _DAMPING_MOVED, _GUESSED = 30.0, 100.0, 3.0


# Checks of single channels: clipped peaks, dropouts, no motion.


def _channel_warnings(item: Output, values: Vector, time: Vector) -> list[str]:
    found = [_clipping(item.name, values)]
    # A mass that friction holds has an acceleration that is constant, and jumps when it breaks
    # loose; a force may do both in contacts.
    if item.quantity not in (ACCELERATION, FORCE):
        found += [_dropouts(item.name, values, time), _no_motion(item.name, values)]
    return [sentence for sentence in found if sentence]


def _clipping(name: str, values: Vector) -> str:
    """Say so if a channel was cut off at the end of its range, "" if not."""
    plateaus = clipped_plateaus(values)
    if not plateaus:
        return ""
    return (
        f"{name} sticks at its extremes in {len(plateaus)} places ({sum(plateaus)} samples at "
        f"{values.min():.4g} or {values.max():.4g}): its peaks look clipped. Widen the range of "
        "the sensor or amplifier, or lower the amplitude, and record again; what a fit makes of "
        "clipped peaks is a stop or friction that is not there"
    )


def _dropouts(name: str, values: Vector, time: Vector) -> str:
    """Say so if a channel freezes in the middle of a motion and jumps afterwards, "" if not."""

    def jumps_out(first: int, last: int) -> bool:
        """Whether a stretch of one value ends in a jump, larger than the steps nearby."""
        reach = 4 * (last + 1 - first)
        before = np.abs(np.diff(values[max(0, first - reach) : first]))
        behind = np.abs(np.diff(values[last + 1 : last + 2 + reach]))
        if min(before.size, behind.size) < _HELD:
            return False
        usual = float(max(before.max(), behind.max()))
        return usual > 0 and abs(values[last + 1] - values[last]) > _JUMP * usual

    still = [(a, b + 1) for a, b in marked_runs(np.diff(values) == 0) if b + 2 - a >= _HELD]
    if sum(b + 1 - a for a, b in still) > _HELD_SHARE * values.size:
        return ""
    found = [(a, b) for a, b in still if jumps_out(a, b)]
    if not found:
        return ""
    a, b = max(found, key=lambda run: run[1] - run[0])
    more = f", and in {len(found) - 1} other places" if len(found) > 1 else ""
    return (
        f"{name} stands still for {b + 1 - a} samples at {time[a]:.6g} s and then jumps{more}: it "
        "looks like a dropout of the sensor or the logger. Leave the part out with between=, or "
        "blank the samples in the file, so that they count as missing"
    )


def _no_motion(name: str, values: Vector) -> str:
    """Say so if a displacement or velocity is noise from one sample to the next, "" if not."""
    if values.size < _FEWEST_SAMPLES:
        return ""
    moving = values - values.mean()
    power = float(moving @ moving)
    if power == 0:
        return f"{name} never changes. Check the sensor and its cable"
    lags = [float(moving[k:] @ moving[:-k]) / power for k in range(1, 6)]
    if max(abs(lag) for lag in lags) > _WHITE:
        return ""
    return (
        f"{name} holds no motion: its samples know nothing of each other (correlation "
        f"{lags[0]:.2f}), as noise does. Check the sensor and its range, or move the machine more"
    )


# Coherent gain: measured over simulated outputs, line by line.


class CoherentGain(NamedTuple):
    """Measured over simulated, at the frequencies where one follows from the other.

    Attributes
    ----------
    enough : bool
        Whether so many lines over so wide a band speak, that no resonance speaks for all; without
        them the figures are infinite.
    size : float
        Median of the absolute value; 1 where the model is right.
    scatter : float
        Factor that half of the lines lie within, around `size`.
    reversed : float
        Share of the lines whose sign is turned, within 45 degrees.
    distance : float
        Median distance from 1, in the logarithm: 0.1 is 10 % or 6 degrees.
    """

    enough: bool
    size: float = math.inf
    scatter: float = math.inf
    reversed: float = math.inf
    distance: float = math.inf


def coherent_gain(simulated: Vector, measured: Vector, dt: float) -> CoherentGain:
    """Compare two signals line by line, by Welch's method.

    What follows from the inputs counts, however the record starts: a free run with a fitted start
    can take any size and sign, this cannot.

    Parameters
    ----------
    simulated, measured : ndarray, shape (samples,)
    dt : float
        Sampling step in s.

    Returns
    -------
    CoherentGain

    References
    ----------
    P. D. Welch, IEEE Trans. Audio Electroacoustics 15 (1967) 70-73; J. S. Bendat and A. G.
    Piersol, Random Data, 4th ed., section 6.2.1.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> gain = coherent_gain(noise, -2 * noise, 0.01)
    >>> gain.enough, round(gain.size, 6), gain.reversed
    (True, 2.0, 1.0)
    """
    length = int(2 * simulated.size / (_AVERAGES + 1))
    f, across = csd(simulated, measured, 1 / dt, nperseg=length, detrend="linear")
    power, seen = (
        welch(y, 1 / dt, nperseg=length, detrend="linear")[1] for y in (simulated, measured)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.abs(across) ** 2 / (power * seen)
    # The lowest two lines hold what is left of trends.
    spoken = np.flatnonzero((coherence > _COHERENT) & (power > _EXCITED * power.max()))
    spoken = spoken[spoken >= 2]
    lines = f[spoken]
    if lines.size < _LINES or lines[-1] < _BAND * lines[0]:
        return CoherentGain(False)
    gain = across[spoken] / power[spoken]
    size = float(np.median(np.abs(gain)))
    return CoherentGain(
        True,
        size,
        float(np.exp(np.median(np.abs(np.log(np.abs(gain) / size))))),
        float(np.mean(np.abs(np.angle(-gain)) < np.pi / 4)),
        float(np.median(np.abs(np.log(gain)))),
    )


# Checks of measured against simulated outputs: signs, units, exchanged sensors, means.

_UNITS = tables(__file__)["units"]


def _reversed_outputs(gains: Mapping[str, CoherentGain]) -> list[str]:
    """Name the outputs whose sign is turned at nearly all frequencies."""
    turned = [
        name
        for name, gain in gains.items()
        if gain.enough and gain.reversed >= _REVERSED and gain.scatter <= _STEADY
    ]
    if len(turned) == len(gains) > 1:
        return [
            f"{', '.join(turned)} all move against the model, at nearly all frequencies. Check the "
            "sign of the input and the direction it acts in"
        ]
    return [
        f"{name} moves against the model, at {100 * gains[name].reversed:.0f} % of the frequencies "
        "that reach it. Check the direction of its sensor"
        + (" or of the input" if len(gains) == 1 else "")
        for name in turned
    ]


def _unit_factors(gains: Mapping[str, CoherentGain], inputs: Sequence[str]) -> list[str]:
    """Name the outputs whose size is off by a factor that a confusion of units makes.

    Where half of the lines do not lie close together, only powers of a thousand are named.
    """
    found = {}
    for name, gain in gains.items():
        for factor, kind, words in _UNITS["amplitude"]:
            tolerance = _TOLERANCES[kind]
            scatters = gain.scatter > (_SCATTER if kind == "near" else tolerance)
            near = gain.enough and abs(math.log(gain.size / factor)) <= math.log(tolerance)
            if near and not scatters:
                found[name] = words
                break
    source = ", ".join(inputs)
    # An input in the wrong unit makes all outputs wrong, and a sensor only its own.
    every = f" and of {source}" if len(found) == len(gains) else ""
    return [
        f"{name} is {gains[name].size:.3g} times as large as the model makes it from {source}, "
        f"{guess}. Check the unit of {name}{every}, and mend it with units="
        for name, guess in found.items()
    ]


def _exchanged_outputs(
    gains: Mapping[tuple[str, str], CoherentGain], kinds: Mapping[str, str]
) -> list[str]:
    """Name two outputs of one kind that fit far better if they change places."""
    found = []
    for first, second in combinations(kinds, 2):
        near = max(gains[pair].distance for pair in ((first, second), (second, first)))
        # As they are, the outputs may have nothing in common with the model at all.
        far = min(gains[name, name].distance for name in (first, second))
        if kinds[first] == kinds[second] and near < _CROSSED and far > _STRAIGHT * near:
            found.append(
                f"{first} and {second} look exchanged: each follows the model of the other one "
                f"(within {100 * near:.0f} % at half of the frequencies). Check the cables, "
                "or read with rename="
            )
    return found


def _input_warnings(
    model: MechanicalModel, data: xr.Dataset, measured: Mapping[str, Vector]
) -> list[str]:
    """Compare with what the inputs make of the model at rest, however the record starts."""
    moving = [name for name in model.columns if np.ptp(np.asarray(data[name].values)) > 0]
    if not moving:
        return []
    with np.errstate(all="ignore"):
        forced = simulate_model(model, data).outputs
        if not np.isfinite(forced**4).all():  # it diverges, and powers of spectra are to be doubles
            return []
    dt = sampling_time(data)
    gains = {
        (first, second.name): coherent_gain(forced[:, i], values, dt)
        for first, values in measured.items()
        for i, second in enumerate(model.outputs)
    }
    own = {name: gains[name, name] for name in measured}
    kinds = {item.name: f"{item.quantity} in {model.unit_of(item)}" for item in model.outputs}
    swapped = _exchanged_outputs(gains, kinds)
    return swapped or [*_unit_factors(own, moving), *_reversed_outputs(own)]


def _mean_warnings(
    model: MechanicalModel, measured: Mapping[str, Vector], simulated: xr.Dataset
) -> list[str]:
    """Name the outputs whose mean lies far from the model's, against the size of their motion."""
    runs = {name: np.asarray(simulated[name].values, dtype=float) for name in measured}
    poles = np.abs(poles_of(model))
    # only where springs hold every coordinate has the model a place of rest
    at_rest = poles.size and np.min(poles) > 1e-6 * np.max(poles)
    if not at_rest or not all(np.isfinite(run).all() for run in runs.values()):
        return []
    found = []
    for item in model.outputs:
        name, unit = item.name, model.unit_of(item)
        away = float(np.mean(measured[name]) - np.mean(runs[name]))
        size = max(float(np.std(measured[name])), float(np.std(runs[name])))
        if size > 0 and abs(away) > _MEAN * size:
            gravity = unit == "m/s^2" and 9.5 < abs(away) < 10.1
            what = (
                "the sensor feels gravity: take it off the channel"
                if gravity
                else "take the sensor's zero off the channel, or give the model the force that "
                "holds it there"
            )
            found.append(
                f"the mean of {name} is {away:.3g} {unit} from the model, "
                f"{abs(away) / size:.2g} times the size of its motion: {what}"
            )
    return found


# Records of machines in a feedback loop.

# Samples of the past that predict an input, samples for each number of that, share of an input's
# size that is rounding, and share of what its own past leaves that outputs explain at least: a
# weaker loop changes no frequency response by more.
_PAST, _EACH, _ROUNDED, _MATTERS = 16, 10, 1e-6, 0.01
_OTHER_COMMANDS = 0.1
"""Share of its size by which a command may be another than the loop's: its converters round."""
_LOOKED_AT = 10_000
"""Samples that tell of a loop."""


def made_in_loop(
    data: xr.Dataset, inputs: Sequence[str], outputs: Sequence[str]
) -> Literal["yes", "no sign", "not known"]:
    """Return whether past outputs predict an input that its own past does not."""
    past = min(_PAST, data.sizes["time"] // (_EACH * (2 + len(outputs))))
    if past < 4 or not outputs:
        return "not known"
    rows = {n: data[n].values - data[n].values.mean() for n in (*inputs, *outputs)}
    rows = {name: row / row.std() for name, row in rows.items()}

    def lagged(name: str, count: int) -> NDArray[np.float64]:
        return np.lib.stride_tricks.sliding_window_view(rows[name][:-1], count)[2 * past - count :]

    verdicts = set()
    for name in inputs:
        now = rows[name][2 * past :]
        own = np.column_stack([np.ones(now.size), lagged(name, 2 * past)])
        both = np.hstack([own, *(lagged(o, past) for o in outputs)])
        before, after = (np.var(now - A @ np.linalg.lstsq(A, now)[0]) for A in (own, both))
        if before > _ROUNDED**2:
            least = max(past * len(outputs) * np.log(now.size) / now.size, _MATTERS)
            verdicts.add(bool(np.log(before / after) > least))
    return "yes" if True in verdicts else "no sign" if verdicts else "not known"


def _loop_warnings(model: MechanicalModel, data: xr.Dataset) -> list[str]:
    """Say so if a record was made in a loop that the model does not know, or in another one."""
    if model.feedback:
        return _other_loop(model, data)
    head = data.isel(time=slice(0, _LOOKED_AT))
    moving = [n for n in (*model.input_names, *model.output_names) if np.ptp(head[n].values) > 0]
    forces = [item.name for item in model.inputs if item.imposes is None and item.name in moving]
    outputs = [name for name in model.output_names if name in moving]
    looped = [name for name in forces if made_in_loop(head, [name], outputs) == "yes"]
    if not looped:
        return []
    return [
        f"{', '.join(looped)}: past outputs predict it, as in a feedback loop. It is taken as "
        "given: noise and missing forces went round the loop into it, so that frequency responses, "
        "and the numbers of what moves little, lean towards what the controller did. A [feedback] "
        "in the model runs the loop from its references; a plant that is unstable or integrates is "
        "judged without one in windows"
    ]


def _other_loop(model: MechanicalModel, data: xr.Dataset) -> list[str]:
    """Name the commands that differ from what the model's loops make of the measured outputs."""
    found, names = followed(model, data).commands, model.commands
    told = {n: np.asarray(data[n].values, dtype=float) for n in names if n in data}
    away = {n: float(np.std(u - found[:, names.index(n)])) for n, u in told.items()}
    size = {n: max(float(np.std(u)), 1e-300) for n, u in told.items()}
    return [
        f"{n} differs from what [feedback] makes of the measured outputs by "
        f"{100 * away[n] / size[n]:.3g} % of its size. Check gains, signs, period and references"
        for n in told
        if away[n] > _OTHER_COMMANDS * size[n]
    ]


# Checks of fitted against given numbers.


def implausible_changes(before: Mapping[str, float], after: Mapping[str, float]) -> list[str]:
    """Name the numbers of a machine that a fit moved so far that a unit must be wrong.

    Parameters
    ----------
    before, after : mapping of str to float
        ``model.parameters`` of the model as it was given and as it was fitted.

    Returns
    -------
    list of str

    Examples
    --------
    >>> implausible_changes({"spring[0].stiffness": 2.0}, {"spring[0].stiffness": 1.9e6})[0]
    'the fit moved spring[0].stiffness from 2 to 1.9e+06, by 6.0 decades, as milliseconds taken
    for seconds make it. Check the units in the model file and of the channels and the time'
    >>> air = {"dof.z.mass": 1.5, "spring[0].stiffness": 7e7, "damper[0].damping": 1e-8}
    >>> implausible_changes(air, {**air, "damper[0].damping": 1e-3})  # there was no damper
    []
    >>> implausible_changes({"dof.x.mass": 2.0}, {"dof.x.mass": 3.0})
    []
    """
    found = []
    # a damper below any share of the critical damping 2 sqrt(m k) stands for none
    most = {
        kind: max((abs(n) for k, n in before.items() if k.endswith(kind)), default=0.0)
        for kind in ("mass", "inertia", "stiffness")
    }
    none = _NO_DAMPING * 2 * math.sqrt(max(most["mass"], most["inertia"]) * most["stiffness"])
    for key, old in before.items():
        kind, new = key.rpartition(".")[2], after.get(key, old)
        if kind == "damping" and abs(old) <= none:
            continue
        if kind not in _UNITS["changes"] or key.startswith("effect") or old == 0 or new == 0:
            continue
        if old * new < 0:
            found.append(
                f"the fit turned the sign of {key}, from {old:.4g} to {new:.4g}. Check the "
                "direction of the sensors and of the inputs"
            )
            continue
        ratio = new / old
        if max(ratio, 1 / ratio) < (_DAMPING_MOVED if kind == "damping" else _MOVED):
            continue
        near, words = min(
            (abs(math.log(ratio / factor)), text) for factor, text in _UNITS["changes"][kind]
        )
        guess = f", {words}" if near <= math.log(_GUESSED) else ""
        found.append(
            f"the fit moved {key} from {old:.4g} to {new:.4g}, by {abs(math.log10(ratio)):.1f} "
            f"decades{guess}. Check the units in the model file and of the channels and the time"
        )
    return found


# All checks together.


def sanity_warnings(
    model: MechanicalModel,
    data: xr.Dataset,
    simulated: xr.Dataset | None = None,
    fitted: MechanicalModel | None = None,
) -> tuple[str, ...]:
    """Say what an engineer would about a record, a model and its fit before believing them.

    Parameters
    ----------
    model : MechanicalModel
        As it was given.
    data : xarray.Dataset
        Checked inputs and outputs of the model over ``time``, see
        :func:`robustpolish.identification.record.checked_data`.
    simulated : xarray.Dataset, optional
        The model's outputs over the same time, in a free run.
    fitted : MechanicalModel, optional
        The model with its numbers fitted.

    Returns
    -------
    tuple of str
        A sentence for each suspicion: the channel, what was seen, and what to do. Empty for
        most records.

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
    >>> clipped = np.clip(np.cos(2 * time), -0.8, 0.8)
    >>> data = xr.Dataset({"x": ("time", clipped, {"units": "m"})}, {"time": time})
    >>> [sentence[:37] for sentence in sanity_warnings(model, data)]
    ['x sticks at its extremes in 7 places ']
    """
    found: list[str] = []
    time = np.asarray(data["time"].values, dtype=float)
    measured = {item.name: np.asarray(data[item.name].values, float) for item in model.outputs}
    for item in model.outputs:
        found += _channel_warnings(item, measured[item.name], time)
    if time.size >= _FEWEST_SAMPLES:
        found += _input_warnings(model, data, measured)
        found += _loop_warnings(model, data)
    if simulated is not None:
        found += _mean_warnings(model, measured, simulated)
    if fitted is not None:
        found += implausible_changes(model.parameters, fitted.parameters)
    return tuple(found)
