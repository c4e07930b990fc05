"""Design tasks: the machine, its signals and hardware, and weights, as a plant for synthesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import control
import numpy as np

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import (
    Key,
    closest_name_remedy,
    described,
    inside,
    instance_of,
    invalid,
    known_keys,
    misfit,
    one_of,
    positive,
    whole_number,
)
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.systems import as_state_space
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.weights import mixed_sensitivity, weight

# Weights as files and users write them: numbers, gains with a crossover, polynomials.

SENSITIVITIES = ("performance", "effort", "robustness")
"""What mixed sensitivity weights; anything else in a table of weights is a signal's name."""

_GAINS = ("low", "crossover_hz", "high", "order", "inverse", "gain")
_POLYNOMIALS = ("numerator", "denominator")


def asked_weight(where: Key, given: Any) -> control.StateSpace | float:
    """Return the weight that somebody wrote down.

    Parameters
    ----------
    where : tuple of str
        Where it stands, for messages.
    given : float, mapping or system
        A number; ``{low, crossover_hz, high, order, inverse}`` as :func:`robustpolish.weight`
        takes them, times ``gain`` if that is given; ``{numerator, denominator}`` in powers of s,
        the highest first; or a system.

    Returns
    -------
    control.StateSpace or float

    Raises
    ------
    InvalidInputError
        If it is none of these, or no proper system.

    Examples
    --------
    >>> asked_weight(("effort",), {"numerator": [1.0, 0.0], "denominator": [1.0, 5.0]}).nstates
    1
    """
    text = ".".join(map(str, where))
    if isinstance(given, control.LTI):
        return as_state_space(text, given)
    if not isinstance(given, Mapping):
        if isinstance(given, bool | str | Sequence) or given is None:
            want = "a number or a table with low, crossover_hz and high"
            raise invalid(where, given, want, "Write { low = 100, crossover_hz = 5, high = 0.5 }.")
        return positive(where, given)
    if set(given) & set(_POLYNOMIALS):
        known_keys(where, given, _POLYNOMIALS, _POLYNOMIALS)
        want, pair = "a list of numbers, the highest power first", []
        for key in _POLYNOMIALS:
            numbers, at = given[key], (*where, key)
            right = isinstance(numbers, list | tuple) and bool(numbers)
            if not right or any(
                isinstance(n, bool) or not isinstance(n, int | float) for n in numbers
            ):
                raise invalid(at, numbers, want, "Write [1.0, 2.0] for s + 2.")
            if key == "denominator" and not any(numbers):
                raise invalid(at, described("a denominator of zeros"), want, "Correct it.")
            pair.append([float(n) for n in numbers])
        return as_state_space(text, control.TransferFunction(*pair))
    known_keys(where, given, _GAINS, _GAINS[:3])
    gain = positive((*where, "gain"), given.get("gain", 1.0))
    with inside(where):
        shape = weight(**{key: value for key, value in given.items() if key != "gain"})
    return shape if gain == 1 else as_state_space(text, gain * shape)


def is_weight(given: Any) -> bool:
    """Tell whether a table is one weight, and not a table of weights by the names of signals."""
    if not isinstance(given, Mapping):
        return True
    if any(isinstance(value, Mapping) for value in given.values()):
        return False
    return bool({*_GAINS, *_POLYNOMIALS} & set(given))


# A machine as a plant, its signals chosen by the names that users have for them.

Names = Sequence[str]
CONTROL, MEASUREMENT, DISTURBANCE = "u_", "measured_", "disturbance_"
"""What the package puts before the names of coordinates and outputs."""


def machine_plant(
    machine: MechanicalModel | GeneralizedPlant,
    controls: Names,
    measurements: Names,
    performance: Names,
    disturbances: Names,
) -> GeneralizedPlant:
    """Return the plant with the signals of these names; where none are given, with all.

    Parameters
    ----------
    machine : MechanicalModel or GeneralizedPlant
        Effects of a model are linearised about rest.
    controls : sequence of str
        Inputs of the model, or coordinates that a force acts on; controls of a plant.
    measurements : sequence of str
        Outputs of the model, coordinates (``x``) or velocities (``dx``); measurements of a plant.
    performance : sequence of str
        Coordinates, velocities or outputs; performance outputs or measurements of a plant.
    disturbances : sequence of str
        Inputs, or coordinates that a force acts on; disturbances or controls of a plant. All
        inputs that are no controls by default; the controls' places if nothing is left.

    Returns
    -------
    GeneralizedPlant

    Raises
    ------
    InvalidInputError
        If there is no such signal; it names the nearest.
    """
    if isinstance(machine, MechanicalModel):
        plant, known = _of_model(machine, controls, disturbances), len(machine.outputs)
        performance = performance or machine.free
        measurements = measurements or plant.measurement_names[:known]
    else:
        plant = machine
        if not isinstance(plant.system, control.StateSpace):
            shown = described("a frequency response")
            raise invalid("machine", shown, "a model with states", "Fit one to it first.")
    acting, inputs = plant.control_names, plant.disturbance_names
    shown, heard = plant.performance_names, plant.measurement_names
    u = _places("controls", controls, acting, (CONTROL,))
    y = _places("measurements", measurements, heard, (MEASUREMENT,))
    # Every control may disturb as well, and every measurement be judged.
    doubled = [DISTURBANCE + name.removeprefix(CONTROL) for name in acting]
    outputs = [f"output_{name.removeprefix(MEASUREMENT)}" for name in heard]
    wiring = plant.wiring.with_inputs_twice(doubled)
    wiring = wiring.with_performance(np.eye(plant.ny), np.zeros((plant.ny, plant.nu)), outputs)
    z = _places("performance", performance, (*shown, *heard), ("", MEASUREMENT), len(shown))
    at = list(range(len(inputs))) or [len(inputs) + i for i in u]
    if disturbances:
        at = _places("disturbances", disturbances, (*inputs, *acting), ("", CONTROL), len(inputs))
    w = [i + plant.nu if i < len(inputs) else i - len(inputs) for i in at]
    same = zip((*doubled, *outputs), (*acting, *heard), strict=True)
    units = {**plant.units, **{n: plant.units[o] for n, o in same if o in plant.units}}
    chosen = wiring.chosen(w, u, z, y)
    there = {*chosen.system.input_labels, *chosen.system.output_labels, *chosen.states}
    return plant.rewired(chosen, units={name: units[name] for name in units if name in there})


def signal(argument: str, name: str, known: Names, *prefixes: str) -> str:
    """Return the plant's name of a signal that a user calls without its prefix.

    Raises
    ------
    InvalidInputError
        If none has the name, or two have it that differ in the prefix.
    """
    same = [f"{prefix}{name}" for prefix in prefixes if f"{prefix}{name}" in known]
    if len(same) > 1 and name not in known:
        shown = described(f"{name}, which may be {' or '.join(same)}")
        raise invalid((argument, name), shown, "one of both", "Write it out.")
    return known[_places(argument, [name], known, prefixes)[0]]


def _of_model(model: MechanicalModel, controls: Names, disturbances: Names) -> GeneralizedPlant:
    """Return the plant of a model with all that may be chosen: states are measured, too."""
    free, signals = model.free, model.matrices.signals
    acting = (*signals, *free)
    _places("controls", controls, acting, ("",), prefixed=(CONTROL,))
    _places("disturbances", disturbances, acting, ("",), prefixed=(CONTROL,))
    if not controls:
        want = f"names among {', '.join(dict.fromkeys(acting))}"
        raise invalid("controls", described("none"), want, "Say what the controller acts on.")
    own = {name: name if name in signals else name.removeprefix(CONTROL) for name in controls}
    pushes = [name.removeprefix(CONTROL) for name in disturbances if name not in signals]
    pushes = [name for name in pushes if name in free]
    plant = model.linearize(list(dict.fromkeys([*own.values(), *pushes])))
    heard = [f"{MEASUREMENT}{name}" for name in plant.states]
    more = [i for i, name in enumerate(heard) if name not in plant.measurement_names]
    none = np.zeros((len(more), plant.nw + plant.nu))
    D2: Matrix = np.vstack([np.hstack([plant.D21, plant.D22]), none])
    units = {heard[i]: plant.units[plant.states[i]] for i in more if plant.states[i] in plant.units}
    return plant.replace(
        C2=np.vstack([plant.C2, np.eye(plant.nx)[more]]),
        D21=D2[:, : plant.nw],
        D22=D2[:, plant.nw :],
        measurements=[*plant.measurement_names, *(heard[i] for i in more)],
        units=units,
    )


def _places(
    argument: str,
    names: Names,
    known: Names,
    prefixes: Names,
    first: int = 0,
    prefixed: Names = (),
) -> list[int]:
    """Return where names stand among those that are known; all, or the `first`, if none is given.

    A user may leave a prefix out; `prefixed` are those that only users write.
    """
    if isinstance(names, str):
        names = (names,)
    found = []
    for name in names:
        tries = [name, *(f"{prefix}{name}" for prefix in prefixes)]
        tries += [str(name).removeprefix(prefix) for prefix in prefixed]
        place = next((known.index(one) for one in tries if one in known), None)
        if place is None:
            short = list(known)
            for prefix in filter(None, prefixes):
                short = [one.removeprefix(prefix) for one in short]
            want = f"one of {', '.join(dict.fromkeys(short)) or 'none'}"
            raise invalid(argument, name, want, closest_name_remedy(name, short))
        if place in found:
            raise misfit(argument, f"{name} twice", "different names", "Name each signal once.")
        found.append(place)
    return found or list(range(first or len(known)))


# What is asked of a controller for some machine, and the plants that this makes.

Method = Literal["auto", "lmi", "riccati", "slycot"]
METHODS = ("auto", "lmi", "riccati", "slycot")
_ACTUATOR = ("bandwidth_hz", "order", "damping", "limit", "rate_limit")
_SENSOR = ("bandwidth_hz", "order", "damping", "noise")
_Table = Mapping[str, Any]


@dataclass(frozen=True, repr=False, eq=False)
class DesignTask(Displayed):
    """A machine, the signals of its controller, what stands between them, and what is wanted.

    Parameters
    ----------
    machine : MechanicalModel or GeneralizedPlant
        Effects of a model are linearised about its state of rest.
    controls : sequence of str
        Inputs of the model, or coordinates that a force acts on; controls of a plant, all of them
        by default.
    measurements : sequence of str, optional
        Outputs of the model, its coordinates (``x``) or velocities (``dx``); measurements of a
        plant. All outputs, or all measurements, by default.
    performance : sequence of str, optional
        What is kept small: coordinates or outputs, performance outputs or measurements of a plant.
        All free coordinates by default.
    disturbances : sequence of str, optional
        Inputs, or coordinates that a force acts on; disturbances or controls of a plant. By
        default all inputs that are no controls, or the controls' places if no input is left.
    norm : {"hinf", "h2"}, optional
    method : {"auto", "lmi", "riccati", "slycot"}, optional
    order : int, optional
        Number of states of the controller; as many as the plant has by default.
    full_state : bool, optional
        Measure all states. What is measured completely needs no observer in any case.
    control_weight, measurement_noise : float or mapping of str to float, optional
        Price on controls and noise on measurements, as in :func:`robustpolish.output_feedback`;
        one number, or one per name.
    actuators, sensors : mapping of str to mapping, optional
        By name of a control or measurement the arguments of ``plant.with_actuator``
        (``bandwidth_hz``, ``order``, ``damping``, ``limit``, ``rate_limit``) and
        ``plant.with_sensor`` (``noise`` instead of the limits).
    delays : mapping of str to float, optional
        In s, by name of a control or measurement.
    weights : mapping, optional
        ``performance``, ``effort`` and ``robustness`` for mixed sensitivity, each for all channels
        or by name; or ``channels``, by name of a disturbance or performance output. A weight is a
        number, or a table of :func:`robustpolish.weight` or of ``numerator`` and ``denominator``.
    sample_rate_hz : float, optional
        Sample the controller so often, and certify that loop too.
    computation_delay : float, optional
        Seconds from a sample until its control acts.
    anti_aliasing_hz : float, optional
        Corner of a Butterworth filter of second order before the samplers.

    Raises
    ------
    InvalidInputError
        If a name is unknown or something does not fit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 2.0)], [rp.Spring(("x", "ground"), 800.0)],
    ...     inputs=[rp.Input("F", ("x", "ground"))], outputs=[rp.Output("x", "x")])
    >>> rp.results.DesignTask(model, controls=["F"], actuators={"F": {"bandwidth_hz": 200.0}})
    Design task
      plant         3 states
      controls      F
      measurements  measured_x
      performance   x
      disturbances  disturbance_F
      asked for     output feedback, H-infinity norm
      No input is left to disturb the machine: disturbances act as controls.
    """

    machine: MechanicalModel | GeneralizedPlant
    controls: Sequence[str] = ()
    measurements: Sequence[str] = ()
    performance: Sequence[str] = ()
    disturbances: Sequence[str] = ()
    norm: Literal["hinf", "h2"] = "hinf"
    method: Method = "auto"
    order: int | None = None
    full_state: bool = False
    control_weight: float | Mapping[str, float] | None = None
    measurement_noise: float | Mapping[str, float] | None = None
    actuators: Mapping[str, _Table] = field(default_factory=dict)
    sensors: Mapping[str, _Table] = field(default_factory=dict)
    delays: Mapping[str, float] = field(default_factory=dict)
    weights: _Table = field(default_factory=dict)
    sample_rate_hz: float | None = None
    computation_delay: float = 0.0
    anti_aliasing_hz: float | None = None

    def __post_init__(self) -> None:
        kinds = (MechanicalModel, GeneralizedPlant)
        what = "a MechanicalModel or a GeneralizedPlant"
        instance_of("machine", self.machine, kinds, what, "Load one with robustpolish.load(path).")
        for name in ("controls", "measurements", "performance", "disturbances"):
            given = getattr(self, name) or ()
            names = (given,) if isinstance(given, str) else given
            right = isinstance(names, list | tuple)
            if not right or not all(isinstance(name, str) for name in names):
                raise invalid(name, given, "names of signals", "Write a list of names.")
            object.__setattr__(self, name, tuple(names))
        one_of("norm", self.norm, ("hinf", "h2"))
        one_of("method", self.method, METHODS)
        if self.order is not None:
            whole_number("order", self.order, 0, remedy="It counts states.")
        if not isinstance(self.full_state, bool):
            raise invalid("full_state", self.full_state, "true or false", "Choose one of them.")
        for name in ("sample_rate_hz", "anti_aliasing_hz"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name), "Hz")
        positive("computation_delay", self.computation_delay, "s", zero=True)
        for name, known in (("actuators", _ACTUATOR), ("sensors", _SENSOR)):
            tables, remedy = getattr(self, name), f"Write [design.{name}.NAME]."
            instance_of(name, tables, Mapping, "a table of tables by name", remedy)
            for key, table in tables.items():
                remedy = f"Write [design.{name}.{key}]."
                instance_of((name, key), table, Mapping, "a table", remedy)
                known_keys((name, key), table, known)
        instance_of("delays", self.delays, Mapping, "a table of names", "Write { F = 1e-4 }.")
        instance_of("weights", self.weights, Mapping, "a table of weights", "See DesignTask.")
        self._check_combinations()
        _ = self.weighted  # names and weights are wrong now or never

    def _check_combinations(self) -> None:
        def refuse(name: str, given: object, without: str, want: str, remedy: str) -> None:
            raise invalid(name, described(f"{given} {without}"), want, remedy)

        if self.full_state:
            besides = "besides full_state"
            for name in ("measurements", "sensors", "measurement_noise"):
                if getattr(self, name):
                    measured = "All states are measured as they are."
                    refuse(name, name, besides, "one of both", measured)
            if set(SENSITIVITIES) & set(self.weights):
                given = "weights of mixed sensitivity"
                refuse("weights", given, besides, "weights of channels", "Leave full_state out.")
            if self.order:
                refuse("order", self.order, besides, "none", "A state feedback has no states.")
            if self.method == "slycot":
                refuse("method", "slycot", besides, "auto, lmi or riccati", "Choose one of them.")
        if self.order is not None and self.method != "auto":
            remedy = "Leave one of them out: an order asks for a search of its own."
            want = "auto where an order is given"
            refuse("method", self.method, "besides an order", want, remedy)
        if self.sample_rate_hz is None:
            for name in ("computation_delay", "anti_aliasing_hz"):
                if value := getattr(self, name):
                    given, remedy = f"{value:g}", "Give it, or leave this out."
                    refuse(name, given, "without a sampling rate", "sample_rate_hz too", remedy)

    @cached_property
    def plant(self) -> GeneralizedPlant:
        """The machine as it is wired: with actuators, sensors and delays, without weights."""
        plant = machine_plant(
            self.machine, self.controls, self.measurements, self.performance, self.disturbances
        )
        u, y = plant.control_names, plant.measurement_names
        for kind, method, known, prefixes in (
            ("actuators", "with_actuator", u, (CONTROL,)),
            ("sensors", "with_sensor", y, (MEASUREMENT,)),
            ("delays", "with_delay", (*u, *y), (CONTROL, MEASUREMENT)),
        ):
            for name, given in getattr(self, kind).items():
                full, add = signal(kind, name, known, *prefixes), getattr(plant, method)
                with inside((kind, name)):
                    plant = add(full, given) if kind == "delays" else add(full, **given)
        return plant.with_full_state() if self.full_state else plant

    @cached_property
    def weighted(self) -> GeneralizedPlant:
        """The plant for synthesis, weights included, price and noise not."""
        given, plant = self.weights, self.plant
        mixed = {key: given[key] for key in SENSITIVITIES if key in given}
        others = {key: value for key, value in given.items() if key not in mixed}
        known_keys(("weights",), others, (*SENSITIVITIES, "channels"))
        if mixed and others:
            shown, remedy = f"{', '.join(mixed)} and channels", "Leave one of both out."
            raise misfit("weights", shown, "weights of mixed sensitivity, or of channels", remedy)
        _ = self.prices, self.noises  # wrong names are refused here
        if mixed:
            weights: Any = {key: self._per_channel(key, value) for key, value in mixed.items()}
            with inside(("weights",)):
                return mixed_sensitivity(plant, **weights)
        channels = others.get("channels", {})
        instance_of("weights.channels", channels, Mapping, "a table of names", "Write x = 2.0.")
        names = (*plant.performance_names, *plant.disturbance_names)
        asked = {}
        for name, value in channels.items():
            full = signal("weights.channels", name, names, DISTURBANCE)
            asked[full] = asked_weight(("weights", "channels", name), value)
        return plant.weighted(asked)

    @property
    def prices(self) -> np.ndarray | None:
        """Price of each control of the plant, None for none."""
        return self._per_signal("control_weight")

    @property
    def noises(self) -> np.ndarray | None:
        """Noise on each measurement of the plant, None for none."""
        return self._per_signal("measurement_noise")

    @property
    def everything_measured(self) -> bool:
        """Whether the measurements are the states, each once and without noise."""
        P = self.plant
        if P.delays or P.ny != P.nx or P.D21.any() or P.D22.any() or self.noises is not None:
            return False
        ones = P.C2 == 1.0
        return bool((ones | (P.C2 == 0.0)).all() and (ones.sum(0) == 1).all())

    @property
    def kind(self) -> str:
        """Which controllers are searched: "state feedback", "output feedback" or "order N"."""
        if self.order is not None and not self.full_state:
            return f"order {self.order}"
        mixed = set(SENSITIVITIES) & set(self.weights)
        if self.full_state or (self.everything_measured and not mixed and self.method != "slycot"):
            return "state feedback"
        return "output feedback"

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reader should know about the plant."""
        found = []
        if isinstance(self.machine, MechanicalModel) and self.machine.effects:
            kinds = ", ".join(dict.fromkeys(effect.kind for effect in self.machine.effects))
            found.append(f"Effects are linearised about the state of rest: {kinds}.")
        if not self.disturbances and any(
            name.startswith("disturbance_") for name in self.plant.disturbance_names
        ):
            found.append("No input is left to disturb the machine: disturbances act as controls.")
        if not self.full_state and self.kind == "state feedback":
            found.append("All states are measured: the controller is a gain from them.")
        if self.plant.delays:
            found.append("The norm is that of the loop with Pade models of the delays.")
        if set(SENSITIVITIES) & set(self.weights) and self.noises is None and self.sensors:
            found.append("Mixed sensitivity asks for S, K S and T: noise of sensors is left out.")
        return tuple(found)

    def _per_channel(self, kind: str, given: Any) -> Any:
        """Return the weights of mixed sensitivity, one for all or a list of one per channel."""
        plant, where = self.plant, ("weights", kind)
        if isinstance(given, list | tuple):
            rows = enumerate(given)
            return [None if one is None else asked_weight((*where, i), one) for i, one in rows]
        if is_weight(given):
            return asked_weight(where, given)
        acting = kind == "effort"
        names = plant.control_names if acting else plant.measurement_names
        prefix, found = CONTROL if acting else MEASUREMENT, {}
        for name, one in given.items():
            full = signal(".".join(where), name, names, prefix)
            found[full] = asked_weight((*where, name), one)
        return [found.get(name) for name in names]

    def _per_signal(self, argument: str) -> np.ndarray | None:
        """Return a number per control or per measurement; None if there is none at all."""
        given = getattr(self, argument)
        price = argument == "control_weight"
        names = self.plant.control_names if price else self.plant.measurement_names
        if given is None:
            return None
        if not isinstance(given, Mapping):
            return np.full(len(names), positive(argument, given, zero=True))
        values = np.zeros(len(names))
        for name, value in given.items():
            full = signal(argument, name, names, CONTROL if price else MEASUREMENT)
            values[names.index(full)] = positive((argument, name), value, zero=True)
        return values

    def _card(self) -> Card:
        P, kind = self.plant, "H-infinity" if self.norm == "hinf" else "H2"
        rows = [
            ("plant", f"{P.nx} states"),
            ("controls", ", ".join(P.control_names)),
            ("measurements", ", ".join(P.measurement_names)),
            ("performance", ", ".join(P.performance_names)),
            ("disturbances", ", ".join(P.disturbance_names)),
            ("asked for", f"{self.kind}, {kind} norm"),
        ]
        if self.weights:
            rows.append(("weights", ", ".join(self.weights)))
        if self.sample_rate_hz is not None:
            rows.append(("sampling", f"{self.sample_rate_hz:g} Hz"))
        return Card("Design task", (quantities(*rows),), self.notes)
