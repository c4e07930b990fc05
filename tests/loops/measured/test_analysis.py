"""A measured plant's loop against the same plant as a model, and what is said of the lines."""

import control
import numpy as np
import pytest

import robustpolish as rp

s = control.tf("s")
LINES = np.logspace(-2, 3, 400)
TEXTBOOK = 1 / (s * (s + 1) * (0.5 * s + 1))
SATELLITE = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], 0)


def measured(plant, lines=LINES):
    return control.frd(control.ss(plant), lines)


@pytest.mark.parametrize(
    ("plant", "controller", "unstable"),
    [
        (TEXTBOOK, -1, 0),
        (1 / (s - 1), -3, 1),
        (1 / s**2, -control.ss((s + 1) / (0.1 * s + 1)), 0),
        (1 / (s + 1), -control.ss(5 / s), 0),
        (SATELLITE, -np.eye(2), 0),
    ],
)
def test_figures_are_those_of_the_model(plant, controller, unstable):
    own = rp.loop_analysis(measured(plant), controller, unstable_poles=unstable)
    model = rp.loop_analysis(plant, controller)
    assert own.stable
    assert own.gain_margin == pytest.approx(model.gain_margin, rel=2e-3)
    assert own.phase_margin == pytest.approx(model.phase_margin, rel=2e-3)
    assert own.delay_margin == pytest.approx(model.delay_margin, rel=2e-3)
    assert own.disk_margin.alpha == pytest.approx(model.disk_margin.alpha, rel=5e-3)
    assert not own.disk_margin.proven
    assert own.modulus_margin == pytest.approx(model.modulus_margin, rel=5e-3)
    for where, at_once in model.at_once.items():
        assert own.at_once[where].disk.alpha == pytest.approx(at_once.disk.alpha, rel=1e-2)
        assert own.at_once[where].any_delay_s == pytest.approx(at_once.any_delay_s, rel=6e-2)
    for name in ("L", "S", "T", "KS", "GS"):
        lines, system = getattr(own.output, name), getattr(model.output, name)
        np.testing.assert_allclose(
            lines.frdata[..., 7], system(1j * LINES[7], squeeze=False), rtol=1e-9, atol=1e-12
        )
    assert own.output.peaks["S"].value == pytest.approx(model.output.peaks["S"].value, rel=5e-3)
    for one, other in zip(own.bandwidths, model.bandwidths, strict=True):
        assert (one.name, one.place) == (other.name, other.place)
        assert one.complementary_hz == pytest.approx(other.complementary_hz, rel=1e-2, nan_ok=True)


def test_what_it_rests_on_is_said():
    analysis = rp.loop_analysis(measured(TEXTBOOK), -0.5)
    text = analysis.explain()
    assert "400 measured lines from 1.59 mHz to 159 Hz" in text
    assert "nothing is proven" in text
    assert "0 of the plant, as told" in text
    assert "need a model" in text
    assert "stable as counted" in repr(analysis)
    assert (analysis.noise, analysis.effort, analysis.given) == ((), (), ())
    assert analysis.sample_rate is None
    assert analysis.to_dict()["stable"] is True
    assert [table.caption for table in analysis.tables()] == [
        "Margins, one loop at a time", "Margins, all at once", "Bandwidths",
    ]  # fmt: skip


def test_lines_that_end_too_early_are_told():
    short = rp.loop_analysis(measured(TEXTBOOK, np.logspace(-2, -0.5, 50)), -0.5)
    assert "measure further" in short.explain()


def test_an_unstable_loop_has_no_margins_and_the_sign_is_told():
    analysis = rp.loop_analysis(measured(1 / (s - 1)), 3, unstable_poles=1)
    assert not analysis.stable
    assert analysis.margins == ()
    assert "pass -K" in analysis.explain()
    assert np.isnan(analysis.phase_margin)


def test_a_generalised_plant_of_lines_and_a_design_as_controller():
    plant = rp.GeneralizedPlant.from_loop(TEXTBOOK)
    design = rp.loop_shaping(TEXTBOOK)
    whole = control.frd(control.ss(plant.system), LINES)
    lines = rp.GeneralizedPlant(whole, measurements=1, controls=1)
    analysis = rp.loop_analysis(lines, design)
    model = rp.loop_analysis(design)
    assert analysis.disk_margin.alpha == pytest.approx(model.disk_margin.alpha, rel=1e-2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"controller": None}, "controller: got None"),
        ({"controller": [[1.0, 2.0]]}, r"shape \(1, 2\)"),
        ({"controller": -1, "unstable_poles": -1}, "unstable_poles: got -1"),
        ({"controller": -1, "unstable_poles": True}, "unstable_poles: got True"),
        ({"controller": -1, "disturbance": 3}, "disturbance: got.*a model to run"),
        ({"controller": control.frd(TEXTBOOK, LINES)}, "FrequencyResponseData"),
    ],
)
def test_bad_input_is_told(arguments, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.loop_analysis(measured(TEXTBOOK), **arguments)


def test_a_model_tells_its_poles_itself():
    with pytest.raises(rp.InvalidInputError, match="unstable_poles: got a count for a model"):
        rp.loop_analysis(TEXTBOOK, -1, unstable_poles=1)


@pytest.mark.parametrize("kind", ["bode", "nyquist", "nichols", "sigma"])
def test_pictures_show_the_lines(kind):
    analysis = rp.loop_analysis(measured(SATELLITE), -np.eye(2))
    ax = analysis.plot(kind, place="output")
    drawn = [line for line in ax.lines if len(line.get_xdata()) == len(LINES)]
    assert len(drawn) == (4 if kind == "sigma" else 2)
    assert [line.get_label() for line in drawn][:1] == (["S"] if kind == "sigma" else ["y[0]"])
    if kind == "sigma":
        np.testing.assert_allclose(drawn[0].get_xdata(), LINES / (2 * np.pi))
        assert drawn[0].get_ydata().max() == pytest.approx(analysis.output.peaks["S"].value)
    if kind == "nyquist":
        values = analysis.loop.opened("output", [0])[:, 0, 0]
        np.testing.assert_allclose(drawn[0].get_xdata(), values.real)


def test_one_signal_is_drawn_and_an_unstable_loop_too():
    analysis = rp.loop_analysis(measured(1 / (s - 1)), -0.5, unstable_poles=1)
    assert not analysis.stable
    assert len(analysis.plot(kind="nyquist", signal="y[0]").lines[0].get_xdata()) == len(LINES)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"kind": "step"}, "need|model"),
        ({"kind": "root locus"}, "kind"),
        ({"place": "middle"}, "place"),
        ({"signal": "w"}, "one of u"),
    ],
)
def test_what_cannot_be_drawn_is_told(wrong, said):
    analysis = rp.loop_analysis(measured(TEXTBOOK), -1)
    with pytest.raises(rp.InvalidInputError, match=said):
        analysis.plot(**wrong)
