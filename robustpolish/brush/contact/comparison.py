"""One landing under every law of contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import Vector
from robustpolish.brush.contact.impact import quarter_period, rim_mass
from robustpolish.brush.contact.landing import land
from robustpolish.brush.contact.laws import (
    ContactLaw,
    EventImpulse,
    HuntCrossley,
    LinearSpring,
    ListingImpulse,
)
from robustpolish.brush.parameters import BrushParameters
from robustpolish.display import Card, Displayed, Table
from robustpolish.plotting import plot_time_series

_WINDOW = 0.01  # seconds over which impulses are compared, as of the brush


@dataclass(frozen=True, eq=False, repr=False)
class ContactComparison(Displayed):
    """One landing under several laws of contact.

    Attributes
    ----------
    table : xarray.Dataset
        Over `law`: `peak` force [N] and `restitution` of the first blow, `window_impulse`, the
        largest impulse over 10 ms [N s], and `impulse` over all of the run [N s].
    runs : mapping of str to xarray.Dataset
        From :func:`land`.

    Examples
    --------
    >>> import robustpolish as rp
    >>> comparison = rp.compare_contact_laws(rp.BrushParameters.for_run(2))
    >>> [str(name) for name in comparison.table["law"].values][:2]
    ['spring', 'Hunt-Crossley']
    """

    table: xr.Dataset
    runs: Mapping[str, xr.Dataset]

    def plot(self, ax: Axes | None = None, *, signal: str = "force") -> Axes:
        """Draw one signal of every law over time.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        signal : {"force", "impulse", "velocity"}, optional

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.compare_contact_laws(duration=0.005).plot(signal="impulse").get_xlabel()
        'time [ms]'
        """
        return plot_time_series({name: run[signal] for name, run in self.runs.items()}, ax=ax)

    def _card(self) -> Card:
        keys = ("peak", "restitution", "window_impulse", "impulse")
        rows = tuple(
            (str(name), *(float(self.table[key].sel(law=name)) for key in keys))
            for name in self.table["law"].values
        )
        head = ("law", "peak [N]", "restitution", "most in 10 ms [N s]", "impulse [N s]")
        return Card("Contact laws side by side", (Table("", head, rows),), ())


def compare_contact_laws(
    parameters: BrushParameters | None = None,
    *,
    speed: float = 0.05,
    duration: float = 0.05,
    restitution: float = 0.5,
) -> ContactComparison:
    """Let the rim of the disc land under every law with the same stiffness.

    Parameters
    ----------
    parameters : BrushParameters, optional
        Stiffness, damping, polishing force, and the mass at the rim, I_0 / r^2.
    speed : float, optional
        Of arrival [m/s].
    duration : float, optional
        Simulated time [s].
    restitution : float, optional
        Of the bouncing impulse, 0 to below 1.

    Returns
    -------
    ContactComparison
        "spring", "Hunt-Crossley", "impulse", "impulse, bouncing", "impulse as listed" and "impulse
        as listed, whole mass", which is what listing D.1 lets hit.

    Raises
    ------
    InvalidInputError
        If a number is out of its range.

    Examples
    --------
    >>> import robustpolish as rp
    >>> table = rp.compare_contact_laws().table
    >>> bool(table["peak"].sel(law="spring") > 10)
    True
    """
    p = BrushParameters() if parameters is None else parameters
    mass, k = rim_mass(p), p.contact_stiffness
    laws: dict[str, ContactLaw] = {
        "spring": LinearSpring(k),
        "Hunt-Crossley": HuntCrossley(k, p.contact_damping),
        "impulse": EventImpulse(k),
        "impulse, bouncing": EventImpulse(k, restitution),
        "impulse as listed": ListingImpulse(k, mass),
        "impulse as listed, whole mass": ListingImpulse(k, p.mass),
    }
    runs = {name: land(law, mass, speed, p.polishing_force, duration) for name, law in laws.items()}
    closely = 8.0 * quarter_period(p.mass, k)  # a peak needs finer samples than a landing
    figures = np.array(
        [
            [
                float(land(law, mass, speed, p.polishing_force, closely).force.max()),
                law.restitution(speed),
                most_impulse(run.impulse.to_numpy(), float(run.time[1])),
                float(run.impulse[-1]),
            ]
            for law, run in zip(laws.values(), runs.values(), strict=True)
        ]
    ).T
    units = ("N", "1", "N s", "N s")
    keys = ("peak", "restitution", "window_impulse", "impulse")
    table = xr.Dataset(
        {
            key: ("law", row, {"units": unit})
            for key, row, unit in zip(keys, figures, units, strict=True)
        },
        {"law": list(laws)},
    )
    return ContactComparison(table, runs)


def most_impulse(impulse: Vector, interval: float) -> float:
    """Return the largest impulse within 10 ms, of one or of several columns.

    Parameters
    ----------
    impulse : ndarray, shape (samples,) or (samples, n)
        Since the beginning [N s].
    interval : float
        Between samples [s].

    Returns
    -------
    float
        In N s.
    """
    samples = max(1, min(round(_WINDOW / interval), len(impulse) - 1))
    return float(np.max(np.abs(impulse[samples:] - impulse[:-samples])))
