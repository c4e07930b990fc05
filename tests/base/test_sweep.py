"""Sweeps: grids and samples, failures, killed workers, files to go on from, clusters."""

import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.base.sweep import as_bytes
from tests.base import sweep_functions as functions

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


def test_processes_give_the_same_bits_as_this_process():
    here = rp.sweep(functions.drawn, NUMBERS, executor="serial", seed=4)
    assert rp.sweep(functions.drawn, NUMBERS, seed=4).identical(here)


def test_threads_give_the_same_bits_as_this_process():
    here = rp.sweep(functions.drawn, NUMBERS, executor="serial", seed=4)
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


GRID = {"a": list(range(60))}


@pytest.mark.long
def test_the_whole_process_killed_and_resumed(tmp_path):
    log, file = tmp_path / "log", tmp_path / "sweep.jsonl"
    script = tmp_path / "run.py"
    script.write_text(
        "from functools import partial\n"
        "import robustpolish as rp\n"
        "from tests.base import sweep_functions as functions\n"
        'if __name__ == "__main__":\n'
        f"    slow = partial(functions.slow_draw, log={str(log)!r})\n"
        f'    rp.sweep(slow, {{"a": list(range(60))}}, file={str(file)!r}, seed=3)\n'
    )
    root = Path(__file__).parents[2]
    process = subprocess.Popen(
        [sys.executable, str(script)], env={**os.environ, "PYTHONPATH": str(root)}
    )
    while process.poll() is None and not (file.exists() and file.read_bytes().count(b"\n") > 10):
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = file.read_bytes().count(b"\n") - 1
    assert 10 <= kept < 60
    log.write_bytes(b"")
    slow = partial(functions.slow_draw, log=str(log))
    resumed = rp.sweep(slow, GRID, executor="serial", file=file, seed=3)
    assert len(log.read_bytes()) <= 60 - kept + 8  # the orphans may still end a call
    assert resumed.identical(rp.sweep(slow, GRID, executor="serial", seed=3))


@pytest.fixture
def finished(tmp_path):
    file = tmp_path / "sweep.jsonl"
    return file, rp.sweep(functions.drawn, {"a": [1, 2, 3]}, executor="serial", file=file)


def test_a_torn_last_line_is_done_again(finished):
    file, whole = finished
    content = file.read_bytes()
    for cut in range(0, len(content), 23):
        file.write_bytes(content[:cut])
        again = rp.sweep(functions.drawn, {"a": [1, 2, 3]}, executor="serial", file=file)
        assert again.identical(whole)
        assert file.read_bytes() == content


def test_the_file_of_another_sweep_is_refused(finished):
    file, _ = finished
    before = file.read_bytes()
    for function, a, seed in [
        (functions.drawn, [1, 2, 4], 0),
        (functions.drawn, [1, 2, 3], 1),
        (functions.kills_always, [1, 2, 3], 0),
    ]:
        with pytest.raises(rp.InvalidInputError, match="another function, other points"):
            rp.sweep(function, {"a": a}, executor="serial", file=file, seed=seed)
    assert file.read_bytes() == before


def test_foreign_and_damaged_files_are_left_alone(finished):
    file, _ = finished
    lines = file.read_bytes().splitlines(keepends=True)
    for content, words in [
        (b"a,b\n1,2\n", "something else"),
        (b"notes", "something else"),
        (lines[0] + b"0" + lines[1] + lines[2], "damaged in line 2"),
    ]:
        file.write_bytes(content)
        with pytest.raises(rp.InvalidInputError, match=words):
            rp.sweep(functions.drawn, {"a": [1, 2, 3]}, executor="serial", file=file)
        assert file.read_bytes() == content


def test_a_system_comes_back_to_the_bit():
    system = control.StateSpace(
        [[-1.0, 1 / 3], [0.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.1,
        inputs=["F"], outputs=["x"], states=["a", "b"], name="machine",
    )  # fmt: skip
    back = pickle.loads(as_bytes(system))
    assert all(
        np.array_equal(getattr(back, name), getattr(system, name)) for name in ("A", "B", "C", "D")
    )
    assert (back.dt, back.name, back.state_labels) == (0.1, "machine", ["a", "b"])
    assert (back.input_labels, back.output_labels) == (["F"], ["x"])


def test_the_same_plant_gives_the_same_bytes_whatever_else_was_made():
    first, _, second = rp.air_bearing(), control.ss(-1, 1, 1, 0), rp.air_bearing()
    assert first.system.name != second.system.name
    assert as_bytes(first) == as_bytes(second)


@pytest.mark.long
def test_a_plant_can_be_bound_to_a_function_of_other_processes():
    poles = partial(functions.slowest_pole, rp.air_bearing())
    found = rp.sweep(poles, {"factor": [1.0, 2.0]})
    assert (found.failure == "").all()
    assert found.identical(rp.sweep(poles, {"factor": [1.0, 2.0]}, executor="serial"))


def test_what_no_other_process_can_build_is_refused():
    with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
        as_bytes(lambda: 0)
