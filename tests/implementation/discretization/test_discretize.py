"""Designs at samples: what they cost, and honest refusals."""

import numpy as np
import pytest

import robustpolish as rp
from tests.implementation.designs import sampled_servo, servo, servo_design


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
    design = rp.output_feedback(servo(), norm="h2")
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
        rp.synthesis.largest_period(servo())
    discrete = rp.GeneralizedPlant.from_matrices(
        [[0.5]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], dt=0.1
    )
    with pytest.raises(rp.InvalidInputError, match="continuous"):
        rp.given_controller(discrete, [[-0.1]]).discretize(0.1)
