"""A measured plant against the same plant as a model, and the count by Nyquist against poles."""

import math

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.loop import MeasuredLoop
from robustpolish.loops.margins import margins_of, simultaneous_margins
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK, s

LINES = np.logspace(-2, 3, 400)


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


@pytest.fixture(scope="module")
def satellite_lines():
    return rp.loop_analysis(measured(SATELLITE), -np.eye(2))


@pytest.mark.parametrize("kind", ["bode", "nyquist", "nichols", "sigma"])
def test_pictures_show_the_lines(kind, satellite_lines):
    analysis = satellite_lines
    ax = analysis.plot(kind, place="output")
    drawn = [line for line in ax.lines if len(line.get_xdata()) == len(LINES)]
    assert len(drawn) == (4 if kind == "sigma" else 2)
    assert [line.get_label() for line in drawn][:1] == (["S"] if kind == "sigma" else ["y[0]"])
    if kind == "sigma":
        np.testing.assert_allclose(drawn[0].get_xdata(), LINES / (2 * np.pi))
        assert drawn[0].get_ydata().max() == pytest.approx(analysis.output.peaks["S"].value)
    if kind == "nyquist":
        values = analysis.loop.response("output", [0]).values[:, 0, 0]
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
        ({"signal": "w"}, "one of 'u"),
    ],
)
def test_what_cannot_be_drawn_is_told(wrong, said, satellite_lines):
    with pytest.raises(rp.InvalidInputError, match=said):
        satellite_lines.plot(**wrong)


def lines_of(system, lines):
    response = control.frd(system, lines)
    return rp.GeneralizedPlant(response, system.noutputs, system.ninputs)


def test_the_count_is_right_on_random_loops():
    rng = np.random.default_rng(0)
    verdicts = []
    for _ in range(40):
        n = int(rng.integers(2, 6))
        A, B, C = (rng.standard_normal(shape) for shape in ((n, n), (n, 2), (2, n)))
        K = rng.standard_normal((2, 2)) * 10 ** rng.uniform(-1, 1)
        plant = lines_of(control.ss(A, B, C, 0), np.logspace(-3, 4, 3000))
        unstable = int((np.linalg.eigvals(A).real > 0).sum())
        found = MeasuredLoop.of(plant, K, unstable).stability
        truth = int((np.linalg.eigvals(A + B @ K @ C).real > 0).sum())
        assert f"{truth} of the closed one" in found.reason
        assert bool(found) == (truth == 0)
        verdicts.append(bool(found))
    assert 2 <= sum(verdicts) <= 38


@pytest.mark.parametrize("gain", [-0.1, -30.0])
def test_a_discrete_controller_is_taken_up_to_half_its_rate(gain):
    dt = 0.05
    model = control.c2d(control.ss([[0, 1], [0, -1]], [[0], [1]], [[1, 0]], 0), dt)
    omega = np.logspace(-2, 2, 2000)
    values = np.array([model(np.exp(1j * w * dt)) for w in omega])
    response = control.FrequencyResponseData(values[None, None], omega)
    K = control.ss([[1.0]], [[0.001]], [[gain]], [[gain]], dt)
    found = MeasuredLoop.of(rp.GeneralizedPlant(response, 1, 1), K, 0)
    assert found.omega.max() < np.pi / dt
    truth = rp.loop_analysis(model, K).stable
    assert bool(found.stability) == truth


def test_a_count_below_zero_and_jumps_between_lines_are_told():
    plant = lines_of(control.ss([[1.0]], [[1.0]], [[1.0]], 0), np.logspace(-2, 3, 400))
    wrong = MeasuredLoop.of(plant, [[-3.0]], 0).stability
    assert not wrong
    assert "that cannot be" in wrong.reason
    coarse = lines_of(control.ss([[0, 1], [-1, -1e-3]], [[0], [1]], [[1, 0]], 0), [0.5, 2.0, 9.0])
    assert "jumps by" in MeasuredLoop.of(coarse, [[-5.0]], 0).stability.reason


def test_too_few_lines_are_refused():
    plant = lines_of(control.ss([[-1.0]], [[1.0]], [[1.0]], 0), [0.0, 1.0])
    with pytest.raises(rp.InvalidInputError, match="two or more"):
        MeasuredLoop.of(plant, [[-1.0]], 0)


def loop_of_lines(system, gain, unstable=0, lines=None):
    lines = np.logspace(-2, 3, 400) if lines is None else lines
    plant = rp.GeneralizedPlant(control.frd(control.ss(system), lines), 1, 1)
    return MeasuredLoop.of(plant, [[gain]], unstable)


def test_crossings_lie_between_the_lines():
    found = margins_of(loop_of_lines(10 / (s * (s + 1) * (0.1 * s + 1)), -1.0), "input", 0)
    assert found.phase_crossovers[0].frequency_hz == pytest.approx(
        np.sqrt(10) / 2 / np.pi, rel=1e-4
    )
    assert found.phase_crossovers[0].gain == pytest.approx(1.1, rel=1e-3)
    assert len(found.gain_crossovers) == 1


def test_a_crossing_at_rest_is_seen_at_the_first_line():
    # L = 3 / (s - 1) is -3 at rest: a third of the gain is not enough.
    found = margins_of(loop_of_lines(1 / (s - 1), -3.0, 1), "output", 0)
    assert found.gain_down == pytest.approx(1 / 3, rel=1e-3)
    assert found.gain_up == math.inf


def test_delays_in_any_combination_are_no_more_than_one_that_is_known():
    found = loop_of_lines(1 / (s - 1), -3.0, 1)
    at_once = simultaneous_margins(found, "inputs")
    assert at_once.any_delay_s <= at_once.common_delay_s
    assert (
        simultaneous_margins(loop_of_lines(0.1 / (s + 1), -1.0), "inputs").any_delay_s == math.inf
    )
