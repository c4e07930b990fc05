"""What a polishing controller is built of: sensors, actuators and a computer, with their limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from robustpolish.display import Card, Displayed, Table
from robustpolish.validation import invalid, positive


def _quantity(default: float, unit: str, source: str) -> Any:
    """Declare a field whose metadata carry unit and source."""
    return field(default=default, metadata={"unit": unit, "source": source})


@dataclass(frozen=True, repr=False)
class PolishingHardware(Displayed):
    """Sensors, actuators and computer of the polishing robot, for x and y each.

    Force control at the brush: a ring of electromagnets in the nose of the air bearing pulls at the
    brush's hub without touching it, and the bearing takes the reaction. Two displacement sensors
    beside them measure the gap between hub and nose. So force and measurement act between the
    same two bodies, at the same place.

    Of the thesis's six forces the other four are left out. A force on the bearing alone would need
    a frame beside the robot and moves the brush by 1/360 of what the same force at the brush
    does. A pair in z could do nothing about the largest deviation: half a period of that mode is
    over within the delays of sensor, computer and actuator.

    The numbers are typical of their kinds of devices and belong to no product; put in those of
    your data sheets. Infinite bandwidths and no noise or delay stand for ideal parts.

    Parameters
    ----------
    sensor_bandwidth_hz : float
        Where a sensor's gain has fallen by 3 dB, in Hz; its low-pass is the anti-aliasing filter.
    sensor_noise : float
        RMS noise of a reading, in m, over the sensor's bandwidth.
    actuator_bandwidth_hz : float
        Where an actuator's gain has fallen by 3 dB, in Hz.
    actuator_limit : float
        Largest force, in N.
    sample_rate_hz : float
        In Hz.
    computation_delay : float
        From a sample until its force is put out, in s.

    Raises
    ------
    InvalidInputError
        If a number is not positive (noise and delay may be zero; bandwidths and limit may be
        infinite), or if the computation takes more than ten periods.

    Examples
    --------
    >>> import robustpolish as rp
    >>> hardware = rp.PolishingHardware(sample_rate_hz=50e3)
    >>> round(hardware.period * 1e6), round(hardware.lag * 1e6)
    (20, 130)
    >>> hardware.table()[3][:3]
    ('actuator_limit', 20.0, 'N')
    """

    sensor_bandwidth_hz: float = _quantity(
        10e3,
        "Hz",
        "typical of eddy-current displacement sensors: 10 to 100 kHz; set to half the sample rate",
    )
    sensor_noise: float = _quantity(
        20e-9,
        "m",
        "typical of eddy-current sensors of 0.5 mm range: some tens of nm RMS at 10 kHz "
        "(capacitive ones: a few nm, but they dislike slurry)",
    )
    actuator_bandwidth_hz: float = _quantity(
        2e3,
        "Hz",
        "typical of magnetic-bearing actuators with current amplifiers: 1 to 3 kHz for small ones",
    )
    actuator_limit: float = _quantity(
        20.0,
        "N",
        "typical of electromagnets around a hub of 20 mm: some tens of N; twice the brush's peak",
    )
    sample_rate_hz: float = _quantity(
        20e3, "Hz", "typical of real-time controller boards with a processor: 10 to 50 kHz"
    )
    computation_delay: float = _quantity(
        25e-6,
        "s",
        "typical of such boards: conversion, some hundred multiplications, conversion back",
    )

    def __post_init__(self) -> None:
        """Check every field."""
        for item in fields(self):
            name, value = item.name, getattr(self, item.name)
            endless = name.endswith("bandwidth_hz") or name == "actuator_limit"
            zero = name in ("sensor_noise", "computation_delay")
            if not (endless and isinstance(value, float) and value == math.inf):
                value = positive(name, value, item.metadata["unit"], zero=zero)
            object.__setattr__(self, name, value)
        if self.computation_delay > 10 * self.period:
            remedy = "Check its unit, or sample more slowly."
            want = f"at most ten periods of {self.period:.4g} s"
            raise invalid("computation_delay", self.computation_delay, want, remedy)

    @property
    def period(self) -> float:
        """Time between samples, in s."""
        return 1 / self.sample_rate_hz

    @property
    def loop_delay(self) -> float:
        """Computation and the half period that a hold delays on average, in s."""
        return self.computation_delay + self.period / 2

    @property
    def lag(self) -> float:
        """All delays and time constants of the loop outside the machine, in s."""
        corners = (self.sensor_bandwidth_hz, self.actuator_bandwidth_hz)
        return self.loop_delay + sum(1 / (2 * math.pi * corner) for corner in corners)

    @property
    def noise_density(self) -> float:
        """Two-sided density of the sensor's noise, in m per square root of Hz.

        Of the RMS over the noise bandwidth of a low-pass of first order; of that up to half the
        sample rate if the sensor is ideally fast.
        """
        band = min(math.pi / 2 * self.sensor_bandwidth_hz, self.sample_rate_hz / 2)
        return self.sensor_noise / math.sqrt(2 * band)

    def table(self) -> list[tuple[str, float, str, str]]:
        """List every field as (name, value, unit, source).

        Returns
        -------
        list of tuple
        """
        return [
            (item.name, getattr(self, item.name), item.metadata["unit"], item.metadata["source"])
            for item in fields(self)
        ]

    def _card(self) -> Card:
        columns = ("part", "value", "unit", "source")
        return Card("Polishing hardware", (Table("", columns, tuple(self.table())),))
