"""A spring and a damper in a row beside what the model has: a force that relaxes."""

from __future__ import annotations

from collections.abc import Mapping

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan

_FAR = 100.0
"""Times by which a fit may move a relaxation time."""


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z is the force, which begins relaxed; p: stiffness, relaxation time, spring beside it, step
    f[0] = -z[0]
    dz[0] = p[0] * v[0] - z[0] / max(p[1], p[3], 1e-300)


def _near(values: Mapping[str, float]) -> tuple[float, float]:
    # one that relaxes at once is a damper, one that never does a spring
    return values["time"] / _FAR, values["time"] * _FAR


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return abs(values["stiffness"]), 0.0, 1 / max(values["time"], 1e-300)


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    # at most its spring alone, or its damper alone
    return (values["stiffness"] * max(min(q, values["time"] * v), 1e-6 * q),)


KIND = EffectKind(
    kind="maxwell_element",
    title="Relaxation (Maxwell element)",
    domain="pair",
    parameters=(
        Parameter("stiffness", "F/L", "stiffness of its spring", lower=0.0),
        Parameter(
            "time",
            "T",
            "relaxation time: its damping over its stiffness",
            lower=0.0,
            fit_bounds=_near,
        ),
    ),
    law=_law,
    linear_in=("stiffness",),
    scan=(Scan("time", (1, -1), (0.1, 0.25, 0.6, 1.5, 4.0)),),
    gains=_gains,
    state_sizes=_state_sizes,
    states=1,
    # Without a spring beside it, where it drags a machine that drifts, it could be any slow force.
    context=("spring_stiffness", "step"),
    looks_like="A stiffness that grows with frequency and a damping that falls, at every "
    "amplitude the same.",
    checks=(
        "Rubber, glue, cables, fluid films and eddy currents at this place.",
        "Step the position and wait: the force falls back over the relaxation time.",
    ),
    references=("Inman (2017), Vibration with Control, section 2.7, Wiley",),
)
