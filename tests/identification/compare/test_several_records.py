"""Several records held against one model: each by itself, and told together."""

import json

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import compare
from robustpolish.identification.residuals.analysis import residual_analysis
from robustpolish.machines.simulation.run import simulate_model as simulate
from tests.identification.oscillators import RATE, double_well, oscillator, record

SOFT, HARD = record(1000, (0.02, -0.3), noise=0.05), record(1500, (-0.1, 0.0), noise=0.1, seed=1)
BOTH = {"soft": SOFT, "hard": HARD}


def same(one, other):
    assert one.rmse == pytest.approx(other.rmse, rel=1e-9)
    assert one.nrmse == pytest.approx(other.nrmse, rel=1e-9)


@pytest.mark.parametrize("options", [{}, {"window": 0.5}, {"horizon": 0.1}])
def test_each_record_is_run_as_if_it_were_alone(options):
    model = oscillator(stiffness=390.0)
    found = compare(model, BOTH, **options)
    alone = {name: compare(model, data, **options) for name, data in BOTH.items()}
    assert list(found.records) == ["soft", "hard"]
    for name, one in alone.items():
        same(found.records[name].outputs["x"], one.outputs["x"])
        np.testing.assert_allclose(found.records[name].starts, one.starts)
        (itself,) = one.records.values()
        same(itself.outputs["x"], one.outputs["x"])
    assert len(found.starts) == sum(len(one.starts) for one in alone.values())
    sizes = np.array([one.simulated["x"].notnull().sum() for one in alone.values()])
    squares = np.array([one.outputs["x"].rmse ** 2 for one in alone.values()])
    assert found.outputs["x"].rmse == pytest.approx(np.sqrt(sizes @ squares / sizes.sum()))


def test_a_joined_comparison_may_be_compared_again():
    found = compare(oscillator(), BOTH)
    assert found.data.sizes["time"] == found.simulated.sizes["time"] == 2500
    again = compare(oscillator(stiffness=390.0), found.data)
    assert list(again.records) == ["soft", "hard"]
    assert "Record by record" in repr(again)
    assert "Record by record" not in repr(compare(oscillator(), SOFT))
    told = json.loads(json.dumps(again.to_dict(), allow_nan=False))
    assert set(told["records"]) == {"soft", "hard"}
    assert told["records"]["hard"]["fit_percent"] == again.records["hard"].fit_percent
    assert again.plot().get_ylabel() == "x [mm]"
    assert len(again.plot_panels().axes) == 3


def test_records_of_other_rates_come_down_to_the_slowest():
    model, time = oscillator(), np.arange(4000) / (4 * RATE)
    force = np.interp(time, SOFT["time"], SOFT["F"])
    fast = xr.Dataset({"F": ("time", force)}, {"time": time})
    fast["x"] = ("time", simulate(model, fast).outputs[:, 0])
    found = compare(model, {"soft": record(1000), "fast": fast})
    assert found.fit_percent > 99.9
    assert "fast: decimated from 2000 to 500 Hz" in found.notes[0]


def test_a_phase_is_that_at_time_0_of_each_record():
    values = {"amplitude": 3.0, "frequency": 2.3, "phase": 0.4}
    model = oscillator().with_effect("harmonic_force", ("x",), values)
    parts = []
    for begin in (0.0, 5.1):
        data = SOFT.assign_coords(time=SOFT["time"] + begin)
        parts.append(data.assign(x=("time", simulate(model, data).outputs[:, 0])))
    assert compare(model, parts).fit_percent > 99.9
    late = [parts[0], parts[1].assign_coords(time=SOFT["time"])]
    assert compare(model, late).records["record 2"].fit_percent < 95


def test_notes_say_whose_they_are():
    limit = 0.5 * float(HARD["x"].max())
    clipped = HARD.assign(x=HARD["x"].clip(-limit, limit))
    (note,) = compare(oscillator(), {"soft": SOFT, "hard": clipped}).notes
    assert note.startswith("hard: x sticks at its extremes")


def test_one_run_that_judges_nothing_is_enough():
    model, data = double_well(200)
    found = compare(model, {"short": data.isel(time=slice(0, 100)), "long": data})
    states = {name: e.reproducibility.reproducible for name, e in found.records.items()}
    assert states == {"short": True, "long": False}
    assert not found.reproducible
    assert any(note.startswith("long: the free run is not reproducible") for note in found.notes)


def test_repeats_are_told_with_their_noise():
    noise = 0.05 * np.std(record(1000)["x"].values)
    random = np.random.default_rng(3)
    again = [record(1000)["x"] + noise * random.standard_normal(1000) for _ in range(2)]
    pair = [record(1000).assign(x=x) for x in again]
    (note,) = compare(oscillator(), pair).notes
    assert note.startswith("record 1 and record 2 repeat each other; they differ by noise of x ")
    assert float(note.split()[-2]) == pytest.approx(noise, rel=0.1)


def test_uncertain_numbers_give_a_band_over_all_records():
    errors = {"spring[0].stiffness": 4.0}
    both = compare(oscillator(), BOTH, standard_errors=errors).band["x"].values
    soft = compare(oscillator(), SOFT, standard_errors=errors).band["x"].values
    np.testing.assert_allclose(both[:1000], soft, atol=1e-6 * soft.max())
    assert both.size == 2500


def test_where_the_error_of_several_records_is():
    model = oscillator(stiffness=390.0)
    analysis = residual_analysis(compare(model, BOTH), windows=5)
    share = analysis.windows.sel(output="x").values
    assert share[:2].sum() < share[2:].sum()  # the second record is the larger
    assert analysis.places["x"].observed
    assert "x" in analysis.explain()
    short = residual_analysis(compare(model, [SOFT, HARD.isel(time=slice(0, 50))]))
    assert not short.places["x"].observed  # too short for an observer
    ahead = compare(model, BOTH, horizon=0.1)
    with pytest.raises(InvalidInputError, match="predictions of 2 records"):
        residual_analysis(ahead)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "no record at all"),
        ([SOFT, SOFT[["F"]]], "'x' in 'record 1', but not in 'record 2'"),
        ([SOFT, SOFT.isel(time=slice(0, 0))], "record 2: data: got 0 samples"),
    ],
)
def test_refused(given, said):
    with pytest.raises(InvalidInputError, match=said):
        compare(oscillator(), given)
