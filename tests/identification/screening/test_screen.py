from types import SimpleNamespace

import numpy as np
import pytest

from robustpolish.identification.observer.kalman import FREE
from robustpolish.identification.policy import POLICY, Policy
from robustpolish.identification.structure.screening import (
    candidate_columns,
    exceeds_machine_mass,
    screen,
)
from robustpolish.machines.effects.effect import Effect, lookup
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, of_rig, oscillator, rig
from tests.identification.screening.test_evidence import with_resonator

DATA = of_rig(2000, noise=1.0)
X, V = DATA["x"].values, DATA["v"].values


def screened(force, *allowed, policy=POLICY):
    data = DATA.assign(f=("time", DATA["f"].values + force))
    return screen(rig(), prepared_of(rig(), data, policy), allowed)


def test_a_missing_spring_is_the_likeliest_of_all_kinds_at_all_places():
    case = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=1500)
    model = model_of(case)
    found = screen(model, prepared_of(model, records(case)[0][0], Policy(finalists=8)))
    best, second = found.candidates[:2]
    assert best.place == ("cubic_stiffness", PLACE)
    assert best.effect.values["stiffness"] == pytest.approx(4e6, rel=0.1)
    assert best.sensible
    assert best.score > second.score + 10
    places = [candidate.place for candidate in found.candidates]
    assert len(set(places)) == len(places) > 5


def test_the_number_of_processors_changes_no_bit(monkeypatch):
    case = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=800)
    prepared, found = prepared_of(model_of(case), records(case)[0][0]), []
    for processors in (1, 7):
        monkeypatch.setattr("os.cpu_count", lambda processors=processors: processors)
        seen = screen(model_of(case), prepared)
        found.append([(c.place, c.score, c.fall, c.effect.parameters) for c in seen.candidates])
    assert found[0] == found[1]
    assert len(found[0]) > 5


def test_odds_are_those_of_the_information_criterion():
    """Two regressions of the error on x and v, one with an offset besides."""
    alone = Policy(screening=(FREE,), coarse=(FREE,), weak_guidance=(FREE,), noise_orders=(0,))
    (found,) = screened(0.3, Effect("sensor_offset", "f"), policy=alone).candidates
    error = (DATA["f"].values + 0.3) - 50 * X - 4 * V
    left = []
    for columns in (np.column_stack([X, V]), np.column_stack([X, V, np.ones(X.size)])):
        beta = np.linalg.lstsq(columns, error, rcond=None)[0]
        left.append(np.mean((error - columns @ beta) ** 2))
    odds = (X.size * np.log(left[0] / left[1]) - np.log(X.size)) / 2
    assert found.score == pytest.approx(odds, abs=0.5)
    assert found.constant
    assert found.effect.values["offset"] == pytest.approx(0.3, abs=0.08)
    assert found.fall == pytest.approx(1 - np.sqrt(left[1] / left[0]), abs=0.01)


def test_a_force_of_the_wrong_sign_is_not_sensible():
    (found,) = screened(-8.0 * np.sign(V), Effect("coulomb_friction", PLACE)).candidates
    assert found.remark == "its force has the wrong sign"
    assert found.effect.values["force"] == 0.0  # at its bound
    (other,) = screened(8.0 * np.sign(V), Effect("coulomb_friction", PLACE)).candidates
    assert other.sensible
    assert other.effect.values["force"] == pytest.approx(8.0, rel=0.05)


def test_shapes_of_the_wrong_sign_do_not_take_the_place_of_the_right_one():
    """A resonator of negative mass, far below all motion, is a spring to ground."""
    model = oscillator(stiffness=430.0, inputs=[])
    data = with_resonator(0.05, 0.05 * (2 * np.pi * 5) ** 2, 0.05)
    allowed = [Effect("attached_resonator", "x")]
    (found,) = screen(model, prepared_of(model, data), allowed).candidates
    assert found.sensible
    frequency = np.sqrt(found.effect.values["stiffness"] / found.effect.values["mass"])
    assert frequency / (2 * np.pi) == pytest.approx(5, rel=0.15)


def test_what_is_attached_weighs_no_more_than_the_machine():
    model = oscillator(inputs=[])
    prepared = prepared_of(model, with_resonator(0.05, 0.05 * (2 * np.pi * 5) ** 2, 0.05))
    motion = prepared.motion(model, prepared.screened)
    (entry, *_) = candidate_columns(
        model, lookup("attached_resonator"), ("x",), motion, prepared.screened
    )
    assert not exceeds_machine_mass(entry, np.array([0.9, 0.0]), model)
    assert exceeds_machine_mass(entry, np.array([1.1, 0.0]), model)
    (cubic, *_) = candidate_columns(
        model, lookup("cubic_stiffness"), PLACE, motion, prepared.screened
    )
    assert not exceeds_machine_mass(cubic, np.array([1e9]), model)


def test_of_two_shapes_much_alike_one_is_enough():
    model = oscillator(inputs=[])
    data = with_resonator(0.05, 0.05 * (2 * np.pi * 5) ** 2, 0.05)
    found = screen(model, prepared_of(model, data), [Effect("attached_resonator", "x")])
    shapes = [f.shape.columns[0].ravel() for f in found.finalists]
    cosines = np.corrcoef(shapes) - np.eye(len(shapes))
    assert len(shapes) > 1
    assert np.max(np.abs(cosines)) < 0.96


def test_scaling_the_data_down_is_paid_for():
    """A gain of 0.5 on the sensor would halve every error, were it not for the density."""
    found = screened(0.0 * X, Effect("sensor_gain", "f")).candidates
    assert not any(c.score > 0 for c in found)


def test_finalists_are_the_shapes_of_what_has_odds():
    """Free runs look at every place of the list; what was no finalist has no odds."""
    found = screened(40 * X**3, *(Effect(kind, PLACE) for kind in ("cubic_stiffness", "backlash")))
    there = {(entry.kind.kind, entry.at) for entry in found.finalists}
    assert there == {candidate.place for candidate in found.candidates}
    best = found.candidates[0]
    assert found.score(best.effect) == best.score > 100
    assert found.score(Effect("quadratic_damping", PLACE)) == 0.0


def test_beside_an_effect_that_diverges_nothing_is_said(monkeypatch):
    """Along the smoothed motion a law may overflow."""
    diverged = SimpleNamespace(errors=np.full((10, 1), np.nan))
    monkeypatch.setattr(
        "robustpolish.identification.structure.screening.FilteredRecord", lambda *given: diverged
    )
    found = screen(rig(), prepared_of(rig(), DATA))
    assert found.candidates == ()
    assert found.finalists == ()
