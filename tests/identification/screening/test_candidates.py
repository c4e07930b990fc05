import numpy as np
import xarray as xr

from robustpolish.identification.observer.missing_force import SmoothedMotion
from robustpolish.identification.record import record_of
from robustpolish.identification.structure.screening import (
    candidate_columns,
    mutually_exclusive,
    places,
)
from robustpolish.machines.effects.effect import lookup
from robustpolish.machines.effects.user_defined import own_kind
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE, oscillator, rig

TIME = np.arange(600) / 300
Q, V = np.sin(9 * TIME)[None], 9 * np.cos(9 * TIME)[None]
FORCE = np.cos(4 * TIME)


def machine(**changes):
    parts = {
        "dofs": [Dof("a", 2.0), Dof("b", 1.0), Dof("z", 4.0)],
        "springs": [Spring(("a", "ground"), 900.0), Spring(("b", "a"), 500.0)],
        "inputs": [Input("F", ("b", "ground"), gain=-2.0)],
        "outputs": [Output("b", ("b", "ground")), Output("z", ("z", "ground"))],
    }
    return MechanicalModel(**{**parts, **changes})


def columns(kind, at, model=None, q=Q):
    model = model or oscillator(inputs=[Input("F", PLACE, gain=3.0)])
    data = xr.Dataset({"F": ("time", FORCE), "x": ("time", q[0])}, {"time": TIME})
    signals, outputs = FORCE[:, None], q.T
    internal = np.zeros((TIME.size, 0))
    motion = SmoothedMotion(q, V, np.zeros_like(q), np.zeros_like(q), signals, outputs, internal)
    return candidate_columns(model, lookup(kind), at, motion, record_of(model, data))


def test_where_a_kind_can_act():
    model = machine()
    pairs = [("a", "ground"), ("b", "ground"), ("z", "ground"), ("b", "a"), ("z", "a"), ("z", "b")]
    assert sorted(places(model, lookup("coulomb_friction"))) == sorted(pairs)
    assert places(model, lookup("backlash")) == [("a", "ground"), ("b", "a")]  # in springs only
    slipping = model.with_effect("elastic_coulomb_friction", ("z", "ground"))
    clearances = [("a", "ground"), ("z", "ground"), ("b", "a")]  # and in what slips
    assert places(slipping, lookup("backlash")) == clearances
    assert places(model, lookup("constant_force")) == [("a",), ("b",), ("z",)]
    assert places(model, lookup("input_delay")) == [("F",)]
    assert places(model, lookup("sensor_gain")) == [("b",), ("z",)]
    # two axes of one body hang together by nothing
    assert places(model, lookup("gyroscopic_coupling")) == [("a", "z"), ("b", "z")]


def test_imposed_motion_has_places_where_its_force_is_measured():
    assert places(rig(), lookup("coulomb_friction")) == [PLACE]
    assert places(rig(), lookup("input_delay")) == []
    assert places(rig(), lookup("constant_force")) == []


def test_a_law_is_a_column_along_the_motion():
    (found,) = columns("cubic_stiffness", PLACE)
    np.testing.assert_allclose(found.values, -(Q**3)[None])
    np.testing.assert_array_equal(found.rows, [[1.0]])
    assert found.pairs == [PLACE]
    assert found.shape.values(np.array([7.0])) == {"stiffness": 7.0}
    assert columns("cubic_stiffness", PLACE, q=np.zeros_like(Q)) == []  # nothing moves


def test_an_effect_of_an_input_pushes_where_the_input_does():
    (found,) = columns("input_gain", ("F",))
    np.testing.assert_allclose(found.values, 3.0 * FORCE[None, None])
    assert found.pairs == [PLACE]


def test_an_effect_of_an_output_adds_to_it():
    (found,) = columns("sensor_offset", ("x",))
    assert found.rows is None
    np.testing.assert_allclose(found.values, np.ones((1, 1, TIME.size)))


def test_a_place_has_one_effect_of_a_family():
    dry, constant = lookup("coulomb_friction"), lookup("constant_force")
    assert mutually_exclusive(dry, lookup("lugre_friction"))
    assert not mutually_exclusive(dry, constant)
    assert not mutually_exclusive(constant, lookup("sensor_offset"))  # of one family, but elsewhere
    assert not mutually_exclusive(
        lookup("cubic_stiffness"), lookup("cubic_stiffness")
    )  # of no family
    rubbing = oscillator().with_effect("coulomb_friction", PLACE, {"force": 1.0})
    assert columns("lugre_friction", PLACE, rubbing) == []
    assert columns("coulomb_friction", PLACE, rubbing) == []
    assert columns("cubic_stiffness", PLACE, rubbing)


def test_a_clearance_changes_the_friction_that_slips_in_it():
    """Forces with clearance less those without; the clearance gives back the spring's part."""
    at = {"force": 2.0, "stiffness": 50.0}
    slipping = oscillator().with_effect("elastic_coulomb_friction", PLACE, at)
    found = columns("backlash", PLACE, slipping)
    gaps = np.array([entry.shape.values(np.ones(1))["gap"] for entry in found])
    amplitude = np.percentile(np.abs(Q), 95)
    expected = np.repeat([0.03, 0.07, 0.15, 0.3, 0.5], 2) * amplitude  # as stiff, and twice as
    np.testing.assert_allclose(gaps, expected)
    for gap, entry in zip(gaps, found, strict=True):
        friction, spring = entry.values[0]
        assert 0 < np.abs(friction).max() <= 4.0 + 1e-9  # reversed, at most
        np.testing.assert_allclose(spring, 400.0 * np.clip(Q[0], -gap, gap))


def test_nothing_acts_on_a_channel_and_what_reads_it_needs_it():
    model, cubic = machine(), lookup("cubic_stiffness")
    assert places(model.with_channel("u", "V"), cubic) == places(model, cubic)
    reads = own_kind({"formula": "f = -c*u*v", "units": {"c": "N s/(m V)"}, "channels": {"u": "V"}})
    assert places(model, reads) == []
    assert places(model.with_channel("u", "V"), reads) == places(model, cubic)
