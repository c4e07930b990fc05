"""A controller for any machine: designed, certified, analysed and sampled in one call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import control
import numpy as np
from matplotlib.axes import Axes

from robustpolish.app.design_task import DesignTask
from robustpolish.base.checks import known_keys, misfit
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.errors import InfeasibleError, InvalidInputError, SolverError
from robustpolish.implementation.sampled_design import SampledDesign
from robustpolish.linear.norms.hinf import hinf_norm, singular_values
from robustpolish.loops.analysis import LoopAnalysis, model_analysis
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.toml import design_section, toml_with_line_numbers
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.frequency import plot_gains
from robustpolish.signals.frequency_response import ratio_unit
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback
from robustpolish.synthesis.state_feedback.state_feedback import state_feedback
from robustpolish.synthesis.structured.methods import static_output_feedback

# What a file asks of a controller: its sections [design] and [weights].

_KEYS = tuple(item.name for item in fields(DesignTask) if item.name != "machine")


def read_design_task(
    machine: str | Path | MechanicalModel | GeneralizedPlant | DesignTask,
    section: str | Path | None = None,
    **changes: Any,
) -> DesignTask:
    """Read which controller a machine shall have.

    Parameters
    ----------
    machine : path, str, MechanicalModel, GeneralizedPlant or DesignTask
        A TOML file or text with a mechanical model, its sections ``[design]`` and ``[weights]`` at
        the end; a plant that was saved (``.json``); either of them loaded; or a task to be changed.
    section : path or str, optional
        Another TOML file or text with nothing but these sections, as a plant needs it.
    **changes
        What counts instead of the file's word: parameters of :class:`DesignTask` by name.

    Returns
    -------
    DesignTask

    Raises
    ------
    InvalidInputError
        If a file cannot be read, a key is unknown (with the nearest right one and the line), or
        something does not fit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> task = rp.read_design_task('''
    ... [dof.x]
    ... mass = 2.0
    ... [[spring]]
    ... between = ["x", "ground"]
    ... stiffness = 800.0
    ... [[input]]
    ... name = "F"
    ... force_on = "x"
    ... [[output]]
    ... name = "x"
    ... measures = "x"
    ...
    ... [design]
    ... controls = ["F"]
    ... sensors.x = { bandwidth_hz = 500.0, noise = 1e-9 }
    ... delays.F = 1e-4
    ...
    ... [weights]
    ... performance = { low = 100.0, crossover_hz = 3.0, high = 0.5 }
    ... effort = 1e-5
    ... ''')
    >>> task.plant.disturbance_names, dict(task.plant.delays)
    (('disturbance_F', 'noise_measured_x'), {'F': 0.0001})
    >>> task.weighted.performance_names
    ('performance_measured_x', 'effort_F')
    """
    known_keys((), changes, _KEYS)
    if isinstance(machine, DesignTask) and section is None:
        return replace(machine, **changes)
    if section is not None:
        with toml_with_line_numbers(section) as table:
            known_keys((), table, ("design", "weights"))
            return _task(_loaded(machine), design_section(table), changes)
    given = _loaded(machine)
    own = given.design if isinstance(given, MechanicalModel) else {}
    if not (isinstance(machine, str | Path) and isinstance(given, MechanicalModel)):
        return _task(given, own, changes)
    with toml_with_line_numbers(machine):
        return _task(given, own, changes)


def _loaded(machine: Any) -> MechanicalModel | GeneralizedPlant:
    if isinstance(machine, MechanicalModel | GeneralizedPlant):
        return machine
    if not isinstance(machine, str | Path):
        want = "a file, a MechanicalModel or a GeneralizedPlant"
        raise misfit("machine", type(machine).__name__, want, "Pass one of these.")
    read = GeneralizedPlant.load if Path(machine).suffix == ".json" else MechanicalModel.from_toml
    return read(machine)


def _task(
    machine: MechanicalModel | GeneralizedPlant, section: Mapping[str, Any], changes: Any
) -> DesignTask:
    known_keys(("design",), section, _KEYS)
    try:
        return DesignTask(machine, **{**section, **changes})
    except InvalidInputError as error:
        if error.key[:1] == ("weights",) or str(error.key[0]) in changes:
            raise
        raise InvalidInputError(str(error), ("design", *error.key)) from None


MOST_CHANNELS = 24
"""So many pairs of disturbance and output are told one by one; nobody reads more."""


@dataclass(frozen=True)
class ChannelGain:
    """What a controller does to the way from one disturbance to one output.

    Attributes
    ----------
    disturbance, output : str
    unit : str
        Of the gain; empty if it is not known.
    without, controlled : float
        Largest gain over all frequencies; infinite without control where the machine is not stable.
    """

    disturbance: str
    output: str
    unit: str
    without: float
    controlled: float


@dataclass(frozen=True, eq=False, repr=False)
class MachineDesign(Displayed):
    """What :func:`design_machine` found.

    Attributes
    ----------
    task : DesignTask
    machine : GeneralizedPlant
        The machine as it is wired, with y as the controller measures it, without weights.
    design : Design
        The certified controller; its plant has the weights.
    analysis : LoopAnalysis
        Margins, bandwidths, noise and effort of the loop.
    channels : tuple of ChannelGain
        From disturbances to performance outputs of the machine, without and with control.
    sampled : SampledDesign or None
        The sampled controller, if a sampling rate was given and its loop is certified.
    sampling : str
        What sampling cost, or why there is no sampled controller.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> found = rp.design_machine(plant, control_weight=0.1, measurement_noise=0.1)
    >>> found.verdict()
    'The certified H-infinity norm is ...; judged by its margins and sampling the loop ...'
    >>> found.tables()[0].caption, found.to_dict()["controls"], found.plot().get_xlabel()
    ('Largest gains', ['u1'], 'frequency')
    """

    task: DesignTask
    machine: GeneralizedPlant
    design: Design
    analysis: LoopAnalysis
    channels: tuple[ChannelGain, ...]
    sampled: SampledDesign | None
    sampling: str

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reader should know."""
        said = [*self.task.notes, self.design.message]
        return tuple([*said, self.sampling] if self.sampling else said)

    def verdict(self) -> str:
        """Say in a sentence what was reached and whether it can be built.

        Returns
        -------
        str
        """
        return (
            f"The certified {self._norm} norm is {self.design.certificate.achieved:.4g}; "
            f"judged by its margins and sampling the loop {self._built}."
        )

    @property
    def _norm(self) -> str:
        return "H-infinity" if self.design.norm == "hinf" else "H2"

    @property
    def _built(self) -> str:
        return "can be built" if self.analysis.buildable else "cannot be built as it is"

    def tables(self) -> tuple[Table, ...]:
        """Return the figures as tables: the channels, then the loop.

        Returns
        -------
        tuple of Table
        """
        names = ("disturbance", "output", "unit", "without", "controlled")
        rows = tuple(tuple(getattr(c, name) for name in names) for c in self.channels)
        head = ("from", "to", "unit", "without control", "with control")
        own = (Table("Largest gains", head, rows),) if rows else ()
        return (*own, *self.analysis.tables())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the machine's largest gain from disturbances to outputs, without and with control.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        loops = {"without control": self.machine.open_loop, "with control": self.loop}
        grids = [singular_values(loop)["frequency"].values for loop in loops.values()]
        grid = np.unique(np.concatenate(grids))
        units = dict.fromkeys(c.unit for c in self.channels)
        unit = ", ".join(units) if all(units) else ""
        gains = {
            name: singular_values(loop, grid).isel(singular_value=0).assign_attrs(units=unit)
            for name, loop in loops.items()
        }
        return plot_gains(gains, {}, ax, first_style=0)

    @property
    def loop(self) -> control.StateSpace:
        """The machine's closed loop from disturbances to performance outputs."""
        return self.machine.closed_loop(self.design.controller)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain values.

        Returns
        -------
        dict
        """
        d, c, s, P = self.design, self.design.certificate, self.sampled, self.machine
        sampled = None
        if s is not None:
            limits = {"lower": s.certificate.lower, "upper": s.certificate.bound}
            sampled = {"period": s.period, "delay": s.delay, "norm": s.norm, **limits}
        return {
            "status": d.status,
            "message": d.message,
            "method": d.method,
            "norm": {"kind": d.norm, "achieved": c.achieved, "bound": c.bound},
            "lower_bound": d.lower_bound,
            "certificate": {"valid": c.valid, "reasons": list(c.reasons), "stable": c.stable},
            "controls": list(P.control_names),
            "measurements": list(P.measurement_names),
            "performance": list(P.performance_names),
            "disturbances": list(P.disturbance_names),
            "states": d.controller.nstates,
            "channels": [vars(channel) for channel in self.channels],
            "loop": self.analysis.to_dict(),
            "buildable": self.analysis.buildable,
            "problems": list(self.analysis.problems),
            "words": self.analysis.explain(),
            "sampled": sampled,
            "notes": list(self.notes),
        }

    def _card(self) -> Card:
        d, K = self.design, self.design.controller
        size = f"{K.nstates} states" if K.nstates else "a static gain"
        rows = [
            ("controls", ", ".join(self.machine.control_names)),
            ("measurements", ", ".join(self.machine.measurement_names)),
            ("controller", f"{size}, {d.method}"),
            (f"{self._norm} norm", f"{d.certificate.achieved:.6g}, proven"),
        ]
        title = f"Design for a machine: {d.status}, {self._built}"
        notes = (*self.notes, self.analysis.explain())
        return Card(title, (quantities(*rows), *self.tables()), notes)


def design_machine(
    machine: DesignTask | MechanicalModel | GeneralizedPlant | str | Path, **changes: Any
) -> MachineDesign:
    """Design the controller that a file asks for, certify it, and tell what its loop is like.

    Parameters
    ----------
    machine : DesignTask, MechanicalModel, GeneralizedPlant, path or str
        A task, or what :func:`robustpolish.read_design_task` makes one of.
    **changes
        Parameters of :class:`~robustpolish.results.DesignTask` that
        count instead of the file's word.

    Returns
    -------
    MachineDesign
        ``design`` is what ``robustpolish margins`` and ``export`` read after ``design.save``.

    Raises
    ------
    InvalidInputError
        If a name is unknown or something does not fit.
    InfeasibleError
        If no controller stabilises the machine; it names the mode.
    SolverError
        If no certified controller was found.

    Notes
    -----
    All states measured: :func:`robustpolish.state_feedback`. An order given:
    :func:`robustpolish.static_output_feedback`. Otherwise :func:`robustpolish.output_feedback`.
    A sampled loop that is unstable does not stop the design: ``sampling`` says which period is
    short enough.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 2.0)], [rp.Spring(("x", "ground"), 800.0)],
    ...     inputs=[rp.Input("F", ("x", "ground"))], outputs=[rp.Output("x", "x")])
    >>> found = rp.design_machine(
    ...     model, controls=["F"], control_weight=1e-3, measurement_noise=1e-3)
    >>> found.design.certificate.valid, found.machine.disturbance_names
    (True, ('disturbance_F',))
    >>> found.channels[0].without, round(found.channels[0].controlled, 4)
    (inf, 0.0017)
    """
    task = read_design_task(machine, **changes)
    noisy: dict[str, Any] = {"control_weight": task.prices, "measurement_noise": task.noises}
    if task.kind == "state feedback":
        method = "riccati" if task.method == "riccati" else "lmi"
        design = state_feedback(task.weighted, task.norm, method, "cvxpy", task.prices)
    elif task.order is not None:
        design = static_output_feedback(task.weighted, task.norm, order=task.order, **noisy)
    else:
        design = output_feedback(task.weighted, task.norm, task.method, **noisy)
    K, plant = design.controller, task.plant
    if K.ninputs != plant.ny or design.plant.measurement_names != plant.measurement_names:
        plant = plant.with_full_state()
    rate, sampled, sampling = task.sample_rate_hz, None, ""
    asked = {} if rate is None else {"sample_rate_hz": rate}
    analysis = model_analysis(plant, K, LoopRequirements(**asked))
    if rate is not None:
        delay, corner = task.computation_delay, task.anti_aliasing_hz
        try:
            sampled = design.discretize(1.0 / rate, delay, anti_aliasing=corner)
            sampling = sampled.message
        except (InfeasibleError, SolverError) as error:
            sampling = f"Sampled, the loop is not certified: {error}"
    return MachineDesign(task, plant, design, analysis, _channels(plant, K), sampled, sampling)


def _channels(plant: GeneralizedPlant, K: control.StateSpace) -> tuple[ChannelGain, ...]:
    """Return the gains of the machine's channels; noise of sensors is not one of them."""
    before, after = plant.open_loop, plant.closed_loop(K)
    names = enumerate(plant.disturbance_names)
    pairs = [(i, j) for j, w in names if not w.startswith("noise_") for i in range(plant.nz)]
    found = []
    for i, j in pairs[:MOST_CHANNELS]:
        z, w = plant.performance_names[i], plant.disturbance_names[j]
        unit = ratio_unit(plant.units.get(z, ""), plant.units.get(w, ""))
        gains = (float(hinf_norm(system[i, j])) for system in (before, after))
        found.append(ChannelGain(w, z, unit, *gains))
    return tuple(found)
