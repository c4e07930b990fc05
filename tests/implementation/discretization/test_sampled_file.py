"""Sampled designs in files: what was saved comes back proven, edited files are refused."""

import json

import numpy as np
import pytest

import robustpolish as rp
from tests.implementation.designs import servo_design


@pytest.fixture(scope="module")
def sampled():
    design = servo_design().discretize(0.05, delay=0.02, anti_aliasing=8.0)
    return design.realization("modal")


@pytest.fixture
def saved(sampled, tmp_path):
    path = tmp_path / "sampled.json"
    sampled.save(path)
    return path


def test_there_and_back(sampled, saved):
    again = rp.load(saved)
    assert isinstance(again, rp.results.SampledDesign)
    for name in "ABCD":
        np.testing.assert_array_equal(
            getattr(again.controller, name), getattr(sampled.controller, name)
        )
    assert again.certificate.bound == sampled.certificate.bound
    kept = ("period", "delay", "norm", "continuous_norm", "method", "message")
    assert [getattr(again, key) for key in kept] == [getattr(sampled, key) for key in kept]
    assert again.anti_aliasing is not None
    assert again.anti_aliasing.nstates == sampled.anti_aliasing.nstates
    assert again.details["form"] == "modal"
    with pytest.raises(rp.InvalidInputError, match="does not exist yet"):
        sampled.save(saved)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c["controller"]["D"][0].__setitem__(0, 50.0), "without a valid certificate"),
        (lambda c: c.update(achieved=c["achieved"] * 0.9), "achieved: got a norm of"),
        (lambda c: c.update(period=0.06), "the controller's sampling time"),
        (lambda c: c.update(period=-1), "period: got -1"),
        (lambda c: c.update(delay=-0.1), "delay"),
        (lambda c: c.update(delay=1e9), "at most 200 periods"),
        (lambda c: c.update(norm="h3"), "norm: got 'h3'"),
        (lambda c: c.update(form="pretty"), "form: got 'pretty'"),
        (lambda c: c.update(anti_aliasing=3), "anti_aliasing: got 3"),
        (lambda c: c.pop("message"), "the key 'message'"),
        (lambda c: c.update(continuous_norm=-1), "continuous_norm"),
        (lambda c: c["plant"]["system"].update(dt=0.1), "a continuous plant"),
        (lambda c: c["controller"].update(inputs=[]), "controller: B"),
        (lambda c: c.update(robustpolish="design"), "a design in sampled.json"),
    ],
)
def test_edited_files_are_refused(saved, change, says):
    content = json.loads(saved.read_text())
    change(content)
    saved.write_text(json.dumps(content))
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.results.SampledDesign.load(saved)
