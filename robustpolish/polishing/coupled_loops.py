"""Loops coupled with the brush: simulation, comparison with replayed forces, linearisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.linalg import block_diag

from robustpolish.base.arrays import Vector
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive, whole_number
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.closed_loop.simulate import loop_with_units
from robustpolish.errors import InvalidInputError
from robustpolish.implementation.sampled_design import SampledDesign
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.response import linear_response
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.simulation import simulate_model
from robustpolish.plants.linearization import Linearization
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.time import plot_time_series
from robustpolish.polishing import contact as disc
from robustpolish.polishing.air_bearing import PolishingHardware, air_bearing_model
from robustpolish.polishing.brush import physical_dataset
from robustpolish.polishing.coupled import (
    PLACE,
    REST_AXIS,
    REST_TURNING,
    VELOCITY,
    BrushAtRest,
    LinearMachine,
    brush_at_rest,
    guided_brush,
    run_coupled,
)
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.quantities import or_default
from robustpolish.synthesis.design import Design

# Loop as a machine that carries the brush: forces to displacements of the joint.

PLACES = ("x", "y", "z")
FORCES = ("F_x", "F_y", "F_z")
SIGNS = np.array([-1.0, -1.0, 1.0])
"""Of the forces (8.45): F_x and F_y push the tool against their axes, F_z along its own."""

Loop = Design | GeneralizedPlant | control.StateSpace


def _refused(what: str, expected: str, remedy: str) -> InvalidInputError:
    return invalid("design", described(what), expected, remedy)


@dataclass(frozen=True, eq=False)
class BrushCarrier:
    """A loop, what it is for the brush, and the units of its signals.

    Attributes
    ----------
    system : control.StateSpace
        From the forces to all outputs.
    machine : LinearMachine
        The same from the contact force on the brush to its place.
    units : dict of str to str
    """

    system: control.StateSpace
    machine: LinearMachine
    units: dict[str, str]

    def inputs(self, forces: Vector, polishing_force: float) -> Vector:
        """Return the loop's inputs under contact forces on the brush along world axes.

        Parameters
        ----------
        forces : ndarray, shape (samples, 3)
            In N.
        polishing_force : float
            In N.

        Returns
        -------
        ndarray, shape (samples, m)
        """
        labels = self.system.input_labels
        given = np.zeros((len(forces), self.system.ninputs))
        given[:, [labels.index(name) for name in FORCES]] = SIGNS * forces
        if "F_p" in labels:
            given[:, labels.index("F_p")] = polishing_force
        return given

    def labelled(self, time: Vector, outputs: Vector) -> xr.Dataset:
        """Return outputs over time with their names and units.

        Parameters
        ----------
        time : ndarray, shape (samples,)
            In s.
        outputs : ndarray, shape (samples, p)

        Returns
        -------
        xarray.Dataset
        """
        columns = zip(self.system.output_labels, outputs.T, strict=True)
        signals = {name: ("time", y, {"units": self.units.get(name, "")}) for name, y in columns}
        return xr.Dataset(signals, {"time": ("time", time, {"units": "s"})})


def carrier(design: Loop, polishing_force: float) -> BrushCarrier:
    """Read a loop as the machine that carries the brush.

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        In continuous time, with inputs F_x, F_y, F_z and perhaps F_p, signs as in (8.45), and
        outputs x, y, z, the displacements of the brush.
    polishing_force : float
        In N.

    Returns
    -------
    BrushCarrier

    Raises
    ------
    InvalidInputError
        If the loop is sampled, lacks one of these signals, or a force moves the brush at once.
    """
    remedy = "Pass the design that was sampled."
    if isinstance(design, SampledDesign):
        raise _refused("a sampled design", "a loop in continuous time", remedy)
    system, units = loop_with_units(design)
    if not system.isctime(strict=False):
        raise _refused("a loop in discrete time", "one in continuous time", remedy)
    inputs, outputs = system.input_labels, system.output_labels
    for kind, wanted, labels in (("input", FORCES, inputs), ("output", PLACES, outputs)):
        missing = [name for name in wanted if name not in labels]
        if missing:
            what = f"{kind}s {', '.join(labels)}"
            remedy = f"Name the {kind}s; {', '.join(missing)} is missing."
            raise _refused(what, f"{', '.join(wanted)} among them", remedy)
    rows = [outputs.index(name) for name in PLACES]
    columns = [inputs.index(name) for name in FORCES]
    A, B, C, D = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    if np.any(D[np.ix_(rows, columns)]):
        remedy = "Give the place where the brush hangs a mass."
        raise _refused("a brush that a force displaces at once", "a brush with a mass", remedy)
    has_steady = "F_p" in inputs
    steady = B[:, inputs.index("F_p")] * polishing_force if has_steady else np.zeros(len(A))
    machine = LinearMachine(A, B[:, columns] * SIGNS, steady, C[rows])
    return BrushCarrier(system, machine, units)


# Coupled simulation: contact at the actual place of the tool, not at the commanded one.


def simulate_coupled(
    design: Loop, brush: xr.Dataset, *, tolerance: float = 2e-3, max_passes: int = 5
) -> xr.Dataset:
    r"""Simulate a loop and the brush that hangs on it, each of which feels the other.

    :func:`robustpolish.simulate` replays forces that the brush made on a rigid machine. Here the
    contact is where the machine has yielded to:

    .. math:: p(t) = p_{rigid}(t) + q(t) - q(0), \qquad \dot x = A x + B F(p, \dot p, k, \omega)

    with the joint's place p, the loop's displacement q of the brush, and the free tilts of the
    disc. The robot leads the joint as it went on the rigid machine, height included, under the
    first load; accelerations of the path, 0.5 m/s² here, do not act on the machine, as in (8.45).

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        A closed or open loop in continuous time with inputs F_x, F_y, F_z and perhaps F_p (N),
        signs as in (8.45), and outputs x, y, z, the displacements of the brush (m).
    brush : xarray.Dataset
        What the physical brush did on a rigid machine, from
        :func:`robustpolish.polishing.simulate_brush`; tells parameters, path, start and samples.
    tolerance : float, optional
        Largest difference of the contact impulse over 10 ms between the last two passes,
        relative to that of the polishing force.
    max_passes : int, optional
        At least 2; each takes half the steps of the one before.

    Returns
    -------
    xarray.Dataset
        All outputs of the loop, and what :func:`~robustpolish.polishing.simulate_brush` returns:
        the forces F_x, F_y, F_z that act between brush and machine, tilts, contacts. `tool_x`,
        `tool_y` and `tool_z` are where the joint is, `surface_height` and `elevation` are those
        of the path. The loop begins at rest under the first load.

    Raises
    ------
    InvalidInputError
        If the loop lacks a signal, is sampled, or has a pole at zero; if the brush is a run of the
        listing.
    SolverError
        If brush and machine swing up until the disc tips over.

    Warns
    -----
    RobustPolishWarning
        If the passes do not agree.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, section 9.4, which calculates the
    disc and the air bearing one after the other.

    Examples
    --------
    >>> import robustpolish as rp
    >>> brush = rp.polishing.simulate_brush(run=1, duration=0.05)
    >>> coupled = rp.polishing.simulate_coupled(rp.air_bearing(), brush)
    >>> coupled["y"].attrs["units"], coupled.sizes["time"] == brush.sizes["time"]
    ('m', True)
    """
    remedy = "Make it with simulate_brush(run=..., duration=...)."
    instance_of("brush", brush, xr.Dataset, "an xarray.Dataset", remedy)
    limit = positive("tolerance", tolerance)
    whole_number("max_passes", max_passes, 2, remedy="Allow more passes.")
    guided = guided_brush(brush)
    parameters = guided.parameters
    carried = carrier(design, parameters.polishing_force)
    system = carried.system
    with progress_bar(f"Simulating brush and machine for {guided.time[-1]:g} s"):
        run, states, check = run_coupled(
            guided, carried.machine, tolerance=limit, max_passes=max_passes
        )
    signals = physical_dataset(run, check, parameters, guided.three_angles)
    inputs = carried.inputs(run.forces, parameters.polishing_force)
    outputs = states @ np.asarray(system.C).T + inputs @ np.asarray(system.D).T
    yielded = (states - states[0]) @ carried.machine.C.T
    for i, axis in enumerate(PLACES[:2]):
        tool = signals[f"tool_{axis}"]
        signals[f"tool_{axis}"] = tool.copy(data=guided.place[:, i] + yielded[:, i])
    loop = carried.labelled(guided.time, outputs)
    return signals.merge(loop).assign_attrs({**signals.attrs, "simulator": "coupled"})


# Record of a machine that carries the brush, as sensors take it.


def brush_record(
    brush: xr.Dataset,
    model: MechanicalModel | None = None,
    *,
    sensors: Sequence[str] = PLACES,
    noise: float | None = None,
    seed: int = 0,
) -> xr.Dataset:
    """Return what force sensors and displacement sensors record while the brush shakes a machine.

    Without effects of its own, which are not linear, the machine and the brush feel each other
    (:func:`simulate_coupled`); with effects the forces of the rigid machine act on it. It begins
    where the first load holds its linear part at rest.

    Parameters
    ----------
    brush : xarray.Dataset
        What the brush did on a rigid machine, from
        :func:`robustpolish.polishing.simulate_brush`.
    model : MechanicalModel, optional
        With inputs among F_x, F_y, F_z and F_p (N);
        :func:`robustpolish.polishing.air_bearing_model` by default.
    sensors : sequence of str, optional
        Outputs of the model that are measured; the displacements of the brush by default.
    noise : float, optional
        Standard deviation of a reading in m; that of
        :class:`robustpolish.polishing.PolishingHardware` by default. Forces have none.
    seed : int, optional
        Of the noise.

    Returns
    -------
    xarray.Dataset
        Inputs and measured outputs over ``time``, for :func:`robustpolish.compare` and the like.

    Raises
    ------
    InvalidInputError
        If a sensor is no output of the model, or the brush lacks an input.

    Examples
    --------
    >>> import robustpolish as rp
    >>> brush = rp.polishing.simulate_brush(run=1, duration=0.05)
    >>> record = rp.polishing.brush_record(brush)
    >>> sorted(record.data_vars)
    ['F_p', 'F_x', 'F_y', 'F_z', 'x', 'y', 'z']
    >>> rp.compare(rp.polishing.air_bearing_model(), record).outputs["y"].fit_percent > 99
    True
    """
    machine = air_bearing_model() if model is None else model
    size = PolishingHardware().sensor_noise if noise is None else noise
    size, random = positive("noise", size, zero=True), np.random.default_rng(seed)
    for name in sensors:
        one_of("sensors", name, machine.output_names)
    for name in machine.input_names:
        one_of("model", name, (*FORCES, "F_p"), "Name its inputs so.")
    if machine.effects:
        data = brush[list(machine.input_names)]
        system = replace(machine, effects=()).state_space()
        first = np.array([float(data[name][0]) for name in system.input_labels])
        begin = -np.linalg.solve(np.asarray(system.A), np.asarray(system.B) @ first)
        moved = simulate_model(machine, data, begin).outputs
        columns = zip(machine.output_names, moved.T, strict=True)
        data = data.assign({name: ("time", column) for name, column in columns})
    else:
        data = simulate_coupled(machine.state_space(), brush)[
            [*machine.input_names, *machine.output_names]
        ]
    units = {o.name: machine.unit_of(o) for o in machine.outputs}
    for name in sensors:
        reading = data[name].values + size * random.standard_normal(data.sizes["time"])
        data[name] = ("time", reading, {"units": units[name]})
    return data[[*machine.input_names, *sensors]]


# Comparison of replayed forces with coupled simulation.


@dataclass(frozen=True, eq=False, repr=False)
class CoupledComparison(Displayed):
    """One loop under the brush, replayed and coupled.

    Attributes
    ----------
    table : xarray.Dataset
        Over `signal`, the displacements x, y, z and the forces F_x, F_y, F_z: `replayed` and
        `coupled`, the largest departures from the first sample, `difference`, the largest
        difference of both, and `share`, that over the larger of the two.
    replayed, coupled : xarray.Dataset
        The runs, from rest under the first load.
    machine_stiffness : ndarray, shape (3,)
        Static, of the loop at the brush along x, y, z [N/m].
    contact_stiffness : float
        Largest static stiffness of the contact at the first sample [N/m], tilts held.
    loop_gain : float
        Largest gain, over frequency, from a force on the brush to the force with which the contact
        answers what the machine yields, at the first sample. The displacements are about
        1/(1 + gain) to 1/(1 - gain) of those that replay shows; its inverse says how many times
        stiffer the machine is than the contact when both are moved.

    Examples
    --------
    >>> import robustpolish as rp
    >>> brush = rp.polishing.simulate_brush(run=1, duration=0.05)
    >>> comparison = rp.polishing.compare_coupled(rp.air_bearing(), brush)
    >>> comparison.coupled.attrs["simulator"], comparison.replay_is_good_enough()
    ('coupled', False)
    """

    table: xr.Dataset
    replayed: xr.Dataset
    coupled: xr.Dataset
    machine_stiffness: np.ndarray
    contact_stiffness: float
    loop_gain: float

    @property
    def stiffness_ratio(self) -> float:
        """Static stiffness of the machine in its softest direction over that of the contact."""
        return float(np.min(self.machine_stiffness)) / self.contact_stiffness

    @property
    def largest_share(self) -> float:
        """Largest difference of a displacement, as a share of the largest displacement.

        Displacements are judged together: where one axis hardly moves, what matters is small
        beside the others.
        """
        moved = self.table.sel(signal=list(PLACES))
        return float(
            moved["difference"].max() / max(moved["replayed"].max(), moved["coupled"].max())
        )

    def replay_is_good_enough(self, share: float = 0.01) -> bool:
        """Whether replayed and coupled displacements agree.

        Parameters
        ----------
        share : float, optional
            Of the largest displacement.

        Returns
        -------
        bool
        """
        return self.largest_share <= positive("share", share)

    def plot(self, ax: Axes | None = None, *, signal: str = "y") -> Axes:
        """Draw one signal of both runs over time.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        signal : str, optional
            One of the table's.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> brush = rp.polishing.simulate_brush(run=1, duration=0.02)
        >>> rp.polishing.compare_coupled(rp.air_bearing(), brush).plot(signal="F_y").get_ylabel()
        'F_y [N]'
        """
        one_of("signal", signal, [str(name) for name in self.table["signal"].values])
        runs = {"replayed": self.replayed[signal], "coupled": self.coupled[signal]}
        return plot_time_series(runs, ax=ax)

    def _card(self) -> Card:
        rows: list[tuple[Any, ...]] = []
        for name in self.table["signal"].values:
            row = self.table.sel(signal=name)
            unit = str(self.coupled[name].attrs.get("units", ""))
            figures = (float(row[key]) for key in ("replayed", "coupled", "difference"))
            rows.append((str(name), unit, *figures, f"{100 * float(row['share']):.2g} %"))
        columns = ("largest", "unit", "replayed", "coupled", "difference", "of the larger")
        ratio = (
            f"the loop is {self.stiffness_ratio:.3g} times stiffer than the contact at rest, "
            f"{1.0 / self.loop_gain:.3g} times where it matters most"
        )
        verdict = f"displacements differ by {100 * self.largest_share:.2g} %"
        tables = (Table("", columns, tuple(rows)),)
        return Card("Replayed against coupled", tables, (ratio, verdict))


def compare_coupled(
    design: Loop, brush: xr.Dataset, *, tolerance: float = 2e-3, max_passes: int = 5
) -> CoupledComparison:
    """Simulate a loop under the brush twice: forces replayed, and coupled.

    Both runs begin at rest under the first load, so that they differ by the coupling alone. (A loop
    that :func:`robustpolish.simulate` starts unloaded is struck by the load first.)

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        As in :func:`robustpolish.polishing.simulate_coupled`.
    brush : xarray.Dataset
        From :func:`robustpolish.polishing.simulate_brush`.
    tolerance : float, optional
        As in :func:`robustpolish.polishing.simulate_coupled`.
    max_passes : int, optional
        As in :func:`robustpolish.polishing.simulate_coupled`.

    Returns
    -------
    CoupledComparison

    Raises
    ------
    InvalidInputError, SolverError
        As :func:`robustpolish.polishing.simulate_coupled`.

    Examples
    --------
    Three springs of 1e8 N/m with dampers, far stiffer than the contact of run 1:

    >>> import control
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> A = np.kron(np.eye(3), [[0.0, 1.0], [-1e8 / 0.2, -9e3 / 0.2]])
    >>> B = np.kron(np.diag([-5.0, -5.0, 5.0]), [[0.0], [1.0]])
    >>> stiff = control.ss(
    ...     A, B, np.kron(np.eye(3), [[1.0, 0.0]]), 0, inputs=["F_x", "F_y", "F_z"],
    ...     outputs=["x", "y", "z"],
    ... )
    >>> forces = rp.polishing.simulate_brush(run=1, duration=0.1)
    >>> comparison = rp.polishing.compare_coupled(stiff, forces)
    >>> comparison.stiffness_ratio > 100, comparison.replay_is_good_enough(0.01)
    (True, True)
    """
    coupled = simulate_coupled(design, brush, tolerance=tolerance, max_passes=max_passes)
    guided = guided_brush(brush)
    force = guided.parameters.polishing_force
    carried = carrier(design, force)
    machine = carried.machine
    # The loop under the forces that the brush made on a rigid machine.
    inputs = carried.inputs(
        SIGNS * np.column_stack([brush[name].to_numpy() for name in FORCES]), force
    )
    rest = machine.rest(guided.first_force)
    outputs = linear_response(carried.system, guided.time, inputs, rest).outputs
    replayed = carried.labelled(guided.time, outputs)
    replayed = replayed.assign({name: brush[name] for name in FORCES})
    at_start = BrushAtRest.at(guided.parameters, guided.place[0], guided.start[disc.AXES])
    # From a force on the brush, through the machine and the contact, to the force back.
    slopes = at_start.jacobian[:3]
    answer = slopes[:, PLACE] @ machine.C + slopes[:, VELOCITY] @ machine.C @ machine.A
    gain = hinf_norm(control.StateSpace(machine.A, machine.B, answer, np.zeros((3, 3))))
    table = _table(replayed, coupled)
    stiffness = machine.stiffness, at_start.stiffness
    return CoupledComparison(table, replayed, coupled, *stiffness, float(gain.value))


def _table(replayed: xr.Dataset, coupled: xr.Dataset) -> xr.Dataset:
    names = [*PLACES, *FORCES]
    figures = []
    for name in names:
        sizes = [float(np.abs(run[name] - run[name][0]).max()) for run in (replayed, coupled)]
        apart = float(np.abs(coupled[name] - replayed[name]).max())
        figures.append((*sizes, apart, apart / max(*sizes, np.finfo(float).tiny)))
    keys = ("replayed", "coupled", "difference", "share")
    columns = zip(keys, zip(*figures, strict=True), strict=True)
    return xr.Dataset({key: ("signal", list(row)) for key, row in columns}, {"signal": names})


# Linearisation of brush and machine about equilibrium: (10.1) to (10.5).

DISC = ("tilt_x", "tilt_y", "turning_x", "turning_y")
"""Deviation of the disc's axis along x and y [rad], and its angular velocity [rad/s]."""


def linearize_with_brush(
    design: Loop,
    parameters: BrushParameters | None = None,
    *,
    x: float | None = None,
    y: float = 0.0,
) -> Linearization:
    r"""Linearise brush and machine together about the rest of the spinning disc on one spot.

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        As in :func:`robustpolish.polishing.simulate_coupled`; of a plant the controls stay open,
        and its
        measurements are outputs, so that a controller can be designed for the machine in contact.
    parameters : BrushParameters, optional
        Run 1 by default. The disc has two angles and an ideal drive; the path stands still.
    x, y : float, optional
        Where the ball joint is, in m; by default on the bottom of the trough where the path
        begins. Where a stiff disc hangs askew on two narrow patches there may be no rest.

    Returns
    -------
    Linearization
        States: those of the loop in deviations from its rest under the contact force, then
        `tilt_x`, `tilt_y` [rad] and `turning_x`, `turning_y` [rad/s] of the disc. Inputs: those of
        the loop; forces F_x, F_y, F_z and F_p act besides the contact's. Outputs: those of the
        loop, the disc's four, and the changes `contact_x`, `contact_y`, `contact_z` [N] of the
        contact force on the brush in world axes. `state` is the equilibrium of the loop and of
        the disc, the latter as components of its axis.

    Raises
    ------
    InvalidInputError
        As :func:`robustpolish.polishing.simulate_coupled`.
    SolverError
        If the disc finds no rest there.

    Notes
    -----
    (10.4) by the chain rule: the machine is linear already, and the disc's axis k and angular
    velocity w obey k' = w x k, I_0 w' = M - I p (w x k) to first order; only the contact's ten
    derivatives are taken by differences, extrapolated to fourth order.

    Examples
    --------
    >>> import robustpolish as rp
    >>> at_rest = rp.polishing.linearize_with_brush(
    ...     rp.air_bearing(), rp.polishing.BrushParameters.for_run(2)
    ... )
    >>> at_rest.system.nstates, at_rest.system.output_labels[-1]
    (16, 'contact_z')
    """
    p = or_default("parameters", parameters, BrushParameters)
    along = p.radius + 2.0 * p.rotation_radius if x is None else x
    carried = carrier(design, p.polishing_force)
    rest = brush_at_rest(p, along, y)
    loop = design.system if isinstance(design, GeneralizedPlant) else carried.system
    machine, order = carried.machine, len(carried.machine.A)
    whole = np.zeros((order + 4, order + 4))
    whole[:order, :order] = machine.A
    # The free disc: with e_1 x e_2 = k, w x k = (w_2, -w_1) along e_1, e_2.
    gyro = p.spin_inertia * p.spin / p.tilt_inertia
    whole[order:, order:] = np.kron([[0.0, 1.0], [0.0, 0.0]], [[0.0, 1.0], [-1.0, 0.0]])
    whole[order + 2 :, order + 2 :] = [[0.0, -gyro], [gyro, 0.0]]
    # The ten changes that the contact depends on, by the states of machine and disc.
    change = np.zeros((10, order + 4))
    change[PLACE, :order], change[VELOCITY, :order] = machine.C, machine.C @ machine.A
    change[REST_AXIS, order : order + 2] = change[REST_TURNING, order + 2 :] = np.eye(2)
    slopes = rest.jacobian @ change
    whole[:order] += machine.B @ slopes[:3]
    whole[order + 2 :] += slopes[3:] / p.tilt_inertia
    rows: Any = [block_diag(loop.C, np.eye(4)), slopes[:3]]
    outputs = np.vstack(rows)
    # Forces may enter outputs at once, such as an acceleration's; so does the contact's then.
    columns = [loop.input_labels.index(name) for name in FORCES]
    outputs[: loop.noutputs] += np.asarray(loop.D)[:, columns] * SIGNS @ slopes[:3]
    system = control.StateSpace(
        whole,
        np.vstack([loop.B, np.zeros((4, loop.ninputs))]),
        outputs,
        np.vstack([loop.D, np.zeros((7, loop.ninputs))]),
        states=[*loop.state_labels, *DISC],
        inputs=list(loop.input_labels),
        outputs=[*loop.output_labels, *DISC, "contact_x", "contact_y", "contact_z"],
    )
    residual = float(np.max(np.abs(rest.load[3:]))) / (p.polishing_force * p.radius)
    state = np.concatenate([machine.rest(rest.load[:3]), rest.axis[:2], np.zeros(2)])
    return Linearization(system, state, np.zeros(loop.ninputs), residual)
