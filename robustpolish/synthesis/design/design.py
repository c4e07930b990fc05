"""What every synthesis returns: a controller, its loop, and what is known about both."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import control
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.analysis import singular_values, stability
from robustpolish.display import Card, Displayed, Table, quantities
from robustpolish.models import GeneralizedPlant
from robustpolish.plotting import plot_gains
from robustpolish.saved_file import Fields, read_saved, write_saved
from robustpolish.synthesis.certificate.certificate import Certificate
from robustpolish.synthesis.design.design_file import design_content, design_fields
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.problem.pole_regions import PoleRegion


@dataclass(frozen=True, eq=False, repr=False)
class Design(Displayed):
    """A certified controller.

    Attributes
    ----------
    plant : GeneralizedPlant
        The plant that the controller was designed for, in its own units.
    controller : control.StateSpace
        K in u = K y; for a state feedback K is static and y is the state.
    closed_loop : control.StateSpace
        The system from w to z.
    norm : {"hinf", "h2"}
        The norm that was minimised.
    status : str
        "optimal": within the tolerance of `lower_bound`; "suboptimal": certified, but no
        claim of optimality (a constrained, nonconvex or stopped search);
        "infimum_not_attained": the infimum is only approached, by ever larger gains or by a
        limit; "time_limit": the best certified controller when the safety net in seconds stopped
        the search, so that another machine may find another one.
    message : str
        What happened, and what to try next.
    certificate : Certificate
        Computed afresh from the closed loop.
    method : str
        "lmi", "riccati", ...
    backend : str
        The library that solved it: "cvxpy", "picos", "slycot", "scipy", ...
    elapsed : float
        Seconds.
    history : tuple of mapping
        One entry per step of the search (such as per axis, or per gamma).
    details : mapping
        What the method wants to tell besides: diagnosis, observer gain, ...
    lower_bound : float or None
        A norm below which no controller of this kind comes, computed in double precision (how, is
        in the message); None if none is known.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.given_controller(plant, [[-3.0]])
    Design (given): suboptimal
      plant               1 states, 1 controls, 1 measurements
      controller          a static gain
      H-infinity norm     0.5, proven to be at most 0.500005
      largest entry of K  3
      certificate         valid
      seconds             ...
      This controller was given; it is certified, not optimised.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    closed_loop: control.StateSpace
    norm: Literal["hinf", "h2"]
    status: Status
    message: str
    certificate: Certificate
    method: str
    backend: str
    elapsed: float
    history: tuple[Mapping[str, Any], ...] = ()
    details: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    lower_bound: float | None = None

    @property
    def gain(self) -> NDArray[np.float64] | None:
        """The matrix K of a static controller, shape (nu, ny); None for a dynamic one."""
        return np.array(self.controller.D) if self.controller.nstates == 0 else None

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the design to one JSON file, whole or not at all.

        Parameters
        ----------
        path : path
            Ends in ``.json``; its folder has to exist.
        force : bool, optional
            Replace an existing file.

        Raises
        ------
        InvalidInputError
            If the file exists and `force` is not set, or it cannot be written there.

        Examples
        --------
        >>> import os, tempfile
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> design = rp.given_controller(plant, [[-3.0]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     design.save(os.path.join(folder, "design.json"))
        ...     again = rp.Design.load(os.path.join(folder, "design.json"))
        >>> again.certificate.valid, float(again.gain[0, 0])
        (True, -3.0)
        """
        write_saved(path, "design", design_content(self), force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Design:
        """Read a design from a file, and certify it again: the file is not believed.

        Parameters
        ----------
        path : path
            A file that :meth:`save` wrote.

        Returns
        -------
        Design
            Plant, controller and what the method told are those of the file; closed loop, poles,
            norm and proof are computed anew.

        Raises
        ------
        InvalidInputError
            If it is no such file, or if its controller does not earn a certificate for the norm
            that the file claims.

        Examples
        --------
        See :meth:`save`.

        >>> import robustpolish as rp
        >>> rp.Design.load("missing.json")
        Traceback (most recent call last):
        ...
        robustpolish.errors.InvalidInputError: path: got missing.json (No such file or directory)...
        """
        return design_from(read_saved(path, "design"))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the largest singular value from w to z without and with control.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            For the H-infinity norm, with the certified norm at its peak.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.given_controller(plant, [[-3.0]]).plot().get_xlabel()
        'frequency'
        """
        open_loop = self.plant.open_loop
        without = "without control" + ("" if stability(open_loop) else " (unstable)")
        unit = self._gain_unit()
        loops = {without: open_loop, "with control": self.closed_loop}
        grids = [singular_values(loop)["frequency"].values for loop in loops.values()]
        gains = {
            name: singular_values(loop, np.unique(np.concatenate(grids)))
            .isel(singular_value=0)
            .assign_attrs(units=unit)
            for name, loop in loops.items()
        }
        achieved, peak = self.certificate.achieved, self.certificate.peak_frequency
        mark = {} if peak is None else {f"norm {achieved:.4g}": (peak / (2 * np.pi), achieved)}
        return plot_gains(gains, mark, ax, first_style=0)

    def plot_poles(
        self, ax: Axes | None = None, *, regions: PoleRegion | Sequence[PoleRegion] | None = None
    ) -> Axes:
        """Draw the closed-loop poles, and the regions that they were to lie in.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        regions : HalfPlane, Disk, Sector or a sequence of them, optional
            By default the regions that were demanded of the design.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.given_controller(plant, [[-3.0]]).plot_poles().get_ylabel()
        'frequency [mHz]'
        """
        demanded = self.details.get("pole_regions", ()) if regions is None else regions
        return self.certificate.plot(ax, regions=demanded)

    def _gain_unit(self) -> str:
        """Return the unit of the gain from w to z, if all z and all w have one each."""
        known = self.plant.units
        z = {known[name] for name in self.plant.performance_names if name in known}
        w = {known[name] for name in self.plant.disturbance_names if name in known}
        return f"{z.pop()}/{w.pop()}" if len(z) == len(w) == 1 else ""

    def _card(self) -> Card:
        c, plant, order = self.certificate, self.plant, self.controller.nstates
        name = "H-infinity" if self.norm == "hinf" else "H2"
        rows = (
            ("plant", f"{plant.nx} states, {plant.nu} controls, {plant.ny} measurements"),
            ("controller", f"{order} states" if order else "a static gain"),
            (f"{name} norm", f"{c.achieved:.6g}, proven to be at most {c.bound:.6g}"),
            ("largest entry of K", f"{c.largest_gain:.6g}"),
            ("certificate", "valid" if c.valid else "NOT valid"),
            ("seconds", f"{self.elapsed:.2g}"),
        )
        if self.lower_bound is not None:
            below = (f"no {name} norm below", f"{self.lower_bound:.6g}")
            rows = (*rows[:3], below, *rows[3:])
        tables = [quantities(*rows)]
        if self.details.get("elements"):
            found = [
                (e.kind, " and ".join(e.between), e.coefficient, e.unit)
                for e in self.details["elements"]
            ]
            head = ("element", "between", "coefficient", "unit")
            tables.append(Table("Springs and dampers", head, tuple(found)))
        solved = self.backend not in ("none", self.method)
        how = f"{self.method}, {self.backend}" if solved else self.method
        notes = [self.message]
        if c.exact_delays is not None:
            notes.append(f"The certificate is {c.exact_delays}.")
        return Card(f"Design ({how}): {self.status}", tuple(tables), tuple(notes))


def design_from(fields: Fields) -> Design:
    """Return the design in a file that has been opened; see :meth:`Design.load`."""
    return Design(**design_fields(fields))
