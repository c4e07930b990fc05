import numpy as np
import pytest

import robustpolish as rp
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.identification.refit import collect_warnings
from tests.identification.oscillators import oscillator, record

DATA = record(start=(0.05, 0.0), noise=0.01)


def said(data, fitted=None, model=None):
    model = model or oscillator()
    return collect_warnings(model, fitted or model, prepare(model, record_of(model, data), POLICY))


def test_a_good_record_and_a_small_change_leave_nothing_to_say():
    assert said(DATA, oscillator(stiffness=410.0)) == ()


def test_remarks_and_warnings_are_said_once():
    x = DATA["x"].values
    limit = 0.6 * np.abs(x).max()
    cut = DATA.assign(x=("time", np.clip(x, -limit, limit), {"units": "m"}))
    notes = said(cut.assign_attrs(notes=["3 samples were mended", "3 samples were mended"]))
    assert notes[0] == "3 samples were mended"
    assert "x sticks at its extremes" in notes[1]
    assert len(notes) == 2


def test_a_number_that_moved_by_decades_is_told():
    (note,) = said(DATA, oscillator(stiffness=4e8))
    assert note.startswith("the fit moved spring[0].stiffness from 400 to 4e+08, by 6.0 decades")


def test_a_mean_far_from_rest_is_told_unless_a_constant_was_found():
    away = DATA.assign(x=("time", DATA["x"].values + 0.5, {"units": "m"}))
    (note,) = said(away)
    assert "the mean of x is" in note
    explained = oscillator().with_effect("sensor_offset", "x", {"offset": 0.5})
    assert said(away, explained) == ()


def test_a_refit_says_it():
    fitted = rp.refit(oscillator(), DATA.assign(x=("time", -DATA["x"].values, {"units": "m"})))
    assert any("x moves against the model" in note for note in fitted.notes)
    assert "x moves against the model" in repr(fitted)
    assert rp.refit(oscillator(), DATA).notes == ()


@pytest.mark.parametrize("factor", [1.0, 1e3])
def test_a_diagnosis_says_it_in_words_and_in_plain_data(factor):
    data = DATA.assign(x=("time", factor * DATA["x"].values, {"units": "m"}))
    found = rp.diagnose(oscillator(), data, progress=str)
    times = [note for note in found.notes if "times as large" in note]
    assert len(times) == (factor != 1.0)
    assert found.to_dict()["notes"] == list(found.notes)
    for note in found.notes:
        assert found.explain().count(note) == 1
        assert repr(found).count(note) == 1
    if factor == 1.0:
        assert found.notes == ()
        assert "Look at the record" not in found.explain()
        assert found.verdict == "adequate"
        assert found.maps[0].follows < 0.1  # what is left is noise, and mapped all the same
