from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.identification.record import (
    checked_data,
    input_period,
    least_samples,
    quiet_after,
    record_of,
    require_length,
    require_time_data,
)
from robustpolish.machines.mechanical.parts import Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE, RATE, of_rig, oscillator, record, rig


def test_a_part_of_a_part_knows_where_it_is():
    whole = record_of(oscillator(), record())
    part = whole.part(100, 300).part(10, 60)
    assert (part.first, part.samples) == (110, 50)
    assert part.start == pytest.approx(110 / RATE)
    np.testing.assert_array_equal(part.time, whole.times[110:160])
    np.testing.assert_array_equal(part.own(np.arange(4000)), np.arange(110, 160))
    np.testing.assert_array_equal(part.Y, record()["x"].values[110:160, None])
    assert part.data is whole.data


def test_files_and_frames_are_read(tmp_path):
    data = record()
    frame = pd.DataFrame(
        {"time [s]": data["time"], "F [N]": data["F"], "x [mm]": 1e3 * data["x"].values}
    )
    frame.to_csv(tmp_path / "data.csv", index=False)
    for source in (frame, tmp_path / "data.csv"):
        found = record_of(oscillator(), source)
        np.testing.assert_allclose(found.Y[:, 0], data["x"], rtol=1e-9)
        assert found.dt == pytest.approx(1 / RATE)


def test_a_gain_may_convert_the_unit_of_an_input():
    amperes = record().assign(F=record()["F"].assign_attrs(units="A"))
    motor = oscillator(inputs=[Input("F", PLACE, gain=35.0)])
    assert checked_data(motor, amperes) is amperes
    with pytest.raises(InvalidInputError, match="a column in A"):
        checked_data(oscillator(), amperes)


def test_outputs_are_asked_for_only_where_they_are_needed():
    assert "F" in checked_data(oscillator(), record()[["F"]], outputs=False)


def test_several_records_stand_one_behind_the_other():
    """Each on its own clock; parts know whose they are, and what goes on from what."""
    one, two = record(600), record(400, seed=1)
    two = two.assign_coords(time=two["time"] + 100.0)
    whole = record_of(oscillator(), {"soft": one, "hard": two})
    assert (whole.samples, whole.marks, whole.names) == (1000, [0, 600, 1000], ("soft", "hard"))
    assert whole.dt == pytest.approx(1 / RATE)
    np.testing.assert_array_equal(whole.time, [*one["time"].values, *two["time"].values])
    np.testing.assert_allclose(whole.axis, np.arange(1000) / RATE)
    soft, hard = whole.parts
    assert [(p.name, p.first, p.samples) for p in (soft, hard)] == [
        ("soft", 0, 600),
        ("hard", 600, 400),
    ]
    np.testing.assert_array_equal(hard.Y[:, 0], two["x"].values)
    middle = whole.part(500, 700)
    assert [(p.name, p.samples) for p in middle.parts] == [("soft", 100), ("hard", 100)]
    assert hard.part(50, 60).start == pytest.approx(100.1)
    assert hard.part(50, 60).follows(hard.part(20, 50))
    assert not hard.follows(soft)
    assert not hard.part(50, 60).follows(soft)


def test_inputs_begin_anew_with_each_record():
    """No derivative of an imposed displacement sees the jump from one to the next."""
    model = replace(rig(), inputs=[Input("x", PLACE, "displacement")])
    one = of_rig()
    whole = record_of(model, [one, -one, one.isel(time=slice(0, 300))])
    alone = record_of(model, one).signals(model)
    found = whole.signals(model)
    np.testing.assert_array_equal(found[:1000], alone)
    np.testing.assert_allclose(found[1000:2000], -alone, atol=1e-12)
    assert found.shape == (2300, alone.shape[1])


def test_a_joined_record_is_taken_for_what_it_is():
    whole = record_of(oscillator(), [record(600), record(400, seed=1)])
    again = record_of(oscillator(), whole.data)
    assert (again.names, again.marks) == (whole.names, whole.marks)
    np.testing.assert_array_equal(again.times, whole.times)


def test_each_of_several_records_has_to_be_long_enough():
    whole = record_of(oscillator(), {"run": record(), "stub": record().isel(time=slice(0, 50))})
    with pytest.raises(InvalidInputError, match="50 samples in 'stub', expected at least 60"):
        require_length(oscillator(), whole)


SEVERAL = {
    "none": ([], "no record at all"),
    "other channels": (
        {"a": record(), "b": record()[["F"]], "c": record()[["F"]]},
        "'x' in 'a', but not in 'b', 'c', expected the same channels",
    ),
    "a channel that all lack": ([record()[["F"]]] * 2, "record 1: data: got no column 'x'"),
    "empty": ([record(), record().isel(time=slice(0, 0))], "record 2: data: got 0 samples"),
    "other rates": (
        [record(), record().assign_coords(time=record()["time"] * 1.5)],
        "whole multiples of the lowest",
    ),
}


@pytest.mark.parametrize("case", SEVERAL)
def test_several_refused(case):
    given, message = SEVERAL[case]
    with pytest.raises(InvalidInputError, match=message):
        record_of(oscillator(), given)


def test_how_long_a_record_has_to_be():
    two = oscillator(dofs=[Dof("x", 1.0), Dof("y", 1.0)], springs=[Spring(("x", "y"), 1.0)])
    assert least_samples(two) == 100
    short = record_of(two, record()).part(0, 99)
    with pytest.raises(InvalidInputError, match="at least 100"):
        require_length(two, short)
    assert require_length(oscillator(), short) is short


@pytest.mark.parametrize("kept", [1.0, 0.75])
def test_inputs_that_repeat_do_so_with_their_shortest_period(kept):
    """Once three turns of 300 samples, once two and a quarter; beside a constant."""
    turn = np.random.default_rng(0).standard_normal(300)
    u = np.tile(turn, 3)[: round(900 * kept)]
    assert input_period(np.column_stack([u, np.ones(u.size)]), 0.01) == pytest.approx(3.0)
    swing = np.sin(2 * np.pi * np.arange(u.size) / 50)[:, None]
    assert input_period(swing, 0.01) == pytest.approx(0.5)
    assert input_period(np.column_stack([u, swing]), 0.01) == pytest.approx(3.0)


def test_inputs_that_do_not_repeat_have_no_period():
    noise = np.random.default_rng(0).standard_normal((900, 1))
    assert input_period(noise, 0.01) is None
    assert input_period(np.tile(noise[:500], (2, 1))[:900], 0.01) is None  # not seen twice
    assert input_period(np.ones((900, 2)), 0.01) is None
    assert input_period(np.linspace(0, 1, 900)[:, None], 0.01) is None


def changed(**columns):
    return record().assign(columns)


def jittered():
    return record().assign_coords(time=np.sort(np.random.default_rng(0).random(4000)))


BAD = {
    "no column": (lambda: (oscillator(), record()[["F"]]), "no column 'x'"),
    "unit": (lambda: (oscillator(), changed(x=record()["F"])), "a column in N"),
    "nan": (
        lambda: (oscillator(), changed(x=record()["x"].where(record()["time"] < 2))),
        "nan at sample 1000",
    ),
    "text": (lambda: (oscillator(), changed(x=("time", ["a"] * 4000))), "numbers over time"),
    "no time": (lambda: (oscillator(), record().drop_vars("time")), "time"),
    "jitter": (lambda: (oscillator(), jittered()), "uniform"),
    "backwards": (lambda: (oscillator(), record().isel(time=slice(None, None, -1))), "rising"),
    "short": (lambda: (oscillator(), record().isel(time=slice(0, 2))), "samples"),
    "slow": (lambda: (oscillator(stiffness=4e6), record()), "sampling rate"),
    "no model": (lambda: ("model.toml", record()), "MechanicalModel"),
    "no data": (lambda: (oscillator(), 3), "measurement"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    make, message = BAD[case]
    with pytest.raises(InvalidInputError, match=message):
        record_of(*make())


def test_frequency_responses_are_refused_where_signals_over_time_are_needed():
    require_time_data(record())
    require_time_data("not_there.csv")
    response = oscillator().frequency_response(np.geomspace(1, 10, 20))
    with pytest.raises(InvalidInputError, match=r"compare .* and refit take frequency responses"):
        require_time_data(response)


def test_outputs_are_freed_of_what_sensors_add_and_lines_belong_to_their_part():
    model = oscillator(outputs=[Output("x", PLACE, "acceleration")])
    model = model.with_effect("sensor_offset", "x", {"offset": 2.0})
    held = model.with_effect("input_hold", "F", {"order": 0.0})
    shown = record()["x"].values
    found = record_of(model, record().assign(x=("time", shown, {"units": "m/s^2"})))
    np.testing.assert_allclose(found.raw_outputs(model), found.Y - 2.0)
    np.testing.assert_allclose(found.raw_outputs(held), found.Y - 2.0)
    assert found.lines(model) is None
    lines = found.lines(held)
    np.testing.assert_allclose(lines.end, found.signals(held))
    part = found.part(100, 200)
    np.testing.assert_allclose(part.own_lines(lines).begin, lines.begin[100:200])
    assert part.own_lines(None) is None


def test_a_motion_that_has_died_away_moves_no_more():
    rng = np.random.default_rng(1)
    time, noise = np.arange(2000.0), rng.standard_normal((2000, 2))
    decay = 300.0 * np.exp(-time / 40) * np.cos(time)
    outputs = 5.0 + noise + np.column_stack([decay, 0.5 * decay])
    quiet = np.full(2, 1.5)
    over = quiet_after(outputs, quiet, 200)
    assert 200 <= over <= 400  # of 300 noises one is left after 228 samples
    assert quiet_after(outputs, quiet, 500) == 500
    assert quiet_after(outputs[:390], quiet, 200) == 390  # more than half of it moves
    assert quiet_after(noise, quiet, 200) == 200
