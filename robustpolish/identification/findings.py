"""The findings of a diagnosis, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.checks import one_of
from robustpolish.base.results import Card, Displayed, Table, quantities, tables
from robustpolish.machines.effects.effect import Effect, lookup
from robustpolish.machines.effects.kind import EffectKind
from robustpolish.machines.effects.learned_law import LearnedLaw
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.charts import plot_waterfall
from robustpolish.plots.residuals import plot_surface

# Restoring-force maps of the missing force.


@dataclass(frozen=True, eq=False, repr=False)
class ForceMap(Displayed):
    """The missing force over displacement and velocity at one place.

    Attributes
    ----------
    at : (str, str)
        Two coordinates, or one and ``"ground"``.
    surface : xarray.Dataset
        ``force`` on the first coordinate, the mean of each cell (NaN where the machine never was),
        and ``samples``, the share of the record in it, over ``displacement`` and ``velocity``.
    size : float
        Root mean square of the missing force here, in its unit.
    follows : float
        Share of its power that displacement and velocity foretell, from 0 to 1: what the map of
        one half of the record says of the other half. A law without memory at this place makes it
        1, noise and forces from elsewhere make it 0.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> found = rp.diagnose(model, data.isel(time=slice(0, 500)))
    >>> found.maps[0].name, found.maps[0].plot().get_ylabel()
    ('x', 'velocity [mm/s]')
    >>> found.maps[0].describe().split(",")[-1]
    ' 0 % of their power follow from displacement and velocity.'
    """

    at: tuple[str, str]
    surface: xr.Dataset
    size: float
    follows: float

    @property
    def name(self) -> str:
        """The place in words: ``x``, or ``x - y``."""
        return self.at[0] if self.at[1] == "ground" else " - ".join(self.at)

    @property
    def unit(self) -> str:
        """Unit of the force."""
        return str(self.surface["force"].attrs.get("units", ""))

    def describe(self) -> str:
        """Say how much force is missing here and how far the motion here foretells it.

        Returns
        -------
        str
        """
        return (
            f"{self.name}: {self.size:.3g} {self.unit} (root mean square) are missing here, "
            f"{100 * self.follows:.0f} % of their power follow from displacement and velocity."
        )

    def _card(self) -> Card:
        rows = (
            (f"missing, root mean square [{self.unit}]", self.size),
            ("follows from the motion here", f"{100 * self.follows:.0f} %"),
            ("cells with samples", int((self.surface["samples"] > 0).sum())),
        )
        return Card(f"Missing force at {self.name}", (quantities(*rows),))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the map.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        ax = plot_surface(self.surface, ax)
        ax.set_title(f"missing force at {self.name}")
        return ax


# The learned laws of a model, with how well their coefficients are known.


def learned_laws_of(
    model: MechanicalModel, covariance: xr.DataArray | None
) -> tuple[LearnedLaw, ...]:
    """Return the learned laws among the effects of a model, to look at.

    Parameters
    ----------
    model : MechanicalModel
    covariance : xarray.DataArray or None
        Of the fitted numbers, over their keys twice.

    Returns
    -------
    tuple of LearnedLaw
    """
    found = []
    for i, effect in enumerate(model.effects):
        if not effect.definition.over:
            continue
        names = [p.name for p in effect.definition.parameters if p.fitted]
        known = None
        if covariance is not None:
            keys = covariance["parameter"].values.tolist()
            wanted = [f"effect[{i}].{name}" for name in names]
            if set(wanted) <= set(keys):
                here = [keys.index(key) for key in wanted]
                known = covariance.values[np.ix_(here, here)]
        found.append(LearnedLaw(effect, known, model.is_rotational(effect.at)))
    return tuple(found)


# Error reduction table: the error after each step, and the noise floor.


@dataclass(frozen=True)
class Entry:
    """A step of the table: its name, the free-run error over each output's deviation, the model."""

    step: str
    nrmse: Mapping[str, float]
    model: MechanicalModel | None = None


@dataclass(frozen=True, repr=False)
class Ledger(Displayed):
    """Error reduction table: entries in order, and the noise floor of each output.

    Attributes
    ----------
    entries : tuple of Entry
    noise_floor : mapping of str to float
        Noise over the standard deviation, by output.

    Examples
    --------
    >>> import robustpolish as rp
    >>> ledger = rp.results.Ledger(noise_floor={"x": 0.01}).add("base", {"x": 0.5})
    >>> ledger = ledger.add("coulomb_friction at x, ground", {"x": 0.02})
    >>> ledger.falls("x")[1:]
    [('coulomb_friction at x, ground', -0.48, 0.02), ('noise floor', -0.01, 0.01)]
    >>> ledger
    Error of a free run over the standard deviation of each output
      step                              x
      base                            0.5
      coulomb_friction at x, ground  0.02
      noise floor                    0.01
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
        >>> ledger = rp.results.Ledger(noise_floor={"x": 0.01}).add("base", {"x": 0.5})
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


@dataclass(frozen=True)
class Value:
    """A fitted number with its standard error and unit."""

    value: float
    stderr: float
    unit: str


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added, with fitted parameters; `own` is its kind, if no catalogue's."""

    kind: str
    at: tuple[str, ...]
    parameters: Mapping[str, Value]
    own: EffectKind | None = None

    @property
    def definition(self) -> EffectKind:
        """The kind's description."""
        return self.own or lookup(self.kind)


@dataclass(frozen=True)
class RankedCandidate:
    """A set of effects that was tried, or an effect that was screened only.

    Attributes
    ----------
    kind : str
        Of the effect that was new; of the one that explains most where several were.
    at : tuple of str
    parameters : mapping of str to float
    step : int
        1 when it was tried as the first effect, and so on.
    nrmse_held_out : float
        Error on held-out blocks over the deviation, the mean over the outputs.
    score : float
        Nats by which the set beats the model without effects; log odds from screening if it was not
        refitted.
    remark : str
        Why it was not taken, if there is a reason.
    own : EffectKind or None
        Its kind, if no catalogue's.
    beside : tuple of Effect
        The other effects of the set.
    """

    kind: str
    at: tuple[str, ...]
    nrmse_held_out: float
    score: float
    step: int
    parameters: Mapping[str, float]
    remark: str = ""
    own: EffectKind | None = None
    beside: tuple[Effect, ...] = ()

    def __str__(self) -> str:
        """Name the effects of the set with their places."""
        return " + ".join([f"{self.kind} at {', '.join(self.at)}", *map(str, self.beside)])

    def sizes(self) -> str:
        """Return the sizes of the effects of the set, in SI units, in a line."""
        each = [self.parameters, *(e.parameters for e in self.beside)]
        told = (", ".join(f"{k} = {v:.4g}" for k, v in values.items()) for values in each)
        return "; ".join(t for t in told if t)


@dataclass(frozen=True)
class IndistinguishablePair:
    """Two effects that this data cannot tell apart, and an experiment that would."""

    first: Effect
    second: Effect
    experiment: str


# Indistinguishable pairs of effects, and experiments that separate them.

_EXPERIMENTS = {frozenset(k.split()): text for k, text in tables(__file__)["experiments"].items()}


def indistinguishable_pair(first: Effect, second: Effect) -> IndistinguishablePair:
    """Return two effects as a pair that data cannot tell apart, with an experiment that would."""
    experiment = _EXPERIMENTS.get(frozenset({first.kind, second.kind}))
    if experiment is None and first.kind == second.kind:
        ends = " and ".join(sorted(set(first.at) ^ set(second.at)))
        experiment = f"Measure, or hold still, {ends}: the place shows in the relative motion."
    elif experiment is None and first.definition.has_memory != second.definition.has_memory:
        experiment = (
            "Move slowly to and fro with growing amplitude, ten cycles each: only memory makes "
            "the path depend on the reversal before."
        )
    elif experiment is None:
        experiment = (
            "Repeat with a multisine of the same band at a third and at three times the amplitude: "
            "the two forces grow differently."
        )
    return IndistinguishablePair(first, second, experiment)
