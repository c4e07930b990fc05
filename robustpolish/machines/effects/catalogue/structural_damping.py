"""Damping inside a material: the loss of a cycle grows with its amplitude squared, not its rate.

Hysteretic damping, a complex stiffness k (1 + j eta), is a law over frequency: no force in time
that knows the past alone answers to it. Reid's force does: it opposes the motion in proportion to
the displacement, and takes the same energy out of a harmonic motion, pi eta k A^2 per cycle, if
its coefficient is pi/2 eta k.
"""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * abs(q[0]) * np.sign(v[0])


KIND = EffectKind(
    kind="structural_damping",
    title="Structural (hysteretic) damping",
    domain="pair",
    # Neither linear_in nor scan: at one frequency and one amplitude it is a viscous damper, so that
    # a diagnosis does not try it. Fits and simulations take it.
    parameters=(Parameter("loss", "F/L", "pi/2 times loss factor times stiffness", lower=0.0),),
    law=_law,
    sharp=True,
    looks_like="Damping ratios that are the same at every frequency and amplitude; small third "
    "harmonics in the force.",
    checks=(
        "Joints, rubber and composites at this place.",
        "Shake at two frequencies with one amplitude: the energy lost per cycle stays.",
    ),
    references=(
        "Reid (1956), Free vibration and hysteretic damping, J. Royal Aeronautical Society 60, 283",
        "Crandall (1970), The role of damping in vibration theory, J. Sound and Vibration 11, 3-18",
    ),
)
