import numpy as np
import pytest

from robustpolish.identification.compare import compare
from robustpolish.identification.observer.runs import (
    Reproducibility,
    StartedPiece,
    free_run,
    reproducibility,
    rest,
)
from robustpolish.identification.record import record_of
from robustpolish.machines.mechanical.parts import Output
from tests.identification.oscillators import (
    PLACE,
    RATE,
    double_well,
    of_rig,
    oscillator,
    record,
    rig,
)


def judged(model, data, outputs=None, **options):
    held = record_of(model, data)
    run, piece = free_run(model, held), StartedPiece(held, rest(model))
    outputs = run.over(piece).outputs if outputs is None else outputs
    return reproducibility(run, piece, outputs, **options)


def test_a_damped_oscillator_forgets_its_start():
    found = judged(oscillator(), record(noise=0.01))
    assert found.reproducible
    assert found.diverged_after is None
    assert found.reason == ""
    assert 0 < found.growth < 2  # of displacement and velocity, each by a millionth of its size


def test_changes_grow_as_the_matrix_exponential_says():
    """Poles at +5 and -5 1/s; what is beyond a thousandth of the output's size matters."""
    model, held = oscillator(stiffness=-25.0, damping=0.0), record_of(oscillator(), record(1000))
    run, piece = free_run(model, held), StartedPiece(held, rest(model))
    seen = run.over(piece, keep=True)
    found = reproducibility(run, piece, seen.outputs)
    moved = 1e-6 * np.std(seen.states, axis=0)
    time = np.arange(1000) / RATE
    change = (moved[0] * np.cosh(5 * time) + moved[1] * np.sinh(5 * time) / 5) / np.std(held.Y)
    assert found.growth == pytest.approx(1e6 * change.max(), rel=1e-4)
    assert found.diverged_after == pytest.approx(time[change > 1e-3][0])
    assert not found.reproducible
    assert f"within {found.diverged_after:.4g} s" in found.reason
    assert judged(model, record(1000), span=0.1).reproducible


def test_a_jump_that_comes_a_sample_later_is_no_parting_of_runs():
    """With friction an acceleration jumps as it turns round; runs in front of and behind agree."""
    model = oscillator(outputs=[Output("x", PLACE, "acceleration")])
    model = model.with_effect("coulomb_friction", PLACE, {"force": 0.5})
    data = record(20000)[["F"]].assign(x=("time", np.zeros(20000)))
    seen = free_run(model, held := record_of(model, data)).over(StartedPiece(held, rest(model)))
    data = data.assign(x=("time", seen.outputs[:, 0]))
    found = judged(model, data)
    assert found.reproducible
    assert found.growth < 1000


def test_predictions_need_not_hold_from_the_first_sample_on():
    data = record()
    late = data["x"].values[:, None].copy()
    late[:7] = np.nan
    found = judged(oscillator(), data, late)
    assert not found.reproducible
    assert found.diverged_after == pytest.approx(0.0)
    late[:7], late[7:] = 0.0, np.nan
    assert judged(oscillator(), data, late).diverged_after == pytest.approx(7 / RATE)
    late[7:], late[:7] = 0.0, np.nan
    assert judged(oscillator(), data, late, span=0.1, ahead=True).reproducible


def test_what_has_no_start_is_reproducible():
    assert judged(rig(), of_rig()) == Reproducibility(True, 0.0, None, "")


def test_an_integrating_model_says_that_windows_judge_it_better():
    model = oscillator(springs=[])
    result = compare(model, record())
    assert result.reproducible
    assert any("integrates" in note for note in result.notes)
    assert compare(model, record(), window=0.5).notes == ()


def test_a_chaotic_run_judges_nothing_and_says_so():
    model, data = double_well(300)
    result = compare(model, data)
    assert not result.reproducible
    assert any("not reproducible" in note for note in result.notes)
    assert 0 < result.reproducibility.diverged_after < 300
    short = compare(model, data, window=5.0)
    assert short.reproducible
    assert short.fit_percent > 95


def test_an_unstable_model_diverges_and_says_so():
    result = compare(oscillator(damping=-200.0), record())
    assert not result.reproducible
    assert "diverges" in result.notes[0]
    assert result.outputs["x"].nrmse > 1 or np.isinf(result.outputs["x"].nrmse)
