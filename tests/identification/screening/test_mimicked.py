"""Other kinds that make nearly the same force along the same motion."""

import pytest

from robustpolish.identification.structure.evidence import find_force_equivalents
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, of_rig, oscillator, record, rig


def mimicking(model, at=0):
    return find_force_equivalents(model, at, prepared_of(rig(), of_rig(noise=0.1)))


def test_what_holds_a_kind_as_a_special_case_makes_its_force():
    """Dahl's law is Bouc and Wen's with an exponent of 1 and a gamma of 0."""
    dahl = {"force": 3.0, "stiffness": 50.0}
    found = mimicking(rig().with_effect("dahl_friction", PLACE, dahl))
    by_kind = {mimic.effect.kind: mimic for mimic in found}
    assert set(by_kind) == {
        "coulomb_friction", "stribeck_friction", "elastic_coulomb_friction", "lugre_friction",
        "bouc_wen_hysteresis",
    }  # fmt: skip
    assert [mimic.left for mimic in found] == sorted(mimic.left for mimic in found)
    smooth = by_kind["bouc_wen_hysteresis"]
    assert smooth.left < 1e-3
    values = smooth.effect.values
    assert values["exponent"] == pytest.approx(1.0, abs=0.02)
    assert values["stiffness"] == pytest.approx(50.0, rel=0.01)
    assert values["beta"] * 3.0 / values["force"] == pytest.approx(1.0, rel=0.02)
    # a jump and a corner are further off, and yet of the right size
    corner = by_kind["elastic_coulomb_friction"]
    assert smooth.left < corner.left < by_kind["coulomb_friction"].left
    assert 0.7 * 3.0 < corner.effect.values["force"] < 1.1 * 3.0


def test_beside_a_clearance_friction_may_be_in_series_or_not():
    worn = rig().with_effect("backlash", PLACE, {"gap": 0.2})
    elastic = {"force": 3.0, "stiffness": 50.0}
    found = mimicking(worn.with_effect("elastic_coulomb_friction", PLACE, elastic), at=1)
    ways = [(mimic.effect.kind, mimic.effect.values.get("behind_clearance")) for mimic in found]
    assert ("elastic_coulomb_friction", 0.0) in ways
    assert ("elastic_coulomb_friction", 1.0) not in ways  # it is that one
    assert ("dahl_friction", 0.0) in ways
    assert ("dahl_friction", 1.0) in ways
    # without a clearance both are one
    alone = mimicking(rig().with_effect("elastic_coulomb_friction", PLACE, elastic))
    assert all(mimic.effect.values.get("behind_clearance", 1.0) == 1.0 for mimic in alone)
    assert "elastic_coulomb_friction" not in {mimic.effect.kind for mimic in alone}


def test_what_turns_over_gently_goes_on_to():
    values = {"force": 3.0, "static_force": 4.0, "velocity": 0.4, "width": 0.03}
    found = mimicking(rig().with_effect("stribeck_friction", PLACE, values))
    (jump,) = [mimic.effect for mimic in found if mimic.effect.kind == "coulomb_friction"]
    assert jump.values["width"] == 0.03


def test_nothing_mimics_no_force():
    assert mimicking(rig().with_effect("coulomb_friction", PLACE, {"force": 0.0})) == []
    assert mimicking(rig().with_effect("cubic_stiffness", PLACE, {"stiffness": 1.0})) == []


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 1e14])
@pytest.mark.parametrize("kind", ["dahl_friction", "lugre_friction"])
def test_a_friction_too_stiff_for_any_step_is_a_jump_by_another_name(kind, stiffness):
    values = {"force": 3.0, "stiffness": stiffness}
    if kind == "lugre_friction":
        values |= {"static_force": 3.0, "velocity": 0.02}
    prepared = prepared_of(oscillator(), record(1500, noise=0.01))
    found = find_force_equivalents(oscillator().with_effect(kind, PLACE, values), 0, prepared)
    by_kind = {mimic.effect.kind: mimic for mimic in found}
    assert by_kind["coulomb_friction"].left < 0.15
    assert by_kind["coulomb_friction"].effect.values["force"] == pytest.approx(3.0, rel=0.05)
