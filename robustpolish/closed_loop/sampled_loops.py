"""Monte Carlo over machines and loads: norms and peaks of a design's loop."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import described, invalid, one_of, whole_number
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.base.sampling import draws, percentile, percentile_limits, share_limits
from robustpolish.base.sweep import sweep
from robustpolish.closed_loop.simulate import simulate
from robustpolish.errors import RobustPolishWarning
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.stability import stability
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.charts import plot_distribution
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.proofs.bounded_real import estimate_norm

# Plant with other parameters, and the signals that the synthesis added.


def with_added_signals(nominal: GeneralizedPlant, other: GeneralizedPlant) -> GeneralizedPlant:
    """Return `other` with the signals that a synthesis added to `nominal`, in the same order.

    Prices on u and noise on y do not depend on the machine.

    Parameters
    ----------
    nominal : GeneralizedPlant
        The plant of a design.
    other : GeneralizedPlant

    Returns
    -------
    GeneralizedPlant
    """
    if nominal.measurement_names != other.measurement_names:
        every = other.with_full_state()
        if nominal.measurement_names == every.measurement_names:
            other = every
    own = "states", "control_names", "measurement_names", "disturbance_names", "performance_names"
    said = "states", "controls", "measurements", "disturbances", "performance outputs"
    for what, name in zip(said, own, strict=True):
        wanted, found = getattr(nominal, name), getattr(other, name)
        # Of w and z some may be missing, which the synthesis added.
        fits = set(found) <= set(wanted) if name in own[3:] else found == wanted
        if not fits:
            expected = f"those of the design's plant: {', '.join(wanted)}"
            same = "the same controls, actuation and measured."
            remedy = f"Linearise as the design's plant was: {same}"
            raise invalid("plant_of", described(f"{what} {', '.join(found)}"), expected, remedy)
    old, new = nominal.system, other.system
    inputs = [old.input_labels.index(name) for name in new.input_labels]
    outputs = [old.output_labels.index(name) for name in new.output_labels]
    B, C, D = (np.array(M, dtype=float) for M in (old.B, old.C, old.D))
    B[:, inputs] = new.B
    C[outputs] = new.C
    D[np.ix_(outputs, inputs)] = new.D
    nw, nz = nominal.nw, nominal.nz
    return nominal.replace(
        A=new.A, B1=B[:, :nw], B2=B[:, nw:], C1=C[:nz], C2=C[nz:],
        D11=D[:nz, :nw], D12=D[:nz, nw:], D21=D[nz:, :nw], D22=D[nz:, nw:],
    )  # fmt: skip


def loop_norm(loop: control.StateSpace, norm: str) -> float:
    """Return the norm of a loop, infinite if it is not stable."""
    if not stability(loop):
        return np.inf
    if norm == "h2":
        return float(h2_norm(loop))
    if loop.dt == 0 and loop.nstates:
        A, B, C, D = (np.asarray(M, dtype=float) for M in (loop.A, loop.B, loop.C, loop.D))
        found = estimate_norm(A, B, C, D)
        if found.settled:
            return found.value
    return float(hinf_norm(loop))


# One sampled loop: machine and load with given parameters, and its figures of merit.

PlantOf = Callable[[Any], GeneralizedPlant]
Figures = Callable[[xr.Dataset], Mapping[str, float]]

PEAK = "peak_"
"""Begins the names of largest absolute values."""


class SampledMachine(Protocol):
    """A machine some of whose numbers are drawn; the values may hold those of the load as well."""

    def plant(self, values: Mapping[str, Any]) -> GeneralizedPlant:
        """Return the plant with these numbers."""
        ...


class SampledLoad(Protocol):
    """A disturbance some of whose numbers are drawn."""

    def dataset(self, values: Mapping[str, Any]) -> xr.Dataset:
        """Return the disturbance over time with these numbers."""
        ...


@dataclass(frozen=True)
class SampledModel:
    """A mechanical model as a machine whose numbers are drawn.

    Attributes
    ----------
    model : MechanicalModel
    plant_of : callable, optional
        Makes a plant of a model; its linear plant with the defaults otherwise.
    """

    model: MechanicalModel
    plant_of: PlantOf | None = None

    def plant(self, values: Mapping[str, Any]) -> GeneralizedPlant:
        """Return the plant with these numbers."""
        own = self.model.parameters
        changes = {name: value for name, value in values.items() if name in own}
        changed = self.model.with_parameters(changes)
        return changed.linearize() if self.plant_of is None else self.plant_of(changed)


@dataclass(frozen=True)
class LoopTrial:
    """What all loops of a study share.

    Attributes
    ----------
    plant : GeneralizedPlant
        The one that the controller was designed for.
    controller : control.StateSpace
    norm : {"hinf", "h2"}
    names : tuple of str
        The numbers that are drawn, in the order in which they come.
    machine : SampledMachine or None
        None if the plant stays.
    load : SampledLoad, xarray.Dataset or None
        Disturbances; a Dataset if they are the same for all loops.
    figures : callable or None
        What else is to be told of a response.
    told : tuple of str
        The figures of a stable loop, which are infinite for an unstable one.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    norm: str
    names: tuple[str, ...]
    machine: SampledMachine | None = None
    load: SampledLoad | xr.Dataset | None = None
    figures: Figures | None = None
    told: tuple[str, ...] = ()

    def __call__(self, **columns: Any) -> dict[str, float]:
        """Return the figures of one loop; `columns` are ``value_0``, ``value_1`` and so on."""
        return self.figures_of({name: columns[column(i)] for i, name in enumerate(self.names)})

    def figures_of(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Return `norm`, largest deviations and controls; infinite if the loop is unstable."""
        plant = self.plant_with(values)
        norm = loop_norm(plant.closed_loop(self.controller), self.norm)
        if not np.isfinite(norm) and self.told:
            return dict.fromkeys(self.told, np.inf)
        found = {"norm": norm}
        load = self.load_with(values)
        if load is None:
            return found
        response = self.response(plant, load)
        for name in response.data_vars:
            if not str(name).startswith("price_"):  # which is a control once more
                found[f"{PEAK}{name}"] = float(np.abs(response[name]).max())
        return found | dict(self.figures(response) if self.figures else {})

    def plant_with(self, values: Mapping[str, Any]) -> GeneralizedPlant:
        """Return the plant with numbers of the machine in place of its own."""
        if self.machine is None:
            return self.plant
        with warnings.catch_warnings():
            # an effect without a linear part has been warned of when the plant was made
            warnings.simplefilter("ignore", RobustPolishWarning)
            return with_added_signals(self.plant, self.machine.plant(values))

    def load_with(self, values: Mapping[str, Any]) -> xr.Dataset | None:
        """Return the disturbance, made anew if it is not the same for all loops."""
        if self.load is None or isinstance(self.load, xr.Dataset):
            return self.load
        return self.load.dataset(values)

    def response(self, plant: GeneralizedPlant, load: xr.Dataset) -> xr.Dataset:
        """Return all performance outputs and controls over time."""
        found = simulate(plant.with_control_outputs().closed_loop(self.controller), load)
        for name in found.data_vars:
            if name in plant.units:
                found[name].attrs["units"] = plant.units[str(name)]
        return found


def column(i: int) -> str:
    """Return the name by which a sweep hands over a number; keys of models are no identifiers."""
    return f"value_{i}"


# Result: percentiles, shares and their confidence limits, and the worst loop.


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
    """Loops with drawn numbers, from :func:`robustpolish.polishing.monte_carlo`.

    Attributes
    ----------
    dataset : xarray.Dataset
        Over `sample`: what was drawn as coordinates, `norm`, `peak_NAME` and other figures of
        merit as variables, and `failure`, the reason where a sample has no figures.
    nominal : mapping of str to float
        The figures of the loop with the nominal numbers.
    seed : int
    trial : LoopTrial
        What all loops share.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> design = rp.state_feedback(plant, method="riccati", control_weight=1e-7)
    >>> study = rp.polishing.monte_carlo(
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
    trial: LoopTrial

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
        i, trial = self.worst(figure) if sample is None else sample, self.trial
        one_of("sample", i, range(self.samples), "Count from 0.")
        values = {name: self.dataset[name].values[i].item() for name in trial.names}
        plant, load = trial.plant_with(values), trial.load_with(values)
        figures = trial.figures_of(values)
        response = None
        if load is not None and np.isfinite(figures["norm"]):
            response = trial.response(plant, load)
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


def sample_loops(
    design: Design,
    distributions: Mapping[str, Any],
    machine: SampledMachine | None,
    load: SampledLoad | xr.Dataset | None,
    *,
    load_is_drawn: bool,
    figures: Figures | None = None,
    samples: int = 200,
    seed: int = 0,
    executor: Executor | Literal["serial"] | None = None,
    file: str | os.PathLike[str] | None = None,
    progress: bool = True,
) -> SampledLoops:
    """Close a design's loop around machines and loads whose numbers are drawn.

    What :func:`robustpolish.polishing.monte_carlo` does, for any machine and any load.

    Parameters
    ----------
    design : Design
    distributions : mapping of str to distribution
        Of numbers that `machine` or `load` knows.
    machine : SampledMachine or None
        None if the plant stays.
    load : SampledLoad, xarray.Dataset or None
        Disturbances.
    load_is_drawn : bool
        Whether the load has numbers among those that are drawn; else it is made once.
    figures, samples, seed, executor, file, progress : optional
        As for :func:`robustpolish.polishing.monte_carlo`.

    Returns
    -------
    SampledLoops
    """
    for name, value, least in (("samples", samples, 1), ("seed", seed, 0)):
        whole_number(name, value, least, remedy="Write 200.")
    names, plant = tuple(sorted(distributions)), design.plant
    trial = LoopTrial(plant, design.controller, design.norm, names, machine, load, figures)
    usual = trial.load_with({})
    nominal = replace(trial, load=usual).figures_of({})
    if not np.isfinite(nominal["norm"]):
        expected = "a design whose loop is stable with the nominal numbers"
        raise invalid("design", described("an unstable loop"), expected, "Check the machine.")
    trial = replace(trial, told=tuple(nominal))
    if usual is not None and not load_is_drawn:
        # Workers get what drives the loop, not all that the load tells.
        driving = [name for name in plant.disturbance_names if name in usual]
        trial = replace(trial, load=usual[driving])
    drawn = draws(distributions, int(samples), int(seed))
    points = [{column(i): one[name] for i, name in enumerate(names)} for one in drawn]
    found = sweep(trial, points, executor=executor, file=file, progress=progress)
    found = found.rename({column(i): name for i, name in enumerate(names)})
    for name in trial.told:
        if name not in found:  # no sample has figures
            found[name] = ("sample", np.full(found.sizes["sample"], np.nan))
        unit = plant.units.get(name.removeprefix(PEAK))
        if name.startswith(PEAK) and unit:
            found[name].attrs["units"] = unit
    return SampledLoops(found, nominal, seed, trial)
