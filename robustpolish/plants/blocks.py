"""The blocks of a system whose signals are sorted into w, u, z and y, and its loop with u = K y."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.arrays import EPS, AnyArray, Matrix, Vector
from robustpolish.base.checks import described, invalid, is_whole, matrix, misfit, state_space
from robustpolish.linear.systems import as_state_space, is_system, named_system


class PlantBlocks:
    """Sizes, matrices and names of a plant, read off its system.

    Attributes
    ----------
    system : control.StateSpace
    measurements, controls : int
        Number of last outputs that are y and of last inputs that are u.
    units : mapping of str to str
        Unit of each named signal or state that has one.
    """

    system: control.StateSpace
    measurements: int
    controls: int
    units: Mapping[str, str]

    @property
    def nx(self) -> int:
        """Number of states."""
        return int(self._model().nstates)

    @property
    def nw(self) -> int:
        """Number of disturbances."""
        return int(self.system.ninputs) - self.controls

    @property
    def nu(self) -> int:
        """Number of controls."""
        return self.controls

    @property
    def nz(self) -> int:
        """Number of performance outputs."""
        return int(self.system.noutputs) - self.measurements

    @property
    def ny(self) -> int:
        """Number of measurements."""
        return self.measurements

    @property
    def A(self) -> Matrix:
        """State matrix, shape (nx, nx)."""
        return self._matrix("A")

    @property
    def B1(self) -> Matrix:
        """Disturbance to state, shape (nx, nw)."""
        return self._matrix("B")[:, : self.nw]

    @property
    def B2(self) -> Matrix:
        """Control to state, shape (nx, nu); the thesis's B."""
        return self._matrix("B")[:, self.nw :]

    @property
    def C1(self) -> Matrix:
        """State to performance, shape (nz, nx)."""
        return self._matrix("C")[: self.nz]

    @property
    def C2(self) -> Matrix:
        """State to measurement, shape (ny, nx); the thesis's C."""
        return self._matrix("C")[self.nz :]

    @property
    def D11(self) -> Matrix:
        """Disturbance to performance, shape (nz, nw); the thesis's D1."""
        return self._matrix("D")[: self.nz, : self.nw]

    @property
    def D12(self) -> Matrix:
        """Control to performance, shape (nz, nu)."""
        return self._matrix("D")[: self.nz, self.nw :]

    @property
    def D21(self) -> Matrix:
        """Disturbance to measurement, shape (ny, nw)."""
        return self._matrix("D")[self.nz :, : self.nw]

    @property
    def D22(self) -> Matrix:
        """Control to measurement, shape (ny, nu)."""
        return self._matrix("D")[self.nz :, self.nw :]

    @property
    def dt(self) -> float | bool:
        """Sampling time in s; 0 in continuous time."""
        return 0 if self.system.dt is None else self.system.dt

    @property
    def is_discrete(self) -> bool:
        """Whether the plant is a discrete-time system."""
        return self.dt != 0

    @property
    def states(self) -> tuple[str, ...]:
        """Names of x."""
        return tuple(self._model().state_labels)

    @property
    def disturbance_names(self) -> tuple[str, ...]:
        """Names of w."""
        return tuple(self.system.input_labels[: self.nw])

    @property
    def control_names(self) -> tuple[str, ...]:
        """Names of u."""
        return tuple(self.system.input_labels[self.nw :])

    @property
    def performance_names(self) -> tuple[str, ...]:
        """Names of z."""
        return tuple(self.system.output_labels[: self.nz])

    @property
    def measurement_names(self) -> tuple[str, ...]:
        """Names of y."""
        return tuple(self.system.output_labels[self.nz :])

    def _matrix(self, name: str) -> Matrix:
        """Copy A, B, C or D of the system."""
        return np.array(getattr(self._model(), name))

    def _model(self) -> control.StateSpace:
        """Return the system if it is one of states, and not a measured response."""
        if isinstance(self.system, control.StateSpace):
            return self.system
        shown = described("a frequency response, which has no states")
        remedy = "Fit a model to the response; itself it serves plant.frequency_response only."
        raise invalid("plant", shown, "a model in state space", remedy)


def matrices_of(system: control.StateSpace) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Copy A, B, C and D of a system as floats of consistent shapes."""
    n, m, p = system.nstates, system.ninputs, system.noutputs
    shapes = ((n, n), (n, m), (p, n), (p, m))
    A, B, C, D = (
        np.array(getattr(system, name), dtype=float).reshape(shape)
        for name, shape in zip("ABCD", shapes, strict=True)
    )
    return A, B, C, D


def chosen_signals(
    system: control.StateSpace,
    outputs: Sequence[int],
    inputs: Sequence[int],
    states: Sequence[int] | None = None,
) -> control.StateSpace:
    """Return a system's part of some outputs, inputs and states, in the given order.

    Parameters
    ----------
    system : control.StateSpace
    outputs, inputs : sequence of int
    states : sequence of int, optional
        All by default.

    Returns
    -------
    control.StateSpace
    """
    A, B, C, D = matrices_of(system)
    x = list(range(len(A)) if states is None else states)
    if states is None:  # B by columns: products depend on the order in memory, in the last bit
        B, C = B[:, inputs], C[outputs]
    else:
        A, B, C = A[np.ix_(x, x)], B[np.ix_(x, inputs)], C[np.ix_(outputs, x)]
    labels = (system.input_labels, system.output_labels, system.state_labels)
    places = zip(labels, (inputs, outputs, x), strict=True)
    names = [[known[i] for i in own] for known, own in places]
    return named_system((A, B, C, D[np.ix_(outputs, inputs)]), system.dt or 0, *names)


def closed_loop(
    plant: PlantBlocks, controller: control.StateSpace | ArrayLike
) -> control.StateSpace:
    """Return the system from w to z; see `GeneralizedPlant.closed_loop`."""
    K = _checked(plant, controller)
    Ak, Bk, Ck, Dk = (np.asarray(M) for M in (K.A, K.B, K.C, K.D))
    loop = np.eye(plant.nu) - Dk @ plant.D22
    condition = np.linalg.cond(loop) if loop.size and np.isfinite(loop).all() else 1.0
    if condition > 1 / EPS:
        shown = described(f"a loop matrix I - Dk D22 with condition {condition:.1e}")
        remedy = "Change the controller's feedthrough or the plant's D22."
        raise invalid("controller", shown, "a well-posed loop", remedy)
    # u = solve(loop, Ck xk + Dk (C2 x + D21 w)), then y follows from u.
    on_x = np.linalg.solve(loop, Dk @ plant.C2)
    on_k = np.linalg.solve(loop, Ck)
    on_w = np.linalg.solve(loop, Dk @ plant.D21)
    through = Bk @ (plant.C2 + plant.D22 @ on_x), Ak + Bk @ plant.D22 @ on_k
    A = np.block([[plant.A + plant.B2 @ on_x, plant.B2 @ on_k], [*through]])
    B = np.vstack([plant.B1 + plant.B2 @ on_w, Bk @ (plant.D21 + plant.D22 @ on_w)])
    C = np.hstack([plant.C1 + plant.D12 @ on_x, plant.D12 @ on_k])
    D = plant.D11 + plant.D12 @ on_w
    if not all(np.isfinite(M).all() for M in (loop, A, B, C, D)):
        shown = described("a loop with entries beyond 1e308")
        want = "products of plant and controller that double precision can hold"
        raise invalid("controller", shown, want, "Choose other units for the signals.")
    taken = set(plant.states)
    extra = [f"{'controller_' if name in taken else ''}{name}" for name in K.state_labels]
    names = (plant.disturbance_names, plant.performance_names, [*plant.states, *extra])
    return named_system((A, B, C, D), plant.dt, *names)


def static_controller(plant: PlantBlocks, gain: ArrayLike) -> control.StateSpace:
    """Return u = K y as a system; see `GeneralizedPlant.static_controller`."""
    K = matrix("controller", gain, (plant.nu, plant.ny))
    return named_system(([], [], [], K), plant.dt, plant.measurement_names, plant.control_names)


def _checked(plant: PlantBlocks, controller: control.StateSpace | ArrayLike) -> control.StateSpace:
    if not isinstance(controller, control.StateSpace):
        return static_controller(plant, controller)
    state_space("controller", controller)
    if (controller.noutputs, controller.ninputs) != (plant.nu, plant.ny):
        shown = described(f"{controller.ninputs} inputs and {controller.noutputs} outputs")
        want = f"{plant.ny} inputs (y) and {plant.nu} outputs (u)"
        raise invalid("controller", shown, want, "Check measurements= and controls= of the plant.")
    static = controller.nstates == 0
    if not static and controller.dt is not None and controller.dt != plant.dt:
        shown, want = f"sampling time {controller.dt}", f"{plant.dt} like the plant"
        raise misfit("controller", shown, want, "Discretise the plant or the controller first.")
    return controller


# A plant that is known by its frequency response only.


def as_response(argument: str, value: Any) -> control.FrequencyResponseData | None:
    """Return a measured response, also one of read_frequency_response; None if it is none."""
    if isinstance(value, xr.DataArray):
        if set(value.dims) != {"frequency", "output", "input"}:
            shown = described(f"an array over {', '.join(map(str, value.dims))}")
            remedy = "Read it with read_frequency_response, and pass one measurement each."
            raise invalid(argument, shown, "frequency, output and input", remedy)
        ordered, hertz = value.transpose("output", "input", ...), value["frequency"].values
        names = {f"{end}s": [str(n) for n in value[end].values] for end in ("output", "input")}
        value = control.FrequencyResponseData(ordered.values, 2 * np.pi * hertz, **names)
    if not isinstance(value, control.FrequencyResponseData):
        return None
    if not (np.isfinite(value.omega).all() and np.isfinite(value.frdata).all()):
        shown = described("a response with values that are not finite")
        raise invalid(argument, shown, "finite values", "Leave out those lines.")
    return value


def interpolate_response(system: control.FrequencyResponseData, omega: Vector) -> AnyArray:
    """Return a measured response at other frequencies, drawn straight between its lines.

    Parameters
    ----------
    system : control.FrequencyResponseData
    omega : ndarray, shape (k,)
        In rad/s, from the first of the lines to the last.

    Returns
    -------
    ndarray of complex, shape (k, outputs, inputs)

    Raises
    ------
    InvalidInputError
        If a frequency lies beyond the lines: nothing is known there.
    """
    order = np.argsort(system.omega)
    lines, values = np.asarray(system.omega)[order], np.asarray(system.frdata)[..., order]
    room = 1e-9 * lines[-1]  # hertz to rad/s and back
    if omega.size and not (lines[0] - room <= omega.min() and omega.max() <= lines[-1] + room):
        hertz = (lines[0] / (2 * np.pi), lines[-1] / (2 * np.pi))
        shown = described(f"{omega.min() / (2 * np.pi):.6g} to {omega.max() / (2 * np.pi):.6g} Hz")
        want = f"frequencies within those measured, {hertz[0]:.6g} to {hertz[1]:.6g} Hz"
        raise invalid("frequency", shown, want, "Measure there, or fit a model.")
    found = [[np.interp(omega, lines, entry) for entry in row] for row in values]
    return np.moveaxis(np.array(found).reshape(*values.shape[:2], omega.size), -1, 0)


# Which signals of a system are controls or measurements: by name or by number.

SignalChoice = int | str | Sequence[str]


def sorted_signals(
    system: Any, measurements: SignalChoice, controls: SignalChoice
) -> tuple[Any, int, int]:
    """Put measurements behind the other outputs and controls behind the other inputs.

    Parameters
    ----------
    system : control.StateSpace or control.FrequencyResponseData
    measurements, controls : int, str or sequence of str
        Number of the last outputs or inputs, or names of some, wherever they stand; they get the
        order in which they are named.

    Returns
    -------
    system : control.StateSpace or control.FrequencyResponseData
        The system itself if nothing had to be moved.
    measurements, controls : int
        Their numbers.

    Raises
    ------
    InvalidInputError
        If a number does not fit, or a name is unknown or doubled.
    """
    outs, ny = _order("measurements", measurements, system.output_labels, "outputs")
    ins, nu = _order("controls", controls, system.input_labels, "inputs")
    if outs == sorted(outs) and ins == sorted(ins):
        return system, ny, nu
    if isinstance(system, control.FrequencyResponseData):
        names = {"inputs": [system.input_labels[i] for i in ins],
                 "outputs": [system.output_labels[i] for i in outs]}  # fmt: skip
        values = np.asarray(system.frdata)[np.ix_(outs, ins)]
        return control.FrequencyResponseData(values, system.omega, **names), ny, nu
    return chosen_signals(system, outs, ins), ny, nu


def _order(argument: str, given: Any, labels: Sequence[str], what: str) -> tuple[list[int], int]:
    """Return the order of all signals with the chosen ones last, and how many these are."""
    count = len(labels)
    whole = is_whole(given)
    if whole and 0 <= given <= count:
        return list(range(count)), int(given)
    if whole or given is None or isinstance(given, bool | float):
        want = f"a whole number from 0 to {count}, the system's number of {what}, or names"
        remedy = f"Count the {what} at the end of the list, or name them."
        raise invalid(argument, given, want, remedy)
    names = chosen_names(argument, given, labels, what)
    chosen = [labels.index(name) for name in names]
    return [*(i for i in range(count) if i not in chosen), *chosen], len(chosen)


def chosen_names(argument: str, given: Any, labels: Sequence[str], what: str) -> list[str]:
    """Return names that are all known and different; a single one may stand for itself."""
    try:
        names = [given] if isinstance(given, str) else list(given)
    except TypeError:
        names = [given]
    listed = ", ".join(labels) or "none"
    for name in names:
        if not isinstance(name, str) or name not in labels:
            want = f"names among the system's {what}: {listed}"
            raise invalid(argument, name, want, "Check its spelling, or give a number of signals.")
    if len(set(names)) != len(names):
        shown = described(f"{', '.join(names)}, with a name twice")
        raise invalid(argument, shown, "different names", "Name each signal once.")
    return names


GivenController = control.StateSpace | control.TransferFunction | ArrayLike


def controller_system(plant: PlantBlocks, controller: GivenController) -> control.StateSpace:
    """Return K of u = K y as a system.

    Parameters
    ----------
    plant : PlantBlocks
    controller : control.StateSpace, control.TransferFunction or array_like, shape (nu, ny)
        A system comes back as it is. A transfer function is realised; its states have no meaning.
        One of several inputs or outputs takes slycot, which realises it with the fewest states.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If it is of another kind, improper or of another shape than the plant needs.
    """
    K: Any = getattr(controller, "controller", controller)  # of a design
    if isinstance(K, control.StateSpace):
        return K
    if not is_system(K):
        return static_controller(plant, K)
    sizes = (getattr(K, "noutputs", None), getattr(K, "ninputs", None))
    if isinstance(K, control.TransferFunction) and sizes != (plant.nu, plant.ny):
        shown = f"a TransferFunction with {sizes[0]} outputs and {sizes[1]} inputs"
        want = f"one with {plant.nu} outputs and {plant.ny} inputs"
        remedy = "It leads from the measurements y to the controls u."
        raise invalid("controller", described(shown), want, remedy)
    # A transfer function without a sampling time takes that of the plant.
    names = (plant.measurement_names, plant.control_names)
    return as_state_space("controller", K, plant.dt, *names)
