"""The viscous damper that takes as much energy out of a cycle as something else does.

Signs: an energy that is lost counts as positive. Frequencies are in rad/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robustpolish.base.checks import described, instance_of, invalid, positive
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.effects.kind import Motion

_SAMPLES = 8192
_CYCLES = 6
"""Cycles before an effect with memory has forgotten how it started."""
_SETTLED = 1e-3
"""Largest share by which the last two of them may differ."""
_IDEAL = ("mobility", "step", "clearance")
"""Context that limits what a step in time can resolve, or what others at the place give: 0 is the
law alone."""

Loss = float | Effect


def energy_per_cycle(effect: Effect, amplitude: float, frequency: float) -> float:
    """Return the energy that an effect takes out of a cycle of a harmonic motion.

    The force is integrated along q = A sin(w t) at the place of the effect, in the steady state of
    its memory if it has one.

    Parameters
    ----------
    effect : Effect
        Between two degrees of freedom, or one and ground.
    amplitude : float
        A of the relative displacement, in m (rad).
    frequency : float
        w in rad/s.

    Returns
    -------
    float
        In J; negative if the effect puts energy in.

    Raises
    ------
    InvalidInputError
        If amplitude or frequency is not above 0, if the effect acts on a signal, on two axes, or
        depends on anything but this motion, or if its memory does not settle.

    References
    ----------
    Inman (2014), Engineering vibration, section 2.7; M.L. Postma, Polishing robot: vibrations due
    to impact, section 5.1.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.effects import Effect
    >>> friction = Effect("coulomb_friction", "x", {"force": 3.0})
    >>> round(rp.effects.energy_per_cycle(friction, amplitude=0.01, frequency=100.0), 6)  # 4 F A
    0.12
    """
    A = positive("amplitude", amplitude, "m")
    w = positive("frequency", frequency, "rad/s")
    remedy = "Build one with robustpolish.effects.Effect(...)."
    instance_of("effect", effect, Effect, "an Effect", remedy)
    kind = effect.definition
    if kind.domain not in ("pair", "dof") or kind.ports != 1:
        got = described(f"{kind.kind}, which acts on {kind.domain} with {kind.ports} ports")
        raise invalid("effect", got, "a force along one motion", "Take another effect.")
    needs = [name for name in kind.context if name not in _IDEAL]
    if needs or kind.line is not None:
        got = described(f"{kind.kind}, which needs {', '.join(needs) or 'a time of its own'}")
        raise invalid("effect", got, "a force by displacement and speed", "Take another effect.")
    cycles = _CYCLES if kind.has_memory else 1
    phase = 2 * math.pi * np.arange(cycles * _SAMPLES + 1) / _SAMPLES
    q, v = A * np.sin(phase)[None], A * w * np.cos(phase)[None]
    power = -force_with(kind, effect.values, Motion(phase / w, q, v))[0] * v[0]
    # The motion is periodic: the mean over a cycle converges faster than any other rule.
    each = power[:-1].reshape(cycles, _SAMPLES).mean(axis=1) * 2 * math.pi / w
    change = float(np.ptp(each[-2:]))
    if not np.isfinite(each).all() or change > _SETTLED * abs(each[-1]):
        got = described(f"{each[-1]:.4g} J in cycle {cycles}, {change:.4g} J from the one before")
        raise invalid("effect", got, "a steady loss per cycle", "Check its parameters.")
    return float(each[-1])


def equivalent_damping(losses: Loss | Sequence[Loss], amplitude: float, frequency: float) -> float:
    """Return the viscous damping that loses as much energy per cycle, (5.6) of the thesis.

    c = sum of the losses / (pi w A^2), because a damper loses pi c w A^2 in a cycle of
    A sin(w t).

    Parameters
    ----------
    losses : float, Effect or sequence of these
        Energies lost per cycle in J, or effects such as those of a model, whose energies
        :func:`energy_per_cycle` gives.
    amplitude : float
        A, in m (rad).
    frequency : float
        w, in rad/s.

    Returns
    -------
    float
        c in N s/m (N m s/rad). It depends on amplitude and frequency, except for viscous damping.

    Raises
    ------
    InvalidInputError
        As :func:`energy_per_cycle`.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (5.6) and (5.7).

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.effects import Effect
    >>> air = Effect("quadratic_damping", "x", {"coefficient": 2.0})
    >>> c = rp.effects.equivalent_damping(air, amplitude=0.01, frequency=100.0)
    >>> round(c, 4)  # 8/(3 pi) b w A
    1.6977
    >>> round(rp.effects.equivalent_damping([air, 0.12], 0.01, 100.0), 4)  # and dry friction of 3 N
    5.5174
    """
    A = positive("amplitude", amplitude, "m")
    w = positive("frequency", frequency, "rad/s")
    several = [losses] if isinstance(losses, int | float | np.number | Effect) else losses
    instance_of("losses", several, Sequence, "energies in J or effects", "Write [0.1, effect].")
    total = 0.0
    for i, loss in enumerate(several):
        if isinstance(loss, Effect):
            total += energy_per_cycle(loss, A, w)
        else:
            total += positive(("losses", i), loss, "J", zero=True)
    return total / (math.pi * w * A**2)


def share_damping(share: float, stiffness: float, frequency: float) -> float:
    """Return the viscous damping that loses a share of the spring's energy, (8.23) of the thesis.

    c = n k / (2 pi w): (5.6) with n times the largest energy k A^2 / 2. The amplitude cancels. A
    body on the spring that swings at w then has the damping ratio n / (4 pi).

    Parameters
    ----------
    share : float
        n, lost per cycle; 0.001 in the thesis.
    stiffness : float
        k in N/m (N m/rad).
    frequency : float
        w in rad/s.

    Returns
    -------
    float
        c in N s/m (N m s/rad).

    Raises
    ------
    InvalidInputError
        If a value is negative, or the frequency 0.

    Examples
    --------
    >>> import math
    >>> import robustpolish as rp
    >>> p = rp.polishing.AirBearingParameters()
    >>> omega_D = p.natural_frequencies()["x"][1]
    >>> round(rp.effects.share_damping(0.001, p.k_x, omega_D), 4)  # c_D of section 9.1
    0.0389
    """
    n = positive("share", share, zero=True)
    k = positive("stiffness", stiffness, "N/m", zero=True)
    return n * k / (2 * math.pi * positive("frequency", frequency, "rad/s"))


def loss_damping(loss_factor: float, stiffness: float, frequency: float) -> float:
    """Return the viscous damping of a complex stiffness k (1 + j eta) at one frequency.

    c = eta k / w. Structural damping loses pi eta k A^2 per cycle at every frequency, so that it is
    a share n = 2 pi eta of the energy; a viscous damper does so at w alone.

    Parameters
    ----------
    loss_factor : float
        eta.
    stiffness : float
        k in N/m (N m/rad).
    frequency : float
        w in rad/s.

    Returns
    -------
    float
        c in N s/m (N m s/rad).

    Raises
    ------
    InvalidInputError
        If a value is negative, or the frequency 0.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.effects.loss_damping(0.01, 1e6, 1000.0)
    10.0
    """
    eta = positive("loss_factor", loss_factor, zero=True)
    k = positive("stiffness", stiffness, "N/m", zero=True)
    return eta * k / positive("frequency", frequency, "rad/s")
