from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from tests.sweeps import functions

NUMBERS = {"a": list(range(8))}


def test_a_grid_becomes_dimensions():
    found = rp.sweep(functions.product, {"a": [1, 2], "b": [1.5, 2.5, 3.5]}, executor="serial")
    assert found.result.dims == ("a", "b")
    assert np.array_equal(found.result, np.outer([1, 2], [1.5, 2.5, 3.5]))
    assert (found.failure == "").all()


def test_samples_become_one_dimension():
    samples = [{"a": 1, "b": 2}, {"a": 3, "b": 4}]
    found = rp.sweep(functions.product, samples, executor="serial")
    assert found.result.dims == ("sample",)
    assert found.result.values.tolist() == [2, 12]
    table = xr.Dataset({"a": ("i", [1, 3]), "b": ("i", [2, 4])})
    assert rp.sweep(functions.product, table, executor="serial").identical(found)


def test_processes_threads_and_this_process_give_the_same_bits():
    here = rp.sweep(functions.drawn, NUMBERS, executor="serial", seed=4)
    assert rp.sweep(functions.drawn, NUMBERS, seed=4).identical(here)
    with ThreadPoolExecutor(2) as threads:
        assert rp.sweep(functions.drawn, NUMBERS, executor=threads, seed=4).identical(here)
    spawned = np.random.SeedSequence(4).spawn(8)[6]
    assert np.array_equal(here.draws.sel(a=6), np.random.default_rng(spawned).normal(size=2))
    assert not rp.sweep(functions.drawn, NUMBERS, executor="serial", seed=5).identical(here)


def test_a_failure_has_its_reason_and_stops_nothing():
    found = rp.sweep(functions.drawn, NUMBERS, executor="serial")
    assert found.failure.sel(a=3) == "ValueError: three is refused"
    assert np.isnan(found.draws.sel(a=3)).all()
    assert np.isfinite(found.same.drop_sel(a=3)).all()


def test_another_shape_is_a_failure():
    found = rp.sweep(lambda n: np.zeros(n), {"n": [2, 3, 2]}, executor="serial")
    assert found.failure.values[1].startswith("ValueError: names, shapes")
    assert found.failure.values[[0, 2]].tolist() == ["", ""]


@pytest.mark.long
def test_a_worker_killed_in_mid_sweep_changes_nothing(tmp_path):
    killed = rp.sweep(partial(functions.kills_once, mark=str(tmp_path / "mark")), NUMBERS)
    assert (tmp_path / "mark").exists()
    quiet = partial(functions.kills_once, mark=str(tmp_path / "mark"))
    assert killed.identical(rp.sweep(quiet, NUMBERS, executor="serial"))


@pytest.mark.long
def test_a_point_that_always_kills_its_worker_is_the_only_failure():
    found = rp.sweep(functions.kills_always, {"a": [0, 1, 2, 3, 4]})
    assert (found.failure != "").values.tolist() == [False, False, True, False, False]
    assert "died 2 times" in str(found.failure.sel(a=2).item())
    assert np.array_equal(found.result.sel(a=4), [4, 4.5])


def test_a_lambda_needs_this_process():
    with pytest.raises(rp.InvalidInputError, match='executor="serial"'):
        rp.sweep(lambda a: a, NUMBERS)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ({}, "at least one name"),
        ([], "not empty"),
        ({"a": [object()]}, "real numbers"),
        ({"a": [np.nan]}, "finite"),
        ({"failure": [1]}, "Rename"),
        ([{"a": 1}, {"b": 2}], "first one's names"),
    ],
)
def test_points_that_are_none(points, words):
    with pytest.raises(rp.InvalidInputError, match=words):
        rp.sweep(functions.product, points, executor="serial")


def test_seed_and_executor_are_checked():
    with pytest.raises(rp.InvalidInputError, match="seed"):
        rp.sweep(functions.product, {"a": [1], "b": [2]}, seed=-1)
    with pytest.raises(rp.InvalidInputError, match="get_executor"):
        rp.sweep(functions.product, {"a": [1], "b": [2]}, executor="dask")
