"""Plausibility checks of a record, a model and a fit: signs, units, clipping, dropouts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import xarray as xr
from scipy.signal import get_window

from robustpolish.base.arrays import AnyVector, Vector
from robustpolish.identification.record import poles_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import ACCELERATION, FORCE, Output
from robustpolish.machines.simulation import simulate_model
from robustpolish.signals.quality import clipped_plateaus, marked_runs, sampling_time

# Thresholds of warnings; a false alarm costs more than one that is missing.


@dataclass(frozen=True)
class Limits:
    """The thresholds of the warnings.

    Attributes
    ----------
    held : int
        Samples of exactly one value that make a dropout: fewer come about by chance in a coarse
        converter.
    jump : float
        Times the largest step nearby that a signal jumps when a dropout ends. One that was held
        for five steps at full speed jumps by six of them; one that stopped by itself, as a mass in
        friction does, by one.
    repeats : float
        Share of a channel in stretches of one value beyond which it is held, coarse or stuck by
        nature.
    white : float
        Correlation of neighbouring samples below which a displacement is no motion, but noise: a
        mass moves on from one sample to the next.
    least : int
        Samples below which nothing is said of noise, signs and units.
    averages : int
        Stretches that spectra are averaged over: enough for a coherence, few enough for lines
        that are narrow against the modes.
    coherence : float
        From which a line is taken to follow from the inputs; of lines of noise one in 500 does.
    excited : float
        Share of the largest power that a line of the model needs: what is less is leakage.
    lines : int
        Such lines that have to speak for a sign or a unit, and `band`, times the lowest, how far
        they have to reach. Between the resonance of a machine and that of its model, where the
        stiffness is wrong, one swings against the other with nothing wrong with the sign.
    band : float
        See `lines`.
    reversed : float
        Share of them that have to be turned, within 45 degrees, and `steady`, the factor that half
        of the gains have to lie within: between two resonances they run from nothing to infinity.
    steady : float
        See `reversed`.
    near : float
        Factor by which the ratio of amplitudes may miss a power of a thousand, as stiffnesses are
        guessed, and `close` for 57.3 and 9.81, which a guess might be off by.
    close : float
        See `near`.
    scatter : float
        Factor that half of the lines have to lie within, for a ratio to be one of units.
    crossed : float
        Distance of outputs that have changed places from the model, in the logarithm, below which
        they fit, and `straight`, times that, by which they have to be further away as they are.
    straight : float
        See `crossed`.
    mean : float
        Times the spread of an output that its mean may lie from the model's.
    moved : float
        Factor by which a fit may change a mass, a stiffness or a gain; 1.5 decades.
    damped : float
        The same for dampings, which are guessed to a decade at best.
    guessed : float
        Factor by which a change may miss the one that a confusion of units would make.
    """

    held: int = 5
    jump: float = 3.0
    repeats: float = 0.2
    white: float = 0.2
    least: int = 200
    averages: int = 7
    coherence: float = 0.8
    excited: float = 1e-5
    lines: int = 8
    band: float = 3.0
    reversed: float = 0.8
    steady: float = 1.7
    near: float = 2.5
    close: float = 1.08
    scatter: float = 3.0
    crossed: float = 0.3
    straight: float = 3.0
    mean: float = 3.0
    moved: float = 30.0
    damped: float = 100.0
    guessed: float = 3.0


LIMITS = Limits()
"""What the warnings go by."""


# Checks of single channels: clipped peaks, dropouts, no motion.


def clipping(name: str, values: Vector) -> str:
    """Say so if a channel was cut off at the end of its range, "" if not.

    Parameters
    ----------
    name : str
    values : ndarray, shape (samples,)

    Returns
    -------
    str

    Examples
    --------
    >>> sine = np.sin(np.arange(1000) / 20)
    >>> clipping("x", sine), clipping("x", np.clip(sine, -0.8, 0.8))[:27]
    ('', 'x sticks at its extremes in')
    """
    plateaus = clipped_plateaus(values)
    if not plateaus:
        return ""
    return (
        f"{name} sticks at its extremes in {len(plateaus)} places ({sum(plateaus)} samples at "
        f"{values.min():.4g} or {values.max():.4g}): its peaks look clipped. Widen the range of "
        "the sensor or amplifier, or lower the amplitude, and record again; what a fit makes of "
        "clipped peaks is a stop or friction that is not there"
    )


def dropouts(name: str, values: Vector, time: Vector) -> str:
    """Say so if a channel freezes in the middle of a motion and jumps afterwards, "" if not.

    Parameters
    ----------
    name : str
    values, time : ndarray, shape (samples,)

    Returns
    -------
    str

    Examples
    --------
    >>> time = np.arange(1000) / 100
    >>> frozen = np.sin(5 * time)
    >>> frozen[700:715] = frozen[700]
    >>> dropouts("x", frozen, time)[:39]
    'x stands still for 15 samples at 7 s an'
    """
    still = marked_runs(np.diff(values) == 0)
    long = [(a, b + 1) for a, b in still if b + 2 - a >= LIMITS.held]
    share = sum(b + 1 - a for a, b in long) / values.size
    if not long or share > LIMITS.repeats:
        return ""
    found = [(a, b) for a, b in long if _jumps_out(values, a, b)]
    if not found:
        return ""
    a, b = max(found, key=lambda run: run[1] - run[0])
    more = f", and in {len(found) - 1} other places" if len(found) > 1 else ""
    return (
        f"{name} stands still for {b + 1 - a} samples at {time[a]:.6g} s and then jumps{more}: it "
        "looks like a dropout of the sensor or the logger. Leave the part out with between=, or "
        "blank the samples in the file, so that they count as missing"
    )


def no_motion(name: str, values: Vector) -> str:
    """Say so if a displacement or velocity is noise from one sample to the next, "" if not.

    Parameters
    ----------
    name : str
    values : ndarray, shape (samples,)

    Returns
    -------
    str

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(1000)
    >>> no_motion("x", noise)[:40], no_motion("x", np.cumsum(noise))
    ('x holds no motion: its samples know noth', '')
    """
    if values.size < LIMITS.least:
        return ""
    moving = values - values.mean()
    power = float(moving @ moving)
    if power == 0:
        return f"{name} never changes. Check the sensor and its cable"
    lags = [float(moving[k:] @ moving[:-k]) / power for k in range(1, 6)]
    if max(abs(lag) for lag in lags) > LIMITS.white:
        return ""
    return (
        f"{name} holds no motion: its samples know nothing of each other (correlation "
        f"{lags[0]:.2f}), as noise does. Check the sensor and its range, or move the machine more"
    )


def _jumps_out(values: Vector, first: int, last: int) -> bool:
    """Whether a stretch of one value inside a record ends in a jump, larger than steps nearby."""
    reach = 4 * (last + 1 - first)
    before = np.abs(np.diff(values[max(0, first - reach) : max(first, 0)]))
    behind = np.abs(np.diff(values[last + 1 : last + 2 + reach]))
    if before.size < LIMITS.held or behind.size < LIMITS.held:
        return False
    usual = float(max(before.max(), behind.max()))
    return usual > 0 and abs(values[last + 1] - values[last]) > LIMITS.jump * usual


# Coherent gain: measured over simulated outputs, line by line.


@dataclass(frozen=True, eq=False)
class CoherentGain:
    """Measured over simulated, at the frequencies where one follows from the other.

    Attributes
    ----------
    frequencies : ndarray, shape (lines,)
        In Hz.
    values : ndarray of complex, shape (lines,)
        1 where the model is right.
    """

    frequencies: Vector
    values: AnyVector

    @property
    def enough(self) -> bool:
        """Whether so many lines over so wide a band speak, that no resonance speaks for all."""
        f = self.frequencies
        return f.size >= LIMITS.lines and bool(f[-1] >= LIMITS.band * f[0])

    @property
    def size(self) -> float:
        """Median of the absolute value."""
        return float(np.median(np.abs(self.values)))

    @property
    def scatter(self) -> float:
        """Factor that half of the lines lie within, around `size`."""
        return float(np.exp(np.median(np.abs(np.log(np.abs(self.values) / self.size)))))

    @property
    def reversed(self) -> float:
        """Share of the lines whose sign is turned, within 45 degrees."""
        return float(np.mean(np.abs(np.angle(-self.values)) < np.pi / 4))

    @property
    def distance(self) -> float:
        """Median distance from 1, in the logarithm: 0.1 is 10 % or 6 degrees."""
        return float(np.median(np.abs(np.log(self.values))))


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
    length = int(2 * simulated.size / (LIMITS.averages + 1))
    window = get_window("hann", length)
    parts = [
        [np.fft.rfft(window * _without_trend(y[i : i + length])) for y in (simulated, measured)]
        for i in range(0, simulated.size - length + 1, length // 2)
    ]
    S, Y = np.transpose(np.array(parts), (1, 0, 2))
    across = np.mean(S.conj() * Y, axis=0)
    power, seen = np.mean(np.abs(S) ** 2, axis=0), np.mean(np.abs(Y) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.abs(across) ** 2 / (power * seen)
    # The lowest two lines hold what is left of trends.
    spoken = np.flatnonzero((coherence > LIMITS.coherence) & (power > LIMITS.excited * power.max()))
    spoken = spoken[spoken >= 2]
    frequencies = spoken / (length * dt)
    return CoherentGain(frequencies, across[spoken] / power[spoken])


def _without_trend(values: Vector) -> Vector:
    place = np.arange(values.size) - (values.size - 1) / 2
    moving = values - values.mean()
    return moving - place * float(place @ moving) / float(place @ place)


# Conversion factors of confused units.

_AMPLITUDES = (
    (1e3, True, "as a length in mm read as m is, or a force in kN read as N"),
    (1e-3, True, "as a length in m read as mm is, or a force in N read as kN"),
    (1e6, True, "as a length in um read as m is"),
    (1e-6, True, "as a length in m read as um is"),
    (180 / math.pi, False, "as degrees read as radians are"),
    (math.pi / 180, False, "as radians read as degrees are"),
    (9.80665, False, "as m/s^2 read as g is, or kg read as N"),
    (1 / 9.80665, False, "as g read as m/s^2 is, or N read as kg"),
)
"""Measured over simulated, whether it needs no more than the power of ten, and the confusion."""

_NUMBERS: dict[str, tuple[tuple[float, str], ...]] = {
    "mass": ((1e3, "as t for kg makes it, or g for kg the other way round"),
             (1e-3, "as g for kg makes it"),
             (1e6, "as milliseconds taken for seconds make it")),
    "stiffness": ((1e3, "as N/mm for N/m makes it"), (1e-3, "as mm taken for m makes it"),
                  (1e6, "as milliseconds taken for seconds make it"),
                  (1e-6, "as seconds taken for milliseconds make it"),
                  ((2 * math.pi) ** 2, "as Hz taken for rad/s makes it"),
                  (180 / math.pi, "as degrees taken for radians make it"),
                  (math.pi / 180, "as degrees taken for radians make it")),
    "damping": ((1e3, "as milliseconds taken for seconds make it, or N s/mm for N s/m"),
                (1e-3, "as seconds taken for milliseconds make it, or mm taken for m")),
    "gain": ((1e3, "as kN for N makes it, or mm for m"),
             (1e-3, "as N for kN makes it, or m for mm"),
             (180 / math.pi, "as degrees for radians make it"),
             (math.pi / 180, "as radians for degrees make it")),
}  # fmt: skip
"""New over old, by the kind of number, and the confusion that makes it."""


def unit_of_ratio(ratio: float, scatter: float) -> str:
    """Return which confusion of units makes an amplitude so many times too large, "" if none.

    Parameters
    ----------
    ratio : float
        Measured over simulated amplitude.
    scatter : float
        Factor that half of the frequencies lie within, around it: where it is not near one, only
        powers of a thousand are named.

    Returns
    -------
    str

    Examples
    --------
    >>> unit_of_ratio(57.0, 1.02), unit_of_ratio(57.0, 1.7), unit_of_ratio(3.0, 1.02)
    ('as degrees read as radians are', '', '')
    """
    for factor, decade, words in _AMPLITUDES:
        tolerance = LIMITS.near if decade else LIMITS.close
        near = abs(math.log(ratio / factor)) <= math.log(tolerance)
        if near and (decade or scatter <= tolerance):
            return words
    return ""


def unit_of_change(kind: str, ratio: float) -> str:
    """Return which confusion of units makes a fit change a number so, "" if none is known.

    Parameters
    ----------
    kind : str
        ``"mass"``, ``"stiffness"``, ``"damping"`` or ``"gain"``.
    ratio : float
        New over old.

    Returns
    -------
    str

    Examples
    --------
    >>> unit_of_change("stiffness", 0.9e6)
    'as milliseconds taken for seconds make it'
    >>> unit_of_change("stiffness", 12.0)
    ''
    """
    near = [(abs(math.log(ratio / factor)), words) for factor, words in _NUMBERS.get(kind, ())]
    distance, words = min(near, default=(math.inf, ""))
    return words if distance <= math.log(LIMITS.guessed) else ""


# Checks of measured against simulated outputs: signs, units, exchanged sensors, means.

Outputs = Mapping[str, Vector]
"""Signals by the name of the output, all of one length."""


def signs(gains: Mapping[str, CoherentGain]) -> list[str]:
    """Name the outputs whose sign is turned at nearly all frequencies.

    Parameters
    ----------
    gains : mapping of str to CoherentGain
        Measured over simulated, by output.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from robustpolish.identification.sanity import coherent_gain
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> signs({"x": coherent_gain(noise, -3 * noise, 0.01)})[0][:25]
    'x moves against the model'
    >>> signs({"x": coherent_gain(noise, 3 * noise, 0.01)})
    []
    """
    turned = [
        name
        for name, gain in gains.items()
        if gain.enough and gain.reversed >= LIMITS.reversed and gain.scatter <= LIMITS.steady
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


def amplitudes(gains: Mapping[str, CoherentGain], inputs: Sequence[str]) -> list[str]:
    """Name the outputs whose size is off by a factor that a confusion of units makes.

    Parameters
    ----------
    gains : mapping of str to CoherentGain
        Measured over simulated, by output.
    inputs : sequence of str
        Their names, for the message.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from robustpolish.identification.sanity import coherent_gain
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> amplitudes({"x": coherent_gain(noise, 1e3 * noise, 0.01)}, ["F"])[0][:44]
    'x is 1e+03 times as large as the model makes'
    >>> amplitudes({"x": coherent_gain(noise, 5 * noise, 0.01)}, ["F"])
    []
    """
    found = {}
    for name, gain in gains.items():
        if gain.enough and gain.scatter <= LIMITS.scatter:
            guess = unit_of_ratio(gain.size, gain.scatter)
            if guess:
                found[name] = (gain.size, guess)
    source = ", ".join(inputs)
    # An input in the wrong unit makes all outputs wrong, and a sensor only its own.
    every = f" and of {source}" if len(found) == len(gains) else ""
    return [
        f"{name} is {ratio:.3g} times as large as the model makes it from {source}, {guess}. Check "
        f"the unit of {name}{every}, and mend it with units="
        for name, (ratio, guess) in found.items()
    ]


def swapped_outputs(
    gains: Mapping[tuple[str, str], CoherentGain], kinds: Mapping[str, str]
) -> list[str]:
    """Name two outputs of one kind that fit far better if they change places.

    Parameters
    ----------
    gains : mapping of (str, str) to CoherentGain
        The first output as measured over the second one as simulated.
    kinds : mapping of str to str
        What may change places: the quantity and unit by output.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from robustpolish.identification.sanity import coherent_gain
    >>> x, y = np.random.default_rng(0).standard_normal((2, 4000))
    >>> simulated, measured = {"x": x, "y": y - 3 * x}, {"x": y - 3 * x, "y": x}
    >>> gains = {
    ...     (a, b): coherent_gain(simulated[b], measured[a], 0.01) for a in "xy" for b in "xy"
    ... }
    >>> swapped_outputs(gains, {"x": "m", "y": "m"})[0][:22]
    'x and y look exchanged'
    """
    found = []
    for first, second in combinations(kinds, 2):
        if kinds[first] != kinds[second]:
            continue
        straight = [gains[name, name] for name in (first, second)]
        crossed = [gains[first, second], gains[second, first]]
        # As they are, the outputs may have nothing in common with the model at all.
        if not all(gain.enough for gain in crossed):
            continue
        near = [gain.distance for gain in crossed]
        far = [gain.distance if gain.enough else np.inf for gain in straight]
        if max(near) < LIMITS.crossed and min(far) > LIMITS.straight * max(near):
            found.append(
                f"{first} and {second} look exchanged: each follows the model of the other one "
                f"(within {100 * max(near):.0f} % at half of the frequencies). Check the cables, "
                "or read with rename="
            )
    return found


def means(measured: Outputs, simulated: Outputs, units: Mapping[str, str]) -> list[str]:
    """Name the outputs whose mean lies far from the model's, against the size of their motion.

    Parameters
    ----------
    measured, simulated : mapping of str to ndarray, shape (samples,)
        Of a model that has a place of rest.
    units : mapping of str to str

    Returns
    -------
    list of str

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(1000)
    >>> means({"x": noise + 9}, {"x": noise}, {"x": "m"})[0][:35]
    'the mean of x is 9 m from the model'
    """
    found = []
    for name, values in measured.items():
        if not np.isfinite(simulated[name]).all():
            continue
        away = float(np.mean(values) - np.mean(simulated[name]))
        size = max(float(np.std(values)), float(np.std(simulated[name])))
        if size > 0 and abs(away) > LIMITS.mean * size:
            gravity = units[name] == "m/s^2" and 9.5 < abs(away) < 10.1
            what = (
                "the sensor feels gravity: take it off the channel"
                if gravity
                else "take the sensor's zero off the channel, or give the model the force that "
                "holds it there"
            )
            found.append(
                f"the mean of {name} is {away:.3g} {units[name]} from the model, "
                f"{abs(away) / size:.2g} times the size of its motion: {what}"
            )
    return found


# Checks of fitted against given numbers.

_KINDS = {"mass": "mass", "inertia": "mass", "stiffness": "stiffness", "damping": "damping",
          "gain": "gain"}  # fmt: skip


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
    >>> implausible_changes({"dof.x.mass": 2.0}, {"dof.x.mass": 3.0})
    []
    """
    found = []
    for key, old in before.items():
        kind = _KINDS.get(key.rpartition(".")[2])
        new = after.get(key, old)
        if kind is None or key.startswith("effect") or old == 0 or new == 0:
            continue
        if old * new < 0:
            found.append(
                f"the fit turned the sign of {key}, from {old:.4g} to {new:.4g}. Check the "
                "direction of the sensors and of the inputs"
            )
            continue
        ratio = new / old
        if max(ratio, 1 / ratio) < (LIMITS.damped if kind == "damping" else LIMITS.moved):
            continue
        guess = unit_of_change(kind, ratio)
        found.append(
            f"the fit moved {key} from {old:.4g} to {new:.4g}, by {abs(math.log10(ratio)):.1f} "
            f"decades{f', {guess}' if guess else ''}. Check the units in the model file and of the "
            "channels and the time"
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
        found += _of_channel(item, measured[item.name], time)
    if time.size >= LIMITS.least:
        found += _of_inputs(model, data, measured)
    if simulated is not None:
        found += _of_run(model, measured, simulated)
    if fitted is not None:
        found += implausible_changes(model.parameters, fitted.parameters)
    return tuple(found)


def _of_channel(item: Output, values: np.ndarray, time: np.ndarray) -> list[str]:
    found = [clipping(item.name, values)]
    # A mass that friction holds has an acceleration that is constant, and jumps when it breaks
    # loose; a force may do both in contacts.
    if item.quantity not in (ACCELERATION, FORCE):
        found += [dropouts(item.name, values, time), no_motion(item.name, values)]
    return [sentence for sentence in found if sentence]


def _of_run(
    model: MechanicalModel, measured: dict[str, np.ndarray], simulated: xr.Dataset
) -> list[str]:
    runs = {name: np.asarray(simulated[name].values, dtype=float) for name in measured}
    if not all(np.isfinite(run).all() for run in runs.values()):
        return []
    units = {item.name: model.unit_of(item) for item in model.outputs}
    return means(measured, runs, units) if _rests(model) else []


def _of_inputs(
    model: MechanicalModel, data: xr.Dataset, measured: dict[str, np.ndarray]
) -> list[str]:
    """Compare with what the inputs make of the model at rest, however the record starts."""
    moving = [name for name in model.input_names if np.ptp(np.asarray(data[name].values)) > 0]
    if not moving:
        return []
    with np.errstate(all="ignore"):
        forced = simulate_model(model, data).outputs
    if not np.isfinite(forced).all():
        return []
    dt = sampling_time(data)
    gains = {
        (first, second.name): coherent_gain(forced[:, i], values, dt)
        for first, values in measured.items()
        for i, second in enumerate(model.outputs)
    }
    own = {name: gains[name, name] for name in measured}
    kinds = {item.name: f"{item.quantity} in {model.unit_of(item)}" for item in model.outputs}
    swapped = swapped_outputs(gains, kinds)
    return swapped or [*amplitudes(own, moving), *signs(own)]


def _rests(model: MechanicalModel) -> bool:
    """Whether springs hold every coordinate, so that the model has a place of rest."""
    poles = np.abs(poles_of(model))
    return bool(poles.size and np.min(poles) > 1e-6 * np.max(poles))
