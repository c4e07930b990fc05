from dataclasses import replace

import pytest

from robustpolish.identification.discover.wrong_gains import add_wrong_gains
from tests.hidden_effects.cases import Case, model_of, one, records, two
from tests.identification.discover.searches import search_of


def gained(gain, machine=None, **more):
    machine = machine or one()
    place = f"F_{machine.forced[0]}"
    case = Case(
        "gain", machine, drive=10.0, samples=1200, effects=[("input_gain", (place,), [gain])]
    )
    case = replace(case, **more)
    search = search_of(model_of(case), records(case)[0][0])
    add_wrong_gains(search)
    return search


def test_masses_and_springs_that_err_alike_are_a_gain():
    search = gained(0.6)
    (effect,) = search.stage.model.effects
    assert (effect.kind, effect.at) == ("input_gain", ("F_x",))
    assert effect.values["gain"] == pytest.approx(0.6, rel=0.05)
    assert search.steps[-1][0] == "input_gain"
    assert "F_x acts 0.6" in search.reasons[-1]
    (pair,) = search.confusions
    assert pair.second.kind == "sensor_gain"  # one output: it may be that one as well
    assert "known weight" in pair.experiment


def test_springs_that_are_known_roughly_do_not_hide_a_gain():
    search = gained(0.6, two(), noise_db=50.0, wrong={"mass": 0.03, "stiffness": 0.1})
    (effect,) = search.stage.model.effects
    assert (effect.kind, effect.at) == ("input_gain", ("F_x",))
    assert effect.values["gain"] == pytest.approx(0.6, rel=0.06)


def test_an_input_that_is_right_gets_no_gain():
    search = gained(1.0)
    assert search.stage is search.linear
    assert search.reasons == search.confusions == []
