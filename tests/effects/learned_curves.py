"""Learned laws made of known curves, with known errors."""

import numpy as np

from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.learned_law import LearnedLaw
from robustpolish.machines.effects.spline_law import learned_name, spline_basis


def learned_law_of(
    curve, low=-1.1, high=1.0, count=25, over="stiffness", share=0.002, seed=0, at="x"
):
    """The law whose curve is nearest to a function, its coefficients off by a share of its size."""
    x = np.linspace(low, high, 800)
    basis = spline_basis(x, low, high, count, over != "stiffness")
    c = np.linalg.lstsq(basis.T, curve(x), rcond=None)[0]
    error = share * float(np.max(np.abs(curve(x))))
    c = c + error * np.random.default_rng(seed).standard_normal(count)
    values = {f"c{j + 1}": float(value) for j, value in enumerate(c)}
    effect = Effect(learned_name(over, count), at, {"low": low, "high": high, **values})
    return LearnedLaw(effect, error**2 * np.eye(count))


def surface_of(force, count=7, share=0.002, seed=0):
    """The same of a function of displacement and velocity, over -1 to 1 and -2 to 2."""
    q, v = np.linspace(-1, 1, 40), np.linspace(-2, 2, 40)
    along, across = spline_basis(q, -1, 1, count), spline_basis(v, -2, 2, count, True)
    values = force(q[:, None], v[None])
    left, right = (np.linalg.lstsq(b.T, np.eye(40), rcond=None)[0] for b in (along, across))
    error = share * float(np.max(np.abs(values)))
    c = left @ values @ right.T
    c = c + error * np.random.default_rng(seed).standard_normal(c.shape)
    knots = {"low": -1.0, "high": 1.0, "slow": -2.0, "fast": 2.0}
    numbered = {f"c{i + 1}_{j + 1}": float(c[i, j]) for i in range(count) for j in range(count)}
    effect = Effect(learned_name("force", count), "x", {**knots, **numbered})
    return LearnedLaw(effect, error**2 * np.eye(count * count))
