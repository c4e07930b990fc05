"""A plant with two forces and three sensors, and blocks of every kind on it."""

import control
import numpy as np

import robustpolish as rp


def plant():
    """Return a random plant with named signals and units."""
    rng = np.random.default_rng(0)
    A, B, C = (rng.normal(size=shape) for shape in ((4, 4), (4, 2), (3, 4)))
    G = control.StateSpace(A, B, C, 0, inputs=["F", "M"], outputs=["x", "v", "p"])
    units = {"F": "N", "M": "N m", "x": "m", "v": "m/s", "p": "Pa"}
    return rp.GeneralizedPlant.from_loop(G, units=units)


def blocks():
    """Return series, shared numbers, a structure, a given filter and a free state space."""
    k = rp.tunable.tunable("k", 0.5, low=0.1, high=3.0)
    return [
        rp.tunable.pid("x", "F", Kp=k) * rp.tunable.notch() * rp.tunable.low_pass(),
        rp.tunable.lead_lag("v", "M", gain=k)
        * rp.tunable.low_pass(order=1)
        * control.tf([1, 2], [1, 5]),
        rp.tunable.static_gain(["x", "p"], ["F", "M"], structure=[[1, 0], [1, 1]]),
        rp.tunable.fixed_order("p", ["F", "M"], order=2, sign=-1) * rp.tunable.pid(kind="PI"),
    ]
