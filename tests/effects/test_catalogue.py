import numpy as np
import pytest

from robustpolish.effects import Effect, Motion, force_along, kinds, lookup, register, registry
from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.errors import InvalidInputError

NAMED = [
    "coulomb_friction",
    "stribeck_friction",
    "elastic_coulomb_friction",
    "lugre_friction",
    "quadratic_damping",
    "displacement_dependent_damping",
    "bouc_wen_hysteresis",
    "cubic_stiffness",
    "quadratic_stiffness",
    "backlash",
    "contact_stop",
    "pendulum_gravity",
    "constant_force",
    "harmonic_force",
    "unbalance",
    "parametric_stiffness",
    "gyroscopic_coupling",
    "cross_stiffness",
    "attached_resonator",
    "input_delay",
    "input_gain",
    "sensor_offset",
    "sensor_gain",
]


def motion(kind):
    time = np.arange(1500) * 1e-3
    q = np.vstack([np.sin(40 * time) * 1e-3, np.cos(31 * time) * 1e-3])[: kind.ports]
    v = np.gradient(q, 1e-3, axis=1)
    context = {"spin_frequency": 100.0, "spring_stiffness": 1e4, "mobility": 0.0, "clearance": 0.0}
    return Motion(time, q, v, context, force=q)


def test_the_catalogue_has_every_kind():
    assert set(NAMED) <= set(kinds())


@pytest.mark.parametrize("name", NAMED)
def test_every_kind_explains_itself(name):
    kind = lookup(name)
    assert kind.looks_like
    assert kind.checks
    assert kind.references
    assert all(p.meaning and p.lower < p.upper for p in kind.parameters)


@pytest.mark.parametrize("name", [n for n in NAMED if lookup(n).law is not None])
def test_a_shape_is_the_law_with_its_values(name):
    kind = lookup(name)
    along = motion(kind)
    for shape in kind.shapes(along)[:4]:
        unit = np.zeros(len(shape.signs))
        unit[0] = 1.0
        values = Effect(name, ("x", "y")[: kind.places], shape.values(unit)).values
        p = [*values.values(), *(along.context[c] for c in kind.context)]
        if name == "backlash":
            p[1] = 1e4
        force = force_along(kind, along, np.array(p))
        assert np.isfinite(force).all()
        wanted = shape.columns[0]
        moving = np.abs(along.v[0]) > 0.2 * along.speed  # a shape rounds the corners of friction
        close = np.abs(force - wanted)[:, moving] <= 1e-2 * np.max(np.abs(wanted))
        assert np.mean(close) > 0.97


def test_friction_takes_energy_out():
    for name in ("coulomb_friction", "elastic_coulomb_friction", "bouc_wen_hysteresis"):
        kind = lookup(name)
        along = motion(kind)
        shape = kind.shapes(along)[0]
        power = np.sum(shape.columns[0] * along.v)
        assert power < 0


def test_bad_effects_say_what_is_wrong():
    with pytest.raises(InvalidInputError, match="coulomb_friktion"):
        Effect("coulomb_friktion", ("x", "ground"))
    with pytest.raises(InvalidInputError, match="weight"):
        Effect("coulomb_friction", ("x", "ground"), {"weight": 1.0})
    with pytest.raises(InvalidInputError, match="two degrees"):
        Effect("gyroscopic_coupling", ("x",), {})
    with pytest.raises(InvalidInputError, match="finite"):
        Effect("coulomb_friction", ("x", "ground"), {"force": float("nan")})


def test_users_add_a_kind(monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})

    def law(t, q, v, z, p, f, dz):
        f[0] = -p[0] * q[0] ** 5

    kind = EffectKind(
        "fifth_power", "Fifth power", "pair", (Parameter("stiffness", "F/L^5", "coefficient"),), law
    )
    assert register(kind) is lookup("fifth_power")
    along = motion(kind)
    force = force_along(kind, along, np.array([2.0]))
    np.testing.assert_allclose(force, -2 * along.q**5)
    with pytest.raises(InvalidInputError, match="taken"):
        register(EffectKind("cubic_stiffness", "Another", "pair", (Parameter("a", "F", "b"),), law))


def test_units_follow_the_motion():
    parameter = lookup("cubic_stiffness").parameter("stiffness")
    assert parameter.unit() == "N/m^3"
    assert parameter.unit(rotational=True) == "N m/rad^3"
