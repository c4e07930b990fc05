"""Records: files and datasets, several records, what is refused."""

import control
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.identification.record import (
    checked_data,
    join_records,
    measured,
    named_records,
    record_of,
    require_time_data,
    split_joined,
    with_common_step,
)
from tests.identification.oscillators import PLACE, RATE, oscillator, record


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


def two_masses(**changes):
    """A mass on a fast one: 3.2 and 318 Hz."""
    parts = {
        "dofs": [rp.Dof("x", 1.0), rp.Dof("fast", 0.01)],
        "springs": [rp.Spring(("fast", "ground"), 4e4), rp.Spring(("x", "fast"), 404.04)],
        "dampers": [rp.Damper(("x", "ground"), 1.0)],
        "outputs": [rp.Output("x", PLACE), rp.Output("fast", ("fast", "ground"))],
    }
    return oscillator(**{**parts, **changes})


def test_outputs_that_were_not_measured_are_left_out_with_a_note(tmp_path):
    model = two_masses().with_effect("sensor_offset", "fast", {"offset": 1e-3})
    kept, found, notes = measured(model, record())
    assert (kept.output_names, kept.effects, found.Y.shape[1]) == (("x",), (), 1)
    assert "fast: not measured" in notes[0]
    compared = rp.compare(model, record())
    assert [*compared.outputs] == ["x"]
    assert "fast: not measured" in compared.notes[0]
    record().to_dataframe().to_csv(tmp_path / "data.csv")
    assert rp.compare(model, tmp_path / "data.csv").fit_percent == pytest.approx(
        compared.fit_percent, abs=1e-6
    )
    fitted = rp.refit(model, record()).model  # nothing of the model is lost
    assert (fitted.output_names, fitted.effects) == (("x", "fast"), model.effects)
    with pytest.raises(rp.InvalidInputError, match="no column 'fast'"):
        rp.compare(model, record(), outputs=model.output_names)
    with pytest.raises(rp.InvalidInputError, match="no column 'x'"):
        rp.compare(model, record()[["F"]])


def test_a_mode_above_the_band_of_the_record_keeps_its_static_part():
    # 404.04 N/m on 4e4 N/m make the 400 N/m of the record; 1 % more would be an error of 10 %
    compared = rp.compare(two_masses(), record())
    assert any("does not show the model's mode at 3" in note for note in compared.notes)
    assert compared.outputs["x"].nrmse < 5e-4


def test_a_constant_input_is_an_input():
    # 4 N push the oscillator of 400 N/m 10 mm away from where the record has it
    load = rp.Input("F_p", PLACE)
    model = oscillator(inputs=[rp.Input("F", PLACE), load])
    data = record().assign(F_p=("time", np.full(4000, 4.0)), x=record()["x"] + 0.01)
    assert rp.compare(model, data).outputs["x"].nrmse < 1e-3


def test_a_gain_may_convert_the_unit_of_an_input():
    amperes = record().assign(F=record()["F"].assign_attrs(units="A"))
    motor = oscillator(inputs=[rp.Input("F", PLACE, gain=35.0)])
    assert checked_data(motor, amperes) is amperes
    with pytest.raises(rp.InvalidInputError, match="a column in A"):
        checked_data(oscillator(), amperes)


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
    with pytest.raises(rp.InvalidInputError, match=message):
        record_of(oscillator(), given)


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
    "a still sensor": (lambda: (oscillator(), changed(x=0 * record()["x"])), "0 throughout"),
    "no data": (lambda: (oscillator(), 3), "measurement"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    make, message = BAD[case]
    with pytest.raises(rp.InvalidInputError, match=message):
        record_of(*make())


def test_frequency_responses_are_refused_where_signals_over_time_are_needed():
    require_time_data(record())
    require_time_data("not_there.csv")
    response = oscillator().frequency_response(np.geomspace(1, 10, 20))
    with pytest.raises(
        rp.InvalidInputError, match=r"compare .* and refit take frequency responses"
    ):
        require_time_data(response)


# Concatenation of several records.


def made(samples=50, begin=0.0, step=0.01, **channels):
    time = begin + step * np.arange(samples)
    values = {"x": np.sin(7 * time), **channels}
    return xr.Dataset({k: ("time", v, {"units": "m"}) for k, v in values.items()}, {"time": time})


def test_records_are_called_by_what_is_known_of_them(tmp_path):
    for name in ("soft.csv", "hard.csv"):
        (tmp_path / name).touch()
    one, two = made(), pd.DataFrame({"x": [1.0]})
    assert list(named_records(one)) == ["record 1"]
    assert list(named_records([one, two])) == ["record 1", "record 2"]
    assert list(named_records((tmp_path / "soft.csv", str(tmp_path / "hard.csv")))) == [
        "soft",
        "hard",
    ]
    assert list(named_records(["a/run.csv", "b/run.csv"])) == ["record 1", "record 2"]
    assert named_records({"soft": one, 2: two}) == {"soft": one, "2": two}
    assert list(named_records("a.csv")) == list(named_records(two)) == ["record 1"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "no record at all"),
        ({}, "no record at all"),
        ([made(), np.zeros(3)], "ndarray as 'record 2'"),
        ({"a": made(), "b": control.frd([1, 2], [1.0, 2.0])}, "frequency responses as 'b'"),
    ],
)
def test_what_is_no_record_is_refused(given, said):
    with pytest.raises(rp.InvalidInputError, match=said):
        named_records(given)


def test_what_is_joined_comes_apart_again():
    """With times that overlap, run backwards from record to record, or follow each other."""
    parts = {"late": made(50, 3.0), "early": made(30, 0.0), "next": made(20, 0.3)}
    whole = join_records(parts)
    assert whole.sizes["time"] == 100
    np.testing.assert_allclose(np.diff(whole["time"]), 0.01)
    apart = split_joined(whole)
    assert list(apart) == list(parts)
    for name, part in parts.items():
        xr.testing.assert_allclose(apart[name], part)
        assert apart[name]["x"].attrs["units"] == "m"
    cut = split_joined(whole.isel(time=slice(40, 60)))
    assert {name: part.sizes["time"] for name, part in cut.items()} == {"late": 10, "early": 10}


def test_faster_records_come_down_to_the_slowest():
    fast, slow = made(4000, step=0.001), made(400, step=0.01)
    found = with_common_step({"fast": fast, "slow": slow})
    assert found["slow"] is slow
    np.testing.assert_allclose(np.diff(found["fast"]["time"]), 0.01)
    np.testing.assert_allclose(found["fast"]["x"], np.sin(7 * found["fast"]["time"]), atol=1e-3)
    assert "decimated from 1000 to 100 Hz" in found["fast"].attrs["notes"][0]
    same = {"a": made(), "b": made(step=0.01 * (1 + 1e-6))}  # the rounding of a file
    assert all(with_common_step(same)[name] is same[name] for name in same)
