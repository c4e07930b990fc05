"""Gain scheduling (LPV control): feedback that follows measured parameters of the plant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import WORK, Budget, progress_bar, single_threaded_blas
from robustpolish.base.checks import described, instance_of, invalid, known_keys, positive
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.errors import SolverError
from robustpolish.linear.norms.hinf import singular_values
from robustpolish.linear.response import uniform_step, varying_response
from robustpolish.linear.systems import named_system
from robustpolish.plants.blocks import SignalChoice, matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.plots.frequency import plot_gains
from robustpolish.synthesis.lmi.output_feedback import (
    bounded_real,
    controllers_near_optimum,
    loop_terms,
)
from robustpolish.synthesis.lmi.program import Affine, ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.problem.preflight import ScaledPlant, with_measurement_noise
from robustpolish.synthesis.scheduled import polytope as polytopes
from robustpolish.synthesis.scheduled import robust_state_feedback

# `ScheduledDesign`: a controller that follows measured numbers, and what is proven of it.


@dataclass(frozen=True, eq=False, repr=False)
class ScheduledDesign(Displayed):
    """A controller whose matrices follow numbers of the plant that are measured while it runs.

    Attributes
    ----------
    controllers : tuple of control.StateSpace
        At the vertices; in between they are mixed as the plants are. u = K y with positive sign.
    points : tuple of mapping of str to float
        The numbers at the vertices.
    bound : float
        Proven: the largest ratio of energies of z and w, over all ways that the numbers may go
        within their ranges and rates, in the plants' units, prices and noise included.
    rates : mapping of str to float
        Largest rates of change that the bound allows, in the numbers' units per s; infinite for
        jumps.
    status : {"proven", "time_limit"}
        After "time_limit" the bound is proven too, but another machine may find a better one.
    message : str
        The status in words.
    vertices : Polytope
        The plants.

    Examples
    --------
    A mass on a spring whose stiffness changes from 1 to 9, and is measured:

    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 5.0, range=(1.0, 9.0))
    >>> mass = rp.uncertain.system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
    >>> design = rp.scheduled_feedback(mass, controls=1, control_weight=0.3)
    >>> gains = [design.at({"k": value}).D[0, 0] for value in (1.0, 5.0, 9.0)]
    >>> bool(abs(gains[1] - (gains[0] + gains[2]) / 2) < 1e-9)
    True
    >>> bool(design.closed_loop({"k": 3.0}).poles().real.max() < 0)
    True
    >>> design.plot().get_xlabel()
    'frequency'
    """

    controllers: tuple[control.StateSpace, ...]
    points: tuple[Mapping[str, float], ...]
    bound: float
    rates: Mapping[str, float]
    status: Literal["proven", "time_limit"]
    message: str
    vertices: polytopes.Polytope

    @property
    def plants(self) -> tuple[GeneralizedPlant, ...]:
        """The plants at the vertices, prices and noise included."""
        return self.vertices.plants

    def at(self, values: Mapping[str, float]) -> control.StateSpace:
        """Return the controller at measured numbers.

        Parameters
        ----------
        values : mapping of str to float
            All numbers by name, within their ranges, in their own units.

        Returns
        -------
        control.StateSpace

        Raises
        ------
        InvalidInputError
            If a number is missing, unknown or outside its range.
        """
        return self._mixed(values, self.controllers)

    def closed_loop(self, values: Mapping[str, float]) -> control.StateSpace:
        """Return the loop from w to z at numbers that rest.

        Parameters
        ----------
        values : mapping of str to float

        Returns
        -------
        control.StateSpace
        """
        return self._mixed(values, self._loops())

    def simulate(self, disturbance: xr.Dataset, numbers: Mapping[str, ArrayLike]) -> xr.Dataset:
        """Simulate the loop while its numbers change, and the controller with them.

        Parameters
        ----------
        disturbance : xarray.Dataset
            Over ``time`` in s, uniform; disturbances by name, those that are missing are zero.
        numbers : mapping of str to array_like, shape (samples,), or xarray.Dataset
            All numbers by name, at the same samples, within their ranges.

        Returns
        -------
        xarray.Dataset
            The performance outputs z over ``time``.

        Raises
        ------
        InvalidInputError
            If signals do not fit, or the plant is not continuous.

        Examples
        --------
        >>> import numpy as np
        >>> import xarray as xr
        >>> import robustpolish as rp
        >>> k = rp.uncertain.real("k", 2.0, range=(1.0, 3.0))
        >>> lag = rp.uncertain.system([[-k]], [[1, 1]], [[1]], 0)
        >>> design = rp.scheduled_feedback(lag, controls=1, control_weight=1.0)
        >>> time = np.linspace(0, 5, 101)
        >>> push = xr.Dataset({"u[0]": ("time", np.ones(101))}, coords={"time": time})
        >>> z = design.simulate(push, {"k": 2 + np.sin(time)})
        >>> bool(abs(z["y[0]"]).max() < design.bound)
        True
        """
        plant = self.plants[0]
        if plant.is_discrete:
            remedy = "Step through design.closed_loop({...}) instead."
            raise invalid("design", described("discrete time"), "continuous time", remedy)
        instance_of("disturbance", disturbance, xr.Dataset, "an xarray.Dataset", "Name its signals")
        known_keys((), {str(n): 0 for n in disturbance.data_vars}, plant.disturbance_names)
        time = np.asarray(disturbance["time"], dtype=float)
        zero = np.zeros(time.size)
        inputs = np.stack(
            [np.asarray(disturbance.get(n, zero), dtype=float) for n in plant.disturbance_names],
            axis=1,
        )
        names = tuple(self.points[0])
        known_keys(("numbers",), {str(n): 0 for n in numbers}, names, names)
        tracks = {name: np.asarray(numbers[name], dtype=float).ravel() for name in names}
        for name, track in tracks.items():
            if track.size != time.size:
                shown = described(f"{track.size} samples")
                raise invalid(("numbers", name), shown, f"{time.size} as of time", "Resample it.")
        rows, places = np.unique(np.stack(list(tracks.values())), axis=1, return_inverse=True)
        known = [self._shares(dict(zip(names, row, strict=True))) for row in rows.T.tolist()]
        shares = np.array(known)[places.ravel()]
        loops: list[Any] = [matrices_of(loop) for loop in self._loops()]
        outputs = varying_response(loops, shares, uniform_step(time), inputs).outputs
        signals = {
            name: ("time", outputs[:, i], {"units": plant.units.get(name, "")})
            for i, name in enumerate(plant.performance_names)
        }
        return xr.Dataset(signals, coords={"time": disturbance["time"]})

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the largest gain of the loop over frequency at each corner, and the bound.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            Numbers that move may cost more than any that rest: the bound counts them in.
        """
        gains = {
            name: singular_values(loop).isel(singular_value=0)
            for name, loop in zip(self.vertices.names, self._loops(), strict=True)
        }
        return plot_gains(gains, {"bound": (math.nan, self.bound)}, ax)

    def _mixed(
        self, values: Mapping[str, float], systems: Sequence[control.StateSpace]
    ) -> control.StateSpace:
        """Return the mixture of systems at the vertices that belongs to some numbers."""
        shares, first = self._shares(values), systems[0]
        parts = zip(*(matrices_of(system) for system in systems), strict=True)
        mixed = [np.tensordot(shares, np.array(each), axes=1) for each in parts]
        names = (first.input_labels, first.output_labels, first.state_labels)
        return named_system(mixed, self.plants[0].dt, *names)

    def _shares(self, values: Mapping[str, float]) -> Matrix:
        elements = {element.name: element for element in self.vertices.numbers}
        known_keys(("values",), values, elements, elements)
        for name, element in elements.items():
            slack = 1e-9 * (element.high - element.low)
            if not element.low - slack <= values[name] <= element.high + slack:
                want = f"a number from {element.low:.6g} to {element.high:.6g}"
                remedy = "The controller is proven within its range only."
                raise invalid(("values", name), values[name], want, remedy)
        return self.vertices.weights(values)

    def _loops(self) -> list[control.StateSpace]:
        return [p.closed_loop(K) for p, K in zip(self.plants, self.controllers, strict=True)]

    def _card(self) -> Card:
        rows: list[tuple[str, Any]] = [("gain proven to be at most", self.bound)]
        for element in self.vertices.numbers:
            rate = self.rates[element.name]
            told = "jumps" if np.isinf(rate) else f"{rate:.6g} per s"
            rows.append((element.name, f"{element.low:.6g} to {element.high:.6g}, {told}"))
        rows.append(("states of the controller", self.controllers[0].nstates))
        return Card(f"Scheduled feedback: {self.status}", (quantities(*rows),), (self.message,))


# Output feedback for a polytope of plants whose numbers are measured: a controller per vertex.
#
# With one X and Y for all vertices the changed variables of the controller may differ, and where
# the controls and the measurements see constant matrices everything is affine: the mixture of the
# controllers belongs to the mixture of the plants (Apkarian, Gahinet and Becker 1995).


def scheduled_controllers(
    plants: Sequence[PlantMatrices], solver: ProgramSolver
) -> Iterator[tuple[list[Controller], float]]:
    """Yield a controller for each vertex and the bound claimed for them, small bounds first.

    Parameters
    ----------
    plants : sequence of PlantMatrices
        Scaled, continuous, without D22, with the same B2, C2, D12 and D21.
    solver : ProgramSolver
    """

    def impose(program: SemidefiniteProgram, unknowns: Any, square: Affine) -> None:
        for p, v in zip(plants, unknowns, strict=True):
            program.positive(-bounded_real(loop_terms(p, v), square))

    return controllers_near_optimum(plants, impose, solver, robust_state_feedback.BACK_OFFS)


@single_threaded_blas
def scheduled_feedback(
    plant: UncertainSystem,
    *,
    controls: SignalChoice,
    measurements: SignalChoice | None = None,
    rates: Mapping[str, float] | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    solver: str | None = None,
    time_limit: float = 300.0,
) -> ScheduledDesign:
    r"""Design a controller that is scheduled by the numbers of a plant, for the smallest gain.

    The numbers of a linear parameter-varying plant change with time and are measured. There is a
    controller for each corner of their box, mixed as the plant is, and one Lyapunov matrix for all
    corners proves the loop however fast the numbers move.

    Parameters
    ----------
    plant : UncertainSystem
        With real numbers, each of which is measured. Its matrices depend on a line on each (or on
        a function of it, such as 1 / m).
    controls : int, str or sequence of str
        Which inputs are u, by name, or how many of the last ones.
    measurements : int, str or sequence of str, optional
        Which outputs are y. Without them u = F x, all states measured.
    rates : mapping of str to float, optional
        Largest rates of change of some numbers, in their units per s; what is not named may jump.
        The Lyapunov matrix is then affine in them, which lowers the bound. For output feedback
        rates enter the proof, not the search, and loops of eight and more states take minutes
        there. In continuous time only.
    control_weight : float or array_like, shape (nu,), optional
        Price on u in units of z per unit of u: ``control_weight * u`` joins z.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y in units of y per unit of w, which joins w.
    backend, solver : str, optional
        Who solves the inequalities; "cvxpy" (with Clarabel) or "picos".
    time_limit : float, optional
        Seconds: a safety net for the search, whose work is limited otherwise; the status says if it
        was reached.

    Returns
    -------
    ScheduledDesign

    Raises
    ------
    InvalidInputError
        If the numbers reach the controls or the measurements directly; the message tells how to
        put a filter between. Output feedback in discrete time is refused too.
    InfeasibleError
        If a corner has an unstable mode that no control moves; it is named.
    SolverError
        If no controller was found and proven for the whole box.

    Notes
    -----
    The proof is started again from the loops at the corners: the bounded-real inequality with one
    P, or with P affine in slow numbers and a slack for all, is checked in ball arithmetic at
    every corner and, for each of them, at every corner of the rates. All loops in between are
    mixtures of these. For state feedback and numbers that may jump, scheduling does not lower the
    bound, only the gains: with one Lyapunov matrix, C1 constant and D11 zero, some fixed gain
    reaches as much. It does with bounded rates, and for output feedback.

    References
    ----------
    P. Apkarian, P. Gahinet, G. Becker, "Self-scheduled H-infinity control of linear
    parameter-varying systems: a design example", Automatica 31 (1995). P. Apkarian, R.J. Adams,
    "Advanced gain-scheduling techniques for uncertain systems", IEEE Trans. Control Systems
    Technology 6 (1998), for bounded rates.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 5.0, range=(1.0, 9.0))
    >>> plant = rp.uncertain.system([[0, k], [-1, 0.5]], [[1, 0], [0, 1]], [[1, 0]], 0)
    >>> jumps = rp.scheduled_feedback(plant, controls=1, control_weight=1.0)
    >>> slow = rp.scheduled_feedback(plant, controls=1, control_weight=1.0, rates={"k": 0.1})
    >>> bool(slow.bound < 0.85 * jumps.bound)
    True
    """
    remedy = "Make it with uncertain_real and uncertain_system."
    instance_of("plant", plant, UncertainSystem, "an UncertainSystem", remedy)
    positive("time_limit", time_limit)
    whole = _checked(
        polytopes.polytope(plant, controls, measurements, control_weight), measurements
    )
    if measurements is not None:
        whole = replace(
            whole, plants=tuple(with_measurement_noise(p, measurement_noise) for p in whole.plants)
        )
    elif measurement_noise is not None:
        remedy = "Name measurements=, or leave it out."
        raise invalid("measurement_noise", measurement_noise, "none for state feedback", remedy)
    limits = _rates(whole, rates)
    robust_state_feedback.refuse_uncontrollable_vertices(whole)
    budget = Budget(WORK, time_limit)
    programs = ProgramSolver(backend, solver, budget, polytopes.ACCURACY)
    with progress_bar("Designing for all corners"):
        scaled, vertices = polytopes.scaled_vertices(whole)
        moving = [whole.speed(name) * rate * scaled.time for name, rate in limits.items()]
        family = polytopes.LyapunovFamily.affine(whole.positions, moving)
        specification = polytopes.PolytopeSpecification(family, "hinf", vertices[0].discrete)
        search = robust_state_feedback.GainSearch(vertices, specification, programs, scheduled=True)
        # State feedback is proven for its own candidates, output feedback for controllers.
        if measurements is None:
            ways = ((search.loops(one), one.gains, one.claimed) for one in search.candidates())
        else:
            ways = (
                (
                    [polytopes.output_loop(p, K) for p, K in zip(vertices, made, strict=True)],
                    made,
                    claimed,
                )
                for made, claimed in scheduled_controllers(vertices, programs)
            )
        proven = (
            (controllers, polytopes.prove(loops, specification, programs, claimed))
            for loops, controllers, claimed in ways
        )
        found, bound = next((pair for pair in proven if pair[1] is not None), (None, None))
    if found is None or bound is None:
        text = "No controller was found and proven for the whole box. "
        if budget.late:
            raise SolverError(
                f"{text}The time limit was reached. Raise time_limit, or leave numbers out of "
                "rates= (the bound then holds for jumps of them, which is proven much faster)."
            )
        raise SolverError(
            f"{text}Make the ranges smaller, tell rates= of numbers that move slowly, or give the "
            "problem a price (control_weight) and a noise (measurement_noise)."
        )
    message = "The bound is proven for numbers that move within their ranges"
    message += ", however fast." if all(map(math.isinf, limits.values())) else " and rates."
    if budget.late:
        message += " The time limit was reached: a better one may exist."
    return ScheduledDesign(
        controllers=tuple(_named(scaled, K) for K in found),
        points=whole.points,
        bound=scaled.norm(bound),
        rates=limits,
        status="time_limit" if budget.late else "proven",
        message=message,
        vertices=whole,
    )


def _named(scaled: ScaledPlant, K: Any) -> control.StateSpace:
    """Return a gain of the state or a controller of y in the plant's units.

    The factors are powers of two and round nothing.
    """
    plant = scaled.original
    if not isinstance(K, Controller):
        return plant.static_controller(scaled.state_gain(K))
    states = [f"controller_{i + 1}" for i in range(len(K.A))]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system(scaled.controller(K), plant.dt, *names)


def _checked(whole: polytopes.Polytope, measurements: SignalChoice | None) -> polytopes.Polytope:
    """Return a polytope whose mixtures the controllers follow, or say what to do."""
    if not whole.is_convex_hull:
        raise invalid(
            "plant",
            described("a plant that is not on a line in each number, the others held"),
            "one whose corners mix to all plants of the box",
            'Take functions of its numbers for numbers of their own, such as "k_squared".',
        )
    if any(element.group for element in whole.numbers):
        remedy = "Make each with uncertain_real: each is measured on its own."
        raise invalid("plant", described("an ellipsoid"), "numbers of their own", remedy)
    if measurements is None:
        return polytopes.require_equal(whole.with_full_state(), ("B2", "D12"))
    plant = whole.plants[0]
    if plant.is_discrete:
        remedy = "Design in continuous time, or with state feedback."
        raise invalid("plant", described("discrete time"), "continuous time", remedy)
    if any(p.D22.any() for p in whole.plants):
        remedy = "Put a lag before the controls or behind the measurements."
        raise invalid("plant", described("a D22 that is not zero"), "none from u to y", remedy)
    return polytopes.require_equal(whole, ("B2", "C2", "D12", "D21"))


def _rates(whole: polytopes.Polytope, given: Mapping[str, float] | None) -> dict[str, float]:
    names = [element.name for element in whole.numbers]
    given = {} if given is None else given
    instance_of("rates", given, Mapping, "a mapping of names to rates", 'Write {"k": 0.5}.')
    known_keys(("rates",), given, names)
    if given and whole.plants[0].is_discrete:
        remedy = "Leave rates out: the bound then holds for jumps."
        raise invalid("rates", given, "no rates in discrete time", remedy)
    checked = {name: positive(("rates", name), rate, zero=True) for name, rate in given.items()}
    return {name: checked.get(name, math.inf) for name in names}
