"""The margins of one loop, broken at one signal while all others stay closed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import control
import numpy as np
from matplotlib.axes import Axes

from robustpolish.analysis.poles.eigen import eigensystem
from robustpolish.display import Card, Displayed, Table, quantities
from robustpolish.loops.loop import Loop, Place
from robustpolish.loops.margins.disk import DiskMargin, decibel, disk_of
from robustpolish.loops.pictures import plot_loop_nyquist
from robustpolish.loops.response import Response

# A crossing of the negative axis below 160 dB or above them is rounding of the response.
_SMALLEST_GAIN = 1e-8


@dataclass(frozen=True)
class Crossing:
    """A frequency at which the loop's gain is 1, or its phase -180 degrees.

    Attributes
    ----------
    frequency_hz : float
    gain : float
        Factor of the gain that makes the loop marginal here; 1 at a gain crossover.
    phase_deg : float
        Lag, from 0 to 360 degrees, that makes it marginal here; 0 at a phase crossover.
    delay_s : float
        The same lag as a delay in s; infinite at frequency 0.

    Examples
    --------
    >>> from robustpolish.loops import Crossing
    >>> Crossing(10.0, 1.0, 36.0, 0.01).delay_s
    0.01
    """

    frequency_hz: float
    gain: float
    phase_deg: float
    delay_s: float


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Displayed):
    """Margins at one signal, all other loops being closed.

    Attributes
    ----------
    name : str
        The signal at which the loop is broken.
    place : {"input", "output"}
        Of the plant.
    gain_up, gain_down : float
        Factors to which the gain may rise and fall; infinite and 0 if it may as it likes.
    phase_deg : float
        Degrees by which the phase may lag or lead; infinite if the gain never is 1.
    delay_s : float
        Smallest delay in s that makes the loop unstable; infinite if none does, 0 if any does. In
        discrete time it is a turn of the phase by omega times the delay, exact for whole samples.
    modulus : float
        Smallest distance of the Nyquist curve from -1, one over the peak of S.
    disk : DiskMargin
        Gain and phase changed together.
    gain_crossovers, phase_crossovers : tuple of Crossing
        All of them, by frequency.
    loop : control.StateSpace
        L, with S = 1/(1 + L).
    unstable_poles : int
        Poles of L beyond the boundary of stability.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> analysis = rp.loop_analysis(1 / (s * (s + 1) * (0.5 * s + 1)), -1)
    >>> margins = analysis.margins[0]
    >>> round(margins.gain_up, 6), round(margins.phase_deg, 4), round(margins.delay_s, 5)
    (3.0, 32.6131, 0.75958)
    >>> margins.plot().get_xlabel()
    'real part of L'
    """

    name: str
    place: Place
    gain_up: float
    gain_down: float
    phase_deg: float
    delay_s: float
    modulus: float
    disk: DiskMargin
    gain_crossovers: tuple[Crossing, ...]
    phase_crossovers: tuple[Crossing, ...]
    loop: control.StateSpace = field(repr=False)
    unstable_poles: int = 0

    @property
    def gain_up_db(self) -> float:
        """The upper gain margin in dB."""
        return decibel(self.gain_up)

    @property
    def gain_down_db(self) -> float:
        """The lower gain margin in dB; negative."""
        return decibel(self.gain_down)

    @property
    def delay_samples(self) -> float:
        """The delay margin in samples of a discrete loop; nan in continuous time."""
        if not self.loop.isdtime(strict=True):
            return math.nan
        return self.delay_s / (1.0 if self.loop.dt is True else float(self.loop.dt))

    @property
    def conditionally_stable(self) -> bool:
        """Whether less gain makes a loop unstable whose own poles are all stable."""
        return self.gain_down > 0 and self.unstable_poles == 0

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the Nyquist curve of the loop with the disk that it stays out of.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return plot_loop_nyquist({self.name: self.loop}, {self.name: self.disk.alpha}, ax)

    def _card(self) -> Card:
        rows = (
            ("gain margin [dB]", f"{self.gain_down_db:.4g} to {self.gain_up_db:.4g}"),
            ("phase margin [deg]", self.phase_deg),
            ("delay margin [s]", self.delay_s),
            ("disk margin", f"{self.disk.alpha:.4g}: {_disk_words(self.disk)}"),
            ("modulus margin", self.modulus),
        )
        columns = ("crossing", "frequency [Hz]", "gain [dB]", "lag [deg]", "delay [s]")
        crossings = tuple(
            (kind, c.frequency_hz, decibel(c.gain), c.phase_deg, c.delay_s)
            for kind, found in (("gain", self.gain_crossovers), ("phase", self.phase_crossovers))
            for c in found
        )
        tables = [quantities(*rows, digits=4)]
        if crossings:
            tables.append(Table("", columns, crossings))
        notes = ("Less gain makes it unstable too.",) if self.conditionally_stable else ()
        return Card(f"Loop broken at {self.place} {self.name}", tuple(tables), notes)


def margins_of(loop: Loop, place: Place, signal: int) -> LoopMargins:
    """Return the margins of a stable loop at one signal of a place."""
    response = loop.response(place, [signal])
    at_gain = tuple(_gain_crossover(response, omega) for omega in response.level_crossings(1.0))
    at_phase = tuple(_phase_crossovers(response))
    return LoopMargins(
        name=loop.names(place)[signal],
        place=place,
        gain_up=min((c.gain for c in at_phase if c.gain > 1), default=math.inf),
        gain_down=max((c.gain for c in at_phase if c.gain < 1), default=0.0),
        phase_deg=min((min(c.phase_deg, 360 - c.phase_deg) for c in at_gain), default=math.inf),
        delay_s=_delay(response, at_gain),
        modulus=_modulus(loop, place, signal),
        disk=disk_of(loop.balanced_peak(loop.at(place, [signal]))),
        gain_crossovers=at_gain,
        phase_crossovers=at_phase,
        loop=response.system,
        unstable_poles=_unstable(response),
    )


def _gain_crossover(response: Response, omega: float) -> Crossing:
    lag = (float(np.angle(response.scalar(omega)[0])) + math.pi) % (2 * math.pi)
    return Crossing(omega / (2 * math.pi), 1.0, math.degrees(lag), lag / omega)


def _phase_crossovers(response: Response) -> list[Crossing]:
    """Return where L is real and negative, at both ends of the axis too."""
    found = [0.0, *response.phase_crossings()]
    if response.highest not in found:
        found.append(response.highest)
    crossings = []
    for omega in found:
        value: Any = response.scalar(omega)[0]
        real = float(value.real)
        beyond = not np.isfinite(value) or not _SMALLEST_GAIN < -real < 1 / _SMALLEST_GAIN
        if not beyond and abs(value.imag) <= 1e-6 * abs(real):
            crossings.append(Crossing(omega / (2 * math.pi), -1 / real, 0.0, 0.0))
    return crossings


def _delay(response: Response, crossovers: tuple[Crossing, ...]) -> float:
    """Return the smallest delay; any will do if the gain stays at or above 1 for ever."""
    if not response.model.discrete and abs(response.scalar(math.inf)[0]) >= 1 - 1e-12:
        return 0.0
    return min((c.delay_s for c in crossovers), default=math.inf)


def _modulus(loop: Loop, place: Place, signal: int) -> float:
    largest = loop.peak(loop.at(place, [signal])).value
    return 1 / largest if largest > 0 else math.inf


def _unstable(response: Response) -> int:
    """Count poles beyond the boundary of stability, those that rounding leaves on it aside."""
    model = response.model
    spectrum = eigensystem(model.A)
    poles = spectrum.values
    beyond = np.abs(poles) - 1 if model.discrete else poles.real
    return int((beyond > spectrum.errors).sum())


def _disk_words(disk: DiskMargin) -> str:
    return f"±{disk.gain_db:.3g} dB with ±{disk.phase_deg:.3g} deg"
