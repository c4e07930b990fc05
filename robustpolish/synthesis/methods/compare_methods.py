"""One plant, several methods, one table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.display import Card, Displayed, Table, quantities
from robustpolish.errors import RobustPolishError
from robustpolish.long_calls import Budget, working
from robustpolish.models import GeneralizedPlant
from robustpolish.plotting import plot_gain_against_norm
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.output_feedback import output_feedback
from robustpolish.validation import invalid, one_of, positive

METHODS = ("auto", "riccati", "lmi/cvxpy", "lmi/picos", "slycot")
_HEADER = ("method", "status", "claimed", "achieved", "gain", "condition", "order", "seconds")


@dataclass(frozen=True, eq=False, repr=False)
class MethodResult(Displayed):
    """What one method made of the plant.

    Attributes
    ----------
    method : str
    status : str
        That of the design, or "infeasible", "refused" and "missing" for a method that raised
        an InfeasibleError, another error, or that lacks its solver.
    claimed, achieved : float
        The norm that the method promised and that of its certified loop; not a number
        without a controller.
    gain : float
        Largest entry of the controller's matrices.
    condition : float
        Condition number of the eigenvectors of the loop: how sensitive its poles are.
    order : int
        States of the controller; -1 without one.
    seconds : float
        Wall time.
    message : str
        What the method said.
    design : Design or None

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> result = rp.compare_methods(plant, ["riccati"])["riccati"]
    >>> result.row()[:2], result.design.certificate.valid
    (('riccati', 'optimal'), True)
    >>> result.plot().get_xlabel()
    'frequency'
    """

    method: str
    status: str
    claimed: float
    achieved: float
    gain: float
    condition: float
    order: int
    seconds: float
    message: str
    design: Design | None = field(default=None, repr=False)

    def row(self) -> tuple[Any, ...]:
        """Return the figures in the order of the table's columns.

        Returns
        -------
        tuple
        """
        rounded = [float(f"{x:.2g}") for x in (self.gain, self.condition)]
        order = self.order if self.order >= 0 else None
        figures = (self.claimed, self.achieved, *rounded, order, round(self.seconds, 2))
        return self.method, self.status, *figures

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the frequency response of the design, as :meth:`Design.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        if self.design is None:
            raise invalid("design", None, "a controller to draw", self.message)
        return self.design.plot(ax)

    def _card(self) -> Card:
        rows = tuple(zip(_HEADER[2:], self.row()[2:], strict=True))
        return Card(f"{self.method}: {self.status}", (quantities(*rows),), (self.message,))


@dataclass(frozen=True, eq=False, repr=False)
class MethodComparison(Displayed):
    """The results of several methods on one plant; ``print`` shows them as a table.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    results : tuple of MethodResult

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> [result.method for result in rp.compare_methods(plant, ["riccati", "lmi/cvxpy"])]
    ['riccati', 'lmi/cvxpy']
    """

    norm: Norm
    results: tuple[MethodResult, ...]

    def __iter__(self) -> Iterator[MethodResult]:
        return iter(self.results)

    def __len__(self) -> int:
        return len(self.results)

    def __getitem__(self, method: str) -> MethodResult:
        """Return the result of a method by its name."""
        for result in self.results:
            if result.method == method:
                return result
        raise KeyError(method)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the achieved norm against the controller's gain.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices(
        ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
        ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
        >>> rp.compare_methods(plant, ["riccati"]).plot().get_ylabel()
        'H-infinity norm achieved'
        """
        name = "H-infinity" if self.norm == "hinf" else "H2"
        gain, norm = "largest entry of the controller", f"{name} norm achieved"
        points = xr.Dataset(
            {
                "gain": ("controller", [r.gain for r in self.results], {"long_name": gain}),
                "norm": ("controller", [r.achieved for r in self.results], {"long_name": norm}),
            },
            {"controller": [r.method for r in self.results]},
        )
        return plot_gain_against_norm(points, ax)

    def _card(self) -> Card:
        table = Table("", _HEADER, tuple(r.row() for r in self.results), digits=6)
        why = tuple(f"{r.method}: {r.message}" for r in self.results if r.design is None)
        return Card("", (table,), why)


def compare_methods(
    plant: GeneralizedPlant,
    methods: Sequence[str] = METHODS,
    *,
    norm: Norm = "hinf",
    tolerance: float = 4e-3,
    time_limit: float = 60.0,
) -> MethodComparison:
    """Run several methods of output feedback on one plant and compare what they achieve.

    Parameters
    ----------
    plant : GeneralizedPlant
    methods : sequence of str
        Out of "auto", "riccati", "lmi/cvxpy", "lmi/picos" and "slycot"; a third part names a
        solver, as in "lmi/cvxpy/SCS".
    norm : {"hinf", "h2"}
    tolerance : float
        As for :func:`output_feedback`.
    time_limit : float
        A safety net for each method, in seconds.

    Returns
    -------
    MethodComparison
        Every norm in it is certified; a method that finds no certified controller is listed
        with the reason.

    Raises
    ------
    InvalidInputError
        If a method is not known or an argument does not fit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> table = rp.compare_methods(plant, ["riccati", "lmi/cvxpy"])
    >>> table["riccati"].status, round(table["riccati"].achieved, 1)
    ('optimal', 2.7)
    """
    one_of("norm", norm, ("hinf", "h2"))
    positive("tolerance", tolerance)
    positive("time_limit", time_limit, "s")
    if isinstance(methods, str) or not all(isinstance(name, str) for name in methods):
        raise invalid("methods", methods, "a list of names", f"Choose from {METHODS}.")
    tasks = [(name, *_parsed(name)) for name in methods]
    options = {"norm": norm, "tolerance": tolerance, "time_limit": time_limit}
    results = []
    with working("Comparing methods", len(tasks)) as tell:
        for task in tasks:
            tell(task[0])
            results.append(_run(plant, *task, options))
    return MethodComparison(norm, tuple(results))


def _parsed(name: str) -> tuple[str, str, str | None]:
    """Split a name into method, backend and solver."""
    method, *rest = name.split("/")
    known = {each.split("/")[0] for each in METHODS}
    if method not in known or (rest and method != "lmi") or len(rest) > 2:
        raise invalid("methods", name, f"one of {', '.join(METHODS)}", "Check its spelling.")
    backend = rest[0] if rest else "cvxpy"
    one_of("methods", backend, ("cvxpy", "picos"))
    return method, backend, rest[1] if len(rest) > 1 else None


def _run(
    plant: GeneralizedPlant,
    name: str,
    method: Any,
    backend: str,
    solver: str | None,
    options: dict[str, Any],
) -> MethodResult:
    clock = Budget()
    try:
        design = output_feedback(plant, method=method, backend=backend, solver=solver, **options)
    except RobustPolishError as error:
        kinds = {"InfeasibleError": "infeasible", "MissingDependencyError": "missing"}
        status = kinds.get(type(error).__name__, "refused")
        none = math.nan
        seconds = clock.elapsed
        return MethodResult(name, status, none, none, none, none, -1, seconds, str(error))
    certificate = design.certificate
    _, vectors = np.linalg.eig(np.asarray(design.closed_loop.A))
    return MethodResult(
        method=name,
        status=design.status,
        claimed=float(design.details["claim"]),
        achieved=certificate.achieved,
        gain=certificate.largest_gain,
        condition=float(np.linalg.cond(vectors)) if vectors.size else 1.0,
        order=int(design.controller.nstates or 0),
        seconds=clock.elapsed,
        message=design.message,
        design=design,
    )
