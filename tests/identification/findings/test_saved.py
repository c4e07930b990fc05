import json
from dataclasses import fields, replace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.identification.diagnosis.findings import (
    FoundEffect,
    IndistinguishablePair,
    RankedCandidate,
    Value,
)
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.user_defined import own_kind
from tests import made_up

KEYS = ["dof.x.mass", "spring[0].stiffness", "effect[0].force"]


def told():
    """A diagnosis with a covariance; one of its numbers is not seen by the data."""
    matrix = np.diag([1e-4, np.inf, 4e-4])
    matrix[0, 2] = matrix[2, 0] = 1e-5 / 3
    covariance = xr.DataArray(matrix, {"parameter": KEYS, "other": KEYS}, ("parameter", "other"))
    return replace(made_up.diagnosis(), covariance=covariance, reproducible=False)


def test_everything_comes_back(tmp_path):
    before = told()
    before.save(tmp_path / "slide.json")
    after = rp.load(tmp_path / "slide.json")
    for field in fields(before):
        one, other = getattr(before, field.name), getattr(after, field.name)
        if isinstance(one, xr.DataArray):
            xr.testing.assert_identical(other, one)
        elif isinstance(one, np.ndarray):
            np.testing.assert_array_equal(other, one)
        else:
            assert other == one, field.name


def test_a_diagnosis_without_covariance_has_none_afterwards(tmp_path):
    made_up.diagnosis().save(tmp_path / "slide.json")
    assert rp.results.Diagnosis.load(tmp_path / "slide.json").covariance is None


def test_older_files_are_read(tmp_path):
    path = tmp_path / "slide.json"
    told().save(path)
    content = json.loads(path.read_text())
    del content["covariance"]
    path.write_text(json.dumps(content))
    assert rp.results.Diagnosis.load(path).covariance is None


def test_a_damaged_covariance_is_refused(tmp_path):
    path = tmp_path / "slide.json"
    told().save(path)
    content = json.loads(path.read_text())
    content["covariance"]["values"].pop()
    path.write_text(json.dumps(content))
    with pytest.raises(InvalidInputError, match="values"):
        rp.results.Diagnosis.load(path)


def test_a_loaded_diagnosis_says_how_uncertain_a_design_is(tmp_path):
    def plant_of(model):
        return model.without_effects().linearize(measured="state")

    before = replace(told(), covariance=told().covariance.copy(data=np.diag([1e-4, 1e4, 4e-4])))
    before.save(tmp_path / "slide.json")
    after = rp.load(tmp_path / "slide.json")
    design = rp.state_feedback(plant_of(before.model), control_weight=1e-3)
    one, other = (
        rp.simulation.check_robustness(design, found, plant_of=plant_of, samples=5)
        for found in (before, after)
    )
    assert one.keys == other.keys == tuple(KEYS)
    np.testing.assert_array_equal(other.norms, one.norms)
    assert np.std(one.norms) > 0


def told_of_its_own():
    """A diagnosis that found, tried and confused effects that only its formulas tell."""
    law = own_kind({"formula": "f = -k*q**5", "units": {"k": "N/m^5"}})
    drag = own_kind({"formula": "f = -c*v**3", "units": {"c": "N s^3/m^3"}, "name": "drag",
                     "bounds": {"c": [0.0, np.inf]}})  # fmt: skip
    effect = Effect.of(law, made_up.PLACE, {"k": 3.0})
    found = FoundEffect(effect.kind, effect.at, {"k": Value(3.0, 0.1, "N/m^5")}, effect.own)
    tried = [
        RankedCandidate(law.kind, effect.at, 0.02, 812.5, 1, {"k": 3.0}, "", effect.own),
        RankedCandidate("drag", effect.at, np.inf, 9.1, 1, {"c": 1.0}, "screened only", drag),
    ]
    confusion = IndistinguishablePair(
        effect, Effect.of(drag, made_up.PLACE, {"c": 1.0}), "Move slowly."
    )
    return replace(
        made_up.diagnosis(),
        model=made_up.model().with_effect(law, made_up.PLACE, {"k": 3.0}),
        effects=(found,),
        candidates=(*made_up.diagnosis().candidates, *tried),
        indistinguishable=(confusion,),
    )


def test_effects_of_ones_own_come_back_and_are_offered_to_nobody(tmp_path):
    before, catalogue = told_of_its_own(), list(kinds())
    before.save(tmp_path / "own.json")
    after = rp.load(tmp_path / "own.json")
    assert after.model == before.model
    assert after.effects == before.effects
    assert after.candidates == before.candidates
    assert after.indistinguishable == before.indistinguishable
    assert after.explain() == before.explain()
    assert "f = -k*q**5 at x, ground" in after.explain()
    after.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "own.json").read_bytes()
    assert list(kinds()) == catalogue


def test_a_damaged_effect_of_ones_own_is_refused(tmp_path):
    path = tmp_path / "own.json"
    told_of_its_own().save(path)
    for damage in ("f = -k*q^5", 3, None, "f = __import__('os')"):
        content = json.loads(path.read_text())
        content["candidates"][2]["own"]["formula"] = damage
        (tmp_path / "damaged.json").write_text(json.dumps(content))
        with pytest.raises(InvalidInputError, match="formula"):
            rp.load(tmp_path / "damaged.json")
