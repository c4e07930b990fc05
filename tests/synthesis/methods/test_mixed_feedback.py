"""Output and state feedback under several specifications, each checked from outside."""

import numpy as np
import pytest
from small_plants import oscillator

import robustpolish as rp
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.problem.matrices import channel
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.structured.mixed import mixed_output_feedback


@pytest.mark.slow
def test_bound_on_the_other_norm_is_kept_and_costs():
    plant = oscillator()
    h2_best = mixed_output_feedback(plant, "h2", time_limit=5)
    loop = plant.closed_loop(h2_best.controller)
    bound = 0.9 * float(hinf_norm(loop))
    both = mixed_output_feedback(plant, "h2", hinf_bound=bound, time_limit=10)
    loop = plant.closed_loop(both.controller)
    assert float(hinf_norm(loop)) <= bound * (1 + 1e-6)
    assert float(h2_norm(loop)) == pytest.approx(both.certificate.achieved, rel=1e-6)
    assert both.certificate.achieved >= h2_best.certificate.achieved * (1 - 1e-4)
    assert set(both.details["certificates"]) == {"h2", "hinf"}


@pytest.mark.slow
def test_channels_are_minimised_and_bounded_apart():
    plant = oscillator()
    design = mixed_output_feedback(
        plant,
        "hinf",
        hinf_channel=("force", "x"),
        h2_channel=(["force", "noise"], ["price"]),
        h2_bound=0.4,
        time_limit=10,
    )
    on_x = channel(plant, "force", "x").closed_loop(design.controller)
    on_u = channel(plant, ["force", "noise"], "price").closed_loop(design.controller)
    assert float(hinf_norm(on_x)) == pytest.approx(design.certificate.achieved, rel=1e-6)
    assert float(h2_norm(on_u)) <= 0.4 * (1 + 1e-6)
    assert float(hinf_norm(on_x)) < float(hinf_norm(channel(plant, "force", "x").open_loop))


@pytest.mark.parametrize(
    "region",
    [
        *(
            pytest.param(region, marks=pytest.mark.long)
            for region in (HalfPlane(-0.6), Disk(-2.0, 1.8), Sector(0.8))
        ),
        [HalfPlane(-0.4), Sector(0.6)],
    ],
)
def test_poles_stay_in_their_region(region):
    design = mixed_output_feedback(oscillator(), pole_region=region, time_limit=8)
    poles = design.closed_loop.poles()
    for each in region if isinstance(region, list) else [region]:
        assert each.contains(poles)


@pytest.mark.long
def test_gain_bound_holds_at_all_frequencies():
    design = mixed_output_feedback(oscillator(), gain_bound=0.5, time_limit=20)
    assert float(hinf_norm(design.controller)) <= 0.5 * (1 + 1e-6)


def test_one_norm_alone_is_that_of_state_feedback():
    for norm in ("hinf", "h2"):
        plant = oscillator()
        mixed = rp.mixed_state_feedback(plant, norm, time_limit=5)
        plain = rp.state_feedback(plant, norm)
        assert mixed.certificate.achieved == pytest.approx(plain.certificate.achieved, rel=1e-3)


def test_a_bound_on_the_other_norm_is_kept_by_state_feedback():
    plant = oscillator()
    best = rp.mixed_state_feedback(plant, "h2", time_limit=4)
    bound = 0.95 * float(rp.hinf_norm(plant.state_feedback_loop(best.gain)))
    both = rp.mixed_state_feedback(plant, "h2", hinf_bound=bound, time_limit=8)
    loop = plant.state_feedback_loop(both.gain)
    assert float(rp.hinf_norm(loop)) <= bound * (1 + 1e-6)
    assert float(rp.h2_norm(loop)) == pytest.approx(both.certificate.achieved, rel=1e-6)
    assert both.certificate.achieved > best.certificate.achieved * (1 - 1e-6)
    assert set(both.details["certificates"]) == {"h2", "hinf"}


def test_channels_poles_and_gain_together():
    plant = oscillator()
    region = rp.HalfPlane(-0.4)
    design = rp.mixed_state_feedback(
        plant,
        "hinf",
        hinf_channel=("force", "x"),
        h2_channel=("force", "price"),
        h2_bound=0.6,
        pole_region=region,
        gain_bound=5.0,
        time_limit=8,
    )
    loop = channel(plant, "force", "price").state_feedback_loop(design.gain)
    assert float(rp.h2_norm(loop)) <= 0.6 * (1 + 1e-6)
    assert region.contains(np.linalg.eigvals(loop.A))
    assert np.linalg.norm(design.gain, 2) <= 5.0 * (1 + 1e-6)


@pytest.mark.long
def test_the_polishing_robot_with_a_sector():
    """12 states; a matrix shared by norm and region alone would be conservative."""
    plant = rp.air_bearing(actuation="force")
    asked = {"control_weight": 1e-5, "pole_region": rp.Sector(0.8)}
    design = rp.mixed_state_feedback(plant, **asked)
    assert design.certificate.valid
    assert (design.certificate.damping >= 0.8).all()
    shared = rp.state_feedback(plant, **asked)
    assert design.certificate.achieved <= shared.certificate.achieved * 1.02


@pytest.mark.parametrize("method", [mixed_output_feedback, rp.mixed_state_feedback])
def test_what_cannot_be_met_is_not_a_success(method):
    with pytest.raises(rp.SolverError, match="all specifications"):
        method(oscillator(), "h2", hinf_bound=1e-3, time_limit=3)
