"""`RobustStateFeedback`: one gain for all plants of a polytope, and what is proven of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.display import Card, Displayed, Table, quantities
from robustpolish.models import UncertainSystem
from robustpolish.plotting import plot_bars
from robustpolish.robust import WorstCaseGain
from robustpolish.synthesis.certificate.certificate import Certificate

Lyapunov = Literal["vertices", "common"]
Status = Literal["proven", "vertices only", "time_limit"]


@dataclass(frozen=True, eq=False, repr=False)
class RobustStateFeedback(Displayed):
    """A gain F of u = F x for all plants of a polytope.

    Attributes
    ----------
    gain : ndarray, shape (nu, nx)
        F.
    norm : {"hinf", "h2"}
    bound : float
        Proven for every plant that is meant, in the plants' units, prices included; infinite where
        nothing between the vertices is proven.
    vertex_norms : tuple of float
        What F achieves at each vertex.
    points : tuple of mapping of str to float
        The numbers at the vertices; empty mappings for a list of plants.
    certificates : tuple of Certificate
        Of the loop at each vertex.
    lyapunov : {"vertices", "common"}
        What the search and the proof used.
    time_varying : bool
        Whether the bound holds for plants that change with time, however fast; the H-infinity
        norm is then the largest ratio of energies of z and w.
    worst_case : WorstCaseGain or None
        Of the loop of an uncertain system; None for a list of plants, and for the H2 norm.
    loop : UncertainSystem or None
        That loop.
    status : {"proven", "vertices only", "time_limit"}
        Whether the bound is proven; after "time_limit" it is, but another machine may find a
        better gain.
    message : str
        The status in words, with what was found on the way.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain_real("k", 2.0, percent=50)
    >>> mass = rp.uncertain_system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
    >>> design = rp.robust_state_feedback(mass, controls=1, control_weight=0.3, norm="h2")
    >>> design.status, design.gain.shape, max(design.vertex_norms) <= design.bound
    ('proven', (1, 2), True)
    >>> design.plot().get_xlabel()
    'H2 norm'
    """

    gain: Matrix
    norm: Literal["hinf", "h2"]
    bound: float
    vertex_norms: tuple[float, ...]
    points: tuple[Mapping[str, float], ...]
    certificates: tuple[Certificate, ...]
    lyapunov: Lyapunov
    time_varying: bool
    worst_case: WorstCaseGain | None
    loop: UncertainSystem | None
    status: Status
    message: str

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the norm that the gain achieves at each vertex.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        name = "H-infinity norm" if self.norm == "hinf" else "H2 norm"
        vertices = xr.DataArray(
            list(self.vertex_norms), {"vertex": list(self._names)}, "vertex", name
        )
        return plot_bars(vertices, ax=ax)

    @property
    def _names(self) -> tuple[str, ...]:
        told = [", ".join(f"{k} = {v:.6g}" for k, v in point.items()) for point in self.points]
        return tuple(text or str(i) for i, text in enumerate(told))

    def _card(self) -> Card:
        name = "H-infinity" if self.norm == "hinf" else "H2"
        rows = (
            (f"{name} norm proven to be at most", self.bound),
            ("largest at a vertex", max(self.vertex_norms)),
            ("holds for numbers that change with time", self.time_varying),
        )
        told = Table(
            "",
            ("vertex", "norm"),
            tuple(zip(self._names, self.vertex_norms, strict=True)),
        )
        tables = (quantities(*rows), told)
        return Card(f"Robust state feedback: {self.status}", tables, (self.message,))
