import json

import numpy as np

import robustpolish as rp
from robustpolish.identification.diagnosis.findings import learned_laws_of
from robustpolish.identification.diagnosis.words import explain, headline, learned_law_of, plain
from tests import made_up
from tests.identification.findings.learned_diagnosis import unknown_law

FIFTH = "k5*q**5 with k5 = "


def test_laws_are_found_with_their_covariance():
    told = unknown_law()
    (law,) = told.laws
    assert law.effect == told.model.effects[1]
    np.testing.assert_array_equal(law.covariance, told.covariance.values)
    assert learned_laws_of(told.model, None)[0].covariance is None
    other = told.covariance.isel(parameter=slice(1, None), other=slice(1, None))
    assert learned_laws_of(told.model, other)[0].covariance is None
    assert learned_laws_of(made_up.model(), None) == ()


def test_the_words_tell_the_law_and_no_coefficients():
    told = unknown_law()
    assert headline(told) == (
        "The model lacked a force that no catalogue describes: Coulomb friction at x, ground and "
        "Learned law over displacement at x, ground."
    )
    text = explain(told)
    assert FIFTH in text
    assert "It hardens" in text
    assert "force = 3.100 +- 0.020 N" in text
    assert "c3 = " not in text
    assert learned_law_of(told, told.effects[0]) is None
    assert "c3" not in str(told)
    assert "largest force" in str(told)


def test_plain_data_hold_the_law():
    content = json.loads(json.dumps(plain(unknown_law()), allow_nan=False))
    assert content["verdict"] == "unknown_law"
    (law,) = content["laws"]
    assert law["kind"] == "learned_stiffness_9"
    assert law["formula"].startswith(FIFTH)
    assert plain(made_up.diagnosis())["laws"] == []


def test_it_is_saved_and_loaded(tmp_path):
    told = unknown_law()
    told.save(tmp_path / "told.json")
    again = rp.load(tmp_path / "told.json")
    assert again.verdict == "unknown_law"
    assert again.model == told.model
    assert again.effects == told.effects
    assert again.laws[0].describe() == told.laws[0].describe()
