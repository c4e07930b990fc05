"""What came out of a search for an experiment that tells two machines apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.arrays import Array
from robustpolish.display import Card, Displayed, Table
from robustpolish.identification.experiments.candidates import Experiment
from robustpolish.identification.experiments.distance import Distance, Machines
from robustpolish.identification.experiments.policy import EXPERIMENTS
from robustpolish.plotting import plot_distances, plot_two_machines
from robustpolish.validation import described, invalid

_SHOWN = 8


@dataclass(frozen=True, eq=False)
class TriedExperiment:
    """An experiment that was simulated on both machines.

    Attributes
    ----------
    experiment : Experiment
    distance : Distance
    noise : ndarray, shape (ny,)
    """

    experiment: Experiment
    distance: Distance
    noise: Array

    @property
    def apart(self) -> float:
        """Difference over noise, of the output that shows it best, as the machines are."""
        return float(np.max(self.distance.apart / self.noise))

    @property
    def left(self) -> float:
        """The same after the numbers of the second machine were fitted to this experiment too."""
        return float(np.max(self.distance.left / self.noise))

    @property
    def best_output(self) -> int:
        """Place of the output that shows the difference best."""
        return int(np.argmax(self.distance.left / self.noise))


@dataclass(frozen=True, eq=False, repr=False)
class ToldApart(Displayed):
    """How far experiments would take two machines apart.

    Attributes
    ----------
    machines : Machines
        Both models, their names, the noise.
    tried : tuple of TriedExperiment
        Those that tell most first.
    refused : tuple of (str, str)
        Experiments that cannot be made or repeated, and why.
    on_record : mapping of str to (float, float)
        Free-run errors of both machines on the record, over the deviation of each output; empty
        if they were not fitted to it.
    hint : str
        What a diagnosis says of the pair.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> sticky = model.with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    >>> told = rp.tell_apart((sticky, model), data.isel(time=slice(0, 500)), fit=False)
    >>> told.recommended is told.tried[0] or told.recommended.left > 3
    True
    >>> told.explain().splitlines()[0]
    'To tell coulomb_friction at x, ground from slide (second):'
    >>> sorted(told.to_dict())[:3], told.table().columns[0]
    (['experiments', 'machines', 'noise'], 'experiment')
    >>> told.plot().get_xlabel(), len(told.plot_panels().axes) > 1
    ('difference over noise', True)
    """

    machines: Machines
    tried: tuple[TriedExperiment, ...]
    refused: tuple[tuple[str, str], ...]
    on_record: Mapping[str, tuple[float, float]]
    hint: str = ""

    @property
    def recommended(self) -> TriedExperiment | None:
        """The experiment to make; None if none tells the machines apart.

        The one that tells most at the smallest amplitude where any is sure, else the one that
        tells most at all.
        """
        for times in sorted({t.experiment.times for t in self.tried}):
            here = [t for t in self.tried if t.experiment.times == times]
            best = max(here, key=lambda t: t.left)
            if best.left >= EXPERIMENTS.sure:
                return best
        best = max(self.tried, key=lambda t: t.left, default=None)
        return best if best is not None and best.left >= EXPERIMENTS.clear else None

    def explain(self) -> str:
        """Say in words which experiment tells the machines apart, and how far.

        Returns
        -------
        str
        """
        first, second = self.machines.names
        lines = [f"To tell {first} from {second}:"]
        chosen = self.recommended
        if chosen is not None:
            lines += [f"make {chosen.experiment}.", *self._figures(chosen)]
        elif self.tried:
            best = self._best()
            lines += [
                "no experiment that was tried tells them apart.",
                f"Most tells {best.experiment}, and that is not enough:",
                *self._figures(best),
            ]
        else:
            lines += ["no experiment could be made."]
        if self.tried and max(t.apart for t in self.tried) < EXPERIMENTS.clear:
            lines += [
                "As they are, the two are one machine to every experiment: what tells them apart "
                "was fitted to next to nothing. To see what would show it, hand over models with "
                "the smallest effect that matters to you, not fitted (fit=False, --no-fit)."
            ]
        if self.hint and chosen is None:
            lines += [f"What may help instead: {self.hint}"]
        if self.on_record:
            shown = ", ".join(f"{k} {a:.4g} and {b:.4g}" for k, (a, b) in self.on_record.items())
            lines += [f"On the record itself their free-run errors are {shown} of the deviation."]
        for text, why in self.refused:
            lines += [f"Left out: {text}: {why}."]
        return "\n".join(lines)

    def _best(self) -> TriedExperiment:
        """Return the experiment that tells most.

        Raises
        ------
        InvalidInputError
            If none could be made.
        """
        if not self.tried:
            why = "; ".join(reason for _, reason in self.refused) or "nothing drives the machine"
            raise invalid(
                "experiments", described(f"none: {why}"), "at least one", "Give wider limits."
            )
        return max(self.tried, key=lambda t: t.left)

    def _figures(self, tried: TriedExperiment) -> list[str]:
        i = tried.best_output
        name, unit = self._outputs()[i]
        far, left, noise = (
            values[i] for values in (tried.distance.apart, tried.distance.left, tried.noise)
        )
        return [
            f"{name} differs by {far:.3g} {unit} (root mean square), {far / noise:.3g} times its "
            f"noise of {noise:.3g} {unit}; by {left:.3g} {unit}, {left / noise:.3g} times, once "
            f"the numbers of {self.machines.names[1]} are fitted to this experiment too."
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data, the experiment that tells most first.

        Returns
        -------
        dict
        """
        chosen = self.recommended
        outputs = [name for name, _ in self._outputs()]
        return {
            "machines": list(self.machines.names),
            "noise": dict(zip(outputs, self.machines.noise.tolist(), strict=True)),
            "told_apart": chosen is not None,
            "recommended": None if chosen is None else str(chosen.experiment),
            "experiments": [
                {
                    "kind": t.experiment.kind,
                    "channel": t.experiment.channel,
                    "amplitude": t.experiment.amplitude,
                    "unit": t.experiment.unit,
                    "times": t.experiment.times,
                    "band": list(t.experiment.band),
                    "apart": dict(zip(outputs, t.distance.apart.tolist(), strict=True)),
                    "left": dict(zip(outputs, t.distance.left.tolist(), strict=True)),
                    "apart_over_noise": t.apart,
                    "left_over_noise": t.left,
                }
                for t in self.tried
            ],
            "refused": [{"experiment": text, "why": why} for text, why in self.refused],
            "on_record": {k: list(v) for k, v in self.on_record.items()},
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw how far the best experiments take the machines apart, over the noise.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        self._best()
        best = self.tried[:_SHOWN]
        labels = [
            f"{t.experiment.kind}, {t.experiment.channel}, {t.experiment.times:g}x" for t in best
        ]
        ratios = xr.DataArray(
            [t.left for t in best], {"experiment": labels}, name="difference over noise"
        )
        return plot_distances(ratios, EXPERIMENTS.clear, ax)

    def plot_panels(self, *, width: float = 9.0) -> Figure:
        """Draw the recommended experiment, or the one that tells most, on both machines.

        Parameters
        ----------
        width : float, optional
            Inches.

        Returns
        -------
        matplotlib.figure.Figure
        """
        tried = self.recommended or self._best()
        e, i = tried.experiment, tried.best_output
        name, unit = self._outputs()[i]
        time = {"time": e.inputs["time"].values}
        runs = (tried.distance.first, tried.distance.second, tried.distance.adapted)
        responses = [xr.DataArray(run[:, i], time, "time", name, {"units": unit}) for run in runs]
        drive = None
        if e.kind != "decay":
            drive = e.inputs[e.channel].assign_attrs(units=e.unit)
        figure = plot_two_machines(
            drive, responses, self.machines.names, float(tried.noise[i]), width
        )
        figure.suptitle(str(e), wrap=True)
        return figure

    def _outputs(self) -> list[tuple[str, str]]:
        model = self.machines.first
        return [(item.name, model.unit_of(item)) for item in model.outputs]

    def table(self, caption: str = "") -> Table:
        """Return the experiments with their amplitudes, bands and differences, the best first.

        Parameters
        ----------
        caption : str, optional

        Returns
        -------
        Table
        """
        rows = tuple(
            (t.experiment.kind, t.experiment.channel, t.experiment.amplitude, t.experiment.unit,
             t.experiment.band[0] if t.experiment.band else None,
             t.experiment.band[-1] if t.experiment.band else None, t.apart, t.left)
            for t in self.tried
        )  # fmt: skip
        head = (
            "experiment", "on", "up to", "unit", "from [Hz]", "to [Hz]", "difference over noise",
            "after a fit",
        )  # fmt: skip
        return Table(caption, head, rows, 3)

    def _card(self) -> Card:
        title, *notes = self.explain().splitlines()
        table = self.table()
        tables = (replace(table, rows=table.rows[:_SHOWN]),) if self.tried else ()
        return Card(title, tables, tuple(notes))
