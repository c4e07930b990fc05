"""Sampled designs: what they cost, show, save and export; honest refusals."""

import json

import control
import numpy as np
import pytest
from scipy.io import loadmat

import robustpolish as rp
from tests.implementation.designs import sampled_servo, static_gain
from tests.reference.examples import servo_design, servo_plant


def test_a_sampled_design_tells_what_sampling_costs():
    sampled = sampled_servo()
    assert sampled.certificate.valid
    assert sampled.certificate.bound > servo_design().certificate.achieved
    assert sampled.cost == pytest.approx(
        sampled.certificate.achieved / servo_design().certificate.achieved - 1
    )
    assert "50 ms" in sampled.message
    assert "20 ms" in sampled.message
    assert "%" in sampled.message
    assert sampled.controller.input_labels == ["x"]
    assert sampled.controller.output_labels == ["F"]
    assert "Sampled design (tustin): valid" in repr(sampled)
    assert "<table>" in sampled._repr_html_()


def test_a_weight_beyond_half_the_sampling_rate_is_named():
    plant = rp.mixed_sensitivity(
        control.ss(control.tf([1], [0.1, 1, 0]), inputs="u", outputs="y"),
        performance=rp.weight(1e3, 1.0, 0.5),
        effort=rp.weight(1e-2, 100.0, 100.0),
    )
    design = rp.output_feedback(plant)
    sampled = design.discretize(0.1)
    assert sampled.certificate.achieved > 20 * design.certificate.achieved
    assert rp.loop_analysis(plant, design.controller).disk_margin.gain_db > 10
    assert "with effort_u through a lag at half the sampling rate (5 Hz) it is 1.5" in str(sampled)
    flat = rp.mixed_sensitivity(
        control.ss(control.tf([1], [0.1, 1, 0]), inputs="u", outputs="y"),
        performance=rp.weight(1e3, 1.0, 0.5), effort=0.1,
    )  # fmt: skip
    assert "half the sampling rate" not in rp.output_feedback(flat).discretize(0.01).message


def test_delay_and_filter_cost_more():
    design = servo_design()
    plain = design.discretize(0.05).certificate.bound
    late = design.discretize(0.05, delay=0.05).certificate.bound
    later = design.discretize(0.05, delay=0.1).certificate.bound
    assert plain < late < later
    filtered = design.discretize(0.05, anti_aliasing=5.0)
    assert filtered.certificate.notes == ()
    assert filtered.certificate.bound > plain
    assert filtered.anti_aliasing.nstates == 2


def test_the_thesis_design_is_unstable_at_a_megahertz_and_says_so():
    plant = rp.air_bearing(actuation="force")
    design = rp.state_feedback(plant, norm="hinf", control_weight=1e-7)
    with pytest.raises(rp.InfeasibleError, match="longest period that keeps it stable is") as error:
        design.discretize(1e-6)
    assert max(abs(mode) for mode in error.value.modes) > 1
    longest = rp.synthesis.largest_period(design)
    assert 1e-7 < longest < 1e-6
    assert design.discretize(longest * 0.99).certificate.stable
    with pytest.raises(rp.InfeasibleError):
        design.discretize(longest * 1.01)


def test_a_delay_that_nothing_can_bear_is_named():
    with pytest.raises(rp.InfeasibleError, match="however short"):
        servo_design().discretize(0.05, delay=5.0)
    assert rp.synthesis.largest_period(servo_design(), delay=5.0) == 0.0


def test_the_largest_period_is_where_stability_is_lost():
    design = servo_design()
    for options in ({}, {"delay": 0.05}, {"anti_aliasing": 10.0}):
        longest = rp.synthesis.largest_period(design, **options)
        assert design.discretize(longest * 0.99, **options).certificate.stable
        with pytest.raises(rp.InfeasibleError):
            design.discretize(longest * 1.01, **options)
    longest = rp.synthesis.largest_period(design, delay_periods=1.0)
    assert design.discretize(longest * 0.99, delay=longest * 0.99).certificate.stable
    with pytest.raises(rp.InfeasibleError):
        design.discretize(longest * 1.01, delay=longest * 1.01)
    stable = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    assert rp.synthesis.largest_period(rp.given_controller(stable, [[-0.1]])) == np.inf


def test_h2_designs_are_certified_in_h2():
    design = rp.output_feedback(servo_plant(), norm="h2")
    sampled = design.discretize(0.02, delay=0.01)
    assert sampled.norm == "h2"
    assert sampled.certificate.valid
    assert sampled.certificate.lower <= sampled.certificate.achieved <= sampled.certificate.bound
    assert sampled.certificate.achieved > design.certificate.achieved
    assert sampled.certificate.peak_frequency is None
    assert sampled.plot().get_xlabel() == "frequency"


def test_wrong_arguments_are_refused():
    design = servo_design()
    for period in (0.0, -1.0, np.nan, None, "fast"):
        with pytest.raises(rp.InvalidInputError, match="period"):
            design.discretize(period)
    for delay in (-0.1, np.inf, "late", 100.0):
        with pytest.raises(rp.InvalidInputError, match="delay"):
            design.discretize(0.05, delay=delay)
    with pytest.raises(rp.InvalidInputError, match="method"):
        design.discretize(0.05, method="magic")
    with pytest.raises(rp.InvalidInputError, match="Design"):
        rp.synthesis.largest_period(servo_plant())
    discrete = rp.GeneralizedPlant.from_matrices(
        [[0.5]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], dt=0.1
    )
    with pytest.raises(rp.InvalidInputError, match="continuous"):
        rp.given_controller(discrete, [[-0.1]]).discretize(0.1)


def test_arguments_that_do_not_fit_are_refused():
    plant, K = servo_plant(), sampled_servo().controller
    with pytest.raises(rp.InvalidInputError, match="period"):
        rp.implementation.certify_sampled(plant, [[-1.0]])
    with pytest.raises(rp.InvalidInputError, match="period"):
        rp.implementation.certify_sampled(plant, K, period=0.1)
    with pytest.raises(rp.InvalidInputError, match="discrete one"):
        rp.implementation.certify_sampled(
            plant, control.ss([[-1.0]], [[1.0]], [[1.0]], 0), period=0.1
        )
    with pytest.raises(rp.InvalidInputError, match="inputs"):
        rp.implementation.certify_sampled(plant, control.ss([[0.5]], [[1.0, 1]], [[1.0]], 0, 0.1))
    with pytest.raises(rp.InvalidInputError, match="norm"):
        rp.implementation.certify_sampled(plant, K, norm="h3")
    with pytest.raises(rp.InvalidInputError, match="GeneralizedPlant"):
        rp.implementation.certify_sampled(plant.system, K)
    direct = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D11=[[1.0]]
    )
    with pytest.raises(rp.InvalidInputError, match="D11"):
        rp.implementation.certify_sampled(direct, [[0.0]], period=0.1, norm="h2")
    assert rp.implementation.certify_sampled(direct, [[0.0]], period=0.1).bound == pytest.approx(
        2.0, rel=1e-4
    )
    assert np.isfinite(rp.implementation.certify_sampled(plant, K).bound)


def test_its_picture_marks_the_norm():
    ax = sampled_servo().plot()
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert any("sampled loop" in label for label in labels)
    assert any("norm" in label for label in labels)


def test_a_realisation_keeps_loop_and_signals():
    sampled = sampled_servo()
    for form in ("balanced", "modal", "sections"):
        found = sampled.realization(form)
        assert found.details["form"] == form
        assert found.controller.input_labels == ["x"]
        assert found.certificate.bound == pytest.approx(sampled.certificate.bound, rel=1e-4)
        np.testing.assert_allclose(
            np.sort(np.abs(found.certificate.poles)),
            np.sort(np.abs(sampled.certificate.poles)),
            rtol=1e-6,
            atol=1e-12,
        )
    gain = static_gain().realization("modal")
    assert gain.controller.nstates == 0


@pytest.fixture(scope="module")
def in_modal_form():
    design = servo_design().discretize(0.05, delay=0.02, anti_aliasing=8.0)
    return design.realization("modal")


@pytest.fixture
def saved(in_modal_form, tmp_path):
    path = tmp_path / "sampled.json"
    in_modal_form.save(path)
    return path


def test_there_and_back(in_modal_form, saved):
    sampled = in_modal_form
    again = rp.load(saved)
    assert isinstance(again, rp.results.SampledDesign)
    for name in "ABCD":
        np.testing.assert_array_equal(
            getattr(again.controller, name), getattr(sampled.controller, name)
        )
    assert again.certificate.bound == sampled.certificate.bound
    kept = ("period", "delay", "norm", "continuous_norm", "method", "message")
    assert [getattr(again, key) for key in kept] == [getattr(sampled, key) for key in kept]
    assert again.anti_aliasing is not None
    assert again.anti_aliasing.nstates == sampled.anti_aliasing.nstates
    assert again.details["form"] == "modal"
    with pytest.raises(rp.InvalidInputError, match="does not exist yet"):
        sampled.save(saved)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c["controller"]["D"][0].__setitem__(0, 50.0), "without a valid certificate"),
        (lambda c: c.update(achieved=c["achieved"] * 0.9), "achieved: got a norm of"),
        (lambda c: c.update(period=0.06), "the controller's sampling time"),
        (lambda c: c.update(period=-1), "period: got -1"),
        (lambda c: c.update(delay=-0.1), "delay"),
        (lambda c: c.update(delay=1e9), "at most 200 periods"),
        (lambda c: c.update(norm="h3"), "norm: got 'h3'"),
        (lambda c: c.update(form="pretty"), "form: got 'pretty'"),
        (lambda c: c.update(anti_aliasing=3), "anti_aliasing: got 3"),
        (lambda c: c.pop("message"), "the key 'message'"),
        (lambda c: c.update(continuous_norm=-1), "continuous_norm"),
        (lambda c: c["plant"]["system"].update(dt=0.1), "a continuous plant"),
        (lambda c: c["controller"].update(inputs=[]), "controller: B"),
        (lambda c: c.update(robustpolish="design"), "a design in sampled.json"),
    ],
)
def test_edited_files_are_refused(saved, change, says):
    content = json.loads(saved.read_text())
    change(content)
    saved.write_text(json.dumps(content))
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.results.SampledDesign.load(saved)


def test_every_number_comes_back_exactly(tmp_path):
    sampled = sampled_servo()
    content = json.loads(sampled.export_json(tmp_path, limits=(-1, 2)).read_text())
    for name in "ABCD":
        np.testing.assert_array_equal(content[name], getattr(sampled.controller, name))
    assert content["robustpolish"] == "controller"
    assert content["measurements"] == ["x"]
    assert content["units"] == {"x": "m", "F": "N"}
    assert content["limits"] == [[-1.0], [2.0]]
    assert content["period"] == 0.05


def test_everything_comes_back(tmp_path):
    sampled = sampled_servo()
    content = loadmat(sampled.export_mat(tmp_path, name="servo", limits=3.0))
    for name in "ABCD":
        np.testing.assert_array_equal(content[name], getattr(sampled.controller, name))
    assert content["Ts"].item() == 0.05
    assert content["delay"].item() == 0.02
    assert content["InputName"][0, 0].item() == "x"
    assert content["OutputName"][0, 0].item() == "F"
    assert content["OutputUnit"][0, 0].item() == "N"
    assert content["high"].item() == 3.0
    assert content["L"].shape == (sampled.controller.nstates, 1)


def test_a_gain_has_empty_states(tmp_path):
    content = loadmat(static_gain().export_mat(tmp_path / "gain.mat"))
    assert content["A"].size == 0
    assert content["D"].item() == -3.0
    assert content["high"].item() == np.inf
