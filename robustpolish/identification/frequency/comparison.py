"""Comparison of a model with measured frequency responses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.base.arrays import AnyArray
from robustpolish.base.checks import one_of
from robustpolish.base.results import Card, Displayed, Table, plus_minus
from robustpolish.identification.frequency.lines import (
    ACCURACY,
    MeasuredResponse,
    Resonance,
    likeness,
    match_modes,
    measured_resonances,
    measured_response,
    model_resonances,
)
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.frequency import plot_bode, plot_nyquist


@dataclass(frozen=True)
class PairError:
    """The error of one pair of output and input.

    Attributes
    ----------
    output, input, unit : str
    relative : float
        Error over size, both as root mean squares over lines that are weighed by their size and
        noise: above the noise all lines count alike, antiresonances like resonances, and lines
        in the noise hardly. 1 is no better than no model.
    noise : float
        What of `relative` the noise alone would leave.
    over_noise : float or None
        Root mean square of the error over the noise's standard deviation, where variance or
        coherence say what that is; 1 for the true model.
    likeness : float
        Frequency response assurance criterion, from 0 to 1; it forgives a common factor, and
        hears little but resonances.
    weight : float
        Of the pair among all; the more lines stand above the noise, the more.
    """

    output: str
    input: str
    unit: str
    relative: float
    noise: float
    over_noise: float | None
    likeness: float
    weight: float


@dataclass(frozen=True)
class ModeComparison:
    """A mode of the model beside the measured one.

    Attributes
    ----------
    model_frequency, model_damping : float or None
        In Hz, and as a ratio; None if the model has no such mode.
    frequency, damping : float or None
        As measured; None if it does not show.
    frequency_error, damping_error : float or None
        Standard errors of the measured ones.
    likeness : float or None
        Modal assurance criterion of the two, over the measured pairs.
    """

    model_frequency: float | None
    model_damping: float | None
    frequency: float | None
    damping: float | None
    frequency_error: float | None
    damping_error: float | None
    likeness: float | None


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyComparison(Displayed):
    """Comparison of a model with measured frequency responses.

    Attributes
    ----------
    model : MechanicalModel
    measured, modelled : xarray.DataArray
        Over ``frequency``, ``output`` and ``input``; the model's at the measured lines.
    pairs : dict of (str, str) to PairError
        Errors by output and input.
    modes : tuple of ModeComparison
        From low to high frequency.
    notes : tuple of str
        What has to be known to judge the figures.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> def machine(stiffness):
    ...     place = ("x", "ground")
    ...     return rp.MechanicalModel(
    ...         [rp.Dof("x", 1.0)], [rp.Spring(place, stiffness)], [rp.Damper(place, 2.0)],
    ...         [rp.Input("F", place)], [rp.Output("x", place)])
    >>> measured = machine(1e4).frequency_response(np.linspace(5, 30, 200))
    >>> comparison = rp.compare(machine(1.1e4), measured)
    >>> mode = comparison.modes[0]
    >>> round(mode.model_frequency, 2), round(mode.frequency, 2)
    (16.69, 15.92)
    >>> sorted(comparison.to_dict())
    ['modes', 'notes', 'overall', 'pairs']
    >>> comparison.plot().get_ylabel(), comparison.plot(kind="nyquist").get_xlabel()
    ('magnitude of x/F', 'real part of x/F [mm/N]')
    >>> len(comparison.plot_panels().axes)  # magnitude and phase
    2
    """

    model: MechanicalModel
    measured: xr.DataArray
    modelled: xr.DataArray
    pairs: Mapping[tuple[str, str], PairError]
    modes: tuple[ModeComparison, ...]
    notes: tuple[str, ...] = ()

    @property
    def relative(self) -> float:
        """Relative error of all pairs together, each with its weight."""
        return combined_error(self.pairs.values())

    @property
    def residual(self) -> xr.DataArray:
        """Measured minus modelled response."""
        return self.measured - self.modelled

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as in the JSON of ``robustpolish compare``.

        Returns
        -------
        dict
        """
        figures = ("relative", "noise", "over_noise", "likeness", "unit")
        return {
            "pairs": {
                "/".join(pair): {name: getattr(error, name) for name in figures}
                for pair, error in self.pairs.items()
            },
            "overall": {"relative": self.relative},
            "modes": [vars(mode) for mode in self.modes],
            "notes": list(self.notes),
        }

    def plot(
        self,
        ax: Axes | None = None,
        *,
        output: str | None = None,
        input: str | None = None,
        kind: Literal["bode", "nyquist"] = "bode",
    ) -> Axes:
        """Draw one pair as measured and as modelled.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure, for ``"bode"`` with the phase below.
        output, input : str, optional
            The pair with the largest error by default.
        kind : {"bode", "nyquist"}, optional
            Magnitude and phase over frequency, or circles in the complex plane.

        Returns
        -------
        matplotlib.axes.Axes
        """
        one_of("kind", kind, ("bode", "nyquist"))
        left = [
            pair for pair in self.pairs if output in (None, pair[0]) and input in (None, pair[1])
        ]
        if not left:
            one_of("output", output, sorted({pair[0] for pair in self.pairs}))
            one_of("input", input, sorted({pair[1] for pair in self.pairs}))
        pair = max(left or self.pairs, key=lambda key: self.pairs[key].relative)
        curves, unit, spread = self._curves(pair)
        name = "/".join(pair)
        if kind == "nyquist":
            return plot_nyquist(curves, ax, name=name, unit=unit)
        return plot_bode(curves, ax, name=f"magnitude of {name}", unit=unit, spread=spread)

    def plot_panels(self) -> Figure:
        """Draw all pairs: magnitude above phase, measured and modelled.

        Returns
        -------
        matplotlib.figure.Figure
        """
        columns = min(len(self.pairs), 3)
        rows = -(-len(self.pairs) // columns)
        figure = plt.figure(figsize=(5.5 * columns, 4.5 * rows), layout="constrained")
        grid = figure.add_gridspec(rows, columns)
        for k, pair in enumerate(self.pairs):
            part = grid[k // columns, k % columns].subgridspec(2, 1, height_ratios=(2, 1))
            upper = figure.add_subplot(part[0])
            lower = figure.add_subplot(part[1], sharex=upper)
            curves, unit, spread = self._curves(pair)
            name = f"magnitude of {'/'.join(pair)}"
            plot_bode(curves, upper, name=name, unit=unit, spread=spread, phase=lower)
        return figure

    def _curves(
        self, pair: tuple[str, str]
    ) -> tuple[dict[str, xr.DataArray], str, xr.DataArray | None]:
        chosen = {"output": pair[0], "input": pair[1]}
        curves = {"measured": self.measured.sel(chosen), "model": self.modelled.sel(chosen)}
        known = "variance" in self.measured.coords
        spread = self.measured["variance"].sel(chosen) ** 0.5 if known else None
        return curves, self.pairs[pair].unit, spread

    def _card(self) -> Card:
        rows = tuple(
            (f"{e.output}/{e.input}", 100 * e.relative, 100 * e.noise, e.over_noise, e.likeness)
            for e in self.pairs.values()
        )
        columns = ("pair", "error [%]", "of it noise [%]", "error/noise", "likeness")

        def percent(value: float | None, error: float | None = 0.0, scale: float = 100.0) -> Any:
            if value is None or error is None:
                return None
            return plus_minus(scale * value, scale * error)

        modes = tuple(
            (m.model_frequency, percent(m.frequency, m.frequency_error, 1.0),
             m.model_damping and 100 * m.model_damping, percent(m.damping, m.damping_error),
             m.likeness)
            for m in self.modes
        )  # fmt: skip
        heads = ("model [Hz]", "measured [Hz]", "model [%]", "measured [%]", "likeness")
        tables = [Table("", columns, rows)]
        if modes:
            tables.append(Table("Modes: frequency and damping ratio", heads, modes))
        title = f"Comparison (frequency responses), error {100 * self.relative:.2f} %"
        return Card(title, tuple(tables), self.notes)


def compare_frequency_response(model: MechanicalModel, data: Any) -> FrequencyComparison:
    """Hold the linear part of a model against measured frequency responses.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.DataArray, control.FrequencyResponseData or path
        See :func:`robustpolish.read_frequency_response`.

    Returns
    -------
    FrequencyComparison

    Raises
    ------
    InvalidInputError
        If no pair is the model's, or a unit is of another kind than the model says.
    """
    measured = measured_response(model, data)
    values, remarks = measured.of(model)
    modelled = measured.data.copy(data=np.full(measured.data.shape, np.nan, dtype=complex))
    for column, (output, source) in zip(values.T, measured.pairs, strict=True):
        modelled.loc[{"output": output, "input": source}] = column
    modelled = modelled.drop_vars(["variance", "coherence"], errors="ignore")
    notes = [*(str(note) for note in measured.data.attrs.get("notes", ())), *remarks]
    if not measured.known:
        notes.append("noise taken from the scatter of neighbouring lines")
    pairs = dict(zip(measured.pairs, pair_errors(measured, values), strict=True))
    modes = _modes(model, measured)
    return FrequencyComparison(model, measured.data, modelled, pairs, modes, tuple(notes))


def combined_error(errors: Iterable[PairError]) -> float:
    """Return the relative error of several pairs."""
    each = np.array([(error.weight, error.relative**2) for error in errors])
    return float(np.sqrt(each[:, 0] @ each[:, 1] / np.sum(each[:, 0])))


def pair_errors(measured: MeasuredResponse, modelled: AnyArray) -> list[PairError]:
    """Return the error of each pair.

    Parameters
    ----------
    measured : MeasuredResponse
    modelled : ndarray, shape (lines, pairs)

    Returns
    -------
    list of PairError
    """
    result, spread = [], measured.spread(ACCURACY)
    for k, (output, source) in enumerate(measured.pairs):
        there = measured.there[:, k] & np.isfinite(modelled[:, k])
        H, G = measured.values[there, k], modelled[there, k]
        variance, weights = measured.variance[there, k], spread[there, k] ** -2
        error, size = np.abs(H - G) ** 2, float(weights @ np.abs(H) ** 2)
        over_noise = float(np.sqrt(np.mean(error / variance))) if measured.known else None
        relative, noise = (float(np.sqrt(weights @ e / size)) for e in (error, variance))
        unit, alike = measured.units[k], likeness(H, G)
        result.append(PairError(output, source, unit, relative, noise, over_noise, alike, size))
    return result


def _modes(model: MechanicalModel, measured: MeasuredResponse) -> tuple[ModeComparison, ...]:
    """Put the model's modes and the measured ones side by side."""
    ours, theirs = model_resonances(model, measured), measured_resonances(measured)
    partners = dict(match_modes(ours, theirs))
    low, high = measured.frequency[[0, -1]]
    absent: Any = Resonance(*[None] * 5)  # pyright: ignore[reportArgumentType]
    sides = [(mode, theirs[partners[i]]) for i, mode in enumerate(ours) if i in partners]
    sides += [
        (mode, absent)
        for i, mode in enumerate(ours)
        if i not in partners and low <= mode.frequency <= high
    ]
    sides += [(absent, mode) for j, mode in enumerate(theirs) if j not in partners.values()]
    rows = [
        ModeComparison(
            mode.frequency, mode.damping, seen.frequency, seen.damping, seen.frequency_error,
            seen.damping_error,
            None if absent in (mode, seen) else likeness(mode.shape, seen.shape),
        )
        for mode, seen in sides
    ]  # fmt: skip
    return tuple(sorted(rows, key=lambda row: row.frequency or row.model_frequency or 0.0))
