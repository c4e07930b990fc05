"""Several specifications at once, each checked from outside."""

import numpy as np
import pytest

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.budget import Budget
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.lmi.mixed.output import Specification, mixed_start
from robustpolish.synthesis.methods.mixed_output_feedback import mixed_output_feedback
from robustpolish.synthesis.nonsmooth import HinfMeasure
from robustpolish.synthesis.problem.channels import channel
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.problem.static_loop import augmented
from robustpolish.synthesis.structured_search.starts import ProgramSolver


def oscillator():
    """X'' + 0.1 x' + x = w + u; price on u, noise on y."""
    return GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [-1.0, -0.1]],
        [[0.0, 0.0], [1.0, 0.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 0.0]],
        D12=[[0.0], [0.5]],
        D21=[[0.0, 0.2]],
        disturbances=["force", "noise"],
        performance=["x", "price"],
    )


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


def test_inequalities_alone_come_within_their_back_off():
    plant = oscillator()
    K = mixed_start(
        [Specification(plant, "hinf", None)], (), ProgramSolver(Budget(), tolerance=1e-8), 1.05
    )
    loop = augmented(PlantMatrices.of(plant), plant.nx)
    achieved = HinfMeasure(loop).pieces(K, 0.0, ())[0].value
    best = mixed_output_feedback(plant, time_limit=5).certificate.achieved
    assert best * 0.999 <= achieved <= 1.06 * best
    assert np.abs(K).max() < 1e3


def test_picos_states_the_same_inequalities():
    plant = oscillator()
    starts = [
        mixed_start(
            [Specification(plant, "hinf", None)],
            (HalfPlane(-0.3),),
            ProgramSolver(Budget(), backend, tolerance=1e-8),
            1.05,
        )
        for backend in ("cvxpy", "picos")
    ]
    loop = augmented(PlantMatrices.of(plant), plant.nx)
    norms = [HinfMeasure(loop).pieces(K, 0.0, ())[0].value for K in starts]
    assert norms[0] == pytest.approx(norms[1], rel=0.02)


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
