"""Output and state feedback under several specifications, each checked from outside."""

import numpy as np
import pytest
from hard_plants import rescaled
from small_plants import oscillator

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import channel
from robustpolish.synthesis.problem.preflight import whole_plant
from robustpolish.synthesis.structured.structures import MixedStructure

PLANT = rescaled(oscillator(), seed=8, decades=2)[0]


def stated(plant, goal=None, static=False, side=None, bound=None, regions=()):
    """The search of one part."""
    asked = goal or plant, static, side, bound, regions, None, ("cvxpy", None)
    problem = MixedStructure("hinf", *asked).problem(whole_plant(plant))
    assert problem is not None
    return problem


def some_gain(problem):
    """A stable full-order controller that leaves the scaled loop stable."""
    n = problem.order
    K = np.zeros((n + 1, n + 1))
    K[:n, :n] = -np.eye(n)
    K[:n, n:], K[n:, :n] = 0.3, -0.1
    return K


@pytest.mark.parametrize(
    "make",
    [
        lambda poles, share: rp.HalfPlane(share * poles.real.max()),
        lambda poles, share: rp.Disk(-1.0, np.abs(poles + 1).max() / share),
        lambda poles, share: rp.Sector(share * (-poles.real / np.abs(poles)).min()),
    ],
    ids=["half plane", "disk", "sector"],
)
def test_demands_on_poles_say_the_same_as_their_regions_and_have_gradients(make):
    problem = stated(PLANT)
    K, change = some_gain(problem), np.random.default_rng(0).normal(size=(3, 3))
    poles = np.asarray(PLANT.closed_loop(problem.controller(K)).poles())
    for share in (0.999, 1.001):
        region = make(poles, share)
        (demand,) = stated(PLANT, regions=(region,)).requirements
        (piece,) = demand.pieces(K, 0.0, ())
        assert (piece.value <= 0) == region.contains(poles) == (share < 1)
    up, down = (demand.pieces(K + s * 1e-6 * change, 0.0, ())[0].value for s in (1, -1))
    assert (piece.gradient * change).sum() == pytest.approx((up - down) / 2e-6, rel=1e-4)


@pytest.mark.parametrize("method", [rp.mixed_output_feedback, rp.mixed_state_feedback])
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
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
    ],
)
def test_bad_arguments_are_named(method, arguments, named):
    with pytest.raises(rp.InvalidInputError, match=named):
        method(oscillator(), **arguments)


def test_signals_of_a_channel_come_in_the_order_asked_for():
    plant = oscillator().replace(D11=[[1.0, 2.0], [3.0, 4.0]])
    turned = rp.synthesis.channel(plant, ["noise", "force"], ["price", "x"])
    np.testing.assert_array_equal(turned.D11, [[4.0, 3.0], [2.0, 1.0]])
    np.testing.assert_array_equal(turned.D21, [[0.2, 0.0]])
    np.testing.assert_array_equal(turned.D12, [[0.5], [0.0]])
    assert turned.disturbance_names == ("noise", "force")


@pytest.mark.parametrize(
    ("disturbances", "performance", "argument"),
    [
        ("wind", "x", "disturbances"),
        (["force", "force"], "x", "disturbances"),
        ("force", ["x", "y"], "performance"),
        ("force", [], "performance"),
    ],
)
def test_unknown_repeated_or_missing_names_are_refused(disturbances, performance, argument):
    known = "force, noise" if argument == "disturbances" else "x, price"
    with pytest.raises(rp.InvalidInputError, match=f"^{argument}: got .* names out of {known}"):
        rp.synthesis.channel(oscillator(), disturbances, performance)


def two_lags():
    """X' = -x + w + u twice, z = x and the priced u.

    u = -k x: sqrt(1 + k^2)/(1 + k) is least for k = 1; the square of the H2 norm,
    (1 + k^2)/(2 (1 + k)), for k = sqrt(2) - 1, where it is that number.
    """
    eye, none = np.eye(2), np.zeros((2, 2))
    return rp.GeneralizedPlant.from_matrices(
        -eye, eye, eye, np.vstack([eye, none]), eye, D12=np.vstack([none, eye]),
        disturbances=["w1", "w2"], performance=["z1", "z2", "p1", "p2"],
    )  # fmt: skip


def test_what_is_specified_is_certified_on_its_channel():
    channels = {"hinf_channel": (["w1"], ["z1", "p1"]), "h2_channel": ("w2", ["z2", "p2"])}
    design = rp.mixed_state_feedback(two_lags(), "hinf", h2_bound=0.65, **channels)
    told = design.details["certificates"]
    assert told["hinf"].achieved == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert np.sqrt(np.sqrt(2) - 1) <= told["h2"].achieved <= 0.65 * (1 + 1e-6)
    assert design.certificate is told["hinf"]
    # All w and z are in the whole loop, those of the goal alone in the design's own.
    assert design.details["whole_loop"].input_labels == ["w1", "w2"]
    assert design.closed_loop.input_labels == ["w1"]


def test_a_bound_on_the_other_norm_joins_the_parts():
    alone = rp.mixed_state_feedback(two_lags(), "h2")
    together = rp.mixed_state_feedback(two_lags(), "h2", hinf_bound=0.9)
    assert [len(d.details["part_norms"]) for d in (alone, together)] == [2, 1]
    for design in (alone, together):
        best = np.sqrt(2 * (np.sqrt(2) - 1))  # of two equal parts
        assert design.certificate.achieved == pytest.approx(best, rel=1e-3)


def test_prices_belong_to_every_channel_and_regions_are_kept():
    plant = two_lags().part(
        states=[0, 1], disturbances=[0, 1], controls=[0, 1], performance=[0, 1], measurements=[0, 1]
    )
    design = rp.mixed_state_feedback(plant, "h2", h2_channel=("w1", "z1"), control_weight=1.0)
    assert design.plant.disturbance_names == ("w1",)
    assert design.plant.performance_names == ("z1", "price_u1", "price_u2")
    assert design.certificate.achieved == pytest.approx(np.sqrt(np.sqrt(2) - 1), rel=1e-3)
    region = rp.HalfPlane(-3.0)
    design = rp.mixed_state_feedback(two_lags(), pole_region=region)
    assert design.details["pole_regions"] == (region,)
    assert region.contains(design.certificate.poles)
    # k > 2 beyond the optimum: sqrt(5)/3.
    assert design.certificate.achieved == pytest.approx(np.sqrt(5) / 3, rel=1e-3)


@pytest.mark.parametrize(
    ("method", "share"), [(rp.mixed_output_feedback, 0.9), (rp.mixed_state_feedback, 0.95)]
)
def test_a_bound_on_the_other_norm_is_kept_and_costs(method, share):
    best = method(oscillator(), "h2", time_limit=5)
    bound = share * float(rp.hinf_norm(best.closed_loop))
    both = method(oscillator(), "h2", hinf_bound=bound, time_limit=10)
    assert float(rp.hinf_norm(both.closed_loop)) <= bound * (1 + 1e-6)
    assert float(rp.h2_norm(both.closed_loop)) == pytest.approx(both.certificate.achieved, rel=1e-6)
    assert both.certificate.achieved >= best.certificate.achieved * (1 - 1e-4)
    assert set(both.details["certificates"]) == {"h2", "hinf"}


def test_channels_are_minimised_and_bounded_apart():
    plant = oscillator()
    design = rp.mixed_output_feedback(
        plant,
        "hinf",
        hinf_channel=("force", "x"),
        h2_channel=(["force", "noise"], ["price"]),
        h2_bound=0.4,
        time_limit=10,
    )
    on_x = channel(plant, "force", "x").closed_loop(design.controller)
    on_u = channel(plant, ["force", "noise"], "price").closed_loop(design.controller)
    assert float(rp.hinf_norm(on_x)) == pytest.approx(design.certificate.achieved, rel=1e-6)
    assert float(rp.h2_norm(on_u)) <= 0.4 * (1 + 1e-6)
    assert float(rp.hinf_norm(on_x)) < float(rp.hinf_norm(channel(plant, "force", "x").open_loop))


@pytest.mark.parametrize(
    "region",
    [
        *(
            pytest.param(region, marks=pytest.mark.long)
            for region in (rp.HalfPlane(-0.6), rp.Disk(-2.0, 1.8), rp.Sector(0.8))
        ),
        [rp.HalfPlane(-0.4), rp.Sector(0.6)],
    ],
)
def test_poles_stay_in_their_region(region):
    design = rp.mixed_output_feedback(oscillator(), pole_region=region, time_limit=8)
    poles = design.closed_loop.poles()
    for each in region if isinstance(region, list) else [region]:
        assert each.contains(poles)


@pytest.mark.long
def test_gain_bound_holds_at_all_frequencies():
    design = rp.mixed_output_feedback(oscillator(), gain_bound=0.5, time_limit=20)
    assert float(rp.hinf_norm(design.controller)) <= 0.5 * (1 + 1e-6)


def test_one_norm_alone_is_that_of_state_feedback():
    for norm in ("hinf", "h2"):
        plant = oscillator()
        mixed = rp.mixed_state_feedback(plant, norm, time_limit=5)
        plain = rp.state_feedback(plant, norm)
        assert mixed.certificate.achieved == pytest.approx(plain.certificate.achieved, rel=1e-3)


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


@pytest.mark.parametrize("method", [rp.mixed_output_feedback, rp.mixed_state_feedback])
def test_what_cannot_be_met_is_not_a_success(method):
    with pytest.raises(rp.SolverError, match="all specifications"):
        method(oscillator(), "h2", hinf_bound=1e-3, time_limit=3)
