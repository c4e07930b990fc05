"""Percentiles, shares and replays of a study whose figures are known."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp


def study(norms, failures=None):
    count = len(norms)
    reasons = np.array(failures or [""] * count)
    dataset = xr.Dataset(
        {"norm": ("sample", np.array(norms, dtype=float)), "failure": ("sample", reasons)},
        coords={"mass": ("sample", np.arange(count, dtype=float))},
    )
    return rp.results.SampledLoops(dataset, {"norm": 1.0}, 0, SimpleNamespace(names=("mass",)))


def test_percentiles_and_shares_count():
    found = study(np.arange(1.0, 101.0))
    assert found.percentile("norm", 95) == 95.0
    assert found.percentile("norm", 100) == 100.0
    assert found.percentile_limits("norm", 50.0) == (40.0, 61.0)
    assert found.share("norm", 80.0) == 0.8
    low, high = found.share_limits("norm", 80.0)
    assert low < 0.8 < high
    assert found.worst() == 99


def test_failures_are_worse_than_everything_but_are_not_replayed():
    found = study([1.0, np.nan, 3.0, np.inf], ["", "ValueError: no", "", ""])
    assert found.failures == {1: "ValueError: no"}
    assert found.share("norm", 5.0) == 0.5
    assert found.percentile("norm", 75) == np.inf
    assert found.worst() == 3
    assert "1 failed, counted as worst: sample 1, ValueError: no" in repr(found)
    assert "2 of 4 loops are stable" in repr(found)


def test_a_replay_has_the_bits_of_the_study():
    plant = rp.air_bearing(actuation="force")
    design = rp.state_feedback(plant, method="riccati", control_weight=1e-7)
    found = rp.monte_carlo(
        design, {"brush_mass": (0.15, 0.25)}, duration=0.005, samples=4, executor="serial"
    )
    for sample in range(4):
        replay = found.replay(sample)
        assert replay.sample == sample
        for name, value in replay.figures.items():
            assert value == float(found.dataset[name][sample])
        assert float(abs(replay.response.y).max()) == replay.figures["peak_y"]
    assert found.replay(figure="peak_y").sample == int(np.argmax(found.dataset.peak_y.values))


def test_the_picture_says_what_it_leaves_out():
    ax = study([1.0, 2.0, np.inf]).plot()
    assert ax.get_title() == "1 of 3 unstable or failed"


def test_questions_without_sense_are_refused():
    found = study([1.0, 2.0])
    for ask, words in [
        (lambda: found.percentile("norm", 0), "percent"),
        (lambda: found.percentile("gain", 50), "figure"),
        (lambda: found.percentile_limits("norm", 50, 95), "confidence"),
        (lambda: found.replay(2), "sample"),
    ]:
        with pytest.raises(rp.InvalidInputError, match=words):
            ask()
