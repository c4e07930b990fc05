"""What is asked of a controller for some machine, and the plants that this makes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from robustpolish.display import Card, Displayed, quantities
from robustpolish.machine_design.asked_weights import SENSITIVITIES, asked_weight, is_weight
from robustpolish.machine_design.signals import CONTROL, MEASUREMENT, machine_plant, signal
from robustpolish.models import GeneralizedPlant, MechanicalModel, mixed_sensitivity
from robustpolish.validation import (
    described,
    inside,
    instance_of,
    invalid,
    is_whole,
    known_keys,
    one_of,
    positive,
)

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
        or by name; or ``channels``, by name of a disturbance or performance output. See
        :func:`robustpolish.machine_design.asked_weight` for the forms of a weight.
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
    >>> rp.DesignTask(model, controls=["F"], actuators={"F": {"bandwidth_hz": 200.0}})
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
            object.__setattr__(self, name, _names(name, getattr(self, name)))
        one_of("norm", self.norm, ("hinf", "h2"))
        one_of("method", self.method, METHODS)
        _whole("order", self.order)
        if not isinstance(self.full_state, bool):
            raise invalid("full_state", self.full_state, "true or false", "Choose one of them.")
        for name in ("sample_rate_hz", "anti_aliasing_hz"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name), "Hz")
        positive("computation_delay", self.computation_delay, "s", zero=True)
        _tables("actuators", self.actuators, _ACTUATOR)
        _tables("sensors", self.sensors, _SENSOR)
        instance_of("delays", self.delays, Mapping, "a table of names", "Write { F = 1e-4 }.")
        instance_of("weights", self.weights, Mapping, "a table of weights", "See DesignTask.")
        self._check_combinations()
        _ = self.weighted  # names and weights are wrong now or never

    def _check_combinations(self) -> None:
        if self.full_state:
            for name in ("measurements", "sensors", "measurement_noise"):
                if getattr(self, name):
                    shown, want = described(f"{name} besides full_state"), "one of both"
                    raise invalid(name, shown, want, "All states are measured as they are.")
            if set(SENSITIVITIES) & set(self.weights):
                shown = described("weights of mixed sensitivity besides full_state")
                raise invalid("weights", shown, "weights of channels", "Leave full_state out.")
            if self.order:
                shown = described(f"{self.order} besides full_state")
                raise invalid("order", shown, "none", "A state feedback has no states.")
            if self.method == "slycot":
                shown = described("slycot besides full_state")
                raise invalid("method", shown, "auto, lmi or riccati", "Choose one of them.")
        if self.order is not None and self.method != "auto":
            shown = described(f"{self.method} besides an order")
            remedy = "Leave one of them out: an order asks for a search of its own."
            raise invalid("method", shown, "auto where an order is given", remedy)
        if self.sample_rate_hz is None:
            for name in ("computation_delay", "anti_aliasing_hz"):
                if getattr(self, name):
                    shown = described(f"{getattr(self, name):g} without a sampling rate")
                    raise invalid(name, shown, "sample_rate_hz too", "Give it, or leave this out.")

    @cached_property
    def plant(self) -> GeneralizedPlant:
        """The machine as it is wired: with actuators, sensors and delays, without weights."""
        plant = machine_plant(
            self.machine, self.controls, self.measurements, self.performance, self.disturbances
        )
        u, y = plant.control_names, plant.measurement_names
        for name, known in self.actuators.items():
            control = signal("actuators", name, u, CONTROL)
            with inside(("actuators", name)):
                plant = plant.with_actuator(control, **known)
        for name, known in self.sensors.items():
            measurement = signal("sensors", name, y, MEASUREMENT)
            with inside(("sensors", name)):
                plant = plant.with_sensor(measurement, **known)
        for name, seconds in self.delays.items():
            delayed = signal("delays", name, (*u, *y), CONTROL, MEASUREMENT)
            with inside(("delays", name)):
                plant = plant.with_delay(delayed, seconds)
        return plant.with_full_state() if self.full_state else plant

    @cached_property
    def weighted(self) -> GeneralizedPlant:
        """The plant for synthesis, weights included, price and noise not."""
        given, plant = self.weights, self.plant
        mixed = {key: given[key] for key in SENSITIVITIES if key in given}
        others = {key: value for key, value in given.items() if key not in mixed}
        known_keys(("weights",), others, (*SENSITIVITIES, "channels"))
        if mixed and others:
            shown = described(f"{', '.join(mixed)} and channels")
            want = "weights of mixed sensitivity, or of channels"
            raise invalid("weights", shown, want, "Leave one of both out.")
        for name in ("control_weight", "measurement_noise"):
            self._per_signal(name)
        if mixed:
            weights: dict[str, Any] = {
                key: self._per_channel(key, value) for key, value in mixed.items()
            }
            with inside(("weights",)):
                return mixed_sensitivity(plant, **weights)
        channels = others.get("channels", {})
        instance_of("weights.channels", channels, Mapping, "a table of names", "Write x = 2.0.")
        names = (*plant.performance_names, *plant.disturbance_names)
        return plant.weighted(
            {
                signal("weights.channels", name, names, "disturbance_"): asked_weight(
                    ("weights", "channels", name), value
                )
                for name, value in channels.items()
            }
        )

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
        names = plant.control_names if kind == "effort" else plant.measurement_names
        if isinstance(given, list | tuple):
            return [
                None if one is None else asked_weight((*where, i), one)
                for i, one in enumerate(given)
            ]
        if is_weight(given):
            return asked_weight(where, given)
        prefix = CONTROL if kind == "effort" else MEASUREMENT
        found: dict[str, Any] = {
            signal(".".join(where), name, names, prefix): asked_weight((*where, name), one)
            for name, one in given.items()
        }
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
        P = self.plant
        kind = "H-infinity" if self.norm == "hinf" else "H2"
        facts = (P.control_names, P.measurement_names, P.performance_names, P.disturbance_names)
        words = ("controls", "measurements", "performance", "disturbances")
        rows = [
            ("plant", f"{P.nx} states"),
            *((word, ", ".join(names)) for word, names in zip(words, facts, strict=True)),
            ("asked for", f"{self.kind}, {kind} norm"),
        ]
        if self.weights:
            rows.append(("weights", ", ".join(self.weights)))
        if self.sample_rate_hz is not None:
            rows.append(("sampling", f"{self.sample_rate_hz:g} Hz"))
        return Card("Design task", (quantities(*rows),), self.notes)


def _names(argument: str, given: Any) -> tuple[str, ...]:
    if given is None:
        return ()
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise invalid(argument, given, "names of signals", "Write a list of names.")
    return tuple(names)


def _whole(argument: str, given: Any) -> None:
    right = is_whole(given) and given >= 0
    if given is not None and not right:
        raise invalid(argument, given, "a whole number of at least 0", "It counts states.")


def _tables(argument: str, given: Any, known: tuple[str, ...]) -> None:
    want = "a table of tables by name"
    instance_of(argument, given, Mapping, want, f"Write [design.{argument}.NAME].")
    for name, table in given.items():
        where = (argument, name)
        instance_of(where, table, Mapping, "a table", f"Write [design.{argument}.{name}].")
        known_keys(where, table, known)
