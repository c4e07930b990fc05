from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.diagnosis.findings import indistinguishable_pair
from robustpolish.identification.structure.moves_special import _log_error_increase, add_gain_errors
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.identification.structure.state import RefittedEffect
from robustpolish.machines.effects.effect import Effect
from tests.hidden_effects.cases import Case, Machine, model_of, one, records, two
from tests.identification.discover.searches import MODEL, judged, search_of


def gained(gain, machine=None, **more):
    machine = machine or one()
    place = f"F_{machine.forced[0]}"
    case = Case(
        "gain", machine, drive=10.0, samples=1200, effects=[("input_gain", (place,), [gain])]
    )
    case = replace(case, **more)
    search = search_of(model_of(case), records(case)[0][0])
    add_gain_errors(search)
    return search


def test_masses_and_springs_that_err_alike_are_a_gain():
    search = gained(0.6)
    (effect,) = search.stage.model.effects
    assert (effect.kind, effect.at) == ("input_gain", ("F_x",))
    assert effect.values["gain"] == pytest.approx(0.6, rel=0.05)
    assert search.steps[-1][0] == "input_gain"
    assert "F_x acts 0.6" in search.reasons[-1]
    (pair,) = search.indistinguishable_pairs
    assert pair.second.kind == "sensor_gain"  # one output: it may be that one as well
    assert "known weight" in pair.experiment


def test_springs_that_are_known_roughly_do_not_hide_a_gain():
    search = gained(0.6, two(), noise_db=50.0, wrong={"mass": 0.03, "stiffness": 0.1})
    (effect,) = search.stage.model.effects
    assert (effect.kind, effect.at) == ("input_gain", ("F_x",))
    assert effect.values["gain"] == pytest.approx(0.6, rel=0.06)


@pytest.mark.parametrize(("gain", "named"), [(1.5, True), (1.03, False)])
def test_a_gain_that_masses_could_hide_is_named_by_what_is_known_of_them(gain, named):
    """Without a sensor at the end of the chain other masses and springs do as well as the gain."""
    names = ["m1", "m2", "m3"]
    springs = [("m1", "ground", 5000.0), ("m2", "m1", 4000.0), ("m3", "m2", 6000.0)]
    dampers = [(a, b, 8e-4 * k) for a, b, k in springs]
    seen = [("m1", "velocity"), ("m2", "acceleration")]
    machine = Machine(names, [1.2, 0.4, 1.0], springs, dampers, ["m3"], seen, f_max=30.0, dt=2e-3)
    hidden = [("sensor_gain", ("m1_v",), [gain])]
    case = Case("gain", machine, hidden, drive=10.0, samples=1500, noise_db=45.0)
    search = search_of(model_of(case), records(case)[0][0])
    add_gain_errors(search)
    found = [(e.kind, e.at) for e in search.stage.model.effects]
    assert found == ([("sensor_gain", ("m1_v",))] if named else [])
    assert any("and that is known better" in reason for reason in search.reasons) == named


def test_a_gain_that_another_would_do_for_is_put_where_the_numbers_are_likelier():
    """With a gain below 1 at one sensor all masses are a third too light for that at the other."""
    case = Case("gain", two(), [("sensor_gain", ("x",), [1.35])], drive=10.0, samples=1200)
    search = search_of(model_of(case), records(case)[0][0])
    first = Effect("sensor_gain", ("x_m",), {"gain": 0.74})
    fitted = search.fit_with(search.stage.model, first)
    search.accept([RefittedEffect(ScreenedEffect(first, 50.0, 0.5), fitted)])
    search.indistinguishable_pairs.append(
        indistinguishable_pair(first, Effect("sensor_gain", ("x",), {"gain": 1.35}))
    )
    add_gain_errors(search)
    (effect,) = search.stage.model.effects
    assert effect.at == ("x",)
    assert effect.values["gain"] == pytest.approx(1.35, rel=0.01)
    (pair,) = search.indistinguishable_pairs
    assert (pair.first.at, pair.second.at) == (("x",), ("x_m",))
    assert search.steps[-1] == ("sensor_gain", search.stage.model)
    assert "and that is known better" in search.reasons[-1]


def test_an_input_that_is_right_gets_no_gain():
    search = gained(1.0)
    assert search.stage is search.linear
    assert search.reasons == search.indistinguishable_pairs == []


def test_numbers_that_lie_far_out_in_a_flat_valley_are_no_gain():
    """All forces as a share of what they are: nothing moves otherwise, and no gain is wrong."""
    search = search_of(*_right())
    numbers = search.stage.model.parameters
    model = search.stage.model.with_parameters({k: 0.7 * v for k, v in numbers.items()})
    search.stage = replace(search.stage, fit=replace(search.stage.fit, model=model))
    add_gain_errors(search)
    assert search.stage.model.effects == ()
    found = search.stage.model.parameters
    assert found["input.F_x.gain"] == pytest.approx(1.0, abs=0.05)
    assert search.steps[-1] == ("refit", search.stage.model)
    assert search.reasons == []


def _right():
    case = Case("right", two(), [], drive=10.0, samples=1200)
    return model_of(case), records(case)[0][0]


@pytest.mark.parametrize(
    ("free", "short", "lost"), [(1.5, 2.0, 1.0), (1.5, 2.8, 1.4), (1.2, 2.8, 1.2)]
)
def test_near_chaos_short_runs_tell_what_a_gain_loses(free, short, lost):
    before, after = judged(MODEL, 1.0, short=2.0), judged(MODEL, free, short=short)
    assert _log_error_increase(before, after) == pytest.approx(np.log(lost))
