"""Several records as one dataset, and apart again."""

import control
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification.record import (
    join_records,
    named_records,
    split_joined,
    with_common_step,
)


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
    with pytest.raises(InvalidInputError, match=said):
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


def test_one_record_is_itself():
    data = made()
    assert join_records({"any": data}) is data
    assert split_joined(data)["record 1"] is data


def test_what_only_some_have_is_left_out_and_notes_say_whose_they_are():
    one = made(T=np.full(50, 20.0)).assign_attrs(notes=["one gap filled"])
    whole = join_records({"a": one, "b": made()})
    assert list(whole.data_vars) == ["x"]
    assert whole.attrs["notes"] == ["a: one gap filled"]


def test_faster_records_come_down_to_the_slowest():
    fast, slow = made(4000, step=0.001), made(400, step=0.01)
    found = with_common_step({"fast": fast, "slow": slow})
    assert found["slow"] is slow
    np.testing.assert_allclose(np.diff(found["fast"]["time"]), 0.01)
    np.testing.assert_allclose(found["fast"]["x"], np.sin(7 * found["fast"]["time"]), atol=1e-3)
    assert "decimated from 1000 to 100 Hz" in found["fast"].attrs["notes"][0]
    same = {"a": made(), "b": made(step=0.01 * (1 + 1e-6))}  # the rounding of a file
    assert all(with_common_step(same)[name] is same[name] for name in same)


def test_rates_without_a_common_measure_are_refused():
    with pytest.raises(InvalidInputError, match="'a' sampled at 100 Hz, 'b' at 66"):
        with_common_step({"a": made(), "b": made(step=0.015)})
