"""Where a model fails, as numbers and pictures: each as the share of the error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from robustpolish.analysis import modes
from robustpolish.display import Card, Displayed, Table
from robustpolish.identification.compare.comparison import Comparison
from robustpolish.identification.residuals.correlation import (
    autocorrelation,
    coherence,
    cross_correlation,
)
from robustpolish.identification.residuals.figures import ResidualFigures
from robustpolish.identification.residuals.places import place_shares
from robustpolish.identification.residuals.shares import (
    band_shares,
    contact_shares,
    line_shares,
    phase_shares,
    window_shares,
)
from robustpolish.identification.residuals.words import explain, to_dict
from robustpolish.measurements import sampling_time
from robustpolish.plotting import plot_residual_analysis, plot_residual_map, plot_surface
from robustpolish.validation import described, invalid, one_of

_PHASES = 24
_HARMONICS = 5


@dataclass(frozen=True, eq=False, repr=False)
class ResidualAnalysis(ResidualFigures, Displayed):
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

    def explain(self) -> str:
        """Say in words where the error is.

        Returns
        -------
        str
        """
        return explain(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the shares and the figures of the tests as plain numbers.

        Returns
        -------
        dict
        """
        return to_dict(self)

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
        worst = self.worst
        crossed = {u: c for (u, y), c in self.cross_correlation.items() if y == worst}
        coherent = {u: c for (u, y), c in self.coherence.items() if y == worst}
        auto = self.autocorrelation[worst]
        return plot_residual_analysis(
            worst,
            self.windows.sel(output=worst),
            self.bands.sel(output=worst),
            self._marks(),
            (auto.value, auto.band),
            {name: (c.value, c.band) for name, c in crossed.items()},
            {name: (c.value, c.threshold) for name, c in coherent.items()},
            {name: place.surface for name, place in self.places.items()},
        )

    def _card(self) -> Card:
        parts: dict[str, list[tuple[str, ...]]] = {}
        for line in self.explain().splitlines():
            if line.startswith(" "):
                parts[next(reversed(parts))].append(tuple(line.strip().split(": ", 1)))
            else:
                parts[line] = []
        return Card("", tuple(Table(head, (), tuple(rows)) for head, rows in parts.items()))


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
    names = list(comparison.outputs)
    step = sampling_time(residual)
    data = comparison.data.sel(time=residual["time"])
    model = comparison.model
    power = np.array([comparison.outputs[name].nrmse ** 2 for name in names])
    total = power.sum()
    auto = {y: autocorrelation(residual[y].values, step) for y in names}
    pairs = [(u, y) for u in model.input_names for y in names if np.ptp(data[u].values) > 0]
    frequencies = modes(model.state_space()).frequencies_hz if model.free else np.zeros(0)
    spin = model.spin_frequency
    harmonics = [
        k * spin for k in range(1, _HARMONICS + 1) if spin is not None and k * spin < 0.5 / step
    ]
    return ResidualAnalysis(
        residual=residual,
        channels=xr.DataArray(
            power / total if total > 0 else power, dims="output", coords={"output": names}
        ),
        windows=window_shares(residual, min(windows, residual.sizes["time"] // 2)),
        bands=band_shares(residual, _edges(residual.sizes["time"], step, bands)),
        modes=line_shares(residual, [f for f in frequencies if f > 0], "mode"),
        harmonics=line_shares(residual, harmonics, "harmonic"),
        places=place_shares(comparison, residual, bins),
        phase=phase_shares(residual, spin, _PHASES) if spin is not None else None,
        contact=_contact(residual, data, contact),
        autocorrelation=auto,
        cross_correlation={
            (u, y): cross_correlation(data[u].values, residual[y].values, step) for u, y in pairs
        },
        coherence={(u, y): coherence(data[u].values, residual[y].values, step) for u, y in pairs},
        nrmse={name: comparison.outputs[name].nrmse for name in names},
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
        raise invalid(
            "comparison",
            described(comparison.reproducibility.reason or "a run that diverged"),
            "a run that stays finite",
            "Compare in short windows, or mend the model first.",
        )
    if good.size < 64:
        raise invalid("comparison", described(f"{good.size} samples"), "64 or more", "Record more.")
    return residual


def _edges(samples: int, step: float, bands: int) -> NDArray[np.float64]:
    """Frequencies between the bands, from some periods in the record to half the sampling rate."""
    lowest, highest = 8 / (samples * step), 0.5 / step
    inner = np.geomspace(min(lowest, highest / 2), highest, bands)
    return np.concatenate([[0.0], inner])


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
