"""Replayed against coupled: what it matters that the brush feels the machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.analysis import hinf_norm
from robustpolish.brush.coupled.near_rest import PLACE, VELOCITY, BrushAtRest
from robustpolish.brush.coupled.run import guided_brush
from robustpolish.brush.physical import disc_motion as disc
from robustpolish.closed_loop.with_brush.carrier import (
    FORCES,
    PLACES,
    SIGNS,
    Carrier,
    Loop,
    carrier,
)
from robustpolish.closed_loop.with_brush.coupled import simulate_coupled
from robustpolish.display import Card, Displayed, Table
from robustpolish.plotting import plot_time_series
from robustpolish.simulation import linear_response
from robustpolish.validation import one_of, positive


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
    >>> brush = rp.simulate_brush(run=1, duration=0.05)
    >>> comparison = rp.compare_coupled(rp.air_bearing(), brush)
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
        largest = np.maximum(moved["replayed"], moved["coupled"]).max()
        return float(moved["difference"].max() / largest)

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
        >>> brush = rp.simulate_brush(run=1, duration=0.02)
        >>> rp.compare_coupled(rp.air_bearing(), brush).plot(signal="F_y").get_ylabel()
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
        return Card(
            "Replayed against coupled", (Table("", columns, tuple(rows)),), (ratio, verdict)
        )


def compare_coupled(
    design: Loop, brush: xr.Dataset, *, tolerance: float = 2e-3, max_passes: int = 5
) -> CoupledComparison:
    """Simulate a loop under the brush twice: forces replayed, and coupled.

    Both runs begin at rest under the first load, so that they differ by the coupling alone. (A loop
    that :func:`robustpolish.simulate` starts unloaded is struck by the load first.)

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        As in :func:`robustpolish.simulate_coupled`.
    brush : xarray.Dataset
        From :func:`robustpolish.simulate_brush`.
    tolerance : float, optional
        As in :func:`robustpolish.simulate_coupled`.
    max_passes : int, optional
        As in :func:`robustpolish.simulate_coupled`.

    Returns
    -------
    CoupledComparison

    Raises
    ------
    InvalidInputError, SolverError
        As :func:`robustpolish.simulate_coupled`.

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
    >>> comparison = rp.compare_coupled(stiff, rp.simulate_brush(run=1, duration=0.1))
    >>> comparison.stiffness_ratio > 100, comparison.replay_is_good_enough(0.01)
    (True, True)
    """
    coupled = simulate_coupled(design, brush, tolerance=tolerance, max_passes=max_passes)
    guided = guided_brush(brush)
    carried = carrier(design, guided.parameters.polishing_force)
    replayed = _replayed(carried, brush, guided.first_force, guided.parameters.polishing_force)
    at_start = BrushAtRest.at(guided.parameters, guided.place[0], guided.start[disc.AXES])
    return CoupledComparison(
        _table(replayed, coupled),
        replayed,
        coupled,
        carried.machine.stiffness,
        at_start.stiffness,
        _loop_gain(carried, at_start),
    )


def _loop_gain(carried: Carrier, contact: BrushAtRest) -> float:
    """Norm from a force on the brush, through the machine and the contact, to the force back."""
    machine, slopes = carried.machine, contact.jacobian[:3]
    answer = slopes[:, PLACE] @ machine.C + slopes[:, VELOCITY] @ machine.C @ machine.A
    loop = control.StateSpace(machine.A, machine.B, answer, np.zeros((3, 3)))
    return float(hinf_norm(loop).value)


def _replayed(
    carried: Carrier, brush: xr.Dataset, first_force: np.ndarray, polishing_force: float
) -> xr.Dataset:
    """Run the loop under the forces that the brush made on a rigid machine."""
    forces = SIGNS * np.column_stack([brush[name].to_numpy() for name in FORCES])
    time = brush["time"].to_numpy()
    inputs = carried.inputs(forces, polishing_force)
    rest = carried.machine.rest(first_force)
    outputs = linear_response(carried.system, time, inputs, rest).outputs
    return carried.labelled(time, outputs).assign({name: brush[name] for name in FORCES})


def _table(replayed: xr.Dataset, coupled: xr.Dataset) -> xr.Dataset:
    names = [*PLACES, *FORCES]
    figures = np.empty((4, len(names)))
    for i, name in enumerate(names):
        first, second = (run[name] - run[name][0] for run in (replayed, coupled))
        apart = float(np.abs(coupled[name] - replayed[name]).max())
        sizes = [float(np.abs(part).max()) for part in (first, second)]
        figures[:, i] = (*sizes, apart, apart / max(*sizes, np.finfo(float).tiny))
    keys = ("replayed", "coupled", "difference", "share")
    columns = {key: ("signal", row) for key, row in zip(keys, figures, strict=True)}
    return xr.Dataset(columns, {"signal": names})
