"""State-space matrices as plain arrays, their units and their decoupled parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray
from scipy import linalg
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from robustpolish.base.arrays import EPS, Matrix, Vector
from robustpolish.base.checks import described, invalid, matrix, positive, square
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.linear.arithmetic.exact import (
    FloatRangeError,
    power_of_two,
    range_errors_as_input_errors,
    refuse_extreme,
    refuse_out_of_range,
    rescaled,
    scaled,
    size,
    state_scales,
    typical_rate,
)
from robustpolish.linear.systems import Realisation, named_like, realisation
from robustpolish.plots.charts import plot_bars
from robustpolish.plots.frequency import plot_over_frequency

# Split a system into parts that share no state, input or output; norms are taken part by part.


@dataclass(frozen=True)
class Block:
    """Indices of one decoupled part of a system.

    Attributes
    ----------
    states, inputs, outputs : tuple of int
        Ascending; each may be empty.
    """

    states: tuple[int, ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


def decoupled_blocks(
    A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike | None = None, *, tolerance: float = 0.0
) -> tuple[Block, ...]:
    """Find the connected components of a system's graph.

    States, inputs and outputs are nodes; an entry that is not zero joins two
    of them. The system is, after a permutation, block diagonal in these parts,
    so each can be analysed or designed alone.

    Parameters
    ----------
    A : array_like, shape (n, n)
        State matrix.
    B : array_like, shape (n, m)
        Input matrix; for a generalised plant all inputs, (B1, B2).
    C : array_like, shape (p, n)
        Output matrix; for a generalised plant all outputs.
    D : array_like, shape (p, m), optional
        Feedthrough; zero by default.
    tolerance : float, optional
        An entry couples if it is larger in magnitude. Zero, the default, keeps
        the split exact; a larger value has a meaning only for scaled matrices.

    Returns
    -------
    tuple of Block
        Ordered by the first state; parts without states come last.

    Raises
    ------
    InvalidInputError
        If the shapes do not fit or an entry is not finite.

    Examples
    --------
    >>> from robustpolish.linear import decoupled_blocks
    >>> A, B, C = [[-1, 0], [0, -2]], [[1, 0], [0, 1]], [[0, 1]]
    >>> for block in decoupled_blocks(A, B, C):
    ...     print(block)
    Block(states=(0,), inputs=(0,), outputs=())
    Block(states=(1,), inputs=(1,), outputs=(0,))
    """
    A = square("A", A)
    n = A.shape[0]
    B, C = matrix("B", B, (n, None)), matrix("C", C, (None, n))
    m, p = B.shape[1], C.shape[0]
    D = np.zeros((p, m)) if D is None else matrix("D", D, (p, m))
    tolerance = positive("tolerance", tolerance, zero=True)
    graph = np.zeros((n + m + p, n + m + p), dtype=bool)
    graph[:n, :n] = np.abs(A) > tolerance
    graph[:n, n : n + m] = np.abs(B) > tolerance
    graph[n + m :, :n] = np.abs(C) > tolerance
    graph[n + m :, n : n + m] = np.abs(D) > tolerance
    count, labels = connected_components(csr_array(graph), directed=False)
    kinds = (labels[:n], labels[n : n + m], labels[n + m :])
    blocks = [
        Block(*(tuple(np.flatnonzero(kind == label).tolist()) for kind in kinds))
        for label in range(count)
    ]
    return tuple(sorted(blocks, key=lambda b: (not b.states, b.states, b.inputs, b.outputs)))


def parts(model: Realisation) -> list[Realisation]:
    """Split a system into its decoupled blocks."""
    return [part for part, _ in parts_with_indices(model)]


def parts_with_indices(model: Realisation) -> list[tuple[Realisation, tuple[int, ...]]]:
    """Split a system into its decoupled blocks; tell which states each has."""
    if _is_one_part(model):
        return [(model, tuple(range(model.states)))]
    found = []
    for block in decoupled_blocks(model.A, model.B, model.C, model.D):
        x, u, y = block.states, block.inputs, block.outputs
        places = {"A": (x, x), "B": (x, u), "C": (y, x), "D": (y, u)}
        own = {name: M[np.ix_(*places[name])] for name, M in model.matrices.items()}
        found.append((replace(model, **own), x))
    return found


def _is_one_part(model: Realisation) -> bool:
    """Say, sooner than by components, whether all states are coupled and no signal is idle."""
    A, B, C = model.A, model.B, model.C

    def full(M: Matrix) -> bool:
        return np.count_nonzero(M) == M.size  # quicker than `all`

    if not ((full(B) or B.any(axis=0).all()) and (full(C) or C.any(axis=1).all())):
        return False
    if model.states and full(A):
        return True
    joined, reached, count = A != 0, np.arange(model.states) == 0, 0
    while count < (found := int(np.count_nonzero(reached))):
        count = found
        reached |= joined[reached].any(axis=0) | joined[:, reached].any(axis=1)
    return 0 < model.states == count


def parts_with_states(model: Realisation) -> list[tuple[Realisation, tuple[int, ...]]]:
    """Split the states alone, whatever the inputs and outputs join; tell which is where."""
    none = np.zeros((0, model.states))
    return parts_with_indices(replace(model, B=none.T, C=none, D=np.zeros((0, 0))))


# State scaling for an accurate frequency response, as the thesis's section 10.5 uses it.


@dataclass(frozen=True, eq=False, repr=False)
class Prescaled(Displayed):
    """A system with scaled states, and what the scaling gained.

    Attributes
    ----------
    system : control.StateSpace
        A_s = T_L A T_R, B_s = T_L B, C_s = C T_R, D_s = D (thesis 10.46 to 10.51).
    left, right : ndarray, shape (n, n)
        T_L and T_R, diagonal, of powers of two, inverse to each other; x = T_R x_s.
    frequency : ndarray, shape (k,)
        Where the accuracy was estimated, in rad/s.
    accuracy_before, accuracy_after : ndarray, shape (k,)
        Relative error of the frequency response to be expected from rounding errors of
        the size of each matrix's norm.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rp.linear.prescale(control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0))
    Prescaled system
      states                   2
      worst accuracy before  ...
      worst accuracy after   ...
    """

    system: control.StateSpace
    left: Vector
    right: Vector
    frequency: Vector
    accuracy_before: Vector
    accuracy_after: Vector

    def state_gain(self, gain: ArrayLike) -> Vector:
        """Map a state feedback of the scaled system back, D_c = D_c^s T_R^-1 (thesis 10.60).

        Parameters
        ----------
        gain : array_like, shape (m, n)
            F_s, found for the scaled system.

        Returns
        -------
        ndarray, shape (m, n)

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> scaled = rp.linear.prescale(control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0))
        >>> scaled.state_gain([[1.0, 2.0]]).shape
        (1, 2)
        """
        return matrix("gain", gain, (None, self.left.shape[0])) @ self.left

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the accuracy of the frequency response before and after.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> plant = control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0)
        >>> rp.linear.prescale(plant).plot().get_ylabel()
        'relative error to expect'
        """
        accuracies = {"as it came": self.accuracy_before, "prescaled": self.accuracy_after}
        curves = xr.Dataset(
            {name: ("frequency", values) for name, values in accuracies.items()},
            {"frequency": self.frequency / (2 * np.pi)},
        )
        return plot_over_frequency(curves, "relative error to expect", ax)

    def _card(self) -> Card:
        rows = (
            ("states", int(self.left.shape[0])),
            ("worst accuracy before", float(self.accuracy_before.max(initial=0.0))),
            ("worst accuracy after", float(self.accuracy_after.max(initial=0.0))),
        )
        return Card("Prescaled system", (quantities(*rows, digits=3),))


def prescale(system: control.StateSpace, band: Sequence[float] | None = None) -> Prescaled:
    r"""Scale the states by powers of two for the most accurate frequency response.

    Algorithms that rotate the states leave errors of the rounding unit times
    the norm of each whole matrix. To first order they change the response at a frequency by

    .. math:: \epsilon\, \bigl(\|C R\| (\|A\| + \omega) \|R B\| + \|C\| \|R B\|
              + \|C R\| \|B\| + \|D\|\bigr)

    in Frobenius norms, where :math:`R = (i\omega I - A)^{-1}`; relative to the norm of the
    response that is the accuracy. Starting from the balanced states, each scale is halved or
    doubled as long as the worst accuracy over the band falls. The result is never worse than the
    system as it came. The idea is that of MATLAB's `prescale`, not its algorithm.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete.
    band : (float, float), optional
        Lowest and highest frequency that matter, in rad/s, above 0. By default from a third of the
        slowest pole to three times the fastest.

    Returns
    -------
    Prescaled

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, or the band is not two ascending positive numbers
        (in discrete time, below the Nyquist frequency).

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> plant = control.ss([[0, 1], [-1e8, -10]], [[0], [1]], [[1, 0]], 0)
    >>> scaled = rp.linear.prescale(plant)
    >>> bool(scaled.accuracy_after.max() < 0.01 * scaled.accuracy_before.max())
    True
    """
    model = realisation("system", system)
    refuse_extreme("system", model.matrices)
    frequency = _frequencies(model, band)
    even, _ = state_scales(model.A, model.B, model.C)
    try:
        accuracy = _accuracy(model, frequency, even)
    except np.linalg.LinAlgError:  # an undamped pole on the grid: look beside it
        accuracy = _accuracy(model, frequency * (1 + 1e-6), even)

    def worst(scales: Vector) -> float:
        """Return what the search minimises: the worst accuracy, then the mean as a tie-break."""
        finite = accuracy(scales)
        finite = finite[np.isfinite(finite)]
        return float(np.log(finite.max()) + 0.01 * np.log(finite).mean()) if finite.size else 0.0

    one, (alone, _) = np.ones(model.states), state_scales(model.A, 0 * model.B, 0 * model.C)
    scales = min((one, alone, even), key=worst)
    best = worst(scales)
    for _ in range(40):
        before = best
        for i, factor in product(range(scales.size), (0.5, 2.0, 0.125, 8.0)):
            trial = scales.copy()
            trial[i] *= factor
            value = worst(trial)
            if value < best - 1e-9:
                scales, best = trial, value
        if best >= before - 1e-6:
            break
    A, B, C = model.A * scales / scales[:, None], model.B / scales[:, None], model.C * scales
    found = named_like(model.source, (A, B, C, model.D), model.source.dt)
    left, right = np.diag(1 / scales), np.diag(scales)
    return Prescaled(found, left, right, frequency, accuracy(one), accuracy(scales))


def _accuracy(model: Realisation, frequency: Vector, even: Vector) -> Callable[[Vector], Vector]:
    """Return the relative accuracy at each frequency as a function of scales, x = scales * x_s."""
    s = np.exp(1j * frequency * model.step) if model.discrete else 1j * frequency
    # The resolvent in even units; scaling only weighs the squares of what is in the estimate.
    resolvent = s[:, None, None] * np.eye(model.states) - model.A * even / even[:, None]
    B = np.broadcast_to((model.B / even[:, None]).astype(complex), (s.size, *model.B.shape))
    C = np.broadcast_to((model.C * even).T.astype(complex), (s.size, *model.C.T.shape))
    RB = np.linalg.solve(resolvent, B) * even[:, None]
    CR = np.linalg.solve(resolvent.transpose(0, 2, 1), C) / even[:, None]
    gain = np.linalg.norm(model.C @ RB + model.D, axis=(1, 2))
    RB_squares, CR_squares = np.sum(np.abs(RB) ** 2, axis=2), np.sum(np.abs(CR) ** 2, axis=2)
    A_squares, direct, point = model.A**2, float(np.linalg.norm(model.D)), np.abs(s)
    B_squares, C_squares = np.sum(model.B**2, axis=1), np.sum(model.C**2, axis=0)

    def accuracy(scales: Vector) -> Vector:
        squares = scales**2
        A = np.sqrt(np.sum(A_squares * squares / squares[:, None]))
        B, C = np.sqrt(np.sum(B_squares / squares)), np.sqrt(np.sum(C_squares * squares))
        RB, CR = np.sqrt(RB_squares @ (1 / squares)), np.sqrt(CR_squares @ squares)
        error = EPS * (CR * (A + point) * RB + C * RB + CR * B + direct)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(error > 0, error / gain, EPS)

    return accuracy


def _frequencies(model: Realisation, band: Sequence[float] | None) -> Vector:
    highest = np.pi / model.step if model.discrete else np.inf
    if band is None:
        low, high = _default_band(model)
        return np.geomspace(min(low, highest / 2), min(high, highest), 60)
    try:
        low, high = (float(edge) for edge in band)
    except (TypeError, ValueError):
        low = high = np.nan
    if not 0 < low < high <= highest or not np.isfinite(high):
        limit = f" up to {highest:.6g} rad/s" if model.discrete else ""
        want = f"(lowest, highest), two ascending positive frequencies{limit}"
        raise invalid("band", described(repr(band)), want, "Give the band in rad/s.")
    return np.geomspace(low, high, 60)


def _default_band(model: Realisation) -> tuple[float, float]:
    if model.states == 0:
        return 0.1, 10.0
    even = rescaled(model)
    poles = np.linalg.eigvals(even.A).astype(complex) * even.time
    if model.discrete:
        poles = np.log(poles[poles != 0]) / model.step
    rates = np.abs(poles)
    rates = rates[rates > 1e-12 * rates.max(initial=0.0)]
    if rates.size == 0:
        return 0.1 / model.step, 3.0 / model.step
    low, high = float(rates.min() / 3), float(3 * rates.max())
    if not (low > 0 and math.isfinite(high)):
        raise FloatRangeError
    return low, high


# Units for synthesis: states, inputs, outputs and time scaled by powers of two, and back.

Groups = Sequence[Sequence[int]]


@dataclass(frozen=True, eq=False, repr=False)
class Scaling(Displayed):
    """Scales of a system's variables; every one is a power of two, so nothing is rounded.

    A variable is its scale times the scaled variable: x = state * x_s,
    u = inputs * u_s, y = outputs * y_s. Scaled time is t_s = time * t. So::

        A_s = T^-1 A T / time       B_s = T^-1 B U / time
        C_s = Y^-1 C T              D_s = Y^-1 D U

    with T, U, Y the diagonal matrices of the scales. In the thesis's notation (10.46) T is
    T_R and its inverse T_L. The transfer matrices obey G(i w) = Y G_s(i w / time) U^-1: a
    closed-loop norm from inputs to outputs that each share one scale is the scaled norm times
    output scale over input scale (an H2 norm in continuous time also times the root of `time`).

    Attributes
    ----------
    state, inputs, outputs : ndarray of float, shapes (n,), (m,), (p,)
        Scale of each variable, in its unit.
    time : float
        Scaled rates times `time` are rates in 1/s; 1 in discrete time.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> plant = control.ss([[0, 1], [-1e12, -1e3]], [[0], [1e9]], [[1, 0]], 0)
    >>> _, scaling = rp.linear.scale_system(plant)
    >>> scaling.state.shape, scaling.time > 1
    ((2,), True)

    Gains and controllers that were found for the scaled system are mapped back:

    >>> scaled = scaling.apply(plant)
    >>> bool(abs(scaled.A).max() < 4)
    True
    >>> scaling.state_gain([[1.0, 1.0]]).shape, scaling.output_gain([[1.0]]).shape
    ((1, 2), (1, 1))
    >>> scaling.controller(control.ss([[-1.0]], [[1.0]], [[1.0]], 0)).nstates
    1
    """

    state: Vector
    inputs: Vector
    outputs: Vector
    time: float = 1.0

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the scale of every variable.

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
        >>> scaled, scaling = rp.linear.scale_system(rp.air_bearing().open_loop)
        >>> scaling.plot().get_ylabel()
        'variable'
        """
        names, values = zip(*self._named(), strict=True)
        where, what = {"variable": list(names)}, "scale, in SI units"
        return plot_bars(xr.DataArray(np.array(values), where, "variable", what), ax=ax)

    def _named(self) -> list[tuple[str, float]]:
        kinds = (("state", self.state), ("input", self.inputs), ("output", self.outputs))
        found = [(f"{kind} {i}", float(x)) for kind, scales in kinds for i, x in enumerate(scales)]
        return [*found, ("time, as a rate", self.time)]

    def _card(self) -> Card:
        return Card("Scaling", (Table("", ("variable", "scale"), tuple(self._named())),))

    def apply(self, system: control.StateSpace) -> control.StateSpace:
        """Return the system in scaled variables, with its names; `dt` stays as it is.

        Parameters
        ----------
        system : control.StateSpace

        Returns
        -------
        control.StateSpace

        Raises
        ------
        InvalidInputError
            If the numbers of states, inputs or outputs differ from those of the scales.
        """
        model = realisation("system", system)
        sizes = (self.state.size, self.inputs.size, self.outputs.size)
        found = (model.states, model.B.shape[1], model.C.shape[0])
        if sizes != found:
            shown, want = f"{found} states, inputs, outputs", f"{sizes}, as the scaling has"
            remedy = "Scale this system with scale_system."
            raise invalid("system", described(shown), want, remedy)
        scaled = in_units(model, self)
        return named_like(model.source, (*scaled.matrices.values(),), model.source.dt)

    def state_gain(self, gain: ArrayLike, inputs: Sequence[int] | None = None) -> Vector:
        """Map a state feedback u_s = F_s x_s to u = F x, F = U F_s T^-1 (thesis 10.60).

        Parameters
        ----------
        gain : array_like, shape (number of `inputs`, n)
            F_s, found for the scaled system.
        inputs : sequence of int, optional
            Which inputs of the system are the controls; all by default.

        Returns
        -------
        ndarray, shape (number of `inputs`, n)
        """
        U = self.inputs[_chosen("inputs", inputs, self.inputs.size)]
        return U[:, None] * matrix("gain", gain, (U.size, self.state.size)) / self.state

    def output_gain(
        self,
        gain: ArrayLike,
        inputs: Sequence[int] | None = None,
        outputs: Sequence[int] | None = None,
    ) -> Vector:
        """Map an output feedback u_s = K_s y_s to u = K y, K = U K_s Y^-1.

        Parameters
        ----------
        gain : array_like, shape (number of `inputs`, number of `outputs`)
            K_s, found for the scaled system.
        inputs, outputs : sequence of int, optional
            Which inputs are the controls and which outputs the measurements; all by default.

        Returns
        -------
        ndarray, shape (number of `inputs`, number of `outputs`)
        """
        U = self.inputs[_chosen("inputs", inputs, self.inputs.size)]
        Y = self.outputs[_chosen("outputs", outputs, self.outputs.size)]
        return U[:, None] * matrix("gain", gain, (U.size, Y.size)) / Y

    def controller(
        self,
        controller: control.StateSpace,
        inputs: Sequence[int] | None = None,
        outputs: Sequence[int] | None = None,
    ) -> control.StateSpace:
        """Map a dynamic controller from y_s to u_s to one from y to u, in real time.

        Parameters
        ----------
        controller : control.StateSpace
            Found for the scaled system: as many inputs as `outputs`, outputs as `inputs`.
        inputs, outputs : sequence of int, optional
            Which inputs of the system are the controls and which outputs the measurements.

        Returns
        -------
        control.StateSpace
        """
        K = realisation("controller", controller)
        U = self.inputs[_chosen("inputs", inputs, self.inputs.size)]
        Y = self.outputs[_chosen("outputs", outputs, self.outputs.size)]
        B = self.time * matrix("controller.B", K.B, (K.states, Y.size)) / Y
        C = U[:, None] * matrix("controller.C", K.C, (U.size, K.states))
        return named_like(K.source, (self.time * K.A, B, C, U[:, None] * K.D / Y), K.source.dt)


def scale_system(
    system: control.StateSpace,
    *,
    input_groups: Groups | None = None,
    output_groups: Groups | None = None,
) -> tuple[control.StateSpace, Scaling]:
    """Choose units in which the matrices of a system are as even as they can be.

    Time is scaled by the geometric mean of the pole magnitudes, each group of
    signals to unit gain, the states by balancing them together with the signals.
    The scaled system of a system in other units (any powers of two) is the same
    up to a factor of two or so in each variable.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete (then time is left alone).
    input_groups, output_groups : sequence of sequences of int, optional
        Signals of one group share one scale. By default each signal has its own.
        An H-infinity or H2 norm survives scaling only up to a factor, so give the
        disturbances as one group and the performance outputs as another.

    Returns
    -------
    scaled : control.StateSpace
        The system in scaled variables; in scaled time, if continuous.
    scaling : Scaling
        The scales, and the way back for gains and controllers.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, or a group repeats a signal or names one that is not there.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> plant = control.ss([[0, 1], [-1e12, -1e3]], [[0], [1e9]], [[1, 0]], 0)
    >>> scaled, scaling = rp.linear.scale_system(plant)
    >>> bool(abs(scaled.A).max() < 4)
    True
    >>> F = scaling.state_gain([[1.0, 2.0]])
    """
    model = realisation("system", system)
    m, p = model.B.shape[1], model.C.shape[0]
    columns = _grouped("input_groups", input_groups, m)
    rows = _grouped("output_groups", output_groups, p)
    scaling = equilibrating_scales(model, columns, rows)
    return scaling.apply(system), scaling


def in_units(model: Realisation, scaling: Scaling) -> Realisation:
    """Return the matrices in scaled variables and time."""
    T, U, Y, time = scaling.state, scaling.inputs, scaling.outputs, scaling.time
    with range_errors_as_input_errors("system", model.matrices):
        return replace(
            model,
            A=scaled(model.A, T, 1 / T[:, None], 1 / time),
            B=scaled(model.B, U, 1 / T[:, None], 1 / time),
            C=scaled(model.C, T, 1 / Y[:, None]),
            D=scaled(model.D, U, 1 / Y[:, None]),
            time=model.time * time,
        )


def equilibrating_scales(
    model: Realisation, columns: list[NDArray[np.intp]], rows: list[NDArray[np.intp]]
) -> Scaling:
    """Choose the scales for plain matrices and complete groups of signals."""
    A, B, C, D = model.A, model.B, model.C, model.D
    T, U, Y, time = np.ones(A.shape[0]), np.ones(B.shape[1]), np.ones(C.shape[0]), 1.0

    def even_states(A: Vector, B: Vector, C: Vector) -> Vector:
        scales, signal = state_scales(A, B, C)
        return scales / signal if signal > 0 else scales

    with range_errors_as_input_errors("system", model.matrices):
        if T.size:
            unit = power_of_two(float(np.abs(A).max()))
            T = even_states(scaled(A, 1 / unit), 0 * B, 0 * C)
            if not model.discrete:
                time = power_of_two(typical_rate(scaled(A, 1 / unit, T, 1 / T[:, None]))) * unit
        for _ in range(4):
            scaled_B, scaled_C = scaled(B, 1 / T[:, None], 1 / time), scaled(C, T)
            # A signal is scaled by its gain through the states, or else by the direct one.
            direct = scaled(D, 1 / Y[:, None])
            for group in columns:
                U[group] = 1 / power_of_two(size(scaled_B[:, group]) or size(direct[:, group]))
            direct = scaled(D, U)
            for group in rows:
                Y[group] = power_of_two(size(scaled_C[group]) or size(direct[group]))
            if T.size:
                even = scaled(A, 1 / time), scaled(B, U, 1 / time), scaled(C, 1 / Y[:, None])
                T = even_states(*even)
        scaling = Scaling(T, U, Y, time)
        refuse_out_of_range(*in_units(model, scaling).matrices.values())
    return scaling


def _chosen(argument: str, indices: Sequence[int] | None, count: int) -> NDArray[np.intp]:
    if indices is None:
        return np.arange(count)
    chosen = np.asarray(indices)
    whole = chosen.size == 0 or np.issubdtype(chosen.dtype, np.integer)
    if not whole or chosen.ndim != 1 or ((chosen < 0) | (chosen >= count)).any():
        want = f"indices from 0 to {count - 1}"
        raise invalid(argument, indices, want, "Count from zero, in the order of the system.")
    return chosen.astype(np.intp)


def _grouped(argument: str, groups: Groups | None, count: int) -> list[NDArray[np.intp]]:
    """Return the groups, with the signals of none each in its own."""
    given = [] if groups is None else [_chosen(argument, group, count) for group in groups]
    seen = [int(i) for group in given for i in group]
    if len(seen) != len(set(seen)):
        raise invalid(argument, groups, "groups without common signals", "Name each once.")
    return [g for g in given if g.size] + [np.array([i]) for i in range(count) if i not in seen]


def border_scale(A: Matrix, reach: Vector, seen: Vector) -> Vector:
    """Return powers of two that balance A with all inputs and all outputs as one more state.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    reach, seen : ndarray, shape (n,)
        Sizes of the rows of B and of the columns of C.

    Returns
    -------
    ndarray, shape (n,)
    """
    n = A.shape[0]
    size = np.zeros((n + 1, n + 1))
    size[:n, :n], size[:n, n], size[n, :n] = np.abs(A), reach, seen
    if not n or not np.isfinite(size).all():
        return np.ones(n)
    # SciPy casts permutation indices that were never set, and may complain about their values.
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(size, permute=False, separate=True)
    found = np.asarray(scale, dtype=float)
    return found[:n] / found[n]
