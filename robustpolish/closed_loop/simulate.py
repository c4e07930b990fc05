"""Simulation of loops under a disturbance, exact for first-order hold, and their comparison."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import SAME
from robustpolish.base.checks import instance_of, invalid, misfit, one_of
from robustpolish.base.results import Card, Displayed, Table, bears_prefix, prefix_power, prefixed
from robustpolish.base.sweep import sweep
from robustpolish.closed_loop.machine_loops import (
    Controller,
    draw,
    in_loop,
    simulate_machine,
    uncertain_numbers,
)
from robustpolish.implementation.run import disturbance_columns
from robustpolish.implementation.sampled_design import SampledDesign
from robustpolish.linear.response import linear_response
from robustpolish.linear.systems import as_state_space, is_system
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.time import plot_time_series
from robustpolish.synthesis.design import Design, checked_design

if TYPE_CHECKING:
    from robustpolish.identification.fit.result import Refit

# Simulation of one loop.


def simulate(
    design: Design | SampledDesign | GeneralizedPlant | control.StateSpace | MechanicalModel,
    disturbance: xr.Dataset | Controller = None,
    load: xr.Dataset | None = None,
    reference: xr.Dataset | None = None,
    *,
    initial_state: ArrayLike | None = None,
    fit: Refit | None = None,
    samples: int = 50,
    seed: int = 0,
) -> xr.Dataset:
    """Simulate a loop: a linear one under a disturbance, or a machine with its controller.

    ``simulate(design, disturbance)`` is exact for first-order hold.
    ``simulate(machine, controller, load, reference)`` runs a mechanical model with all its effects,
    and the sampled controller with its delay, hold, converters and limits.

    Parameters
    ----------
    design : Design, SampledDesign, GeneralizedPlant, control.StateSpace or MechanicalModel
        A design gives its closed loop with the control effort; a sampled design what its method
        :meth:`~robustpolish.results.SampledDesign.simulate` gives, on a finer grid and within the
        limits
        that its plant knows; a plant its open loop, u = 0; a system of any kind is simulated as it
        is.
    disturbance : xarray.Dataset, pandas.DataFrame, mapping, or the controller of a machine
        Variables over `time` (s, uniform) named as disturbances w, such as the forces of
        :func:`robustpolish.polishing.simulate_brush`; other variables are ignored, and disturbances
        that are not given are zero, as in :meth:`~robustpolish.results.SampledDesign.simulate`. One
        has to be given.
        For a machine the controller: a SampledDesign or a discrete control.StateSpace (``u = K y``,
        signals by the names of the machine's outputs and inputs, or of coordinates, velocities
        ``dx`` and forces ``u_x``); one :class:`~robustpolish.simulation.Feedback` or several; None
        for the machine's own feedback, or none.
    load, reference : xarray.Dataset, optional
        Of a machine: its inputs, and what its outputs shall be, by the names of the outputs or of
        the columns that a Feedback names; over `time` in s, linear between samples. What is left
        out is zero.
    initial_state : array_like, optional
        Of a machine: free displacements, then their velocities; at rest by default.
    fit : Refit, optional
        Machines are drawn from the standard errors of this fit of the machine, and the result has
        the dimension ``sample``.
    samples, seed : int, optional
        Number of machines that are drawn, and with which seed.

    Returns
    -------
    xarray.Dataset
        Of a machine its outputs, commands as they act (``at_limit``: at which part of the samples
        at a limit) and references. Otherwise every performance output z and, for a design, every
        control u over `time`, with ``units`` in their attributes where the plant knows them. The
        loop starts at rest.

    Raises
    ------
    InvalidInputError
        If no disturbance is given, one is misspelt (in case or separators), has another unit than
        the plant's or is not finite, or if the time grid is not uniform; if a controller is
        continuous, or sees or drives what the machine has not.
    SolverError
        If the loop of a machine diverges.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import robustpolish as rp
    >>> time = np.arange(2001) / 20e3
    >>> push = xr.Dataset(
    ...     {"F_y": ("time", np.full(time.size, 10.0), {"units": "N"})}, coords={"time": time}
    ... )
    >>> response = rp.simulate(rp.air_bearing(), push)
    >>> response["y"].attrs["units"], bool(response["x"].max() == 0)
    ('m', True)

    A slide with dry friction, and a controller that samples at 1 kHz:

    >>> slide, _ = rp.datasets.sticky_slide()
    >>> slide = slide.with_effect("coulomb_friction", "x", {"force": 3.0})
    >>> position = rp.simulation.FeedbackTerm("x", 4000.0, derivative=80.0, reference="wanted")
    >>> loop = rp.simulation.Feedback(slide.input_names[0], 1e-3, [position], limit=20.0)
    >>> step = xr.Dataset({"wanted": ("time", np.full(501, 1e-3))}, {"time": time[::4][:501] * 5})
    >>> moved = rp.simulate(slide, loop, reference=step)
    >>> bool(abs(moved["x"][-1] - 1e-3) < 1e-3)
    True
    """
    if isinstance(design, MechanicalModel):
        controller: Any = disturbance
        if fit is None:
            return simulate_machine(design, controller, load, reference, initial_state)
        keys, values, *_ = draw(*uncertain_numbers(fit, None), samples, seed)
        drawn = (dict(zip(keys, row, strict=True)) for row in values.tolist())
        machines = (fit.model.with_parameters(numbers) for numbers in drawn)
        runs = [simulate_machine(m, controller, load, reference, initial_state) for m in machines]
        return xr.concat(runs, "sample", combine_attrs="override")
    table: Any = disturbance
    if not hasattr(table, "keys"):
        remedy = "Pass forces over time, or a MechanicalModel first."
        raise misfit("disturbance", type(disturbance).__name__, "an xarray.Dataset", remedy)
    if isinstance(design, SampledDesign):
        return design.simulate(table)
    return _simulated(*loop_with_units(design), table)


def _simulated(
    system: control.StateSpace, units: Mapping[str, str], disturbance: xr.Dataset
) -> xr.Dataset:
    time, inputs = disturbance_columns(disturbance, system.input_labels, units)
    outputs, _ = linear_response(system, time, inputs)
    return _labelled(system, units, time, outputs.T)


def _labelled(
    system: control.StateSpace, units: Mapping[str, str], time: np.ndarray, outputs: np.ndarray
) -> xr.Dataset:
    return xr.Dataset(
        {
            name: ("time", outputs[i], {"units": units[name]} if name in units else {})
            for i, name in enumerate(system.output_labels)
        },
        coords={"time": ("time", time, {"units": "s"})},
    )


def simulate_all(
    loops: Mapping[str, Design | GeneralizedPlant],
    disturbance: xr.Dataset,
    executor: Executor | Literal["serial"] | None,
) -> dict[str, xr.Dataset]:
    """Simulate several loops under one disturbance, on workers, to the bits of :func:`simulate`.

    Parameters
    ----------
    loops : mapping of str to Design or GeneralizedPlant
    disturbance : xarray.Dataset
    executor : concurrent.futures.Executor, "serial" or None
        As for :func:`robustpolish.sweep`.

    Returns
    -------
    dict of str to xarray.Dataset
    """
    if executor == "serial":
        return {name: simulate(loop, disturbance) for name, loop in loops.items()}
    known = {name: loop_with_units(loop) for name, loop in loops.items()}
    run = functools.partial(_outputs, tuple(known.values()), disturbance)
    found = sweep(run, {"loop": range(len(known))}, executor=executor)
    for i in np.flatnonzero(found["failure"].values != "")[:1]:
        run(int(i))  # raises here what it raised there
    time = disturbance["time"].to_numpy()
    return {
        name: _labelled(*known[name], time, outputs)
        for name, outputs in zip(known, found["outputs"].values, strict=True)
    }


def _outputs(
    loops: tuple[tuple[control.StateSpace, dict[str, str]], ...], disturbance: xr.Dataset, loop: int
) -> dict[str, np.ndarray]:
    """Return the outputs of one loop, with rows of zeros up to the number that the most have."""
    response = _simulated(*loops[loop], disturbance)
    outputs = np.zeros((max(system.noutputs for system, _ in loops), response.sizes["time"]))
    for row, name in enumerate(loops[loop][0].output_labels):
        outputs[row] = response[name].to_numpy()
    return {"outputs": outputs}


def loop_with_units(
    design: Design | GeneralizedPlant | control.StateSpace,
) -> tuple[control.StateSpace, dict[str, str]]:
    """Return the system from w to z (and u) and the units of its signals."""
    if isinstance(design, GeneralizedPlant):
        return design.open_loop, dict(design.units)
    if is_system(design):
        return as_state_space("design", design), {}
    expected = "a Design, a SampledDesign, a GeneralizedPlant or a control.StateSpace"
    remedy = "Pass what state_feedback(...) or air_bearing(...) returned."
    known = instance_of("design", design, Design, expected, remedy)
    plant = known.plant
    return plant.with_control_outputs().closed_loop(known.controller), dict(plant.units)


SAME_LOAD = "every row is driven by the same disturbance"


@dataclass(frozen=True, eq=False, repr=False)
class ControllerComparison(Displayed):
    """Largest deviations with and without control.

    Attributes
    ----------
    table : xarray.Dataset
        Over `row` ("without control" first) and `signal`: `deviation`, the largest absolute
        value; `improvement` in percent against the first row. Over `row`: `effort`, the largest
        absolute control, NaN where controls have different units or there is none.
    responses : mapping of str to xarray.Dataset
        The simulated signals of each row.
    load : str
        What drives the rows: one disturbance, or the thesis's unequal ones.

    Examples
    --------
    >>> import robustpolish as rp
    >>> design = rp.polishing.design_against_brush(duration=0.02, realisation="ideal")
    >>> comparison = design.comparison
    >>> header, body = comparison.rows()
    >>> header[:2], [row[0] for row in body]
    (('', 'max |x| [m]'), ['without control', 'with control'])
    """

    table: xr.Dataset
    responses: Mapping[str, xr.Dataset]
    load: str

    def rows(self) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
        """Return column names and rows in SI units, for a CSV file.

        Returns
        -------
        header : tuple of str
        body : list of tuple
        """
        return self._rows({})

    def shown_rows(self) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
        """Return column names and rows with the prefixes that suit them, as in the figures.

        Returns
        -------
        header : tuple of str
            Signals of one unit share a prefix.
        body : list of tuple

        Examples
        --------
        >>> import robustpolish as rp
        >>> design = rp.polishing.design_against_brush(duration=0.02, realisation="ideal")
        >>> comparison = design.comparison
        >>> comparison.shown_rows()[0][1]
        'max |x| [µm]'
        """
        largest: dict[str, float] = {}
        for unit, values in zip(self._units(), self.table["deviation"].values.T, strict=True):
            largest[unit] = max(largest.get(unit, 0.0), float(np.max(values)))
        return self._rows({u: prefix_power(v) for u, v in largest.items() if bears_prefix(u)})

    def _rows(self, powers: Mapping[str, int]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
        table, units = self.table, self._units()
        signals = [str(name) for name in table["signal"].to_numpy()]
        scales = [10.0 ** -powers.get(unit, 0) for unit in units]
        shown = [prefixed(unit, powers.get(unit, 0)) for unit in units]
        names = [f"max |{name}|" for name in signals] + ["max |u|"]
        # Prices and weighted signals have no unit.
        heads = [
            f"{name} [{unit}]" if unit else name
            for name, unit in zip(names, [*shown, table["effort"].attrs.get("units")], strict=True)
        ]
        header = ("", *heads[:-1], *(f"{name} improved [%]" for name in signals), heads[-1])
        columns = table["deviation"].values * scales, table["improvement"].values
        rows = zip(table["row"].values, *columns, table["effort"].values, strict=True)
        body = [(str(row), *map(float, (*own, *better, u))) for row, own, better, u in rows]
        return header, body

    def _units(self) -> list[str]:
        first = next(iter(self.responses.values()))
        names = [str(name) for name in self.table["signal"].to_numpy()]
        return [str(first[name].attrs.get("units", "")) for name in names]

    def _card(self) -> Card:
        header, body = self.shown_rows()
        return Card("", (Table("", header, tuple(body)),), (f"({self.load})",))

    def plot(self, ax: Axes | None = None, *, signal: str | None = None) -> Axes:
        """Draw one signal of every row over time.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        signal : str, optional
            Name of a performance output; by default the one that deviates most without control.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InvalidInputError
            If there is no such signal.

        Examples
        --------
        >>> import robustpolish as rp
        >>> job = rp.polishing.design_against_brush(duration=0.02, realisation="ideal")
        >>> job.comparison.plot(signal="y").get_ylabel()
        'y [µm]'
        """
        names = [str(name) for name in self.table["signal"].to_numpy()]
        worst = names[int(np.argmax(self.table["deviation"].values[0]))]
        chosen = one_of("signal", worst if signal is None else signal, names)
        return plot_time_series(
            {row: response[chosen] for row, response in self.responses.items()}, ax, bands=True
        )


def compare_controllers(
    controllers: Mapping[str, Any],
    disturbance: xr.Dataset | None = None,
    *,
    plant: GeneralizedPlant | MechanicalModel | None = None,
    reference: xr.Dataset | None = None,
    signals: Sequence[str] | None = None,
    executor: Executor | Literal["serial"] | None = "serial",
) -> ControllerComparison:
    """Drive the open loop and every closed loop with the same disturbance.

    Parameters
    ----------
    controllers : mapping of str to Design
        The designs by the name of their row; for a machine whatever :func:`simulate` runs it with.
    disturbance : xarray.Dataset
        As for :func:`simulate`; it drives every row. Of a machine its load.
    plant : GeneralizedPlant or MechanicalModel, optional
        The plant of the row "without control"; that of the first design by default.
    reference : xarray.Dataset, optional
        Of a machine, as for :func:`simulate`: deviations are those from it.
    signals : sequence of str, optional
        The performance outputs to compare, or those of the machine; all of them by default.
    executor : concurrent.futures.Executor, "serial" or None, optional
        As for :func:`sweep`, with the same responses: this process by default, None for local
        processes, which pay for many loops under long disturbances only.

    Returns
    -------
    ControllerComparison

    Raises
    ------
    InvalidInputError
        If there is no controller, or a signal is unknown.

    See Also
    --------
    thesis_comparison : the comparison of chapter 11, in which the loads differ.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> designs = {"cheap": rp.state_feedback(plant, control_weight=1e-7)}
    >>> load = rp.polishing.simulate_brush(duration=0.02)
    >>> comparison = rp.compare_controllers(designs, load, signals=("x", "y"))
    >>> bool(comparison.table["improvement"].sel(row="cheap", signal="y") > 90)
    True
    """
    if not controllers:
        raise invalid("controllers", controllers, "at least one design", "Pass {'name': design}.")
    if isinstance(plant, MechanicalModel):
        return _compared_machine_loops(controllers, disturbance, plant, reference, signals)
    for name, design in controllers.items():
        checked_design(f"controllers[{name!r}]", design)
    open_plant = next(iter(controllers.values())).plant if plant is None else plant
    if disturbance is None:
        raise misfit("disturbance", "None", "an xarray.Dataset", "Pass forces over time.")
    responses = simulate_all({"without control": open_plant, **controllers}, disturbance, executor)
    chosen = open_plant.performance_names if signals is None else tuple(signals)
    for name in chosen:
        remedy = "Choose performance outputs of the plant."
        one_of("signals", name, open_plant.performance_names, remedy)
    return tabulate(responses, chosen, open_plant.control_names, SAME_LOAD)


def _compared_machine_loops(
    controllers: Mapping[str, Any],
    load: xr.Dataset | None,
    machine: MechanicalModel,
    reference: xr.Dataset | None,
    signals: Sequence[str] | None,
) -> ControllerComparison:
    """Run a machine with every controller, and without, and compare deviations from references."""
    chosen = machine.output_names if signals is None else tuple(signals)
    for name in chosen:
        one_of("signals", name, machine.output_names, "Choose outputs of the machine.")
    runs = {name: simulate_machine(machine, c, load, reference) for name, c in controllers.items()}
    first = next(iter(runs.values()))
    none = {name: ("time", np.zeros(first.sizes["time"])) for name in machine.input_names}
    still = xr.Dataset(none, first.coords) if load is None else load
    runs = {"without control": simulate_machine(replace(machine, feedback=()), None, still), **runs}
    asked = {} if reference is None else {name: reference[name] for name in reference.data_vars}
    for loop in (loop for c in controllers.values() for loop in in_loop(machine, c, []).feedback):
        for term in loop.terms:
            if term.reference in asked:
                asked.setdefault(term.of, asked[term.reference])
    largest = {}
    for row, run in runs.items():
        wanted = {n: asked[n].interp(time=run["time"]).values for n in chosen if n in asked}
        away = [run[name].values - wanted.get(name, 0.0) for name in chosen]
        largest[row] = np.max(np.abs(away), axis=1)
    return tabulate(runs, chosen, machine.input_names, SAME_LOAD, largest)


def tabulate(
    responses: Mapping[str, xr.Dataset],
    signals: Sequence[str],
    controls: Sequence[str],
    load: str,
    largest: Mapping[str, NDArray[np.float64]] | None = None,
) -> ControllerComparison:
    """Reduce simulated responses to their largest deviations; the first row is the reference.

    `largest` may hold the deviations per row, where the samples would miss the peaks.
    """
    rows = list(responses)
    deviation = np.array(
        [[float(np.abs(responses[row][name]).max()) for name in signals] for row in rows]
        if largest is None
        else [largest[row] for row in rows]
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        improvement = np.where(deviation[0] > 0, 100 * (1 - deviation / deviation[0]), np.nan)
    # Percent below which two runs of the same differ by rounding alone.
    improvement[np.abs(improvement) < SAME] = 0.0
    effort, effort_unit = _efforts(responses, controls)
    units = {responses[rows[0]][name].attrs.get("units", "") for name in signals}
    table = xr.Dataset(
        {
            "deviation": (("row", "signal"), deviation, {"units": _only(units)}),
            "improvement": (("row", "signal"), improvement, {"units": "%"}),
            "effort": ("row", effort, {"units": effort_unit}),
        },
        coords={"row": rows, "signal": list(signals)},
    )
    return ControllerComparison(table, dict(responses), load)


def _efforts(
    responses: Mapping[str, xr.Dataset], controls: Sequence[str]
) -> tuple[list[float], str]:
    """Largest absolute control of each row, if all controls have one unit."""
    efforts, units = [], set()
    for response in responses.values():
        found = [response[name] for name in controls if name in response]
        units |= {signal.attrs.get("units", "") for signal in found}
        efforts.append(max((float(np.abs(signal).max()) for signal in found), default=np.nan))
    if len(units) > 1:
        return [np.nan] * len(efforts), "mixed"
    return efforts, _only(units)


def _only(units: set[str]) -> str:
    return units.pop() if len(units) == 1 else ""
