"""Kinds of effects that users add."""

import numpy as np
import pytest

from robustpolish.effects import Motion, force_along, lookup, register, registry
from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.errors import InvalidInputError


def test_users_add_a_kind(monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})

    def law(t, q, v, z, p, f, dz):
        f[0] = -p[0] * q[0] ** 5

    kind = EffectKind(
        "fifth_power", "Fifth power", "pair", (Parameter("stiffness", "F/L^5", "coefficient"),), law
    )
    assert register(kind) is lookup("fifth_power")
    time = np.arange(1500) * 1e-3
    along = Motion(time, np.sin(40 * time)[None] * 1e-3, np.cos(40 * time)[None] * 0.04)
    force = force_along(kind, along, np.array([2.0]))
    np.testing.assert_allclose(force, -2 * along.q**5)
    with pytest.raises(InvalidInputError, match="taken"):
        register(EffectKind("cubic_stiffness", "Another", "pair", (Parameter("a", "F", "b"),), law))
