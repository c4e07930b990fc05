"""Units for synthesis: states, inputs, outputs and time scaled by powers of two, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from robustpolish.arrays import Vector
from robustpolish.display import Card, Displayed, Table
from robustpolish.exact.exponents import refuse_beyond, scaled, within_doubles
from robustpolish.exact.realisation import (
    Realisation,
    named_like,
    power_of_two,
    realisation,
    size,
    state_scales,
    typical_rate,
)
from robustpolish.plotting import plot_bars
from robustpolish.validation import described, invalid, matrix

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
    >>> _, scaling = rp.scale_system(plant)
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
        >>> scaled, scaling = rp.scale_system(rp.air_bearing().open_loop)
        >>> scaling.plot().get_ylabel()
        'variable'
        """
        names, values = zip(*self._named(), strict=True)
        return plot_bars(
            xr.DataArray(
                np.array(values), {"variable": list(names)}, "variable", "scale, in SI units"
            ),
            ax=ax,
        )

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
            raise invalid(
                "system",
                described(f"{found} states, inputs, outputs"),
                f"{sizes}, as the scaling has",
                "Scale this system with scale_system.",
            )
        scaled = in_units(model, self)
        return named_like(system, scaled.A, scaled.B, scaled.C, scaled.D)

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
        return named_like(
            controller,
            self.time * K.A,
            self.time * matrix("controller.B", K.B, (K.states, Y.size)) / Y,
            U[:, None] * matrix("controller.C", K.C, (U.size, K.states)),
            U[:, None] * K.D / Y,
        )


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
    >>> scaled, scaling = rp.scale_system(plant)
    >>> bool(abs(scaled.A).max() < 4)
    True
    >>> F = scaling.state_gain([[1.0, 2.0]])
    """
    model = realisation("system", system)
    m, p = model.B.shape[1], model.C.shape[0]
    columns = _grouped("input_groups", input_groups, m)
    rows = _grouped("output_groups", output_groups, p)
    scaling = even_scales(model, columns, rows)
    return scaling.apply(system), scaling


def in_units(model: Realisation, scaling: Scaling) -> Realisation:
    """Return the matrices in scaled variables and time."""
    with within_doubles("system", model.matrices):
        return _in_units(model, scaling)


def _in_units(model: Realisation, scaling: Scaling) -> Realisation:
    T, U, Y, time = scaling.state, scaling.inputs, scaling.outputs, scaling.time
    return replace(
        model,
        A=scaled(model.A, T, 1 / T[:, None], 1 / time),
        B=scaled(model.B, U, 1 / T[:, None], 1 / time),
        C=scaled(model.C, T, 1 / Y[:, None]),
        D=scaled(model.D, U, 1 / Y[:, None]),
        time=model.time * time,
    )


def even_scales(
    model: Realisation, columns: list[NDArray[np.intp]], rows: list[NDArray[np.intp]]
) -> Scaling:
    """Choose the scales for plain matrices and complete groups of signals."""
    with within_doubles("system", model.matrices):
        scaling = _even(model, columns, rows)
        refuse_beyond(*_in_units(model, scaling).matrices.values())
    return scaling


def _even(
    model: Realisation, columns: list[NDArray[np.intp]], rows: list[NDArray[np.intp]]
) -> Scaling:
    A, B, C, D = model.A, model.B, model.C, model.D
    T, U, Y, time = np.ones(A.shape[0]), np.ones(B.shape[1]), np.ones(C.shape[0]), 1.0
    if T.size:
        unit = power_of_two(float(np.abs(A).max()))
        T = _states(scaled(A, 1 / unit), 0 * B, 0 * C)
        if not model.discrete:
            time = power_of_two(typical_rate(scaled(A, 1 / unit, T, 1 / T[:, None]))) * unit
    for _ in range(4):
        scaled_B, scaled_C = scaled(B, 1 / T[:, None], 1 / time), scaled(C, T)
        scaled_D = scaled(D, 1 / Y[:, None])
        for group in columns:
            U[group] = 1 / power_of_two(_size(scaled_B[:, group], scaled_D[:, group]))
        scaled_D = scaled(D, U)
        for group in rows:
            Y[group] = power_of_two(_size(scaled_C[group], scaled_D[group]))
        if T.size:
            T = _states(scaled(A, 1 / time), scaled(B, U, 1 / time), scaled(C, 1 / Y[:, None]))
    return Scaling(T, U, Y, time)


def _states(A: Vector, B: Vector, C: Vector) -> Vector:
    scales, signal = state_scales(A, B, C)
    return scales / signal if signal > 0 else scales


def _size(through_states: Vector, direct: Vector) -> float:
    """Return the norm by which a signal is scaled: through the states if it reaches them."""
    return size(through_states) or size(direct)


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
