"""`ScheduledDesign`: a controller that follows measured numbers, and what is proven of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.analysis import singular_values
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.display import Card, Displayed, quantities
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of, named_system
from robustpolish.plotting import plot_gains
from robustpolish.simulation.linear_response import uniform_step
from robustpolish.simulation.varying_response import varying_response
from robustpolish.synthesis.polytopes.vertices import Polytope
from robustpolish.validation import described, instance_of, invalid, known_keys


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
    >>> k = rp.uncertain_real("k", 5.0, range=(1.0, 9.0))
    >>> mass = rp.uncertain_system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
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
    vertices: Polytope

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
        share = self._shares(values)
        first = self.controllers[0]
        parts = [matrices_of(K) for K in self.controllers]
        names = (first.input_labels, first.output_labels, first.state_labels)
        return named_system(_mixed(share, parts), self.plants[0].dt, *names)

    def closed_loop(self, values: Mapping[str, float]) -> control.StateSpace:
        """Return the loop from w to z at numbers that rest.

        Parameters
        ----------
        values : mapping of str to float

        Returns
        -------
        control.StateSpace
        """
        share = self._shares(values)
        loops = self._loops()
        first = loops[0]
        names = (first.input_labels, first.output_labels, first.state_labels)
        return named_system(
            _mixed(share, [matrices_of(loop) for loop in loops]), self.plants[0].dt, *names
        )

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
        >>> k = rp.uncertain_real("k", 2.0, range=(1.0, 3.0))
        >>> lag = rp.uncertain_system([[-k]], [[1, 1]], [[1]], 0)
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
        inputs = np.stack(
            [
                np.asarray(disturbance[name], dtype=float)
                if name in disturbance
                else np.zeros(time.size)
                for name in plant.disturbance_names
            ],
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
        units = plant.units
        return xr.Dataset(
            {
                name: ("time", outputs[:, i], {"units": units.get(name, "")})
                for i, name in enumerate(plant.performance_names)
            },
            coords={"time": disturbance["time"]},
        )

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


def _mixed(shares: Matrix, parts: list[Any]) -> list[Matrix]:
    """Return the mixture of matrices, one of each kind."""
    return [np.tensordot(shares, np.array(each), axes=1) for each in zip(*parts, strict=True)]
