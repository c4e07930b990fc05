"""One plant, several methods, one table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robustpolish.errors import RobustPolishError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.deadline import Deadline
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.output_feedback import output_feedback
from robustpolish.validation import invalid, one_of, positive

METHODS = ("auto", "riccati", "lmi/cvxpy", "lmi/picos", "slycot")
_HEADER = ("method", "status", "claimed", "achieved", "gain", "condition", "order", "seconds")


@dataclass(frozen=True, eq=False)
class MethodResult:
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


@dataclass(frozen=True, eq=False)
class MethodComparison:
    """The results of several methods on one plant; ``print`` shows them as a table.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    results : tuple of MethodResult
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

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """The table's rows as text, without the header."""
        return tuple(
            (
                r.method,
                r.status,
                _number(r.claimed),
                _number(r.achieved),
                _number(r.gain, 2),
                _number(r.condition, 2),
                str(r.order) if r.order >= 0 else "-",
                f"{r.seconds:.2f}",
            )
            for r in self.results
        )

    def __str__(self) -> str:
        table = [_HEADER, *self.rows]
        widths = [max(len(row[i]) for row in table) for i in range(len(_HEADER))]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in table
        ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{name}</th>" for name in _HEADER)
        body = "".join(
            "<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in self.rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def plot(self, ax: Any = None) -> Any:
        """Plot the achieved norm against the controller's gain.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        import matplotlib.pyplot as plt

        if ax is None:
            _, ax = plt.subplots()
        for result in self.results:
            if math.isfinite(result.achieved):
                ax.plot(result.gain, result.achieved, "o", label=result.method)
        ax.set_xscale("log")
        positive_norms = [r.achieved for r in self.results if r.achieved > 0]
        if positive_norms and max(positive_norms) > 10 * min(positive_norms):
            ax.set_yscale("log")
        ax.set_xlabel("largest entry of the controller")
        name = "H-infinity" if self.norm == "hinf" else "H2"
        ax.set_ylabel(f"{name} norm achieved")
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
        return ax


def compare_methods(
    plant: GeneralizedPlant,
    methods: Sequence[str] = METHODS,
    *,
    norm: Norm = "hinf",
    tolerance: float = 4e-3,
    time_limit: float = 5.0,
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
        Seconds for each method.

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
    >>> from robustpolish import compare_methods
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> table = compare_methods(plant, ["riccati", "lmi/cvxpy"])
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
    return MethodComparison(norm, tuple(_run(plant, *task, options) for task in tasks))


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
    clock = Deadline(math.inf)
    try:
        design = output_feedback(plant, method=method, backend=backend, solver=solver, **options)
    except RobustPolishError as error:
        kinds = {"InfeasibleError": "infeasible", "MissingDependencyError": "missing"}
        status = kinds.get(type(error).__name__, "refused")
        nothing = math.nan
        return MethodResult(
            name, status, nothing, nothing, nothing, nothing, -1, clock.elapsed, str(error)
        )
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


def _number(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"
