"""Several specifications at once, each checked from outside."""

import pytest
from small_plants import oscillator

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.synthesis.methods.mixed_feedback import mixed_output_feedback
from robustpolish.synthesis.problem.channels import channel
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector


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
    "region", [HalfPlane(-0.6), Disk(-2.0, 1.8), Sector(0.8), [HalfPlane(-0.4), Sector(0.6)]]
)
def test_poles_stay_in_their_region(region):
    design = mixed_output_feedback(oscillator(), pole_region=region, time_limit=8)
    poles = design.closed_loop.poles()
    for each in region if isinstance(region, list) else [region]:
        assert each.contains(poles)


def test_gain_bound_holds_at_all_frequencies():
    design = mixed_output_feedback(oscillator(), gain_bound=0.5, time_limit=20)
    assert float(hinf_norm(design.controller)) <= 0.5 * (1 + 1e-6)


def test_what_cannot_be_met_is_not_a_success():
    with pytest.raises(SolverError, match="all specifications"):
        mixed_output_feedback(oscillator(), "h2", hinf_bound=1e-3, time_limit=4)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"hinf_bound": 1.0}, "hinf_bound"),
        ({"minimise": "l1"}, "minimise"),
        ({"pole_region": 3.0}, "pole_region"),
        ({"hinf_channel": ("nobody", "x")}, "disturbances"),
        ({"hinf_channel": ("force",)}, "hinf_channel"),
        ({"h2_bound": -1.0}, "h2_bound"),
        ({"gain_bound": 0.0}, "gain_bound"),
        ({"backend": "yalmip"}, "backend"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(InvalidInputError, match=named):
        mixed_output_feedback(oscillator(), **arguments)
