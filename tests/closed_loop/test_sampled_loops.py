"""Monte Carlo over machines and loads."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.closed_loop.sampled_loops import loop_norm
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.closed_loop.functions import roughness, with_state

# Sampled loops are those that a user would build by hand, on any number of workers.

AT = ("x", "ground")
MASS, STIFFNESS = "dof.x.mass", "spring[0].stiffness"
SPREAD = {STIFFNESS: ("normal", 800.0, 40.0), MASS: (1.9, 2.1)}


def machine(stiffness=800.0, mass=2.0):
    return rp.MechanicalModel(
        [Dof("x", mass)], [Spring(AT, stiffness)], [Damper(AT, 4.0)],
        [Input("F", AT)], [Output("x", AT)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def design():
    return rp.state_feedback(with_state(machine()), method="riccati", control_weight=1e-3)


@pytest.fixture(scope="module")
def bearing():
    plant = rp.air_bearing(actuation="force")
    return rp.state_feedback(plant, method="riccati", control_weight=1e-7)


@pytest.fixture(scope="module")
def push():
    time = np.arange(500) / 1000
    force = np.sin(20 * time)
    plant = with_state(machine())
    return xr.Dataset(
        dict.fromkeys(plant.disturbance_names, ("time", force)), coords={"time": time}
    )


def test_norms_and_peaks_are_those_of_loops_built_by_hand(design, push):
    study = rp.polishing.monte_carlo(
        design, SPREAD, machine=machine(), plant_of=with_state, disturbance=push,
        figures=roughness, samples=5, executor="serial",
    )  # fmt: skip
    assert not study.failures
    for i in range(5):
        drawn = machine(*(float(study.dataset[key][i]) for key in (STIFFNESS, MASS)))
        plant = with_state(drawn).with_full_state()
        priced = rp.state_feedback(plant, method="riccati", control_weight=1e-3).plant
        assert float(study.dataset.norm[i]) == pytest.approx(
            loop_norm(priced.closed_loop(design.controller), "hinf")
        )
        response = rp.simulate(plant.closed_loop(design.controller), push)
        peak = float(abs(response.x).max())
        assert float(study.dataset.peak_x[i]) == pytest.approx(peak, rel=1e-9)
        assert float(study.dataset.rms[i]) == pytest.approx(roughness(response)["rms"], rel=1e-9)
    assert study.nominal["norm"] == pytest.approx(design.certificate.achieved, rel=1e-5)


def test_threads_and_further_names_change_no_draw(design):
    options = {"machine": machine(), "plant_of": with_state, "samples": 8, "seed": 3}
    here = rp.polishing.monte_carlo(design, SPREAD, executor="serial", **options)
    with ThreadPoolExecutor(3) as threads:
        there = rp.polishing.monte_carlo(design, SPREAD, executor=threads, **options)
    assert there.dataset.identical(here.dataset)
    wider = {**SPREAD, "damper[0].damping": (3.0, 5.0)}
    more = rp.polishing.monte_carlo(design, wider, executor="serial", **options)
    assert np.array_equal(more.dataset[MASS], here.dataset[MASS])
    assert not np.array_equal(more.dataset.norm, here.dataset.norm)


@pytest.mark.long
def test_processes_give_the_same_bits_with_brush_and_machine_drawn(bearing):
    drawn = {"brush_mass": ("normal", 0.2, 0.02), "brush.friction": (0.2, 0.4)}
    options = {"duration": 0.005, "samples": 20, "seed": 3}
    here = rp.polishing.monte_carlo(bearing, drawn, executor="serial", **options)
    assert rp.polishing.monte_carlo(bearing, drawn, **options).dataset.identical(here.dataset)


def test_a_study_goes_on_from_its_file(design, tmp_path):
    own = {"machine": machine(), "plant_of": with_state, "executor": "serial", "samples": 6}
    file = tmp_path / "study.jsonl"
    whole = rp.polishing.monte_carlo(design, SPREAD, file=file, **own)
    content = file.read_bytes()
    file.write_bytes(content[: 2 * len(content) // 3])
    again = rp.polishing.monte_carlo(design, SPREAD, file=file, **own)
    assert again.dataset.identical(whole.dataset)
    assert file.read_bytes() == content


def test_the_brush_is_run_with_what_was_drawn(bearing):
    study = rp.polishing.monte_carlo(
        bearing,
        {"run": [1, 2], "brush.friction": (0.2, 0.4), "surface.across": (2.0, 2.5)},
        duration=0.005, samples=3, executor="serial",
    )  # fmt: skip
    for i in range(3):
        drawn = {name: study.dataset[name][i].item() for name in study.trial.names}
        brush = rp.polishing.BrushParameters.for_run(
            drawn["run"],
            friction=drawn["brush.friction"],
            surface=rp.polishing.Surface(across=drawn["surface.across"]),
        )
        load = rp.polishing.simulate_brush(duration=0.005, parameters=brush)
        response = rp.simulate(bearing, load)
        assert float(study.dataset.peak_y[i]) == float(abs(response.y).max())
        assert float(study.dataset.peak_u_z[i]) == float(abs(response.u_z).max())
    assert study.dataset.peak_y.attrs["units"] == "m"
    assert np.unique(study.dataset.norm).size == 1


def test_a_machine_that_cannot_be_is_a_failure_and_counts_as_worst(design):
    study = rp.polishing.monte_carlo(
        design, {MASS: [2.0, -1.0]}, machine=machine(), plant_of=with_state, samples=10,
        executor="serial",
    )  # fmt: skip
    bad = np.flatnonzero(study.dataset[MASS] < 0)
    assert set(study.failures) == set(bad)
    assert 0 < bad.size < 10
    assert "InvalidInputError" in study.failures[int(bad[0])]
    assert study.share("norm", np.finfo(float).max) == pytest.approx(1 - bad.size / 10)
    assert study.worst() not in bad
    assert "failed, counted as worst" in repr(study)


def test_an_unstable_loop_has_infinite_figures(push):
    rod = rp.state_feedback(with_state(machine(-40.0)), method="riccati", control_weight=1e-1)
    study = rp.polishing.monte_carlo(
        rod, {STIFFNESS: [-40.0, -4e9]}, machine=machine(-40.0), plant_of=with_state,
        disturbance=push, figures=roughness, samples=6, executor="serial",
    )  # fmt: skip
    gone = (study.dataset[STIFFNESS] < -1e5).values
    for name in ("norm", "peak_x", "rms"):
        assert np.array_equal(np.isinf(study.dataset[name].values), gone)
    assert study.replay().response is None
    assert not study.failures


def test_what_means_nothing_is_refused(design, bearing, push):
    own = {"machine": machine(), "plant_of": with_state, "executor": "serial"}
    for distributions, options, words in [
        ({"dof.x.mas": (1.0, 2.0)}, own, "Write dof.x.mass"),
        ({"brush.frictoin": (0.2, 0.3)}, own, "Write brush.friction"),
        ({}, own, "a distribution by name"),
        ({"run": [1]}, own, "duration"),
        ({"run": [1]}, {**own, "duration": 1.0, "disturbance": push}, "Leave out duration"),
        (SPREAD, {**own, "samples": 0}, "samples"),
        (SPREAD, {**own, "seed": -1}, "seed"),
        (SPREAD, {"executor": "serial"}, "brush.NAME"),
    ]:
        with pytest.raises(rp.InvalidInputError, match=words):
            rp.polishing.monte_carlo(design, distributions, **options)
    with pytest.raises(rp.InvalidInputError, match="plant_of"):
        rp.polishing.monte_carlo(bearing, SPREAD, **own)


# Percentiles, shares and replays of a study whose figures are known.


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
    found = rp.polishing.monte_carlo(
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
