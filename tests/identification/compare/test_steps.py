from dataclasses import replace

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.identification.steps import STEP_PLOT, step_runs
from tests import made_up
from tests.identification.oscillators import PLACE, oscillator, record

CUBIC = 2e4
DATA = record(cubic=CUBIC, start=(0.05, 0.0), noise=0.01)
MODELS = (
    oscillator(stiffness=380.0),
    oscillator(),
    oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": CUBIC}),
)


def diagnosis(models=MODELS, **changes):
    found = made_up.diagnosis()
    steps = ("base", "refit", "cubic_stiffness")
    ledger = rp.results.Ledger(noise_floor={"x": 0.01})
    for step, model in zip(steps, models, strict=True):
        ledger = ledger.add(step, {"x": 0.1}, model)
    return replace(found, model=MODELS[-1], ledger=ledger, **changes)


@pytest.fixture(scope="module")
def runs():
    return step_runs(diagnosis(), DATA)


def test_every_step_has_the_run_before_and_after_it(runs):
    assert [run.step for run in runs] == ["base", "refit", "cubic_stiffness"]
    assert runs[0].before is None
    assert runs[1].before is runs[0].after
    assert [run.after.model for run in runs] == list(MODELS)
    last = runs[-1]
    assert last.after.outputs["x"].nrmse == pytest.approx(0.01, rel=0.05)
    assert last.before.outputs["x"].nrmse > 0.1
    assert {run.after.method for run in runs} == {"free run"}


def test_the_stretch_is_where_the_step_did_most(runs):
    stretch = runs[-1].stretch()
    lasts = stretch.stop - stretch.start
    gain = (runs[-1].before.residual["x"] ** 2 - runs[-1].after.residual["x"] ** 2).cumsum()
    inside = float(gain.sel(time=stretch)[-1] - gain.sel(time=stretch)[0])
    shifted = gain.values[round(lasts * 500) :] - gain.values[: -round(lasts * 500)]
    assert inside == pytest.approx(shifted.max(), rel=0.02)
    # eight swings of the strongest line, near the mode at 3.2 Hz or the decay's first amplitude
    assert lasts == pytest.approx(STEP_PLOT.swings / 3.2, rel=0.25)


def test_the_panels_show_measured_before_after_and_what_is_left(runs):
    run = runs[-1]
    stretch = run.stretch()
    above, below, whole = run.plot_panels().axes
    labels = [str(line.get_label()) for line in above.lines]
    assert labels == ["measured", "before", "after"]
    np.testing.assert_allclose(
        np.asarray(above.lines[0].get_ydata()), DATA["x"].sel(time=stretch).values
    )
    left = {str(line.get_label()): np.asarray(line.get_ydata()) for line in below.lines}
    np.testing.assert_allclose(
        left["after"], run.after.residual["x"].sel(time=stretch).values, atol=1e-12
    )
    assert left["before"].std() > 5 * left["after"].std()
    assert len(whole.lines[0].get_xdata()) > len(below.lines[0].get_xdata())
    first = runs[0].plot_panels().axes[0]
    assert [str(line.get_label()) for line in first.lines] == ["measured", "after"]
    assert run.plot().get_xlabel() == "time [s]"
    assert "cubic_stiffness, free run" in repr(run)
    with pytest.raises(InvalidInputError, match="output"):
        run.plot_panels(output="F")


def test_a_model_whose_long_runs_judge_nothing_runs_in_windows():
    found = step_runs(diagnosis(reproducible=False), DATA)
    assert {run.after.method for run in found} == {"windows"}
    assert found[0].after.span == pytest.approx(4000 // 25 / 500)


def test_steps_of_older_files_have_no_model_and_are_left_out():
    old = diagnosis(models=(None, None, MODELS[-1]))
    (only,) = step_runs(old, DATA)
    assert (only.step, only.before) == ("cubic_stiffness", None)


def test_models_and_maps_of_steps_come_back_from_files(tmp_path):
    found = rp.diagnose(*_small(), progress=str)
    found.save(tmp_path / "found.json")
    again = rp.load(tmp_path / "found.json")
    assert [e.model for e in again.ledger.entries] == [e.model for e in found.ledger.entries]
    assert again.ledger.entries[-1].model == found.model
    assert again.notes == found.notes
    for one, other in zip(found.maps, again.maps, strict=True):
        assert (one.at, one.size, one.follows) == (other.at, other.size, other.follows)
        np.testing.assert_array_equal(one.surface["force"], other.surface["force"])
        assert one.unit == other.unit == "N"
        assert other.surface["velocity"].attrs == {"units": "m/s"}


def _small():
    model, data = rp.datasets.sticky_slide()
    return model, data.isel(time=slice(0, 500))
