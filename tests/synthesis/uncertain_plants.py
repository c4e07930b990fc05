"""Uncertain plants with weights, their measurements and controls last."""

import control
import numpy as np

import robustpolish as rp


def column():
    """Skogestad, Morari and Doyle (1988): the distillation column, w and z of two signals."""
    gains = np.array([[87.8, -86.4], [108.2, -109.6]])
    lag = control.ss(control.tf(1, [75, 1]))
    error = control.ss(control.tf([1, 0.2], [0.5, 1]))
    errors = rp.uncertain.append(
        *(error * rp.uncertain.dynamics(name) for name in ("first", "second"))
    )
    machine = control.ss(gains * control.append(lag, lag)) * (np.eye(2) + errors)
    weight = control.ss(control.tf([0.5, 0.05], [1, 1e-6]))
    left = np.array([[1.0, 0, -1, 0], [0, 1, 0, -1]]) * rp.uncertain.append(np.eye(2), machine)
    weights = rp.uncertain.append(control.append(weight, weight), np.eye(2))
    return weights * (np.vstack([np.eye(2), np.eye(2)]) * left)


def two_masses(low=0.9, high=1.1, damper=0.05):
    """Two masses of 1 kg joined by a spring: force on the first, position of the second.

    The benchmark of Wie and Bernstein (1992) with a little damping; w is a force on the second
    mass and a noise of half a metre, z the position of the second mass and the force.
    """
    k, c = rp.uncertain.real("k", 1.0, range=(low, high)), damper
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k, k, -c, c], [k, -k, c, -c]]
    return rp.uncertain.system(
        A,
        [[0, 0, 0], [0, 0, 0], [0, 0, 1], [1, 0, 0]],
        [[0, 1, 0, 0], [0, 0, 0, 0], [0, 1, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 0.5, 0]],
        inputs=["push", "noise", "force"],
        outputs=["position", "effort", "measured"],
    )


def lag():
    """A lag whose gain is known to 20 %, with a push, a noise and a price."""
    b = rp.uncertain.real("b", 1.0, percent=20)
    return rp.uncertain.system(
        [[-0.1]],
        [[1.0, 0.0, b]],
        [[1.0], [0.0], [1.0]],
        [[0, 0, 0], [0, 0, 0.5], [0, 0.1, 0]],
        inputs=["push", "noise", "u"],
        outputs=["x", "price", "y"],
    )
