"""The blocks of a system whose signals are sorted into w, u, z and y, and its loop with u = K y."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.arrays import Matrix
from robustpolish.validation import described, invalid, matrix, state_space


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
        known = isinstance(self.system, control.StateSpace)
        return int((self.system if known else self._model()).nstates)

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
        known = isinstance(self.system, control.StateSpace)
        return np.array(getattr(self.system if known else self._model(), name))

    def _model(self) -> control.StateSpace:
        """Return the system if it is one of states, and not a measured response."""
        if isinstance(self.system, control.StateSpace):
            return self.system
        raise invalid(
            "plant",
            described("a frequency response, which has no states"),
            "a model in state space",
            "Fit a model to the response; itself it serves plant.frequency_response only.",
        )


def matrices_of(system: control.StateSpace) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Copy A, B, C and D of a system as floats of consistent shapes."""
    n, m, p = system.nstates, system.ninputs, system.noutputs
    shapes = ((n, n), (n, m), (p, n), (p, m))
    A, B, C, D = (
        np.array(getattr(system, name), dtype=float).reshape(shape)
        for name, shape in zip("ABCD", shapes, strict=True)
    )
    return A, B, C, D


def named_system(
    matrices: Sequence[ArrayLike],
    dt: float | bool,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str] = (),
) -> control.StateSpace:
    """Return the system of A, B, C, D with these names, states without effect kept.

    Parameters
    ----------
    matrices : sequence of array_like
        A, B, C and D.
    dt : float or True
        Sampling time in s; 0 is continuous time.
    inputs, outputs, states : sequence of str
        Names.

    Returns
    -------
    control.StateSpace
    """
    names = {"inputs": list(inputs), "outputs": list(outputs), "states": list(states)}
    A, B, C, D = matrices
    if not names["inputs"]:
        # python-control loses a single row without columns: an input stands in for it.
        n, p = len(names["states"]), len(names["outputs"])
        padded = (A, np.zeros((n, 1)), C, np.zeros((p, 1)))
        names["inputs"] = ["none"]
        system = control.StateSpace(*padded, dt, remove_useless_states=False, **names)
        system.set_inputs([])
        system.B, system.D = np.zeros((n, 0)), np.zeros((p, 0))
        return system
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **names)


def closed_loop(
    plant: PlantBlocks, controller: control.StateSpace | ArrayLike
) -> control.StateSpace:
    """Return the system from w to z; see `GeneralizedPlant.closed_loop`."""
    K = _checked(plant, controller)
    Ak, Bk, Ck, Dk = (np.asarray(M) for M in (K.A, K.B, K.C, K.D))
    loop = np.eye(plant.nu) - Dk @ plant.D22
    condition = np.linalg.cond(loop) if loop.size and np.isfinite(loop).all() else 1.0
    if condition > 1 / np.finfo(float).eps:
        raise invalid(
            "controller",
            described(f"a loop matrix I - Dk D22 with condition {condition:.1e}"),
            "a well-posed loop",
            "Change the controller's feedthrough or the plant's D22.",
        )
    # u = solve(loop, Ck xk + Dk (C2 x + D21 w)), then y follows from u.
    on_x = np.linalg.solve(loop, Dk @ plant.C2)
    on_k = np.linalg.solve(loop, Ck)
    on_w = np.linalg.solve(loop, Dk @ plant.D21)
    A = np.block(
        [
            [plant.A + plant.B2 @ on_x, plant.B2 @ on_k],
            [Bk @ (plant.C2 + plant.D22 @ on_x), Ak + Bk @ plant.D22 @ on_k],
        ]
    )
    B = np.vstack([plant.B1 + plant.B2 @ on_w, Bk @ (plant.D21 + plant.D22 @ on_w)])
    C = np.hstack([plant.C1 + plant.D12 @ on_x, plant.D12 @ on_k])
    D = plant.D11 + plant.D12 @ on_w
    if not all(np.isfinite(M).all() for M in (loop, A, B, C, D)):
        raise invalid(
            "controller",
            described("a loop with entries beyond 1e308"),
            "products of plant and controller that double precision can hold",
            "Choose other units for the signals.",
        )
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
        raise invalid(
            "controller",
            described(f"{controller.ninputs} inputs and {controller.noutputs} outputs"),
            f"{plant.ny} inputs (y) and {plant.nu} outputs (u)",
            "Check measurements= and controls= of the plant.",
        )
    static = controller.nstates == 0
    if not static and controller.dt is not None and controller.dt != plant.dt:
        raise invalid(
            "controller",
            described(f"sampling time {controller.dt}"),
            f"{plant.dt} like the plant",
            "Discretise the plant or the controller first.",
        )
    return controller
