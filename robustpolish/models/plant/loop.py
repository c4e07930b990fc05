"""A plant with its controller: u = K y connected, and K as a system with the plant's names."""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.models.plant.blocks import PlantBlocks
from robustpolish.models.plant.systems import named_system
from robustpolish.validation import described, invalid, matrix, state_space


def closed_loop(
    plant: PlantBlocks, controller: control.StateSpace | ArrayLike
) -> control.StateSpace:
    """Return the system from w to z; see `GeneralizedPlant.closed_loop`."""
    K = _checked(plant, controller)
    Ak, Bk, Ck, Dk = (np.asarray(M) for M in (K.A, K.B, K.C, K.D))
    loop = np.eye(plant.nu) - Dk @ plant.D22
    if np.linalg.cond(loop) > 1 / np.finfo(float).eps:
        raise invalid(
            "controller",
            described(f"a loop matrix I - Dk D22 with condition {np.linalg.cond(loop):.1e}"),
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
