"""The sector of a force that was found: between which slopes it lies up to an amplitude."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy.special import chdtri

from robustpolish.arrays import Vector
from robustpolish.effects import Effect
from robustpolish.identification.findings.machines import effect_of
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import context_values
from robustpolish.validation import described, instance_of, invalid, positive

# Displacements at which a law is looked at, on either side.
_POINTS = 1000
# Velocities in m/s or rad/s, and times in s, at which a law is asked for other dependences.
_VELOCITIES, _TIMES = (0.0, 1.0, -1.0), (0.0, 0.3)


def effect_sector(
    learned: Any, effect: str, amplitude: float, confidence: float = 0.95
) -> tuple[float, float]:
    r"""Return the slopes between which the force of an effect lies up to an amplitude.

    Parameters
    ----------
    learned : Diagnosis, Refit or MechanicalModel
        What a fit found, with the covariance of its numbers; those of a model are certain.
    effect : str
        Such as ``"effect[0]"``, by its place in ``model.effects``: a force that depends on the
        displacement of its place alone.
    amplitude : float
        Largest displacement, in m or rad.
    confidence : float, optional
        Probability that each of the effect's numbers lies in the interval that is allowed for.

    Returns
    -------
    low, high : float
        In N/m or N m/rad: ``low q^2 <= -f(q) q <= high q^2`` for \|q\| up to the amplitude, for
        :func:`robust_sector`.

    Raises
    ------
    InvalidInputError
        If the force depends on more than the displacement, does not vanish with it, or is not
        linear in a number that the data leave uncertain.

    Notes
    -----
    The law is looked at at a thousand displacements on either side, at both ends of each number.
    The numbers of the machine in their ellipsoid and those of the effect in their intervals are all
    true together with a probability of at least one less the sum of what each lacks.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, _ = rp.datasets.sticky_slide()
    >>> model = model.with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 2e6})
    >>> low, high = rp.effect_sector(model, "effect[0]", 0.01)
    >>> round(low), round(high)
    (0, 200)
    """
    model = learned if isinstance(learned, MechanicalModel) else getattr(learned, "model", None)
    remedy = "Pass one of these."
    model = instance_of("learned", model, MechanicalModel, "a diagnosis, refit or model", remedy)
    found = effect_of(model, effect)
    size = positive("amplitude", amplitude)
    if not 0 < confidence < 1:
        raise invalid("confidence", confidence, "a share between 0 and 1", "Write 0.95.")
    spread = _spread(getattr(learned, "covariance", None), effect, confidence)
    linear = {name for item in found.definition.linear_in
              for name in ((item,) if isinstance(item, str) else item)}  # fmt: skip
    bent = [name for name, half in spread.items() if half > 0 and name not in linear]
    if bent:
        shown = described(f"{found}, whose force is not linear in {', '.join(bent)}")
        raise invalid("effect", shown, "a force that is linear in its numbers", "Bound it by hand.")
    q = size * np.concatenate(
        [np.linspace(-1, 0, _POINTS, False), np.linspace(1, 0, _POINTS, False)]
    )
    slopes = []
    for signs in itertools.product((-1.0, 1.0), repeat=len(spread)):
        moved = {
            n: found.values[n] + s * h for s, (n, h) in zip(signs, spread.items(), strict=True)
        }
        slopes.append(_slopes(model, found.with_values(found.values | moved), q))
    every = np.concatenate(slopes)
    return float(every.min()), float(every.max())


def _spread(covariance: Any, key: str, confidence: float) -> dict[str, float]:
    """Return the half widths of the intervals of an effect's numbers."""
    if covariance is None:
        return {}
    half = float(np.sqrt(chdtri(1, 1 - confidence)))
    found = {}
    for i, name in enumerate(covariance["parameter"].values.tolist()):
        if name.startswith(f"{key}."):
            found[name.removeprefix(f"{key}.")] = half * float(np.sqrt(covariance.values[i, i]))
    if not all(np.isfinite(value) for value in found.values()):
        shown = described(f"{key}, whose numbers the data do not see")
        raise invalid("effect", shown, "a force that was measured", "Record what moves it.")
    return found


def _slopes(model: MechanicalModel, effect: Effect, q: Vector) -> Vector:
    """Return minus the force over the displacement."""
    kind = effect.definition
    law = kind.law
    if law is None or kind.ports != 1 or kind.has_memory:
        shown = described(str(effect))
        raise invalid("effect", shown, "a force of one displacement", "Bound it by hand.")
    p = np.array([*effect.values.values(), *context_values(model, effect, 0.0)])

    def force(x: float, v: float, t: float) -> float:
        f = np.zeros(1)
        law(t, np.array([x]), np.array([v]), np.zeros(0), p, f, np.zeros(0))
        return float(f[0])

    values = np.array([force(x, 0.0, 0.0) for x in q.tolist()])
    size = np.abs(values).max()
    others = [
        abs(force(x, v, t) - force(x, 0.0, 0.0))
        for x in (q[0], 0.0) for v in _VELOCITIES for t in _TIMES
    ]  # fmt: skip
    if max(others) > 1e-12 * size or abs(force(0.0, 0.0, 0.0)) > 1e-12 * size:
        shown = described(f"{effect}, which depends on more than the displacement")
        raise invalid("effect", shown, "a force of the displacement alone", "Bound it by hand.")
    return -values / q
