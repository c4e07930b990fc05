"""Why the thesis's forces were unrealistically large: one thing changed at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.integrate import cumulative_trapezoid

from robustpolish.arrays import Matrix
from robustpolish.brush.contact.comparison import most_impulse
from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.motion import listing_forces
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.simulate import simulate_brush
from robustpolish.brush.surfaces.trough import Surface
from robustpolish.display import Card, Displayed, Table
from robustpolish.long_calls import working
from robustpolish.plotting import plot_bars
from robustpolish.validation import one_of, positive

_OF_MOTION = ("tilt_cosine", "inertia_radius", "impact_mass", "pulling_surface", "feed_friction")
"""Mistakes of D.1 that change the brush's own motion and its forces."""

_SPACING = 1e-5  # seconds between stored states, for which the thesis's tables come out


@dataclass(frozen=True, eq=False, repr=False)
class ForceStudy(Displayed):
    """What each suspect does to the brush's forces.

    Attributes
    ----------
    table : xarray.Dataset
        Over `row`: `suspect`; `peak`, the largest force of the contact beyond the polishing force
        [N]; `factor`, that over the base row's; `impulse`, the most within 10 ms, beyond the
        polishing force, as a share of the polishing force's.
    run : int
        Of table 9.2.

    Examples
    --------
    >>> import robustpolish as rp
    >>> study = rp.force_study(duration=0.02, suspects=("friction",))
    >>> study.answer()["friction"] < 10
    True
    """

    table: xr.Dataset
    run: int

    def answer(self) -> dict[str, float]:
        """Return by what factor each suspect can change the peak force, at most.

        Returns
        -------
        dict of str to float
            Largest over smallest peak among the rows of a suspect and the base row.
        """
        suspects = self.table["suspect"].values
        base = float(self.table["peak"][0])
        answer = {}
        for name in dict.fromkeys(suspects[1:]):
            peaks = [base, *self.table["peak"].values[suspects == name]]
            answer[str(name)] = float(max(peaks) / min(peaks))
        return answer

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the factors of the suspects as bars.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.force_study(duration=0.02, suspects=("friction",)).plot().get_xscale()
        'log'
        """
        found = self.answer()
        bars = xr.DataArray(
            list(found.values()), {"suspect": list(found)}, ("suspect",), name="factor of the peak"
        )
        return plot_bars(bars.assign_attrs(units="1"), ax=ax)

    def _card(self) -> Card:
        keys = ("row", "suspect", "peak", "factor", "impulse")
        rows = tuple(zip(*(self.table[key].values.tolist() for key in keys), strict=True))
        head = ("changed", "suspect", "peak [N]", "times the base", "10 ms impulse / (F_p 10 ms)")
        told = [f"{name}: factor {value:.3g}" for name, value in self.answer().items()]
        title = f"Forces beyond the polishing force, run {self.run}"
        return Card(title, (Table("", head, rows, digits=3),), tuple(told))


def force_study(
    run: int = 1,
    duration: float = 0.1,
    *,
    suspects: tuple[str, ...] = ("code", "duration", "friction", "geometry", "contact law"),
) -> ForceStudy:
    """Change one thing at a time in the listing's brush and compare the forces.

    The thesis leaves open whether its forces are too large by its geometry, its coefficient of
    friction, the duration of impact or something else (section 9.4.5).

    Parameters
    ----------
    run : {1, 2, 3, 4}, optional
        Contact stiffness (table 9.2).
    duration : float, optional
        Simulated time [s]. The listing chatters on its own guard, so that its work grows
        quickly with it.
    suspects : tuple of str, optional
        Among "code", each mistake of the listings mended alone, all of them, and the forces as
        D.2 applies them, from states that it interpolates wrongly; "duration", t_m 10 and 100
        times as long; "friction", mu from 0.1 to 0.707; "geometry", troughs in which the disc
        fits; "contact law", the physical brush on a surface that fits, pressed and landing.

    Returns
    -------
    ForceStudy

    Raises
    ------
    InvalidInputError
        If an argument is out of its range.

    Examples
    --------
    >>> import robustpolish as rp
    >>> study = rp.force_study(duration=0.02, suspects=("duration",))
    >>> [str(name) for name in study.table["row"].values]
    ['as listed', 't_m 10 times as long', 't_m 100 times as long']
    """
    positive("duration", duration, "s")
    known = ("code", "duration", "friction", "geometry", "contact law")
    for name in suspects:
        one_of("suspects", name, known)
    found: list[tuple[str, str, float, float]] = []
    with working("Changing one thing at a time"):
        for suspect, row, forces, press in _rows(run, duration, suspects):
            spacing = duration / (len(forces) - 1)
            impulse = cumulative_trapezoid(forces, dx=spacing, axis=0, initial=0.0)
            most = most_impulse(np.asarray(impulse), spacing) / (press * min(0.01, duration))
            peak = float(np.max(np.linalg.norm(forces, axis=1)))
            found.append((row, suspect, peak, most))
    rows, suspect_names, peaks, impulses = zip(*found, strict=True)
    table = xr.Dataset(
        {
            "suspect": ("row", list(suspect_names)),
            "peak": ("row", np.array(peaks), {"units": "N"}),
            "factor": ("row", np.array(peaks) / peaks[0], {"units": "1"}),
            "impulse": ("row", np.array(impulses), {"units": "1"}),
        },
        {"row": list(rows)},
    )
    return ForceStudy(table, run)


def _rows(
    run: int, duration: float, suspects: tuple[str, ...]
) -> Iterator[tuple[str, str, Matrix, float]]:
    """Yield suspect, row, forces beyond the polishing force (n, 3) and the latter [N]."""
    base = BrushParameters.as_published(run)
    press = base.polishing_force

    def listed(brush: BrushParameters = base, **options: Any) -> Matrix:
        return _beyond(simulate_brush("listing", None, duration, parameters=brush, **options))

    yield "base", "as listed", listed(), press
    if "code" in suspects:
        yield "code", "as D.2 applies it", _as_applied(base, duration), press
        every = ListingDefects().names()
        for name in _OF_MOTION:
            defects = ListingDefects.none(but=tuple(other for other in every if other != name))
            yield "code", f"{name} mended", listed(defects=defects), press
        yield "code", "all mended", listed(defects=ListingDefects.none()), press
    if "duration" in suspects:
        for times in (10, 100):
            softer = replace(base, contact_stiffness=base.contact_stiffness / times**2)
            yield "duration", f"t_m {times} times as long", listed(softer), press
    if "friction" in suspects:
        for mu in (0.1, 0.2, 0.5, 0.707):
            yield "friction", f"mu = {mu:g}", listed(replace(base, friction=mu)), press
    if "geometry" in suspects:
        for across in (2.5, 1.0):
            surface = Surface(base.trough.along, across)
            row = f"trough of {1e3 * surface.trough_radius:.3g} mm"
            yield "geometry", row, listed(replace(base, surface=surface)), press
    if "contact law" in suspects:
        for start in ("pressed", "landing"):
            signals = simulate_brush("physical", run, duration, start=start)
            yield "contact law", f"physical, {start}", _beyond(signals), press


def _beyond(signals: xr.Dataset) -> Matrix:
    """Return the forces of the contact, less the polishing force."""
    up = signals["F_z"] - signals["F_p"]
    return np.column_stack([signals["F_x"], signals["F_y"], up])


def _as_applied(parameters: BrushParameters, duration: float) -> Matrix:
    """Return the forces that D.2 applies halfway between stored states, by its wrong weights."""
    signals = simulate_brush(
        "listing", None, duration, parameters=parameters, sample_rate=1.0 / _SPACING
    )
    names = ("theta", "theta_rate", "psi", "psi_rate")
    stored = np.column_stack([signals[name] for name in names])
    later, earlier = 0.5, (1.0 - 0.5 * _SPACING) / _SPACING
    states = later * stored[1:] + earlier * stored[:-1]
    halfway = signals["time"].to_numpy()[:-1] + 0.5 * _SPACING
    forces, _ = listing_forces(parameters, ListingDefects(), halfway, states, 1.0)
    return forces - np.array([0.0, 0.0, parameters.polishing_force])
