"""What many sampled loops have in common: percentiles, shares, limits, and the worst of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import Vector
from robustpolish.closed_loop.studies.trial import Trial
from robustpolish.display import Card, Displayed, Table
from robustpolish.models import GeneralizedPlant
from robustpolish.plotting import plot_distribution
from robustpolish.sweeps.confidence import percentile, percentile_limits, share_limits
from robustpolish.validation import described, invalid, one_of


@dataclass(frozen=True, eq=False)
class Replay:
    """One loop of a study once more.

    Attributes
    ----------
    sample : int
    values : mapping of str to number
        What was drawn.
    plant : GeneralizedPlant
        The machine with these numbers.
    load, response : xarray.Dataset or None
        The disturbance, and all outputs and controls over time; None where a study has none, or
        the loop is unstable.
    figures : mapping of str to float
    """

    sample: int
    values: Mapping[str, Any]
    plant: GeneralizedPlant
    load: xr.Dataset | None
    response: xr.Dataset | None
    figures: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class SampledLoops(Displayed):
    """Loops with drawn numbers, from :func:`robustpolish.monte_carlo`.

    Attributes
    ----------
    dataset : xarray.Dataset
        Over `sample`: what was drawn as coordinates, `norm`, `peak_NAME` and other figures of
        merit as variables, and `failure`, the reason where a sample has no figures.
    nominal : mapping of str to float
        The figures of the loop with the nominal numbers.
    seed : int
    trial : Trial
        What all loops share.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> design = rp.state_feedback(plant, method="riccati", control_weight=1e-7)
    >>> study = rp.monte_carlo(
    ...     design, {"brush_mass": ("normal", 0.2, 0.01)}, samples=59, executor="serial")
    >>> low, high = study.share_limits("norm", study.nominal["norm"] * 1.5)
    >>> round(low, 3), high, study.share("norm", study.nominal["norm"] * 1.5)
    (0.939, 1.0, 1.0)
    >>> low, high = study.percentile_limits("norm", 50.0)
    >>> low < study.percentile("norm", 50.0) < high
    True
    >>> study.plot(figure="norm").get_xlabel()
    'norm'
    >>> replay = study.replay()
    >>> replay.sample == study.worst() and replay.figures["norm"] == float(study.dataset.norm.max())
    True
    """

    dataset: xr.Dataset
    nominal: Mapping[str, float]
    seed: int
    trial: Trial

    @property
    def samples(self) -> int:
        """Number of loops."""
        return self.dataset.sizes["sample"]

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures of merit."""
        return tuple(str(name) for name in self.dataset.data_vars if name != "failure")

    @property
    def failures(self) -> Mapping[int, str]:
        """Reasons of the samples that have no figures, by their numbers."""
        reasons = self.dataset["failure"].values
        return {int(i): str(reasons[i]) for i in np.flatnonzero(reasons != "")}

    def percentile(self, figure: str, percent: float) -> float:
        """Return what `percent` of the samples do not exceed; failures count as infinite.

        Parameters
        ----------
        figure : str
        percent : float
            Above 0, at most 100.

        Returns
        -------
        float
        """
        return percentile(self._values(figure), _share("percent", percent, 100.0))

    def percentile_limits(
        self, figure: str, percent: float, confidence: float = 0.95
    ) -> tuple[float, float]:
        """Return limits of a percentile of all such machines, whatever the distribution.

        Parameters
        ----------
        figure : str
        percent : float
            Above 0, at most 100.
        confidence : float, optional

        Returns
        -------
        low, high : float
            Values of the ordered sample (David and Nagaraja, "Order Statistics", 2003, section
            7.1); infinite where there are too few: 95 % with 95 % confidence need 72 samples.
        """
        share = _share("percent", percent, 100.0)
        confidence = _share("confidence", confidence, 1.0)
        return percentile_limits(self._values(figure), share, confidence)

    def share(self, figure: str, limit: float) -> float:
        """Return the share of the samples whose figure is at most `limit`.

        Parameters
        ----------
        figure : str
        limit : float

        Returns
        -------
        float
        """
        return float(np.mean(self._values(figure) <= limit))

    def share_limits(
        self, figure: str, limit: float, confidence: float = 0.95
    ) -> tuple[float, float]:
        """Return limits of the share of all such machines whose figure is at most `limit`.

        Parameters
        ----------
        figure : str
        limit : float
            Chosen before looking at the sample.
        confidence : float, optional

        Returns
        -------
        low, high : float
            Of Clopper and Pearson (Biometrika 26, 1934), two-sided.
        """
        good = int(np.sum(self._values(figure) <= limit))
        return share_limits(good, self.samples, _share("confidence", confidence, 1.0))

    def worst(self, figure: str = "norm") -> int:
        """Return the number of the sample whose figure is largest, among those that have one.

        Parameters
        ----------
        figure : str, optional

        Returns
        -------
        int
        """
        values = self._values(figure)
        known = self.dataset["failure"].values == ""
        return int(np.argmax(np.where(known, values, -np.inf)))

    def replay(self, sample: int | None = None, *, figure: str = "norm") -> Replay:
        """Run one loop once more, to the same bits, and return all of it.

        Parameters
        ----------
        sample : int, optional
            The worst one of `figure` by default.
        figure : str, optional

        Returns
        -------
        Replay
        """
        i = self.worst(figure) if sample is None else sample
        one_of("sample", i, range(self.samples), "Count from 0.")
        names = self.trial.names
        values = {name: self.dataset[name].values[i].item() for name in names}
        plant = self.trial.plant_with(values)
        figures = self.trial.figures_of(values)
        load = self.trial.load_with(values)
        runs = load is not None and np.isfinite(figures["norm"])
        response = self.trial.response(plant, load) if load is not None and runs else None
        return Replay(i, values, plant, load, response, figures)

    def plot(self, ax: Axes | None = None, *, figure: str = "norm") -> Axes:
        """Draw how a figure is distributed, with its nominal value and 95 % of the sample.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        figure : str, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        values = self._values(figure)
        finite = self.dataset[figure][np.isfinite(values)].rename(figure)
        marks = {"nominal": self.nominal[figure], "95 %": self.percentile(figure, 95.0)}
        left_out = self.samples - finite.size
        note = f"{left_out} of {self.samples} unstable or failed" if left_out else ""
        shown = {name: mark for name, mark in marks.items() if np.isfinite(mark)}
        return plot_distribution(finite.drop_vars(list(finite.coords)), shown, ax, note=note)

    def _values(self, figure: str) -> Vector:
        """Return a figure of all samples; no figure is worse than any."""
        name = one_of("figure", figure, self.figures)
        known = self.dataset["failure"].values == ""
        return np.where(known, self.dataset[name].values.astype(float), np.inf)

    def _card(self) -> Card:
        rows = []
        for name in self.figures:
            low, high = self.percentile_limits(name, 95.0)
            row = (self.nominal[name], self.percentile(name, 50.0), self.percentile(name, 95.0))
            unit = self.dataset[name].attrs.get("units", "")
            label = f"{name} [{unit}]" if unit else name
            rows.append((label, *row, low, high, float(np.max(self._values(name)))))
        head = ("", "nominal", "median", "95 %", "at least", "at most", "worst")
        stable = int(np.sum(np.isfinite(self._values("norm"))))
        low, _ = share_limits(stable, self.samples, 0.95)
        notes = [
            f"{stable} of {self.samples} loops are stable; of all such loops at least "
            f"{100 * low:.4g} % are. Limits hold with 95 % confidence."
        ]
        if self.failures:
            first, why = next(iter(self.failures.items()))
            notes.append(f"{len(self.failures)} failed, counted as worst: sample {first}, {why}")
        title = f"Monte Carlo over {self.samples} loops (seed {self.seed})"
        return Card(title, (Table("", head, tuple(rows)),), tuple(notes))


def _share(name: str, value: float, whole: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= whole:
        expected = f"a number above 0, at most {whole:g}"
        raise invalid(name, described(str(value)), expected, f"Write {0.95 * whole:g}.")
    return value / whole
