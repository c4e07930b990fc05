"""A linear model of a nonlinear one near an equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy import optimize

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import described, invalid
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.errors import SolverError
from robustpolish.linear.modes import modes

VectorField = Callable[[Vector, Vector], ArrayLike]

# Untyped on purpose: checkers would read all of scipy's solvers for what it returns.
_root: Any = optimize.root


@dataclass(frozen=True, eq=False, repr=False)
class Linearization(Displayed):
    """A nonlinear model near an equilibrium.

    Attributes
    ----------
    system : control.StateSpace
        dz/dt = A z + B v with y = C z + D v, in deviations from the equilibrium.
    state : ndarray, shape (n,)
        q*.
    control : ndarray, shape (m,)
        u*.
    residual : float
        Largest entry of abs(f(q*, u*)), relative to the sizes of A q* and B u*.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> rp.linearize(lambda q, u: [q[1], -9.81 * np.sin(q[0]) - 0.2 * q[1]], [0.0, 0.0])
    Linearisation about an equilibrium
      variable  equilibrium
      x[0]                0
      x[1]                0
      relative residual 0
    """

    system: control.StateSpace
    state: Vector
    control: Vector
    residual: float

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the poles near the equilibrium.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import numpy as np
        >>> import robustpolish as rp
        >>> rp.linearize(lambda q, u: [q[1], -np.sin(q[0])], [0.0, 0.0]).plot().get_ylabel()
        'frequency [mHz]'
        """
        return modes(self.system).plot(ax)

    def _card(self) -> Card:
        rows = [
            *zip(self.system.state_labels, map(float, self.state), strict=True),
            *zip(self.system.input_labels, map(float, self.control), strict=True),
        ]
        table = Table("", ("variable", "equilibrium"), tuple(rows))
        note = f"relative residual {self.residual:.2g}"
        return Card("Linearisation about an equilibrium", (table,), (note,))


def linearize(
    dynamics: VectorField,
    state: ArrayLike,
    control_value: ArrayLike = (),
    output: VectorField | None = None,
    *,
    find_equilibrium: bool = True,
    scale: ArrayLike | None = None,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> Linearization:
    """Linearise dq/dt = f(q, u), y = g(q, u) about an equilibrium, (10.1) to (10.5).

    The derivatives are central differences extrapolated to step zero (Richardson), with a step
    proportional to each variable's size.

    Parameters
    ----------
    dynamics : callable
        f(q, u) with q of shape (n,) and u of shape (m,); returns shape (n,).
    state : array_like, shape (n,)
        The equilibrium, or a guess of it.
    control_value : array_like, shape (m,), optional
        u*, which is held fixed; empty for an autonomous model of two or more states.
    output : callable, optional
        g(q, u); the state by default.
    find_equilibrium : bool, optional
        Search f(q, u*) = 0 from `state`; otherwise `state` has to be one already.
    scale : array_like, shape (n + m,), optional
        Typical size of each state and control, which sets the differentiation step;
        max(abs(value), 1) by default.
    states, inputs, outputs : sequence of str, optional
        Names of the signals.

    Returns
    -------
    Linearization

    Raises
    ------
    InvalidInputError
        If a shape does not fit, or `state` is no equilibrium.
    SolverError
        If no equilibrium is found.

    Examples
    --------
    A pendulum hanging down, with g/l = 9.81:

    >>> import numpy as np
    >>> import robustpolish as rp
    >>> pendulum = rp.linearize(lambda q, u: [q[1], -9.81 * np.sin(q[0])], [0.1, 0.0])
    >>> print(np.round(pendulum.system.A, 6))
    [[ 0.    1.  ]
     [-9.81  0.  ]]
    """
    q = np.array(state, dtype=float).ravel()
    u = np.array(control_value, dtype=float).ravel()
    n, m = q.size, u.size
    if n == 1 and m == 0:
        # python-control reads a 1 x 0 input matrix as an empty one.
        shown = described("no control for a single state")
        remedy = "Add an input, if only a disturbance that is zero at the equilibrium."
        raise invalid("control_value", shown, "at least one control", remedy)
    size = np.maximum(np.abs(np.concatenate([q, u])), 1.0)
    if scale is not None:
        size = np.array(scale, dtype=float).ravel()
        if size.shape != (n + m,) or not (size > 0).all():
            remedy = "Give one for each state and control."
            raise invalid("scale", scale, f"{n + m} positive sizes", remedy)

    def f(point: Vector) -> Vector:
        value = np.asarray(dynamics(point[:n], point[n:]), dtype=float).ravel()
        if value.shape != (n,):
            shown = described(f"a result of shape {value.shape}")
            remedy = "Return one derivative for each state."
            raise invalid("dynamics", shown, f"shape ({n},), like the state", remedy)
        return value

    def g(point: Vector) -> Vector:
        if output is None:
            return point[:n]
        return np.asarray(output(point[:n], point[n:]), dtype=float).ravel()

    if find_equilibrium and n:  # each state in units of its size
        answer = _root(lambda x: f(np.concatenate([x * size[:n], u])), q / size[:n], tol=1e-12)
        found = answer.x * size[:n]
        if not np.isfinite(found).all():
            raise SolverError(
                f"state: no equilibrium found near {q} ({answer.message}). "
                "Give a better guess, or pass find_equilibrium=False with a known equilibrium."
            )
        q = found
    point = np.concatenate([q, u])
    jacobian = _derivative(f, point, size)
    # What each term of f amounts to: the yardstick for "f is zero", whatever the units.
    yardstick = np.abs(jacobian) @ size
    residual = float(np.max(np.abs(f(point)) / np.where(yardstick > 0, yardstick, 1.0), initial=0))
    if residual > 1e-6:
        shown = described(f"a state with relative residual {residual:.1e}")
        remedy = "Let find_equilibrium search for it, or improve the guess."
        raise invalid("state", shown, "an equilibrium, f(q, u) = 0", remedy)
    output_jacobian = _derivative(g, point, size)
    given = {"states": states, "inputs": inputs, "outputs": outputs}
    names: dict[str, Any] = {key: list(each) for key, each in given.items() if each is not None}
    (A, B), (C, D) = (np.split(M, [n], axis=1) for M in (jacobian, output_jacobian))
    system = control.StateSpace(A, B, C, D, **names)
    return Linearization(system, q, u, residual)


def _derivative(f: Callable[[Vector], Vector], point: Vector, size: Vector) -> Vector:
    """Jacobian by central differences at steps h and h/2, extrapolated to fourth order."""
    rows = f(point).size
    jacobian = np.zeros((rows, point.size))
    for j in range(point.size):
        wide, narrow = (difference(f, point, j, share * size[j]) for share in (1e-3, 5e-4))
        jacobian[:, j] = (4 * narrow - wide) / 3
    return jacobian


def difference(f: Callable[[Vector], Vector], point: Vector, j: int, step: float) -> Vector:
    """Return the slope of f over one variable by a central difference."""
    ahead, behind = point.copy(), point.copy()
    ahead[j] += step
    behind[j] -= step
    return (f(ahead) - f(behind)) / (ahead[j] - behind[j])
