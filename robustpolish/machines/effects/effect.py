"""An effect: a kind of the catalogue at a place, with numbers; and the catalogue of kinds.

The catalogue holds the built-in kinds, those of installed packages, and those that a script
registers.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, instance_of, invalid, positive
from robustpolish.errors import RobustPolishWarning
from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.effects.kind import GROUND, EffectKind, Motion
from robustpolish.machines.effects.spline_law import learned_kind

ENTRY_POINT_GROUP = "robustpolish.effects"
_FAMILIES = ("forces", "excitation", "signals")
_registered: dict[str, EffectKind] = {}


def register(kind: EffectKind) -> EffectKind:
    """Add a kind of effect to the catalogue of this process.

    A package that is installed does the same without a call, with an entry
    point in the group ``robustpolish.effects`` that names an `EffectKind`.

    Parameters
    ----------
    kind : EffectKind

    Returns
    -------
    EffectKind

    Raises
    ------
    InvalidInputError
        If it is no EffectKind, or the name is one of the catalogue. One that was registered before
        is replaced; effects that were made of it keep it.
    """
    if not isinstance(kind, EffectKind):
        raise invalid("kind", kind, "an EffectKind", "Build one, see 'How to add an effect'.")
    present = _catalogue().get(kind.kind) or learned_kind(kind.kind)
    if present is not None and present != kind:
        raise invalid("kind.kind", kind.kind, "a name that is not taken", "Choose another name.")
    _registered[kind.kind] = kind
    return kind


def unregister(name: str) -> None:
    """Take a kind that was registered out of the catalogue of this process.

    Effects that were made of it keep it.

    Parameters
    ----------
    name : str

    Raises
    ------
    InvalidInputError
        If no such kind was registered.
    """
    if name not in _registered:
        listed = ", ".join(_registered) or "those registered, of which there are none"
        raise invalid("name", name, f"one of {listed}", "Check the spelling.")
    del _registered[name]


def kinds() -> dict[str, EffectKind]:
    """Return the catalogue, by name.

    Examples
    --------
    >>> kinds()["cubic_stiffness"].parameter("stiffness").unit()
    'N/m^3'
    """
    return {**_catalogue(), **_registered}


def lookup(name: str) -> EffectKind:
    """Return the kind called `name`.

    Parameters
    ----------
    name : str
        Of the catalogue, or of a learned law, such as `learned_stiffness_9`.

    Returns
    -------
    EffectKind

    Raises
    ------
    InvalidInputError
        If there is none of that name.
    """
    kind = _registered.get(name) or _catalogue().get(name) or learned_kind(name)
    if kind is None:
        remedy = "Check the spelling."
        raise invalid(("effect", "kind"), name, f"one of {', '.join(kinds())}", remedy)
    return kind


@lru_cache(maxsize=1)
def built_in() -> dict[str, EffectKind]:
    """Return the kinds that come with the package, by name."""
    families = (
        import_module(f"robustpolish.machines.effects.catalogue.{name}") for name in _FAMILIES
    )
    return {kind.kind: kind for family in families for kind in family.KINDS}


@lru_cache(maxsize=1)
def _catalogue() -> dict[str, EffectKind]:
    found = dict(built_in())
    for point in entry_points(group=ENTRY_POINT_GROUP):
        try:
            kind = point.load()
        except Exception as error:  # a broken plug-in must not take the catalogue down
            warnings.warn(
                f"effect {point.name!r} of {point.value} cannot be loaded: {error}",
                RobustPolishWarning,
                stacklevel=2,
            )
            continue
        if isinstance(kind, EffectKind):
            found.setdefault(kind.kind, kind)
    return found


@dataclass(frozen=True)
class Effect:
    """A kind of effect at a place, with numbers.

    Parameters
    ----------
    kind : str
        Name in the catalogue, see :func:`robustpolish.effects.kinds`.
    at : sequence of str
        Names of degrees of freedom ("ground" included), of an input or output.
    parameters : mapping of str to float
        SI values; those not given take the kind's defaults.
    own : EffectKind, optional
        The kind itself, of an effect of your own: the effect keeps it, whatever is registered
        under its name later. What is registered now by default, None for the catalogue's.

    Raises
    ------
    InvalidInputError
        For an unknown kind or parameter, a wrong number of places, or a value
        that is not finite.

    Examples
    --------
    >>> friction = Effect("coulomb_friction", ("x", "ground"), {"force": 3.1})
    >>> friction.values["force"], friction.definition.parameter("force").unit()
    (3.1, 'N')
    """

    kind: str
    at: tuple[str, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    own: EffectKind | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.own is None:
            object.__setattr__(self, "own", _registered.get(self.kind))
        definition = self.definition
        object.__setattr__(self, "at", _places(definition, self.at))
        object.__setattr__(self, "parameters", _numbers(definition, self.parameters))

    @classmethod
    def of(
        cls, kind: EffectKind, at: Sequence[str], parameters: Mapping[str, float] | None = None
    ) -> Effect:
        """Return an effect of this kind, which need not be registered.

        Parameters
        ----------
        kind : EffectKind
        at : sequence of str
        parameters : mapping of str to float, optional

        Returns
        -------
        Effect

        Examples
        --------
        >>> Effect.of(kinds()["cubic_stiffness"], ("x", "ground"), {"stiffness": 2.0}).kind
        'cubic_stiffness'
        """
        known = _catalogue().get(kind.kind) or learned_kind(kind.kind)
        own = None if known == kind else kind
        return cls(kind.kind, at, parameters or {}, own)  # type: ignore[arg-type]

    @cached_property
    def definition(self) -> EffectKind:
        """The kind's description."""
        return self.own or lookup(self.kind)

    def __getstate__(self) -> dict[str, Any]:
        # A file needs no copy of the catalogue.
        return {key: value for key, value in self.__dict__.items() if key != "definition"}

    @property
    def values(self) -> dict[str, float]:
        """All parameters in the kind's order, defaults filled in."""
        given = self.parameters
        return {p.name: given.get(p.name, p.default) for p in self.definition.parameters}

    def with_parameters(self, **changes: float) -> Effect:
        """Return the same effect with some parameters changed.

        Parameters
        ----------
        **changes : float
            New values in SI units.

        Returns
        -------
        Effect
        """
        return self.with_values({**self.parameters, **changes})

    def with_values(self, values: Mapping[str, float]) -> Effect:
        """Return the same effect with these parameters, the kind's defaults for all others.

        Parameters
        ----------
        values : mapping of str to float
            In SI units.

        Returns
        -------
        Effect

        Examples
        --------
        >>> Effect("coulomb_friction", "x", {"force": 3.1}).with_values({}).values["force"]
        0.0
        """
        return replace(self, parameters=values)

    def on_signal(self, signal: Array, time: Array) -> Array:
        """Return what an effect on an input or output makes of a signal.

        Parameters
        ----------
        signal, time : ndarray, shape (samples,)

        Returns
        -------
        ndarray, shape (samples,)

        Raises
        ------
        InvalidInputError
            If it is an effect that makes a force, or its kind returns another shape.

        Examples
        --------
        >>> Effect("input_gain", "F", {"gain": 2.0}).on_signal(np.ones(2), np.arange(2.0))
        array([2., 2.])
        """
        change = self.definition.on_signal
        if change is None:
            raise invalid("kind", self.kind, "an effect on an input or output", "Simulate it.")
        changed = np.asarray(change(signal, time, self.values), dtype=float)
        if changed.shape != signal.shape:
            shown = described(f"a result of shape {changed.shape}")
            want = f"shape {signal.shape}, like the signal"
            remedy = "Return one value for each sample."
            raise invalid(f"{self.kind}.on_signal", shown, want, remedy)
        return changed

    def __str__(self) -> str:
        return f"{self.kind} at {', '.join(self.at)}"


def _places(definition: EffectKind, at: Any) -> tuple[str, ...]:
    names = (at,) if isinstance(at, str) else tuple(at)
    if definition.domain == "pair" and len(names) == 1:
        names = (*names, GROUND)
    if definition.domain == "dof" and len(names) == 2 and names[1] == GROUND:
        names = names[:1]
    bad = len(names) != definition.places or not all(isinstance(n, str) and n for n in names)
    if bad or len(set(names)) != len(names) or names[0] == GROUND:
        what = {
            "pair": "two different degrees of freedom, the first not ground",
            "dof": "one degree of freedom",
            "axes": "two degrees of freedom",
            "path": "the names of an input and an output",
            "input": "the name of one input",
            "output": "the name of one output",
        }[definition.domain]
        raise invalid((definition.kind, "at"), at, what, "Name where the effect acts.")
    return names


def _numbers(definition: EffectKind, parameters: Any) -> dict[str, float]:
    if not isinstance(parameters, Mapping):
        remedy = "Write name = value."
        raise invalid((definition.kind, "parameters"), parameters, "a table of numbers", remedy)
    numbers: dict[str, float] = {}
    for name, value in parameters.items():
        definition.parameter(name)
        bad = isinstance(value, bool) or not isinstance(value, int | float | np.number)
        if bad or not np.isfinite(float(value)):
            key = (definition.kind, "parameters", name)
            raise invalid(key[::2], value, "a finite number", "Check the value.", key)
        numbers[name] = float(value)
    return numbers


# The viscous damper that takes as much energy out of a cycle as something else does. An energy that
# is lost counts as positive; frequencies are in rad/s.

_SAMPLES = 8192
_CYCLES = 6
"""Cycles before an effect with memory has forgotten how it started."""
_SETTLED = 1e-3
"""Largest share by which the last two of them may differ."""
_IDEAL = ("mobility", "step", "clearance")
"""Context that limits what a step in time can resolve, or what others at the place give: 0 is the
law alone."""

Loss = float | Effect


def energy_per_cycle(effect: Effect, amplitude: float, frequency: float) -> float:
    """Return the energy that an effect takes out of a cycle of a harmonic motion.

    The force is integrated along q = A sin(w t) at the place of the effect, in the steady state of
    its memory if it has one.

    Parameters
    ----------
    effect : Effect
        Between two degrees of freedom, or one and ground.
    amplitude : float
        A of the relative displacement, in m (rad).
    frequency : float
        w in rad/s.

    Returns
    -------
    float
        In J; negative if the effect puts energy in.

    Raises
    ------
    InvalidInputError
        If amplitude or frequency is not above 0, if the effect acts on a signal, on two axes, or
        depends on anything but this motion, or if its memory does not settle.

    References
    ----------
    Inman (2014), Engineering vibration, section 2.7; M.L. Postma, Polishing robot: vibrations due
    to impact, section 5.1.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.effects import Effect
    >>> friction = Effect("coulomb_friction", "x", {"force": 3.0})
    >>> round(rp.effects.energy_per_cycle(friction, amplitude=0.01, frequency=100.0), 6)  # 4 F A
    0.12
    """
    A = positive("amplitude", amplitude, "m")
    w = positive("frequency", frequency, "rad/s")
    remedy = "Build one with robustpolish.effects.Effect(...)."
    instance_of("effect", effect, Effect, "an Effect", remedy)
    kind = effect.definition
    if kind.domain not in ("pair", "dof") or kind.ports != 1:
        got = described(f"{kind.kind}, which acts on {kind.domain} with {kind.ports} ports")
        raise invalid("effect", got, "a force along one motion", "Take another effect.")
    needs = [name for name in kind.context if name not in _IDEAL]
    if needs or kind.line is not None:
        got = described(f"{kind.kind}, which needs {', '.join(needs) or 'a time of its own'}")
        raise invalid("effect", got, "a force by displacement and speed", "Take another effect.")
    cycles = _CYCLES if kind.has_memory else 1
    phase = 2 * math.pi * np.arange(cycles * _SAMPLES + 1) / _SAMPLES
    q, v = A * np.sin(phase)[None], A * w * np.cos(phase)[None]
    power = -force_with(kind, effect.values, Motion(phase / w, q, v))[0] * v[0]
    # The motion is periodic: the mean over a cycle converges faster than any other rule.
    each = power[:-1].reshape(cycles, _SAMPLES).mean(axis=1) * 2 * math.pi / w
    change = float(np.ptp(each[-2:]))
    if not np.isfinite(each).all() or change > _SETTLED * abs(each[-1]):
        got = described(f"{each[-1]:.4g} J in cycle {cycles}, {change:.4g} J from the one before")
        raise invalid("effect", got, "a steady loss per cycle", "Check its parameters.")
    return float(each[-1])


def equivalent_damping(losses: Loss | Sequence[Loss], amplitude: float, frequency: float) -> float:
    """Return the viscous damping that loses as much energy per cycle, (5.6) of the thesis.

    c = sum of the losses / (pi w A^2), because a damper loses pi c w A^2 in a cycle of
    A sin(w t).

    Parameters
    ----------
    losses : float, Effect or sequence of these
        Energies lost per cycle in J, or effects such as those of a model, whose energies
        :func:`energy_per_cycle` gives.
    amplitude : float
        A, in m (rad).
    frequency : float
        w, in rad/s.

    Returns
    -------
    float
        c in N s/m (N m s/rad). It depends on amplitude and frequency, except for viscous damping.

    Raises
    ------
    InvalidInputError
        As :func:`energy_per_cycle`.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (5.6) and (5.7).

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.effects import Effect
    >>> air = Effect("quadratic_damping", "x", {"coefficient": 2.0})
    >>> c = rp.effects.equivalent_damping(air, amplitude=0.01, frequency=100.0)
    >>> round(c, 4)  # 8/(3 pi) b w A
    1.6977
    >>> round(rp.effects.equivalent_damping([air, 0.12], 0.01, 100.0), 4)  # and dry friction of 3 N
    5.5174
    """
    A = positive("amplitude", amplitude, "m")
    w = positive("frequency", frequency, "rad/s")
    several = [losses] if isinstance(losses, int | float | np.number | Effect) else losses
    instance_of("losses", several, Sequence, "energies in J or effects", "Write [0.1, effect].")
    total = 0.0
    for i, loss in enumerate(several):
        if isinstance(loss, Effect):
            total += energy_per_cycle(loss, A, w)
        else:
            total += positive(("losses", i), loss, "J", zero=True)
    return total / (math.pi * w * A**2)


def share_damping(share: float, stiffness: float, frequency: float) -> float:
    """Return the viscous damping that loses a share of the spring's energy, (8.23) of the thesis.

    c = n k / (2 pi w): (5.6) with n times the largest energy k A^2 / 2. The amplitude cancels. A
    body on the spring that swings at w then has the damping ratio n / (4 pi).

    Parameters
    ----------
    share : float
        n, lost per cycle; 0.001 in the thesis.
    stiffness : float
        k in N/m (N m/rad).
    frequency : float
        w in rad/s.

    Returns
    -------
    float
        c in N s/m (N m s/rad).

    Raises
    ------
    InvalidInputError
        If a value is negative, or the frequency 0.

    Examples
    --------
    >>> import math
    >>> import robustpolish as rp
    >>> p = rp.polishing.AirBearingParameters()
    >>> omega_D = p.natural_frequencies()["x"][1]
    >>> round(rp.effects.share_damping(0.001, p.k_x, omega_D), 4)  # c_D of section 9.1
    0.0389
    """
    n = positive("share", share, zero=True)
    k = positive("stiffness", stiffness, "N/m", zero=True)
    return n * k / (2 * math.pi * positive("frequency", frequency, "rad/s"))


def loss_damping(loss_factor: float, stiffness: float, frequency: float) -> float:
    """Return the viscous damping of a complex stiffness k (1 + j eta) at one frequency.

    c = eta k / w. Structural damping loses pi eta k A^2 per cycle at every frequency, so that it is
    a share n = 2 pi eta of the energy; a viscous damper does so at w alone.

    Parameters
    ----------
    loss_factor : float
        eta.
    stiffness : float
        k in N/m (N m/rad).
    frequency : float
        w in rad/s.

    Returns
    -------
    float
        c in N s/m (N m s/rad).

    Raises
    ------
    InvalidInputError
        If a value is negative, or the frequency 0.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.effects.loss_damping(0.01, 1e6, 1000.0)
    10.0
    """
    eta = positive("loss_factor", loss_factor, zero=True)
    k = positive("stiffness", stiffness, "N/m", zero=True)
    return eta * k / positive("frequency", frequency, "rad/s")
