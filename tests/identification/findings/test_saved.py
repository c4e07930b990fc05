import json
from dataclasses import fields, replace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
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
    assert rp.Diagnosis.load(tmp_path / "slide.json").covariance is None


def test_older_files_are_read(tmp_path):
    path = tmp_path / "slide.json"
    told().save(path)
    content = json.loads(path.read_text())
    del content["covariance"]
    path.write_text(json.dumps(content))
    assert rp.Diagnosis.load(path).covariance is None


def test_a_damaged_covariance_is_refused(tmp_path):
    path = tmp_path / "slide.json"
    told().save(path)
    content = json.loads(path.read_text())
    content["covariance"]["values"].pop()
    path.write_text(json.dumps(content))
    with pytest.raises(InvalidInputError, match="values"):
        rp.Diagnosis.load(path)


def test_a_loaded_diagnosis_says_how_uncertain_a_design_is(tmp_path):
    def plant_of(model):
        return model.without_effects().linearize(measured="state")

    before = replace(told(), covariance=told().covariance.copy(data=np.diag([1e-4, 1e4, 4e-4])))
    before.save(tmp_path / "slide.json")
    after = rp.load(tmp_path / "slide.json")
    design = rp.state_feedback(plant_of(before.model), control_weight=1e-3)
    one, other = (
        rp.check_robustness(design, found, plant_of=plant_of, samples=5)
        for found in (before, after)
    )
    assert one.keys == other.keys == tuple(KEYS)
    np.testing.assert_array_equal(other.norms, one.norms)
    assert np.std(one.norms) > 0
