"""What is asked of a loop that is to be built, in one place, each number with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from robustpolish.base.checks import invalid, positive


@dataclass(frozen=True)
class LoopRequirements:
    """What a loop has to keep so that an engineer would put it on the machine.

    Attributes
    ----------
    disk_gain_db : float
        Disk margin as a gain: 6 dB, the factor of two of every textbook (Skogestad and
        Postlethwaite, section 2.4.3), here with any phase error that the disk holds besides.
    disk_phase_deg : float
        Disk margin as a phase: 30 degrees, the least that Skogestad and Postlethwaite and
        Åström and Murray (section 10.3) call acceptable.
    at_once_gain_db : float
        Disk margin as a gain if all inputs, or all outputs, change at once in the worst way: 3 dB,
        half of what one has to keep. The spinning satellite of Skogestad and Postlethwaite
        (section 3.7.1), which bears everything in one loop at a time, keeps 0.9 dB.
    modulus : float
        Distance of the Nyquist curve from -1: 0.5, a peak of S of 2 (Åström and Murray: 1.2 to 2).
    computation_samples : float
        Samples from a measurement to the control that answers it: 1, where the control is put
        out at the next sample.
    hold_samples : float
        What a zero-order hold delays on average: 0.5 (Åström and Wittenmark, Computer-Controlled
        Systems, section 8.2; Franklin, Powell and Workman, Digital Control, section 4.3).
    phase_loss_deg : float
        What the delays of sampling may cost at a gain crossover: 15 degrees, the upper end of the
        5 to 15 that Åström and Wittenmark (section 8.2) allow.
    delay_share : float
        Share of the delay margin that the delays of sampling may use: a half, so that cables,
        filters and drives find the other half.
    samples_per_bandwidth : float
        Sampling rate over closed-loop bandwidth: 20, the lower end of the 20 to 40 of Franklin,
        Powell and Workman (section 11.1).
    samples_per_rise : float
        Samples in the rise time of the fastest pole, 2.2 of its time constants: 4, the lower end
        of the 4 to 10 of Åström and Wittenmark (section 2.9).
    sample_rate_hz : float
        A sampling rate that can be bought: 20 kHz, what common real-time controllers and servo
        drives reach. With an FPGA set it to 1 MHz.
    delay_s : float
        Delay of a usual chain of measurement, computation and drive besides that of
        sampling: 20 microseconds, a converter and its filter.
    stiffness_percent, damping_percent, actuator_percent : float
        How far stiffness and damping of each mode of the plant and the gain of each actuator may
        be from those of the model, all at once: 5, 10 and 10 percent.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.LoopRequirements(sample_rate_hz=1e6).sampling_delay_samples
    1.5
    >>> round(rp.LoopRequirements().disk, 3)
    0.665
    """

    disk_gain_db: float = 6.0
    disk_phase_deg: float = 30.0
    at_once_gain_db: float = 3.0
    modulus: float = 0.5
    computation_samples: float = 1.0
    hold_samples: float = 0.5
    phase_loss_deg: float = 15.0
    delay_share: float = 0.5
    samples_per_bandwidth: float = 20.0
    samples_per_rise: float = 4.0
    sample_rate_hz: float = 20e3
    delay_s: float = 20e-6
    stiffness_percent: float = 5.0
    damping_percent: float = 10.0
    actuator_percent: float = 10.0

    def __post_init__(self) -> None:
        for item in fields(self):
            zero = item.name in ("computation_samples", "hold_samples", "delay_s")
            value = positive(item.name, getattr(self, item.name), zero=zero)
            object.__setattr__(self, item.name, value)
        if self.disk_phase_deg >= 180:
            expected = "less than 180 degrees"
            raise invalid("disk_phase_deg", self.disk_phase_deg, expected, "30 is usual.")
        if self.delay_share > 1:
            raise invalid("delay_share", self.delay_share, "at most 1", "It is a share.")

    @property
    def sampling_delay_samples(self) -> float:
        """Delay of computation and hold together, in samples."""
        return self.computation_samples + self.hold_samples

    @property
    def disk(self) -> float:
        """The disk margin alpha that holds the gain and the phase asked for."""
        return max(_disk(self.disk_gain_db), 2 * math.tan(math.radians(self.disk_phase_deg) / 2))

    @property
    def disk_at_once(self) -> float:
        """The disk margin alpha asked of all inputs, or all outputs, at once."""
        return _disk(self.at_once_gain_db)


def _disk(gain_db: float) -> float:
    factor = 10 ** (gain_db / 20)
    return 2 * (factor - 1) / (factor + 1)
