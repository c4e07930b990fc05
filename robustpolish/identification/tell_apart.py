"""Model discrimination: the experiment that separates two machines which a record does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.base.arrays import Array
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import described, invalid, misfit, positive
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.identification.experiments import (
    CLEAR,
    REACH,
    SURE,
    MachinePair,
    SimulatedExperiment,
    UnusableExperimentError,
    describe_difference,
    experiments,
    machine_pair,
    precision_of,
    simulate_experiment,
)
from robustpolish.identification.findings import IndistinguishablePair
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.fit.result import Refit
from robustpolish.identification.observer.kalman import excited_bandwidth, scales_of
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import (
    Record,
    measured,
    require_length,
    require_time_data,
    with_outputs,
)
from robustpolish.identification.refit import refit
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.time import plot_distances, plot_two_machines

# Result of the experiment search.

_SHOWN = 8


@dataclass(frozen=True, eq=False, repr=False)
class ToldApart(Displayed):
    """Distances of two machines in candidate experiments.

    Attributes
    ----------
    machines : MachinePair
        Both models, their names, the noise.
    tried : tuple of SimulatedExperiment
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

    machines: MachinePair
    tried: tuple[SimulatedExperiment, ...]
    refused: tuple[tuple[str, str], ...]
    on_record: Mapping[str, tuple[float, float]]
    hint: str = ""

    @property
    def recommended(self) -> SimulatedExperiment | None:
        """The experiment to make; None if none tells the machines apart.

        The one that tells most at the smallest amplitude where any is sure, else the one that
        tells most at all.
        """
        for times in sorted({t.experiment.times for t in self.tried}):
            here = [t for t in self.tried if t.experiment.times == times]
            best = max(here, key=lambda t: t.left)
            if best.left >= SURE:
                return best
        best = max(self.tried, key=lambda t: t.left, default=None)
        return best if best is not None and best.left >= CLEAR else None

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
        if self.tried and max(t.apart for t in self.tried) < CLEAR:
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

    def _best(self) -> SimulatedExperiment:
        """Return the experiment that tells most.

        Raises
        ------
        InvalidInputError
            If none could be made.
        """
        if not self.tried:
            why = "; ".join(reason for _, reason in self.refused) or "nothing drives the machine"
            raise misfit("experiments", f"none: {why}", "at least one", "Give wider limits.")
        return max(self.tried, key=lambda t: t.left)

    def _figures(self, tried: SimulatedExperiment) -> list[str]:
        i = tried.best_output
        name, unit = self._outputs()[i]
        far, left, noise = *tried.differences[:, i], tried.noise[i]
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
        excitation = ("kind", "channel", "amplitude", "unit", "times")

        def by_output(values: Array) -> dict[str, float]:
            return dict(zip(self.machines.first.output_names, values.tolist(), strict=True))

        return {
            "machines": list(self.machines.names),
            "noise": by_output(self.machines.noise),
            "told_apart": chosen is not None,
            "recommended": None if chosen is None else str(chosen.experiment),
            "experiments": [
                {
                    **{name: getattr(t.experiment, name) for name in excitation},
                    "band": list(t.experiment.band),
                    "apart": by_output(t.differences[0]),
                    "left": by_output(t.differences[1]),
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
        return plot_distances(ratios, CLEAR, ax)

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
        runs = (tried.first, tried.second, tried.adapted)
        responses = [xr.DataArray(run[:, i], time, "time", name, {"units": unit}) for run in runs]
        drive = None if e.kind == "decay" else e.inputs[e.channel].assign_attrs(units=e.unit)
        names, noise = self.machines.names, float(tried.noise[i])
        figure = plot_two_machines(drive, responses, names, noise, width)
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


def tell_apart(
    machines: Diagnosis | tuple[MechanicalModel, MechanicalModel],
    data: Any,
    *,
    pair: int = 0,
    noise: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    fit: bool = True,
    progress: Callable[[str], None] | None = None,
) -> ToldApart:
    """Search for the experiment that tells two machines apart which a record does not.

    Experiments are simulated on both: the record's own excitation, steps, slow motions to and
    fro, sweeps and free decays, at 0.3 to 10 times the amplitudes of the record.

    Parameters
    ----------
    machines : Diagnosis or (MechanicalModel, MechanicalModel)
        A diagnosis with effects that its data cannot tell apart, or two models with the same
        coordinates, inputs and outputs.
    data : xarray.Dataset, path or pandas.DataFrame
        The record that does not tell: it says how large inputs and motions are.
    pair : int, optional
        Which of the diagnosis's pairs, `Diagnosis.indistinguishable`.
    noise : mapping of str to float, optional
        Standard deviation of the noise of outputs, in SI units. By default the noise floor of the
        diagnosis, or what the quietest band of the record allows for.
    limits : mapping of str to float, optional
        Largest value that an input or an output may take, in SI units.
    fit : bool, optional
        Whether both machines are fitted to the record first (the first one of a diagnosis is
        already). Without, nothing says how far numbers may move.
    progress : callable, optional
        Called with a short text at every step.

    Returns
    -------
    ToldApart
        With the experiment that is recommended, or none.

    Raises
    ------
    InvalidInputError
        If there is no such pair, the models differ in what they consist of, `data` do not suit
        them, or `noise` or `limits` name what they do not have.

    Notes
    -----
    Two machines are told apart where the difference is large after the numbers of the second
    took after the first: Gauss-Newton steps minimise the sum of squares over the noise, and
    leaving the numbers that the record gave costs what its covariance says. This is the design
    of experiments that tell models apart (W. G. Hunter and A. M. Reiner 1965, Technometrics 7,
    307-323), with refitted rivals.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> place = ("x", "ground")
    >>> pair = (
    ...     model.with_effect("coulomb_friction", place, {"force": 3.0}),
    ...     model.with_effect("quadratic_damping", place, {"coefficient": 40.0}),
    ... )
    >>> told = rp.tell_apart(pair, data.isel(time=slice(0, 500)))
    >>> told.recommended.experiment.kind in ("record", "step", "to and fro", "sweep", "decay")
    True
    >>> told.recommended.left > 3
    True
    """
    require_time_data(data)
    with progress_bar("Trying experiments") if progress is None else nullcontext(progress) as say:
        diagnosis = machines if isinstance(machines, Diagnosis) else None
        hint = ""
        if diagnosis is not None:
            chosen = _selected_pair(diagnosis, pair)
            hint = chosen.experiment
            models = machine_pair(diagnosis.model, chosen)
        else:
            models = _comparable_models(machines)
        fitted = diagnosis is not None and models[0] is diagnosis.model
        first, record, _ = measured(models[0], data)
        models = first, with_outputs(models[1], first.output_names)
        require_length(first, record)
        floor = _noise(models[0], record, noise, diagnosis)
        reach = _output_limits(models[0], record, limits)
        names = describe_difference(*models)
        on_record: dict[str, tuple[float, float]] = {}
        if fit:
            first, second = models
            if diagnosis is not None and fitted:
                errors = diagnosis.ledger.entries[-1].nrmse
            else:
                say("refit of the first machine")
                found: Refit = refit(first, record.data)
                first, errors = found.model, found.nrmse
            say("refit of the second machine")
            other: Refit = refit(second, record.data)
            models = first, other.model
            on_record = {k: (errors[k], other.nrmse[k]) for k in first.output_names}
            known = {key: float(error) for key, error in other.stderr.items()}
            precision = precision_of(other.covariance)
        else:  # nothing is known of the numbers that a fit would move
            band = excited_bandwidth(models[1], record)
            keys = [f.key for f in free_parameters(models[1], band, POLICY)]
            known, precision = dict.fromkeys(keys, np.inf), np.zeros((len(keys), len(keys)))
        both = MachinePair(*models, names, floor, known, precision)
        places = [end for model in models for e in model.effects for end in e.at]
        tried, refused = [], []
        wanted = experiments(models[0], record, places, limits)
        say(f"simulating {len(wanted)} experiments")
        for experiment in wanted:
            try:
                tried.append(simulate_experiment(both, experiment, reach))
            except UnusableExperimentError as why:
                refused.append((str(experiment), str(why)))
        tried.sort(key=lambda t: -t.left)
        return ToldApart(both, tuple(tried), tuple(refused), on_record, hint)


def _selected_pair(diagnosis: Diagnosis, number: int) -> IndistinguishablePair:
    pairs = diagnosis.indistinguishable
    if not 0 <= number < len(pairs):
        listed = "no pair: this diagnosis has none" if not pairs else f"0 to {len(pairs) - 1}"
        raise invalid("pair", number, listed, "Hand over two models instead.")
    return pairs[number]


def _comparable_models(machines: Any) -> tuple[MechanicalModel, MechanicalModel]:
    """Return two models that can be compared.

    Raises
    ------
    InvalidInputError
        If they are not two, or have other coordinates, inputs or outputs.
    """
    both = isinstance(machines, Sequence) and len(machines) == 2
    if not both or not all(isinstance(m, MechanicalModel) for m in machines):
        shown = described(type(machines).__name__)
        raise invalid("machines", shown, "a Diagnosis, or two models", "Read them with rp.load.")
    first, second = machines
    names = [(m.frame.coordinates, m.input_names, m.output_names) for m in (first, second)]
    for one, other in zip(*names, strict=True):
        if one != other:
            shown = described(f"{', '.join(one)} and {', '.join(other)}")
            raise invalid("machines", shown, "the same names in both models", "Rename them.")
    return first, second


def _noise(
    model: MechanicalModel,
    record: Record,
    given: Mapping[str, float] | None,
    diagnosis: Diagnosis | None,
) -> Array:
    """Return the standard deviation of the noise of each output."""
    names = model.output_names
    found = dict(zip(names, scales_of(model, record).noise.tolist(), strict=True))
    if diagnosis is not None:
        spread = zip(names, np.std(record.Y, axis=0).tolist(), strict=True)
        found = {k: max(diagnosis.noise_floor.get(k, 0.0) * size, 1e-300) for k, size in spread}
    for name, value in (given or {}).items():
        if name not in found:
            raise invalid("noise", name, f"an output: {', '.join(found)}", "Check the name.")
        found[name] = positive(f"noise[{name}]", value, "the unit of the output")
    return np.array([found[name] for name in names])


def _output_limits(
    model: MechanicalModel, record: Record, limits: Mapping[str, float] | None
) -> Array:
    """Return the largest value that each output may take."""
    known = (*model.input_names, *model.output_names)
    for name, value in (limits or {}).items():
        if name not in known:
            raise invalid("limits", name, f"one of {', '.join(known)}", "Check the name.")
        positive(f"limits[{name}]", value, "its unit")
    seen = zip(model.output_names, REACH * np.max(np.abs(record.Y), axis=0), strict=True)
    found = [(limits or {}).get(name, value) for name, value in seen]
    return np.maximum(np.array(found, dtype=float), 1e-300)
