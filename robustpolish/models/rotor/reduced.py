"""A rotor with few coordinates: its plant, and what it lacks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import Matrix, Vector
from robustpolish.display import Card, Displayed, quantities
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.models.rotor.assembly import Assembly
from robustpolish.models.rotor.plant import named_places, rotor_plant
from robustpolish.models.rotor.reduction import Method
from robustpolish.models.rotor.second_order import SecondOrder
from robustpolish.models.rotor.whirl import eigen_whirl
from robustpolish.plotting import plot_gains
from robustpolish.validation import positive

_GRID = 400
_DECADES = 4
_DAMPED = 0.01
"""Damping ratio that is added to both rotors before their responses are compared: without any, the
response at a resonance has no size, and the error there none either."""


@dataclass(frozen=True)
class ReductionError:
    """What a reduced rotor lacks below a frequency.

    Attributes
    ----------
    response : float
        Largest difference of the responses between all ports (largest singular value) over the
        response itself, over frequency, with a damping ratio of 0.01 added to both.
    response_hz : float
        Where that is.
    frequency : float
        Largest relative difference of the whirl frequencies.
    steady : float
        The relative difference of the responses to steady forces.
    band_hz, speed : float
        For which band from 0 Hz and which speed in rad/s this holds.

    Examples
    --------
    >>> import robustpolish as rp
    >>> lost = rp.spindle_rotor().reduced(1, [-0.0445, 0.025], "modal").error()
    >>> round(lost.steady, 3), lost.frequency < 1e-9  # one mode bends too little under steady loads
    (0.002, True)
    """

    response: float
    response_hz: float
    frequency: float
    steady: float
    band_hz: float
    speed: float


@dataclass(frozen=True, eq=False, repr=False)
class ReducedRotor(Displayed):
    """A rotor with few coordinates, as its ports see it.

    Attributes
    ----------
    assembly : Assembly
        The whole rotor.
    system : SecondOrder
        The reduced equations of motion, with gyroscopic terms for every speed.
    bases : tuple of ndarray, or None
        Motions that are kept, by plane; None if all are.
    ports : tuple of float
        In m.
    method : str
    modes : int
        Dynamic shapes of each of x and y.
    speed : float
        In rad/s, at which these were taken.

    Examples
    --------
    >>> import robustpolish as rp
    >>> few = rp.spindle_rotor().reduced(2, [-0.0445, 0.025])
    >>> len(few.system.state_scale), len(few.assembly.system.state_scale), few.modes
    (8, 84, 2)
    """

    assembly: Assembly
    system: SecondOrder = field(repr=False)
    bases: tuple[Matrix, ...] | None
    ports: tuple[float, ...]
    method: Method
    modes: int
    speed: float = 0.0

    @property
    def band_hz(self) -> float:
        """The highest of the whole rotor's normal modes that are kept, in Hz."""
        known = self.assembly.system.normal_modes[0]
        return float(known[min(2 * self.modes, len(known)) - 1]) / (2 * math.pi)

    def rows(self, place: float) -> Matrix:
        """Return rows that give x and y at a place from the reduced coordinates.

        Parameters
        ----------
        place : float
            In m.

        Returns
        -------
        ndarray, shape (2, n)

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.spindle_rotor().reduced(2, [0.02]).rows(0.02).shape
        (2, 6)
        """
        rows = self.assembly.ports([place])
        if self.bases is None:
            return rows
        parts = zip(self.assembly.system.parts, self.bases, strict=True)
        return np.hstack([rows[:, part] @ basis for part, basis in parts])

    def plant(
        self,
        speed: float | None = None,
        *,
        loads: Mapping[str, float],
        actuators: Mapping[str, float],
        sensors: Mapping[str, float] | None = None,
        performance: Mapping[str, float] | None = None,
    ) -> GeneralizedPlant:
        """Return a plant with named forces and displacements.

        Parameters
        ----------
        speed : float, optional
            Of the spin, in rad/s; by default that at which the modes were taken.
        loads : mapping of str to float
            Places of the disturbing forces by name, in m: "tip" becomes F_tip_x and F_tip_y in N.
        actuators : mapping of str to float
            Places of the controls: "magnet" becomes u_magnet_x and u_magnet_y in N.
        sensors : mapping of str to float, optional
            Places of the measurements, measured_magnet_x and measured_magnet_y in m; those of the
            actuators by default.
        performance : mapping of str to float, optional
            Places of the performance outputs, tip_x and tip_y in m; those of the loads by default.

        Returns
        -------
        GeneralizedPlant
            Its states are displacements and rates of the normal modes at rest.

        Raises
        ------
        InvalidInputError
            If a place is none.

        Examples
        --------
        >>> import robustpolish as rp
        >>> few = rp.spindle_rotor().reduced(2, [-0.0445, 0.025])
        >>> few.plant(loads={"brush": 0.025}, actuators={"film": -0.0445}).disturbance_names
        ('F_brush_x', 'F_brush_y')
        """
        given = {
            "loads": loads,
            "actuators": actuators,
            "performance": loads if performance is None else performance,
            "sensors": actuators if sensors is None else sensors,
        }
        rows = {
            role: {name: self.rows(at) for name, at in named_places(role, places).items()}
            for role, places in given.items()
        }
        return rotor_plant(self.system, self.speed if speed is None else speed, rows)

    def error(self, speed: float | None = None, band_hz: float | None = None) -> ReductionError:
        """Compare with the whole rotor between the ports.

        Parameters
        ----------
        speed : float, optional
            In rad/s; by default that at which the modes were taken.
        band_hz : float, optional
            Up to which frequency; by default to the highest normal mode that is kept.

        Returns
        -------
        ReductionError

        Raises
        ------
        InvalidInputError
            If the band is not positive.

        Examples
        --------
        >>> import robustpolish as rp
        >>> few = rp.spindle_rotor().reduced(2, [-0.0445, 0.025])
        >>> few.error(speed=314.0).response < 0.1, few.error().response < 1e-6
        (True, True)
        """
        band, share, response, lost = self._compared(speed, band_hz)
        shares = lost / response
        worst = int(shares.argmax())
        whole, own = self.assembly.system, self.system
        speed = self.speed if speed is None else speed
        found, known = (np.imag(eigen_whirl(system, speed)[0]) for system in (own, whole))
        count = min(int((known <= 2 * math.pi * band * (1 + 1e-9)).sum()), len(found))
        gaps = np.abs(found[:count] / known[:count] - 1)
        return ReductionError(
            response=float(shares[worst]),
            response_hz=float(band * share[worst]),
            frequency=float(gaps.max(initial=0.0)),
            steady=float(shares[0]),
            band_hz=band,
            speed=speed,
        )

    def _compared(
        self, speed: float | None, band_hz: float | None
    ) -> tuple[float, Vector, Vector, Vector]:
        """Return the band in Hz, shares of it, and gains there of the rotor and of what is lost."""
        band = self.band_hz if band_hz is None else positive("band_hz", band_hz, "Hz")
        speed = self.speed if speed is None else speed
        share = np.r_[0.0, np.geomspace(10.0**-_DECADES, 1, _GRID)]
        s = 2 * math.pi * band * share * (1j + _DAMPED)
        rows = self.assembly.ports(self.ports)
        response = self.assembly.system.response(speed, s, rows, rows)
        rows = np.vstack([self.rows(place)[axis] for axis in (0, 1) for place in self.ports])
        lost = response - self.system.response(speed, s, rows, rows)
        gains = [np.linalg.norm(each, 2, axis=(1, 2)) for each in (response, lost)]
        return band, share, gains[0], gains[1]

    def plot(self, ax: Axes | None = None, *, band_hz: float | None = None) -> Axes:
        """Draw the gain between the ports over frequency, and that of what is lost.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        band_hz : float, optional
            As for :meth:`error`.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.spindle_rotor().reduced(2, [0.025]).plot().get_xlabel()
        'frequency'
        """
        band, share, *gains = self._compared(None, band_hz)
        frequency = {"frequency": band * share[1:]}
        names = ("the whole rotor, 1 % damping added", "what is lost")
        curves = {
            name: xr.DataArray(gain[1:], frequency, attrs={"units": "m/N"})
            for name, gain in zip(names, gains, strict=True)
        }
        return plot_gains(curves, ax=ax)

    def _card(self) -> Card:
        lost = self.error()
        rows = (
            ("states", 2 * len(self.system.state_scale)),
            ("states of the whole rotor", 2 * len(self.assembly.system.state_scale)),
            ("band [Hz]", lost.band_hz),
            ("largest relative error within", lost.response),
            ("largest relative error of a frequency", lost.frequency),
            ("relative error for steady forces", lost.steady),
        )
        return Card(f"Reduced rotor ({self.method})", (quantities(*rows),))
