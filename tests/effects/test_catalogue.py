"""Every built-in kind: its explanation, its shapes, its energy."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from robustpolish.machines.effects.effect import Effect, kinds, lookup
from robustpolish.machines.effects.evaluate import force_along, shapes_along
from robustpolish.machines.effects.kind import Motion
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Output, Spring
from robustpolish.machines.simulation.run import simulate_model as simulate

NAMED = [
    "coulomb_friction",
    "stribeck_friction",
    "elastic_coulomb_friction",
    "dahl_friction",
    "lugre_friction",
    "quadratic_damping",
    "structural_damping",
    "displacement_dependent_damping",
    "maxwell_element",
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
    "input_lag",
    "input_gain",
    "input_saturation",
    "input_dead_zone",
    "sensor_offset",
    "sensor_gain",
]


def motion(kind):
    time = np.arange(1500) * 1e-3
    q = np.vstack([np.sin(40 * time) * 1e-3, np.cos(31 * time) * 1e-3])[: kind.ports]
    v = np.gradient(q, 1e-3, axis=1)
    context = {
        "spin_frequency": 100.0, "spring_stiffness": 1e4, "mobility": 0.0, "clearance": 0.0,
        "step": 1e-3,
    }  # fmt: skip
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
    for shape in shapes_along(kind, along)[:4]:
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
    for name in (
        "coulomb_friction", "elastic_coulomb_friction", "bouc_wen_hysteresis", "dahl_friction",
        "lugre_friction",
    ):  # fmt: skip
        kind = lookup(name)
        along = motion(kind)
        for shape in shapes_along(kind, along):
            power = np.sum(shape.columns[0] * along.v)
            assert power < 0


def test_every_kind_can_be_pickled():
    for kind in kinds().values():
        assert pickle.loads(pickle.dumps(kind)) == kind


@pytest.mark.parametrize(
    ("name", "values", "slope"),
    [
        ("input_gain", {"gain": 3.0}, (3.0, 0.0, 0.0)),
        ("input_delay", {"delay": 0.02}, (1.0, 0.02, 0.0)),
        ("input_lag", {"lag": 0.02}, (1.0, 0.0, 0.02)),
        ("input_hold", {"order": 0.0}, (1.0, 0.0, 0.0)),
        ("input_hold", {"order": 3.0}, (1.0, 0.0, 0.0)),
        ("sensor_gain", {"gain": 0.5}, (0.5, 0.0, 0.0)),
        ("sensor_offset", {"offset": 1e6}, (1.0, 0.0, 0.0)),
    ],
)
def test_the_linear_part_of_a_signal_effect_is_its_answer_to_a_slow_signal(name, values, slope):
    kind = lookup(name)
    assert kind.signal_slope(values) == slope
    gain, delay, lag = slope
    time = np.arange(4000) * 1e-3
    signal = np.sin(time)
    effect = Effect(name, ("x",), values)
    changed = effect.on_signal(signal, time) - effect.on_signal(0 * signal, time)
    late = np.maximum(time - delay, 0.0)
    began = lag / (1 + lag**2) * np.exp(-late / lag) if lag else 0.0
    expected = gain * ((np.sin(late) - lag * np.cos(late)) / (1 + lag**2) + began)
    # a hold delays by half a sample
    np.testing.assert_allclose(changed[5:-5], expected[5:-5], atol=6e-4)


@pytest.mark.parametrize(
    ("name", "values", "acting"),
    [
        ("input_saturation", {"limit": 2.0}, [-2.0, -1.0, 0.0, 2.0]),
        ("input_saturation", {}, [-3.0, -1.0, 0.0, 2.5]),
        ("input_dead_zone", {"width": 1.5}, [-1.5, 0.0, 0.0, 1.0]),
    ],
)
def test_what_an_actuator_makes_of_its_commands(name, values, acting):
    time, asked = np.arange(4.0), np.array([-3.0, -1.0, 0.0, 2.5])
    assert Effect(name, "F", values).on_signal(asked, time).tolist() == acting
    assert lookup(name).signal_slope(values) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("name", ["input_saturation", "input_dead_zone"])
def test_candidates_for_actuators_are_what_their_numbers_do(name):
    along = motion(lookup(name))
    shapes = shapes_along(lookup(name), along)
    assert len(shapes) > 3
    for shape in shapes:
        acting = Effect(name, "F", shape.values(np.ones(1))).on_signal(along.q[0], along.time)
        np.testing.assert_allclose(shape.columns[0, 0], acting - along.q[0], atol=1e-12)
        assert shape.values(np.zeros(1)) != shape.values(np.ones(1))
    still = replace(along, q=0 * along.q)
    assert shapes_along(lookup(name), still) == []


def test_friction_parameters_know_their_limits_in_a_fit():
    stribeck, stop = lookup("stribeck_friction"), lookup("contact_stop")
    values = {"force": 2.0, "static_force": 3.0, "velocity": 0.1, "width": 0.0}
    for name in ("stribeck_friction", "lugre_friction"):
        static = lookup(name).parameter("static_force")
        assert static.bounds_from(values) == (0.0, np.inf)
        assert static.at_least == "force"  # which moves too: no number bounds it
        assert lookup(name).implausible({**values, "static_force": 1.99}) is not None
        assert lookup(name).implausible({**values, "static_force": 2.0}) is None
    assert stribeck.parameter("velocity").bounds_from(values) == (0.1 * 0.2, 0.1 * 6)
    assert stop.parameter("gap").bounds_from({"gap": 1e-3, "stiffness": 1.0}) == (0.0, np.inf)
    assert stop.parameter("gap").bounds_from({"gap": -1e-3, "stiffness": 1.0}) == (-np.inf, 0.0)
    assert lookup("harmonic_force").parameter("phase").scale_from(3.0) == 1.0


def test_loops_that_feed_the_motion_are_no_hysteresis():
    kind = lookup("bouc_wen_hysteresis")
    values = {"force": 1.0, "stiffness": 5.0, "exponent": 1.0, "beta": 0.5, "gamma": -0.9}
    assert kind.implausible(values) is None
    assert "feed energy" in str(kind.implausible({**values, "beta": -0.1}))
    assert [p.name for p in kind.parameters if not p.fitted] == ["force"]  # beta and gamma say it


@pytest.mark.parametrize("stiffness", [500.0, 2000.0, 8000.0])
def test_a_slider_behind_a_spring_slips_right_in_rough_steps(stiffness):
    """What a step overshoots slides back, but not beyond its end, where the slider would stick."""
    at, time = ("x", "ground"), 0.004 * np.arange(1000)
    spring, damper, output = Spring(at, 4000.0), Damper(at, 1.0), Output("x", at)
    model = MechanicalModel((Dof("x", 1.0),), (spring,), (damper,), (), (output,))
    values = {"force": 0.5, "stiffness": stiffness}
    model = model.with_effect("elastic_coulomb_friction", at, values)
    about = xr.Dataset({"x": ("time", 0.02 * np.cos(63 * time))}, {"time": time})
    fine, rough = (
        simulate(model, about, [0.02, 0.0], substeps=steps).outputs for steps in (64, None)
    )
    assert np.std(rough - fine) < 1e-3 * np.std(fine)
