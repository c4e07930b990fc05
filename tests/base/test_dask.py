"""A sweep on a Dask cluster is the sweep of one process, also when a worker dies in it."""

import os
from functools import partial

import pytest

import robustpolish as rp
from benchmarks.sweeps import controlled
from tests.base import sweep_functions as functions

distributed = pytest.importorskip("distributed", reason="needs the extra [cluster]")
NUMBERS = {"a": list(range(40))}
pytestmark = [
    pytest.mark.long,
    # Dask says so when a worker is killed, which is what is tried here
    pytest.mark.filterwarnings("ignore::UserWarning:distributed"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture
def cluster():
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        yield client


def test_the_same_dataset_on_two_workers_of_a_cluster(cluster):
    here = rp.sweep(functions.drawn, NUMBERS, executor="serial", seed=4)
    there = rp.sweep(functions.drawn, NUMBERS, executor=cluster.get_executor(), seed=4)
    assert there.identical(here)
    plant = partial(functions.slowest_pole, rp.air_bearing())
    grid = {"factor": [1.0, 2.0]}
    there = rp.sweep(plant, grid, executor=cluster.get_executor())
    assert there.identical(rp.sweep(plant, grid, executor="serial"))


def test_a_worker_of_the_cluster_killed_in_mid_sweep_changes_nothing(cluster, tmp_path):
    before = set(cluster.run(os.getpid).values())
    fragile = partial(functions.kills_once, mark=str(tmp_path / "mark"))
    found = rp.sweep(fragile, NUMBERS, executor=cluster.get_executor())
    assert (tmp_path / "mark").exists()
    assert set(cluster.run(os.getpid).values()) != before
    assert found.identical(rp.sweep(fragile, NUMBERS, executor="serial"))


def test_closed_loops_run_unchanged_on_processes_and_on_a_cluster(cluster):
    """The sweep of the benchmark, shorter: every point draws a machine and simulates its loop."""
    loops, points = controlled(0.1), {"number": range(200)}
    here = rp.sweep(loops, points, seed=1)
    assert (here.failure == "").all()
    assert rp.sweep(loops, points, executor=cluster.get_executor(), seed=1).identical(here)
