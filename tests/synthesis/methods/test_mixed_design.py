"""The driver of several specifications: which parts are joined, what is checked and told."""

import numpy as np
import pytest
from small_plants import oscillator

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.structured import methods as structured_design
from robustpolish.synthesis.structured import mixed as mixed_design
from robustpolish.synthesis.structured.search import POLICY

ARGUMENTS = [
    ({"hinf_bound": 1.0}, "hinf_bound"),
    ({"minimise": "l1"}, "minimise"),
    ({"pole_region": 3.0}, "pole_region"),
    ({"hinf_channel": ("nobody", "x")}, "disturbances"),
    ({"hinf_channel": ("force",)}, "hinf_channel"),
    ({"hinf_channel": "force"}, "hinf_channel"),
    ({"h2_bound": -1.0}, "h2_bound"),
    ({"gain_bound": 0.0}, "gain_bound"),
    ({"backend": "yalmip"}, "backend"),
    ({"time_limit": 0.0}, "time_limit"),
]


@pytest.mark.parametrize("method", [rp.mixed_output_feedback, rp.mixed_state_feedback])
@pytest.mark.parametrize(("arguments", "named"), ARGUMENTS)
def test_bad_arguments_are_named(method, arguments, named):
    with pytest.raises(rp.InvalidInputError, match=named):
        method(oscillator(), **arguments)


def two_lags(fast=1.0):
    """X' = -a x + w + u twice, z = x and the priced u."""
    eye, none = np.eye(2), np.zeros((2, 2))
    return rp.GeneralizedPlant.from_matrices(
        -np.diag([1.0, fast]),
        eye,
        eye,
        np.vstack([eye, none]),
        eye,
        D12=np.vstack([none, eye]),
        disturbances=["w1", "w2"],
        performance=["z1", "z2", "p1", "p2"],
    )


@pytest.fixture
def quick(monkeypatch):
    """Spend little of the work: enough for lags."""
    checked = structured_design.StructuredOptions.checked

    def short(*arguments):
        orders = checked(*arguments)
        return structured_design.StructuredOptions(
            Budget(4e-3 * POLICY.work), orders.seed, orders.target
        )

    monkeypatch.setattr(mixed_design.StructuredOptions, "checked", short)


def test_what_is_specified_is_certified_on_its_channel(quick):
    plant = two_lags()
    channels = {"hinf_channel": (["w1"], ["z1", "p1"]), "h2_channel": ("w2", ["z2", "p2"])}
    design = rp.mixed_state_feedback(plant, "hinf", h2_bound=0.65, **channels)
    # u = -k x: sqrt(1 + k^2)/(1 + k) is least for k = 1; the square of the H2 norm,
    # (1 + k^2)/(2 (1 + k)), for k = sqrt(2) - 1, where it is that number: 0.6436^2.
    told = design.details["certificates"]
    assert told["hinf"].achieved == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert np.sqrt(np.sqrt(2) - 1) <= told["h2"].achieved <= 0.65 * (1 + 1e-6)
    assert design.certificate is told["hinf"]
    # All w and z are in the whole loop, those of the goal alone in the design's own.
    assert design.details["whole_loop"].input_labels == ["w1", "w2"]
    assert design.closed_loop.input_labels == ["w1"]


def test_a_bound_on_the_other_norm_joins_the_parts(quick):
    plant = two_lags()
    alone = rp.mixed_state_feedback(plant, "h2")
    together = rp.mixed_state_feedback(plant, "h2", hinf_bound=0.9)
    assert len(alone.details["part_norms"]) == 2
    assert len(together.details["part_norms"]) == 1
    best = np.sqrt(2 * (np.sqrt(2) - 1))  # of two equal parts
    for design in (alone, together):
        assert design.certificate.achieved == pytest.approx(best, rel=1e-3)


def test_prices_and_noise_belong_to_every_channel(quick):
    plant = two_lags().part(
        states=[0, 1], disturbances=[0, 1], controls=[0, 1], performance=[0, 1], measurements=[0, 1]
    )
    design = rp.mixed_state_feedback(plant, "h2", h2_channel=("w1", "z1"), control_weight=1.0)
    assert design.plant.disturbance_names == ("w1",)
    assert design.plant.performance_names == ("z1", "price_u1", "price_u2")
    assert design.certificate.achieved == pytest.approx(np.sqrt(np.sqrt(2) - 1), rel=1e-3)


def test_regions_are_told_and_kept(quick):
    region = rp.HalfPlane(-3.0)
    design = rp.mixed_state_feedback(two_lags(), pole_region=region)
    assert design.details["pole_regions"] == (region,)
    assert region.contains(design.certificate.poles)
    # k > 2 beyond the optimum: sqrt(5)/3.
    assert design.certificate.achieved == pytest.approx(np.sqrt(5) / 3, rel=1e-3)


def test_a_search_that_breaks_a_bound_is_no_success(quick, monkeypatch):
    """Whatever the search says, a loop that misses a specification is refused."""
    plant = two_lags()
    loose = rp.mixed_state_feedback(plant, "h2")
    monkeypatch.setattr(mixed_design, "design_structured", lambda *_: loose)
    with pytest.raises(rp.SolverError, match=r"the hinf norm is 0\.7.*, not 0\.5"):
        rp.mixed_state_feedback(plant, "h2", hinf_bound=0.5)
    with pytest.raises(rp.SolverError, match="breaks a specification"):
        rp.mixed_state_feedback(plant, "h2", pole_region=rp.HalfPlane(-9.0))
