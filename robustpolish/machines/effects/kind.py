"""What a physical effect is: a force law with named parameters, and where it acts.

A kind (:class:`EffectKind`) is the description; an `Effect` is a kind at a place
with numbers. Effects know no models: a model gives the relative motion at the
place and takes the force, or gives a signal and takes what became of it.

::

    at = ("x", "x_m")      q = x - x_m,  v = dq/dt
                           +f acts on x, -f acts on x_m   (ground takes the rest)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid, one_of

# Candidate forces for screening: what an effect would do along a known motion.

Coefficients = NDArray[np.float64]
LINE = "line of the force"
WAVE = "wave of the force"


@dataclass(frozen=True)
class Motion:
    """The motion at a place, as far as it is known.

    Parameters
    ----------
    time : ndarray, shape (samples,)
        In s, uniform.
    q, v : ndarray, shape (ports, samples)
        Relative displacement and velocity (m, m/s or rad, rad/s); for an effect on an input or
        output, the signal and its derivative.
    context : mapping
        What the kind asked for, see `EffectKind.context`.
    force : ndarray, shape (ports, samples), optional
        Estimated missing force, for kinds that search a frequency.
    """

    time: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    context: Mapping[str, float] = field(default_factory=dict)
    force: NDArray[np.float64] | None = None

    @property
    def amplitude(self) -> float:
        """Robust amplitude of the first port's displacement about zero."""
        return float(np.percentile(np.abs(self.q[0]), 95))

    @property
    def speed(self) -> float:
        """Robust amplitude of the first port's velocity about zero."""
        return float(np.percentile(np.abs(self.v[0]), 95))


@dataclass(frozen=True)
class Scan:
    """Values of one parameter that screening tries, because the force is not linear in it.

    Parameters
    ----------
    parameter : str
    of : str or (float, float)
        What the shares are multiplied by: ``"1"``, the ``"amplitude"`` or the ``"speed"`` of the
        motion, or powers of these two. ``"per slip"`` is the inverse of a share of the amplitude,
        if that is longer than half a sample's travel: the stiffness of what slips at a unit of
        force. ``"percentile"`` is the displacement at which so many percent of the samples are
        below, and its mirror image. ``"line of the force"`` is the frequency in Hz of the line
        of the missing force that stands out most (0), of the second one (1), and so on, and
        ``"wave of the force"`` the same over the displacement, a length.
    shares : tuple of float
    kept : bool
        False for what only rounds a candidate's corners: the effect keeps its default.

    Examples
    --------
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> swing = Motion(time, 2.0 * np.ones((1, 1001)), np.zeros((1, 1001)))
    >>> Scan("gap", "amplitude", (0.1, 0.5)).values(swing)
    [0.2, 1.0]
    """

    parameter: str
    of: str | tuple[float, float]
    shares: tuple[float, ...]
    kept: bool = True

    def values(self, motion: Motion) -> list[float]:
        """Return the values along a motion.

        Parameters
        ----------
        motion : Motion

        Returns
        -------
        list of float
            Empty if the motion, or the missing force, says nothing about the parameter.
        """
        if self.of == "percentile":
            levels = [level for share in self.shares for level in (share, 100 - share)]
            return np.percentile(motion.q[0], levels).tolist()
        if self.of == LINE:
            return [] if motion.force is None else _lines(motion, [int(n) for n in self.shares])
        if self.of == WAVE:
            return [] if motion.force is None else _waves(motion, [int(n) for n in self.shares])
        if self.of == "per slip":
            travel = 0.5 * motion.speed * float(motion.time[1] - motion.time[0])
            slips = (share * motion.amplitude for share in self.shares)
            return [1 / slip for slip in slips if slip > travel]
        if isinstance(self.of, str):
            size = {"1": 1.0, "amplitude": motion.amplitude, "speed": motion.speed}[self.of]
        elif motion.amplitude and motion.speed:
            size = motion.amplitude ** self.of[0] * motion.speed ** self.of[1]
        else:
            size = 0.0
        return [share * size for share in self.shares] if size else []


_CELLS = 4096
"""Of a displacement, over which forces are added."""
_AROUND = 401
"""Bins, a quarter of what the record resolves each, over which a spectrum counts as even."""
_LEAST_AROUND = 1e-6
"""Share of the largest line below which what is around a line is rounding."""


def _lines(motion: Motion, ranks: list[int]) -> list[float]:
    """Return the frequencies of the most prominent lines of the force, refined between the bins.

    A force that is smoothed from poor sensors drifts: there is more of it at low frequencies than a
    line has, but spread out.
    """
    assert motion.force is not None
    force = motion.force[0]
    n = force.size
    spectrum = np.abs(np.fft.rfft((force - force.mean()) * np.hanning(n), 4 * n))
    return _prominent(np.fft.rfftfreq(4 * n, motion.time[1] - motion.time[0]), spectrum, ranks)


def _waves(motion: Motion, ranks: list[int]) -> list[float]:
    """Return the lengths of the strongest waves of the force over the displacement.

    The estimate of the force is that of one that wanders: what the data say of a quick one is its
    second difference. A wave that each sample passes by cannot be seen.
    """
    assert motion.force is not None
    force, q = np.gradient(np.gradient(motion.force[0])), motion.q[0] - np.min(motion.q[0])
    width = float(np.max(q)) / _CELLS
    if not width > 0:
        return []
    sums = np.bincount((q / width).astype(int), force - force.mean(), _CELLS + 1)
    spectrum = np.abs(np.fft.rfft(sums, 4 * sums.size))
    bins = np.fft.rfftfreq(4 * sums.size, width).astype(float)
    seen = bins * np.median(np.abs(np.diff(q))) < 1
    return [1 / wave for wave in _largest(bins[seen], spectrum[seen], ranks) if wave > 0]


def _prominent(bins: Array, spectrum: Array, ranks: list[int]) -> list[float]:
    """Return where a spectrum stands out most, four bins being what the record resolves."""
    around = median_filter(spectrum, _AROUND, mode="nearest")
    spectrum /= np.maximum(around, _LEAST_AROUND * spectrum.max(initial=1e-300))
    return _largest(bins, spectrum, ranks)


def _largest(bins: Array, spectrum: Array, ranks: list[int]) -> list[float]:
    """Return where a spectrum is largest, but for its slow end."""
    spectrum[:8] = 0.0
    lines = []
    for _ in range(max(ranks) + 1):
        k = int(np.argmax(spectrum))
        lines.append(float(bins[k]))
        spectrum[max(k - 10, 0) : k + 11] = 0.0
    return [lines[rank] for rank in ranks]


@dataclass(frozen=True)
class Shape:
    """Forces that are linear in unknown coefficients, at one choice of the rest.

    Parameters
    ----------
    columns : ndarray, shape (coefficients, ports, samples)
        Force on the first degree of freedom for a unit of each coefficient.
    values : callable
        Maps coefficients to the kind's parameters.
    signs : tuple of int
        Required sign of each coefficient: +1, -1, or 0 for either.
    valid : callable, optional
        Whether coefficients are near enough to this choice of the rest.
    """

    columns: NDArray[np.float64]
    values: Callable[[Coefficients], Mapping[str, float]]
    signs: tuple[int, ...]
    valid: Callable[[Coefficients], bool] = lambda c: True


Values = Mapping[str, float]
Steepness = tuple[float, float, float]
Domain = Literal["pair", "dof", "axes", "path", "input", "output"]
Law = Callable[[Any, Any, Any, Any, Any, Any, Any], None]
SignalChange = Callable[[Array, Array, Values], Array]

GROUND = "ground"
CONSTANT = "constant"
"""The family of forces and offsets that never change."""
SPRING = "spring"
"""The family of linear springs, to which those of a model belong."""
_PLACES: dict[str, int] = {"pair": 2, "dof": 1, "axes": 2, "path": 2, "input": 1, "output": 1}
_SI = {"F": ("N", "N m"), "L": ("m", "rad"), "T": ("s", "s"), "M": ("kg", "kg m^2")}


def signal_candidate(
    column: Array, name: str, change: float, within: tuple[float, float], start: float = 0.0
) -> Shape:
    """Return a candidate of an effect on a signal, near one value that is tried of its parameter.

    Parameters
    ----------
    column : ndarray, shape (samples,)
        What the effect adds to the signal at the value that is tried.
    name : str
        Of the parameter: `start` plus the coefficient times `change`.
    change : float
    within : (float, float)
        Coefficients for which the signal is nearly linear in the parameter.
    start : float, optional
        The value at which nothing is added.

    Returns
    -------
    Shape
    """

    def values(c: Coefficients) -> dict[str, float]:
        return {name: start + float(np.clip(c[0], *within)) * change}

    return Shape(column[None, None], values, (1,))


class SignalSlope(NamedTuple):
    """What a linear model keeps of an effect on an input or an output.

    Attributes
    ----------
    gain : float
    delay : float
        In s.
    lag : float
        Time constant of a first-order lag in s.
    """

    gain: float = 1.0
    delay: float = 0.0
    lag: float = 0.0


def unchanged_signal(values: Values) -> SignalSlope:
    """Return that a linear model keeps a signal as it is, whatever the values of its effect."""
    return SignalSlope()


class Timing(NamedTuple):
    """When the samples of an input act, of an effect that changes only that.

    Attributes
    ----------
    order : float or None
        Of the hold between them: 0 held, 1 linear, 3 smooth; None if it says nothing about that.
    delay : float
        In s.
    lag : float
        Time constant in s with which it follows them.
    """

    order: float | None = None
    delay: float = 0.0
    lag: float = 0.0


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kind of effect.

    Parameters
    ----------
    name : str
    dimension : str
        In F (force or torque), L (length or angle), M (mass or inertia), T (time), such as
        ``"F/L^3"``; "rad" and "1" stay, "signal" is the unit of the output.
    meaning : str
        What it is, in a few words.
    lower, upper : float
        Physical bounds; a fit that ends outside has the wrong effect.
    default : float
        Value when none is given.
    fitted : bool
        False for what the data hardly determines (a smoothing width); it is
        fitted on request only.
    fit_bounds : callable, optional
        ``fit_bounds(values)`` gives the lower and upper limit of a fit that starts at these
        values of all parameters; `lower` and `upper` by default.
    fit_scale : float, optional
        Share of its value that a fit takes as one unit of change; less than 1 for what the
        data knows sharply, such as a frequency.
    at_least : str, optional
        Another parameter of the kind, below which a fit never takes this one.
    fit_size : callable, optional
        ``fit_size(values)`` gives the unit of change from the values of all parameters, for one of
        several that share a size and may themselves be near 0.
    choices : tuple of float
        Of a number that is a way of acting and no size: the values it may have, the default first.
    matters_with : str
        What the kind asks of its model, see `EffectKind.context`, without which all `choices` are
        the same.
    """

    name: str
    dimension: str
    meaning: str
    lower: float = -np.inf
    upper: float = np.inf
    default: float = 0.0
    fitted: bool = True
    fit_bounds: Callable[[Values], tuple[float, float]] | None = None
    fit_scale: float = 1.0
    at_least: str = ""
    fit_size: Callable[[Values], float] | None = None
    choices: tuple[float, ...] = ()
    matters_with: str = ""

    def bounds_from(self, values: Values) -> tuple[float, float]:
        """Return the limits of a fit that starts at `values`.

        Parameters
        ----------
        values : mapping of str to float
            All parameters of the effect.

        Returns
        -------
        tuple of float

        Examples
        --------
        >>> Parameter("force", "F", "friction", lower=0.0).bounds_from({"force": 3.0})
        (0.0, inf)
        """
        return (self.lower, self.upper) if self.fit_bounds is None else self.fit_bounds(values)

    def scale_from(self, value: float, values: Values | None = None) -> float:
        """Return the change that a fit which starts at `value` takes as one unit.

        Parameters
        ----------
        value : float
        values : mapping of str to float, optional
            All parameters of the effect, for those that share a size.

        Returns
        -------
        float
            1 for an angle, whose size says nothing, and for a value of 0.

        Examples
        --------
        >>> Parameter("frequency", "1/T", "of the force", fit_scale=0.001).scale_from(50.0)
        0.05
        """
        if self.fit_size is not None and values is not None:
            return self.fit_size(values)
        return 1.0 if self.dimension == "rad" else self.fit_scale * abs(value) or 1.0

    def unit(self, rotational: bool = False) -> str:
        """Return the SI unit, for translation or for rotation.

        Parameters
        ----------
        rotational : bool, optional

        Returns
        -------
        str

        Examples
        --------
        >>> Parameter("stiffness", "F/L^3", "cubic coefficient").unit()
        'N/m^3'
        """
        if self.dimension in ("1", "rad", "signal"):
            return self.dimension
        words = re.split(r"([*/^])", self.dimension)
        unit = "".join(_SI[word][rotational] if word in _SI else word for word in words)
        return unit.replace("*", " ")

    @property
    def powers(self) -> dict[str, float]:
        """The powers of F, L, T and M in the dimension.

        Examples
        --------
        >>> Parameter("coefficient", "F*T/L^3", "of damping").powers
        {'F': 1, 'L': -3, 'T': 1, 'M': 0}
        """
        found: dict[str, float] = dict.fromkeys("FLTM", 0)
        if self.dimension != "signal":
            for slash, factor in re.findall(r"(/?)([^*/]+)", self.dimension):
                letter, _, power = factor.partition("^")
                if letter in found:
                    size = float(power or 1)
                    found[letter] += (-1 if slash else 1) * (int(size) if size % 1 == 0 else size)
        return found

    @property
    def counts_force(self) -> bool:
        """Whether the force grows with it, by its dimension."""
        return bool(self.powers["F"] or self.powers["M"])

    def slopes(self, value: float, q: float, v: float) -> tuple[float, float]:
        """Return the stiffness and damping of the power law that the dimension tells.

        A coefficient in F T^b / L^(a+b) makes the force value q^a v^b; any other makes none.

        Parameters
        ----------
        value, q, v : float
            Of the parameter, and the amplitudes of displacement and velocity.

        Returns
        -------
        stiffness, damping : float

        Examples
        --------
        >>> Parameter("stiffness", "F/L^3", "cubic coefficient").slopes(2.0, q=10.0, v=1.0)
        (600.0, 0.0)
        """
        powers = self.powers
        a, b = -powers["L"] - powers["T"], powers["T"]
        if powers["F"] != 1 or powers["M"] or a < 0 or b < 0:
            return 0.0, 0.0
        size = abs(value)
        stiffness = a * size * q ** (a - 1) * v**b if a and (q or a >= 1) else 0.0
        return stiffness, b * size * q**a * v ** (b - 1) if b and (v or b >= 1) else 0.0


def _no_sizes(values: Values, q: float, v: float) -> tuple[float, ...]:
    return ()


def _plausible(values: Values) -> str | None:
    return None


@dataclass(frozen=True, repr=False)
class EffectKind:
    """One kind of physical effect.

    Parameters
    ----------
    kind : str
        Its name, as in model files.
    title : str
        For people.
    domain : {"pair", "dof", "axes", "path", "input", "output"}
        Where it acts: between two degrees of freedom (or one and ground), on
        one, on two axes, from a force input to a sensor, on a force input, on a sensor.
        The law of a path sees the input as its displacement, and its "force" is what it adds
        to the sensor.
    parameters : tuple of Parameter
    law : callable, optional
        ``law(t, q, v, z, p, f, dz)`` writes the force ``f`` on the first degree
        of freedom and the derivatives ``dz`` of the internal states, from time,
        relative displacement and velocity (one entry per port), states and
        parameters (in the order of `parameters`, then `context`). Plain Python
        that Numba can compile. None for inputs and outputs.
    on_signal : callable, optional
        ``on_signal(u, time, values)`` returns the signal u, shape (samples,), as it acts (of an
        input) or as it is shown (of an output). Every effect on an input or output needs it.
        Of an output the signal has to enter linearly, plus a constant, and sample by sample, so
        that it can be taken out of measured data again; of an input only as far as its velocity and
        acceleration are inputs, too.
    timing : callable, optional
        Of an effect on an input that changes only when its samples act: ``timing(values)`` gives
        the hold between them, a delay and a lag, see :class:`robustpolish.effects.Timing`. Runs go
        by it; `on_signal` is the nearest record of a linear input.
    linear_signal : callable, optional
        ``linear_signal(values)`` gives the gain, the delay and the lag that a linear model keeps
        of `on_signal`, see :class:`robustpolish.effects.SignalSlope`; by default what `timing`
        says, else its answer to a step, at once.
    linear_in : tuple of str or of tuple of str, optional
        Parameters in which the law is linear: screening fits a coefficient for each. An entry of
        several names moves them together.
    scan : tuple of Scan, optional
        Parameters of which screening tries several values. Those in units of force (or mass) are
        tried for a unit of force, and grow with the coefficient.
    shapes : callable, optional
        ``shapes(motion)`` gives the candidate forces used for screening, where `linear_in` and
        `scan` cannot say them. A kind that gives none of the three is never a candidate.
    states : int
        Number of internal states.
    context : tuple of str
        What the law needs of the model: ``"spring_stiffness"`` (N/m, of the
        spring at the place), ``"clearance"`` (m, what the effects there give),
        ``"spin_frequency"`` (rad/s), ``"derivative"`` (of a path: 0, 1 or 2, as its sensor
        shows displacements, velocities or accelerations), ``"mobility"``
        (time step over the effective mass, s/kg: no velocity below force times
        mobility can be resolved), ``"step"`` (s: no memory fades faster than a step).
    gives : tuple of (str, str)
        What the effect adds to the context of others at its place, and the parameter that is
        its size, such as the ``"clearance"`` of a backlash, which is its ``"gap"``.
    gains : callable, optional
        ``gains(values, q, v)`` gives the largest stiffness and damping that the
        law adds at the amplitudes q and v, and the fastest rate in 1/s of its
        internal states; decides on substeps. By default from the units of the parameters,
        see `Parameter.slopes`.
    state_sizes : callable
        ``state_sizes(values, q, v)`` gives the size of each internal state at the amplitudes q
        and v.
    implausible : callable
        ``implausible(values)`` says why values cannot be physical, or None.
    channels : tuple of (str, str)
        Measured signals that the law reads, with their units: coordinates of the model by these
        names, which an input imposes. They are further ports behind its own, without a force:
        ``q[1]`` is the first channel of a pair.
    prior : callable, optional
        ``prior(values)`` gives rows whose products with the fitted parameters are standard normal
        beforehand: what is known about several of them together.
    over : tuple of str
        Of a learned law: what it is a curve over, "displacement", "velocity" or both, or "time".
    contains : tuple of str
        Of a learned law: of which parts of the machine it holds any, "spring", "damper" or both.
    family : str
        Kinds of one family are rivals: a place has one of them at most.
    sharp : bool
        Whether the force has corners or jumps, so that steps have to be short.
    turns_over : str
        Of dry friction: the parameter that is the speed over which it turns over. Where the step of
        a run cannot resolve that, bodies rest until the force gives way, see
        ``simulation/stepper.py``. Needs the context ``"mobility"``.
    idle_without : str
        What of its context has to be there, or the effect does nothing.
    swinging : callable, optional
        Of what swings by itself: the values with a mass in kg at a frequency in Hz, lightly damped.
    looks_like, checks, references
        What it does to the residual, what to check on the machine, sources.
    """

    kind: str
    title: str
    domain: Domain
    parameters: tuple[Parameter, ...]
    law: Law | None = None
    on_signal: SignalChange | None = None
    timing: Callable[[Values], Timing] | None = None
    linear_signal: Callable[[Values], SignalSlope | tuple[float, float]] | None = None
    linear_in: tuple[str | tuple[str, ...], ...] = ()
    scan: tuple[Scan, ...] = ()
    shapes: Callable[[Motion], list[Shape]] | None = None
    states: int = 0
    context: tuple[str, ...] = ()
    gives: tuple[tuple[str, str], ...] = ()
    gains: Callable[[Values, float, float], Steepness] | None = None
    state_sizes: Callable[[Values, float, float], tuple[float, ...]] = _no_sizes
    implausible: Callable[[Values], str | None] = _plausible
    channels: tuple[tuple[str, str], ...] = ()
    prior: Callable[[Values], Array] | None = None
    over: tuple[str, ...] = ()
    contains: tuple[str, ...] = ()
    family: str = ""
    sharp: bool = False
    turns_over: str = ""
    idle_without: str = ""
    swinging: Callable[[float, float], Values] | None = None
    looks_like: str = ""
    checks: tuple[str, ...] = ()
    references: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        one_of((self.kind, "domain"), self.domain, tuple(_PLACES))
        way = "on_signal" if self.acts_on_signals else "law"
        given = [name for name in ("law", "on_signal") if getattr(self, name) is not None]
        if given != [way]:
            shown = " and ".join(given) or "neither law nor on_signal"
            raise invalid(
                (self.kind, way),
                described(f"an effect on {self.domain!r} with {shown}"),
                f"{way} alone",
                "An effect on an input or output acts by on_signal, every other by its law; "
                "without it the effect would do nothing.",
            )

    def __repr__(self) -> str:
        units = ", ".join(f"{p.name} [{p.unit()}]" for p in self.parameters)
        return f"EffectKind({self.kind!r}, {self.domain!r}: {units or 'no parameters'})"

    @property
    def acts_on_signals(self) -> bool:
        """Whether it changes an input or output instead of making a force."""
        return self.domain in ("input", "output")

    @property
    def places(self) -> int:
        """Number of names in `at`."""
        return _PLACES[self.domain]

    @property
    def ports(self) -> int:
        """Number of motions that the law reads: of its places, and of its channels."""
        return (2 if self.domain == "axes" else 1) + len(self.channels)

    @property
    def has_memory(self) -> bool:
        """Whether the force depends on the past."""
        return self.states > 0

    @property
    def line(self) -> str | None:
        """The parameter that is the frequency in Hz of a force from outside, if it makes one."""
        lines = (s.parameter for s in self.scan if s.of == LINE)
        return None if self.has_memory else next(lines, None)

    @property
    def wave(self) -> str | None:
        """The parameter that is the length of a force periodic in the displacement, if any."""
        return next((scan.parameter for scan in self.scan if scan.of == WAVE), None)

    def signal_slope(self, values: Values) -> SignalSlope:
        """Return what a linear model keeps of an effect on a signal.

        Parameters
        ----------
        values : mapping of str to float

        Returns
        -------
        SignalSlope
        """
        if self.linear_signal is not None:
            return SignalSlope(*self.linear_signal(values))
        if self.timing is not None:
            when = Timing(*self.timing(values))
            return SignalSlope(1.0, when.delay, when.lag)
        assert self.on_signal is not None  # only effects on signals come here
        time = np.arange(16.0)
        step, rest = (self.on_signal(np.full(16, u), time, values)[-1] for u in (1.0, 0.0))
        return SignalSlope(float(step - rest))

    def steepness(self, values: Values, q: float, v: float) -> Steepness:
        """Return the largest stiffness and damping of the law, and the rate of its states in 1/s.

        Parameters
        ----------
        values : mapping of str to float
        q, v : float
            Amplitudes of displacement and velocity.

        Returns
        -------
        stiffness, damping, rate : float
        """
        gains = self.gains or getattr(self.law, "steepness", None)  # of a law that knows its own
        if gains is not None:
            return gains(values, q, v)
        slopes = [p.slopes(values[p.name], q, v) for p in self.parameters]
        stiffness, damping = np.max([(0.0, 0.0), *slopes], axis=0).tolist()
        return stiffness, damping, 0.0

    def parameter(self, name: str) -> Parameter:
        """Return the parameter called `name`.

        Parameters
        ----------
        name : str

        Returns
        -------
        Parameter

        Raises
        ------
        InvalidInputError
            If the kind has none of that name.
        """
        known = {p.name: p for p in self.parameters}
        where = (self.kind, "parameters")
        return known[one_of(where, name, known, "Check the parameter's name.")]
