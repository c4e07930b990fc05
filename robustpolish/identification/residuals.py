"""Residual analysis: shares of the error by time, frequency, motion and phase, with tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from robustpolish.base.checks import described, invalid, one_of
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.identification.compare import Comparison
from robustpolish.identification.residual_tests import (
    Coherence,
    Correlation,
    PlaceShares,
    autocorrelation,
    band_shares,
    coherence,
    contact_shares,
    cross_correlation,
    line_shares,
    phase_shares,
    place_shares,
    window_shares,
)
from robustpolish.linear.modes import modes
from robustpolish.plots.residuals import plot_residual_analysis, plot_residual_map, plot_surface
from robustpolish.signals.raw import sampling_time

# A place where the error is this many times denser than on average is worth a sentence.
_DENSE = 2.0
_PHASES = 24
_HARMONICS = 5


@dataclass(frozen=True, eq=False, repr=False)
class ResidualAnalysis(Displayed):
    """Where the error of a comparison is.

    Attributes
    ----------
    residual : xarray.Dataset
        Measured minus simulated outputs, over ``time``.
    channels : xarray.DataArray, shape (output,)
        Share of each output in the total error, outputs being counted in units of their own
        standard deviation.
    windows, bands : xarray.DataArray, shapes (output, window), (output, band)
        Share of each output's squared error by time (``begin``, ``end`` in s) and by frequency
        (``low``, ``high`` in Hz).
    modes, harmonics : xarray.DataArray, shapes (output, mode), (output, harmonic)
        Share near the model's natural frequencies, and near the harmonics of the spin (none if the
        model has no spin frequency).
    places : mapping of str to PlaceShares
        Share by displacement and velocity at each coordinate (``"x"``) and by relative
        displacement and velocity at each connection (``"x - x_m"``), and the missing force over
        both.
    phase : xarray.DataArray or None, shape (output, phase)
        Share by spin phase in rad, and the error averaged in phase with the spin.
    contact : xarray.DataArray or None, shape (output, state)
        Share in contact and in free flight.
    autocorrelation : mapping of str to Correlation
        Of each output's residual, from lag 1 on.
    cross_correlation : mapping of (str, str) to Correlation
        Of each input with each output's residual.
    coherence : mapping of (str, str) to Coherence
        Of each input with each output's residual.
    nrmse : mapping of str to float
        Size of the error by output; effect size comes before any test.

    Examples
    --------
    >>> import robustpolish as rp
    >>> analysis = rp.residual_analysis(rp.compare(*rp.datasets.sticky_slide()))
    >>> print(analysis.explain().splitlines()[1].split(",")[0].strip())
    x: 100 % of the error
    >>> round(float(analysis.overall(analysis.windows).sum()), 6), analysis.worst
    (1.0, 'x')
    >>> analysis.plot().get_ylabel(), analysis.plot_surface(place="x").get_ylabel()
    ('frequency', 'velocity [mm/s]')
    >>> sorted(analysis.to_dict())[:2], len(analysis.plot_panels().axes) > 5
    (['autocorrelation', 'bands'], True)
    """

    residual: xr.Dataset
    channels: xr.DataArray
    windows: xr.DataArray
    bands: xr.DataArray
    modes: xr.DataArray
    harmonics: xr.DataArray
    places: Mapping[str, PlaceShares]
    phase: xr.DataArray | None
    contact: xr.DataArray | None
    autocorrelation: Mapping[str, Correlation]
    cross_correlation: Mapping[tuple[str, str], Correlation]
    coherence: Mapping[tuple[str, str], Coherence]
    nrmse: Mapping[str, float]

    def overall(self, shares: xr.DataArray) -> xr.DataArray:
        """Return the shares of the total error: those of the outputs, weighted by `channels`.

        Parameters
        ----------
        shares : xarray.DataArray
            One of the tables of shares, over ``output``.

        Returns
        -------
        xarray.DataArray
        """
        return (shares * self.channels).sum("output")

    @property
    def worst(self) -> str:
        """The output with the largest share of the error."""
        return str(self.channels["output"].values[int(np.argmax(self.channels.values))])

    def explain(self) -> str:
        """Say in words where the error is.

        Returns
        -------
        str
        """
        where, tests = _parts(self)
        lines = ["Where the error is:", *where, "Tests (99 % bands, 1 % by chance):", *tests]
        return "\n".join(line if line.endswith(":") else f"  {line}" for line in lines)

    def to_dict(self) -> dict[str, Any]:
        """Return the shares and the figures of the tests as plain numbers.

        Returns
        -------
        dict
        """
        tables = ("channels", "windows", "bands", "modes", "harmonics", "phase", "contact")
        return {
            **{name: _table(getattr(self, name)) for name in tables},
            "places": {
                name: {"displacement": _table(p.displacement), "velocity": _table(p.velocity)}
                for name, p in self.places.items()
            },
            "autocorrelation": {
                name: {"flagged_share": test.flagged_share, "largest": test.largest}
                for name, test in self.autocorrelation.items()
            },
            "cross_correlation": [
                {"input": source, "output": name, "flagged_share": test.flagged_share,
                 "largest": test.largest,
                 "coherent_share": self.coherence[source, name].flagged_share}
                for (source, name), test in self.cross_correlation.items()
            ],
        }  # fmt: skip

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw when and at which frequencies one output's error is.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The one with the largest share of the error by default.

        Returns
        -------
        matplotlib.axes.Axes
            With the model's natural frequencies, and the harmonics of its spin.
        """
        name = self.worst if output is None else one_of("output", output, tuple(self.nrmse))
        return plot_residual_map(self.residual[name], self._marks(), ax)

    def plot_surface(self, ax: Axes | None = None, *, place: str | None = None) -> Axes:
        """Draw the missing force over displacement and velocity at one place.

        The residual of a model with wrong numbers shows their forces too: refit it first.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        place : str, optional
            A key of `places`; by default the one whose motion foretells the force best.

        Returns
        -------
        matplotlib.axes.Axes
        """
        name = max(self.places, key=lambda p: self.places[p].follows) if place is None else place
        name = one_of("place", name, tuple(self.places))
        ax = plot_surface(self.places[name].surface, ax)
        ax.set_title(f"missing force at {name}")
        return ax

    def _marks(self) -> dict[str, NDArray[np.float64]]:
        return {
            "mode": self.modes["frequency"].values,
            "spin harmonic": self.harmonics["frequency"].values,
        }

    def plot_panels(self) -> Figure:
        """Draw the shares and the tests of the output with the largest share of the error.

        Returns
        -------
        matplotlib.figure.Figure
        """
        worst, auto = self.worst, self.autocorrelation[self.worst]
        crossed = ((u, c) for (u, y), c in self.cross_correlation.items() if y == worst)
        coherent = ((u, c) for (u, y), c in self.coherence.items() if y == worst)
        return plot_residual_analysis(
            worst, self.windows.sel(output=worst), self.bands.sel(output=worst), self._marks(),
            (auto.value, auto.band), {u: (c.value, c.band) for u, c in crossed},
            {u: (c.value, c.threshold) for u, c in coherent},
            {name: place.surface for name, place in self.places.items()},
        )  # fmt: skip

    def _card(self) -> Card:
        heads = ("Where the error is:", "Tests (99 % bands, 1 % by chance):")
        rows = (tuple(tuple(line.split(": ", 1)) for line in part) for part in _parts(self))
        return Card("", tuple(Table(h, (), r) for h, r in zip(heads, rows, strict=True)))


# A residual analysis in words and in plain numbers.


def _parts(analysis: ResidualAnalysis) -> tuple[list[str], list[str]]:
    """Return sentences on where the error is, and on the tests."""

    def worst_of(shares: xr.DataArray) -> tuple[xr.DataArray, str]:
        share = analysis.overall(shares)
        largest = share[int(np.argmax(share.values))]
        return largest, _percent(largest)

    where = [
        f"{name}: {_percent(share)} of the error, NRMSE {analysis.nrmse[str(name)]:.3g}"
        for name, share in zip(analysis.channels["output"].values, analysis.channels, strict=True)
    ]
    time, share = worst_of(analysis.windows)
    where.append(f"time: most in {time['begin']:.4g} to {time['end']:.4g} s, {share} of the error")
    band, share = worst_of(analysis.bands)
    modes = [f for f in analysis.modes["frequency"].values if band["low"] <= f < band["high"]]
    marks = ", which holds " + ", ".join(f"the mode at {f:.4g} Hz" for f in modes)
    where.append(
        f"frequency: most in {band['low']:.4g} to {band['high']:.4g} Hz, {share}"
        f"{marks if modes else ''}"
    )
    for table, what in ((analysis.modes, "mode"), (analysis.harmonics, "spin harmonic")):
        where += [
            f"near the {what} at {near['frequency']:.4g} Hz: {_percent(near)}"
            for near in analysis.overall(table)
            if near > 0.1
        ]
    for name, place in analysis.places.items():
        for table, what in ((place.displacement, "displacement"), (place.velocity, "velocity")):
            shares, samples = analysis.overall(table), table["samples"].values
            dense = shares.values / np.maximum(samples, 1e-12)
            dense[shares.values < 0.05] = 0.0
            worst = int(np.argmax(dense))
            if dense[worst] > _DENSE:
                at = f"{shares[what][worst]:.3g} {place.surface[what].attrs['units']}"
                where.append(
                    f"{what} of {name} near {at}: {_percent(shares[worst])} of the error in "
                    f"{_percent(samples[worst], 1)} of the samples"
                )
    if analysis.phase is not None:
        phase, share = worst_of(analysis.phase)
        spread = "evenly spread"
        if phase >= _DENSE / analysis.phase.sizes["phase"]:
            spread = f"most near {np.degrees(phase['phase']):.0f} deg, {share} of the error"
        where.append(f"spin phase: {spread}")
    if analysis.contact is not None:
        touching = analysis.overall(analysis.contact)[0]
        where.append(
            f"contact: {_percent(touching)} of the error in {_percent(touching['samples'])} of the "
            "samples; the rest in free flight"
        )
    tests = [
        f"autocorrelation of {name}: {_percent(test.flagged_share, 1)} of the lags outside, "
        f"largest {test.largest:.2f}"
        for name, test in analysis.autocorrelation.items()
    ]
    tests += [
        f"{source} with {name}: correlation outside at {_percent(test.flagged_share, 1)} of the "
        f"lags, coherence above chance at "
        f"{_percent(analysis.coherence[source, name].flagged_share, 1)} of the frequencies"
        for (source, name), test in analysis.cross_correlation.items()
    ]
    return where, tests


def _table(array: xr.DataArray | None) -> dict[str, Any] | None:
    if array is None:
        return None
    coordinates = {str(name): value.values.tolist() for name, value in array.coords.items()}
    return {**coordinates, "share": array.values.tolist()}


def _percent(share: Any, digits: int = 0) -> str:
    return f"{100 * float(share):.{digits}f} %"


def residual_analysis(
    comparison: Comparison,
    *,
    contact: str | NDArray[np.bool_] | None = None,
    windows: int = 20,
    bands: int = 16,
    bins: int = 12,
) -> ResidualAnalysis:
    """Find out where the error of a comparison is.

    Parameters
    ----------
    comparison : Comparison
        Of :func:`robustpolish.compare`. Several records are analysed together, one behind the
        other over the time that ``comparison.data`` has.
    contact : str or ndarray of bool, optional
        When there is contact: a column of the data (contact where it is above 2 % of its largest
        size), or one value for each sample. By default a column with "contact" in its name.
    windows, bands, bins : int, optional
        Number of time windows, of frequency bands (equally wide in the logarithm) and of bins for
        displacement and velocity.

    Returns
    -------
    ResidualAnalysis

    Raises
    ------
    InvalidInputError
        If the run diverged, has less than 64 samples, or `contact` does not fit; for predictions
        of several records.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 900.0)],
    ...     inputs=[rp.Input("F", ("x", "ground"))],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> time = np.arange(2000) * 0.01
    >>> force = np.random.default_rng(0).standard_normal(2000)
    >>> hum = 0.01 * np.sin(2 * np.pi * 20 * time)  # what the model does not know
    >>> data = xr.Dataset({"F": ("time", force), "x": ("time", hum)}, {"time": time})
    >>> result = rp.residual_analysis(rp.compare(model, data))
    >>> [round(float(share), 2) for share in result.channels]
    [1.0]
    """
    residual = _clean(comparison)
    step, samples = sampling_time(residual), residual.sizes["time"]
    data, model = comparison.data.sel(time=residual["time"]), comparison.model
    nrmse = {name: error.nrmse for name, error in comparison.outputs.items()}
    power = xr.DataArray([value**2 for value in nrmse.values()], {"output": [*nrmse]}, "output")
    frequencies = modes(model.state_space()).frequencies_hz if model.free else np.zeros(0)
    spin = model.spin_frequency
    harmonics = [k * spin for k in range(1, _HARMONICS + 1)] if spin is not None else []
    # from some periods in the record to half the sampling rate
    lowest, highest = 8 / (samples * step), 0.5 / step
    inner = np.geomspace(min(lowest, highest / 2), highest, bands)
    pairs = {
        (u, y): (data[u].values, residual[y].values, step)
        for u in model.input_names if np.ptp(data[u].values) > 0 for y in nrmse
    }  # fmt: skip
    return ResidualAnalysis(
        residual=residual,
        channels=power / power.sum() if power.any() else power,
        windows=window_shares(residual, min(windows, samples // 2)),
        bands=band_shares(residual, np.concatenate([[0.0], inner])),
        modes=line_shares(residual, [f for f in frequencies if f > 0], "mode"),
        harmonics=line_shares(residual, [f for f in harmonics if f < highest], "harmonic"),
        places=place_shares(comparison, residual, bins),
        phase=phase_shares(residual, spin, _PHASES) if spin is not None else None,
        contact=_contact(residual, data, contact),
        autocorrelation={y: autocorrelation(residual[y].values, step) for y in nrmse},
        cross_correlation={pair: cross_correlation(*each) for pair, each in pairs.items()},
        coherence={pair: coherence(*each) for pair, each in pairs.items()},
        nrmse=nrmse,
    )


def _clean(comparison: Comparison) -> xr.Dataset:
    """Return the residual without the samples before the first prediction."""
    residual = comparison.residual
    if comparison.method == "prediction" and len(comparison.records) > 1:
        shown = described(f"predictions of {len(comparison.records)} records")
        remedy = "Compare them in free runs or windows, or one by one."
        raise invalid("comparison", shown, "those of one record", remedy)
    good = np.all([np.isfinite(residual[name].values) for name in comparison.outputs], axis=0)
    if comparison.method == "prediction" and good.any():
        first = int(np.argmax(good))
        residual, good = residual.isel(time=slice(first, None)), good[first:]
    if not good.all():
        shown = described(comparison.reproducibility.reason or "a run that diverged")
        remedy = "Compare in short windows, or mend the model first."
        raise invalid("comparison", shown, "a run that stays finite", remedy)
    if good.size < 64:
        raise invalid("comparison", described(f"{good.size} samples"), "64 or more", "Record more.")
    return residual


def _contact(
    residual: xr.Dataset, data: xr.Dataset, contact: str | NDArray[np.bool_] | None
) -> xr.DataArray | None:
    if contact is None:
        named = [str(name) for name in data.data_vars if "contact" in str(name).casefold()]
        if not named:
            return None
        contact = named[0]
    if isinstance(contact, str):
        if contact not in data:
            listed = ", ".join(map(str, data.data_vars))
            raise invalid("contact", contact, f"a column: {listed}", "Check its name.")
        values = np.abs(np.asarray(data[contact].values, dtype=float))
        return contact_shares(residual, values > 0.02 * values.max())
    values = np.asarray(contact)
    if values.shape != (residual.sizes["time"],):
        shown = described(f"shape {values.shape}")
        raise invalid("contact", shown, "one value for each sample", "Cut it like the residual.")
    return contact_shares(residual, values.astype(bool))
