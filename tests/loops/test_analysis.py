"""The analysis as a whole: designs, plants, display, dictionaries, pictures, unstable loops."""

import json
import math

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.saved import plain
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK, delayed_poles


@pytest.fixture(scope="module")
def thesis():
    """The thesis's ideal state feedback: forces priced at 1e-7 m/N."""
    design = rp.state_feedback(rp.air_bearing(actuation="force"), control_weight=1e-7)
    return design, rp.loop_analysis(design)


def test_the_ideal_design_bears_a_fraction_of_a_microsecond(thesis):
    design, analysis = thesis
    assert 0.1e-6 < analysis.delay_margin < 0.3e-6
    fastest = np.abs(design.certificate.poles).max()
    # One fast pole: a quarter of a period at its rate.
    assert analysis.delay_margin == pytest.approx(np.pi / 2 / fastest, rel=1e-3)
    inputs = analysis.at_once["inputs"]
    assert inputs.any_delay_s == pytest.approx(analysis.delay_margin, rel=0.02)
    assert inputs.any_delay_s < analysis.delay_margin
    assert max(row.crossover_hz for row in analysis.bandwidths[:6]) == pytest.approx(
        fastest / (2 * np.pi), rel=1e-3
    )
    assert not analysis.buildable
    for text in ("makes it unstable", "takes all 12 states as measured", "without bound"):
        assert text in analysis.explain()


def test_the_ideal_design_with_delay_by_pade(thesis):
    design, analysis = thesis
    plant = design.plant
    measured = control.ss(plant.A, plant.B2, plant.C2, 0)
    for share, stable in ((0.97, True), (1.03, False)):
        delays = [share * analysis.delay_margin] * 6
        poles = delayed_poles(measured, design.controller.D, delays, order=3)
        assert (
            bool(poles.real.max() < 1e-6 * np.abs(poles).max() and poles.real.max() < 1) is stable
        )


def test_the_ideal_design_cannot_be_sampled_at_a_megahertz(thesis):
    _, analysis = thesis
    assert 1e6 < analysis.sample_rate.lowest_stable_hz < analysis.sample_rate.needed_hz
    # One pole a with gain a and one sample of computation: z^2 - z + a T, stable while a T < 1.
    fastest = np.abs(analysis.loop.rates).max()
    assert analysis.sample_rate.lowest_stable_hz == pytest.approx(fastest, rel=0.02)


def test_it_shows_itself_and_gives_plain_numbers():
    analysis = rp.loop_analysis(TEXTBOOK, -1)
    text = repr(analysis)
    assert text.startswith("Loop analysis, continuous time: stable, cannot be built as it is")
    for caption in ("one loop at a time", "all at once", "Bandwidths", "Noise", "Sampling"):
        assert caption in text
    assert "<table>" in analysis._repr_html_()
    content = json.loads(json.dumps(plain(analysis.to_dict())))
    assert content["gain_margin"] == [0.0, pytest.approx(3.0)]
    assert content["at_once"]["inputs"]["disk"]["proven"] is True
    assert content["margins"][0]["gain_crossovers"][0]["frequency_hz"] == pytest.approx(
        0.749368 / (2 * math.pi), rel=1e-5
    )
    assert analysis.S.input_labels == ["y[0]"]
    assert [getattr(analysis, name)(0.3j) for name in ("S", "T", "KS", "GS")] == [
        getattr(analysis.output, name)(0.3j) for name in ("S", "T", "KS", "GS")
    ]


def test_the_worst_of_several_loops_counts():
    analysis = rp.loop_analysis(SATELLITE, -np.eye(2))
    assert analysis.gain_margin == (0.0, math.inf)
    assert analysis.phase_margin == pytest.approx(90.0)
    assert analysis.delay_margin == min(
        m.common_delay_s for m in list(analysis.at_once.values())[:2]
    )
    assert analysis.disk_margin.alpha == pytest.approx(2.0)
    assert analysis.modulus_margin == pytest.approx(1.0)


def test_an_unstable_loop_says_so():
    analysis = rp.loop_analysis(TEXTBOOK, 1)
    assert not analysis.stable
    assert not analysis.buildable
    assert (analysis.margins, analysis.at_once, analysis.sample_rate) == ((), {}, None)
    numbers = [*analysis.gain_margin, analysis.phase_margin, analysis.delay_margin]
    assert np.isnan([*numbers, analysis.modulus_margin, analysis.disk_margin.alpha]).all()
    assert "NOT stable" in repr(analysis)
    assert analysis.to_dict()["stable"] is False
    assert analysis.largest_rate == {}
    ax = analysis.plot(kind="nyquist")  # the curve shows why
    plt.close(ax.figure)
    with pytest.raises(rp.InvalidInputError, match="unstable"):
        analysis.plot(kind="step")


def test_marginal_loops_are_not_stable():
    analysis = rp.loop_analysis(control.tf([1], [1, 0, 1]), 0)
    assert not analysis.stable
    assert "imaginary axis" in analysis.explain()


@pytest.mark.parametrize("kind", ["bode", "sigma", "nyquist", "nichols", "step"])
def test_pictures(kind):
    analysis = rp.loop_analysis(SATELLITE, -np.eye(2))
    for ax in (analysis.plot(kind), analysis.plot(kind=kind, place="output")):
        assert len(ax.lines) >= 2
        plt.close(ax.figure)
    own = plt.figure().subplots()
    assert analysis.plot(own, kind=kind, signal="u[1]") is own
    plt.close(own.figure)


def test_pictures_of_other_things_and_bad_names():
    analysis = rp.loop_analysis(SATELLITE, -np.eye(2))
    for of in ("S", "KS", "GS"):
        plt.close(analysis.plot(kind="step", of=of, duration=3.0).figure)
    for bad in (
        {"kind": "smith"},
        {"place": "middle"},
        {"signal": "v"},
        {"kind": "step", "of": "L"},
    ):
        with pytest.raises(rp.InvalidInputError, match=list(bad)[-1]):
            analysis.plot(**bad)
    with pytest.raises(rp.InvalidInputError, match="requirements"):
        rp.loop_analysis(SATELLITE, -np.eye(2), requirements={"disk": 1})


def test_units_of_signals_change_no_margin():
    scale = np.diag([1e6, 1e-3])
    plant = control.ss(SATELLITE.A, SATELLITE.B @ scale, SATELLITE.C, 0)
    one, other = (
        rp.loop_analysis(SATELLITE, -np.eye(2)),
        rp.loop_analysis(plant, -np.linalg.inv(scale)),
    )
    assert other.delay_margin == pytest.approx(one.delay_margin, rel=1e-6)
    for where in ("inputs", "outputs", "inputs and outputs"):
        alphas = [analysis.at_once[where].disk.alpha for analysis in (one, other)]
        assert alphas[1] == pytest.approx(alphas[0], rel=2e-3)
