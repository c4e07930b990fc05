import numpy as np
import pytest

from robustpolish.identification.experiments.candidates import EXPERIMENTS, KINDS, experiments
from robustpolish.identification.record import record_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE, of_rig, oscillator, record, rig


def made(model=None, data=None, **options):
    model, data = model or oscillator(), record() if data is None else data
    return experiments(model, record_of(model, data), **options)


def of(found, kind, times=1.0):
    return next(e for e in found if (e.kind, e.times) == (kind, times))


def test_every_kind_comes_at_every_amplitude():
    found = made()
    assert {(e.kind, e.times) for e in found} == {(k, t) for k in KINDS for t in EXPERIMENTS.times}
    largest = float(np.abs(record()["F"].values).max())
    for e in found:
        if e.kind != "decay":
            assert e.amplitude == pytest.approx(e.times * largest)
            assert np.abs(e.inputs["F"].values).max() == pytest.approx(e.amplitude, rel=0.01)
            assert e.unit == "N"


def test_what_the_waves_look_like():
    found = made()
    mode = np.sqrt(400.0) / (2 * np.pi)
    step = of(found, "step").inputs["F"].values
    assert step[0] == 0
    assert set(np.unique(step)) == {0.0, step[-1]}
    slow = of(found, "to and fro")
    # 8000 samples of 2 ms hold two and a half turns of 0.16 Hz
    assert slow.band[0] == pytest.approx(max(mode / EXPERIMENTS.slow, 2.5 / 16.0))
    corners = np.diff(slow.inputs["F"].values, 2)
    assert np.count_nonzero(np.abs(corners) > 1e-3 * np.abs(corners).max()) <= 10  # straight lines
    low, high = of(found, "sweep").band
    assert (low, high) == pytest.approx((0.3 * mode, 2 * mode))
    same = of(found, "record", 3.0).inputs["F"].values
    np.testing.assert_allclose(same, 3 * record()["F"].values)


def test_a_free_decay_begins_with_a_static_pull():
    chain = MechanicalModel(
        [Dof("x", 1.0), Dof("y", 1.0)],
        [Spring(PLACE, 300.0), Spring(("x", "y"), 600.0)],
        [Damper(PLACE, 1.0)],
        [Input("F", PLACE)],
        [Output("x", PLACE)],
    )
    found = [e for e in made(chain, places=["y", "ground"]) if e.kind == "decay"]
    assert {e.channel for e in found} == {"y"}
    for e in found:
        x, y, *rest = e.initial_state
        assert y == pytest.approx(e.amplitude)
        assert x == pytest.approx(y * 600 / 900)  # springs in series share the pull
        assert rest == [0.0, 0.0]
        assert not e.inputs["F"].values.any()


def test_what_the_inputs_do_not_allow_is_left_out():
    largest = float(np.abs(record()["F"].values).max())
    found = made(limits={"F": 1.5 * largest})
    assert {e.times for e in found if e.kind == "step"} == {0.3, 1.0}
    assert {e.times for e in found if e.kind == "decay"} == set(EXPERIMENTS.times)


def test_a_machine_without_inputs_is_pulled_only():
    free = oscillator(inputs=[])
    data = record(start=(0.01, 0.0))[["x"]]
    assert {e.kind for e in made(free, data)} == {"decay"}


def test_a_mass_that_nothing_holds_cannot_be_pulled():
    assert "decay" not in {e.kind for e in made(oscillator(springs=[]))}


def test_an_imposed_motion_does_not_jump_and_brings_its_velocity():
    found = made(rig(), of_rig())
    assert {e.kind for e in found} == {"record", "to and fro", "sweep"}
    assert {e.channel for e in found} == {"x"}
    for e in found:
        x, v, time = (e.inputs[k].values for k in ("x", "v", "time"))
        if e.kind != "record":
            assert x[0] == pytest.approx(0.0)
            np.testing.assert_allclose(v, np.gradient(x, time), atol=1e-9 * np.abs(v).max())


def test_words_name_what_is_driven_how_far_and_where():
    found = made()
    text = str(of(found, "sweep", 3.0))
    assert text.startswith("a sweep on F, up to ")
    assert "3 times that of the record" in text
    assert text.endswith("from 0.955 to 6.37 Hz")
    assert "let go" in str(of(found, "decay"))
