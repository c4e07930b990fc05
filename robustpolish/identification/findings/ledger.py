"""The error ledger: how far the error fell with every step, and what is left to noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any

import xarray as xr
from matplotlib.axes import Axes

from robustpolish.display import Card, Displayed, Table
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.plotting import plot_waterfall
from robustpolish.validation import one_of


@dataclass(frozen=True)
class Entry:
    """One step: what was done, the free-run error over each output's deviation, the model then."""

    step: str
    nrmse: Mapping[str, float]
    model: MechanicalModel | None = None


@dataclass(frozen=True, repr=False)
class Ledger(Displayed):
    """Entries in order, and the noise floor of each output.

    Attributes
    ----------
    entries : tuple of Entry
    noise_floor : mapping of str to float
        Noise over the standard deviation, by output.

    Examples
    --------
    >>> import robustpolish as rp
    >>> ledger = rp.Ledger(noise_floor={"x": 0.01}).add("base", {"x": 0.5})
    >>> ledger = ledger.add("coulomb_friction", {"x": 0.02})
    >>> ledger.falls("x")
    [('base', 0.5, 0.5), ('coulomb_friction', -0.48, 0.02), ('noise floor', -0.01, 0.01)]
    >>> ledger
    Error of a free run over the standard deviation of each output
      step                 x
      base               0.5
      coulomb_friction  0.02
      noise floor       0.01
    >>> ledger.to_list()[0]
    {'step': 'base', 'nrmse': {'x': 0.5}}
    """

    entries: tuple[Entry, ...] = ()
    noise_floor: Mapping[str, float] = field(default_factory=dict)

    def add(
        self, step: str, nrmse: Mapping[str, float] | Any, model: MechanicalModel | None = None
    ) -> Ledger:
        """Return the ledger with one more entry.

        Parameters
        ----------
        step : str
        nrmse : mapping of str to float, or a comparison
            Errors by output; a comparison's outputs are read.
        model : MechanicalModel, optional
            The model after this step.

        Returns
        -------
        Ledger
        """
        if not isinstance(nrmse, Mapping):
            nrmse = {name: output.nrmse for name, output in nrmse.outputs.items()}
        return replace(self, entries=(*self.entries, Entry(step, dict(nrmse), model)))

    def falls(self, output: str) -> list[tuple[str, float, float]]:
        """Return step, change and level for a waterfall picture of one output.

        Parameters
        ----------
        output : str

        Returns
        -------
        list of (str, float, float)
        """
        steps, last = [], 0.0
        for entry in self.entries:
            level = entry.nrmse[output]
            steps.append((entry.step, round(level - last, 12), level))
            last = level
        if output in self.noise_floor:
            floor = self.noise_floor[output]
            steps.append(("noise floor", round(floor - last, 12), floor))
        return steps

    def to_list(self) -> list[dict[str, Any]]:
        """Return the entries as plain data."""
        return [{"step": e.step, "nrmse": dict(e.nrmse)} for e in self.entries]

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw the waterfall of one output's error, relative to its standard deviation.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The first by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> ledger = rp.Ledger(noise_floor={"x": 0.01}).add("base", {"x": 0.5})
        >>> ledger.add("coulomb_friction", {"x": 0.02}).plot().get_ylabel()
        'relative error of x'
        """
        names = tuple(self.entries[0].nrmse)
        name = names[0] if output is None else one_of("output", output, names)
        levels = xr.DataArray(
            [entry.nrmse[name] for entry in self.entries],
            {"step": [entry.step for entry in self.entries]},
            "step",
            name=f"relative error of {name}",
        )
        return plot_waterfall(levels, self.noise_floor.get(name), ax)

    def _card(self) -> Card:
        names = tuple(self.entries[0].nrmse) if self.entries else tuple(self.noise_floor)
        rows = [(entry.step, *(entry.nrmse[n] for n in names)) for entry in self.entries]
        if self.noise_floor:
            rows.append(("noise floor", *(self.noise_floor.get(n, nan) for n in names)))
        title = "Error of a free run over the standard deviation of each output"
        return Card(title, (Table("", ("step", *names), tuple(rows)),))
