"""The search for a state feedback on small plants whose optima are known in closed form."""

import time

import control
import numpy as np
import pytest
from scipy.linalg import block_diag

import robustpolish as rp
from robustpolish.errors import InfeasibleError


def lag(a=-1.0, price=1.0, force=1.0, watched=1.0, state="x"):
    """X' = a x + w + force u, z = (watched x, price u): sqrt(1 + k^2)/(k - a) for u = -k x."""
    return rp.GeneralizedPlant.from_matrices(
        [[a]], [[1.0]], [[force]], [[watched], [0.0]], [[1.0]], D12=[[0.0], [price]], states=[state]
    )


def beside(*plants):
    """Return plants that share no signal as one."""
    A, B1, B2, C1, C2, D12 = (
        block_diag(*(getattr(plant, name) for plant in plants))
        for name in ("A", "B1", "B2", "C1", "C2", "D12")
    )
    return rp.GeneralizedPlant.from_matrices(A, B1, B2, C1, C2, D12=D12)


def designed(plant, norm="hinf", method="riccati", **options):
    return rp.state_feedback(plant, norm, method, **options)


@pytest.mark.parametrize("method", ["riccati", "lmi"])
def test_an_optimum_in_closed_form_is_reached_and_proven(method):
    # sqrt(1 + k^2)/(1 + k) is least for k = 1.
    design = designed(lag(), method=method)
    assert design.status == "optimal"
    assert design.certificate.achieved == pytest.approx(np.sqrt(0.5), rel=1e-4)
    assert np.sqrt(0.5) * (1 - 1e-4) < design.lower_bound <= np.sqrt(0.5) * (1 + 1e-9)
    assert f"has a norm below {design.lower_bound:.6g}. That is within 1e-04" in design.message
    # The regulator of x' = x + u: k = 1 + sqrt(2), and the squared norm is the same number.
    design = designed(lag(a=1.0), "h2", method)
    assert design.certificate.achieved**2 == pytest.approx(1 + np.sqrt(2), rel=1e-6)
    assert design.gain.item() == pytest.approx(-(1 + np.sqrt(2)), rel=1e-4)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_answers_are_in_the_units_of_the_plant(norm):
    plain = designed(lag(), norm)
    # Time in ms, u in mN, z in um.
    other = designed(
        rp.GeneralizedPlant.from_matrices(
            [[-1e-3]], [[1e-3]], [[1e-6]], [[1e6], [0.0]], [[1.0]], D12=[[0.0], [1e3]]
        ),
        norm,
    )
    unit = 1e6 if norm == "hinf" else 1e6 / np.sqrt(1e3)
    assert other.gain.item() == pytest.approx(1e3 * plain.gain.item(), rel=0.05)
    assert other.certificate.achieved == pytest.approx(unit * plain.certificate.achieved, rel=1e-4)
    assert other.lower_bound == pytest.approx(unit * plain.lower_bound, rel=1e-4)
    assert other.history[0]["achieved"] == pytest.approx(other.certificate.achieved, rel=0.05)


def test_equal_parts_get_the_same_gain():
    design = designed(beside(lag(), lag()))
    assert design.gain[0, 0] == design.gain[1, 1] == designed(lag()).gain.item()
    assert not design.gain[0, 1]
    assert not design.gain[1, 0]


def test_a_part_in_which_nothing_happens_is_only_stabilised():
    # The least effort for x' = 2 x + u moves the pole to -2; z has nothing but zeros.
    awake, asleep = lag(a=2.0, price=0.0, watched=0.0), lag(a=-2.0, price=0.0, watched=0.0)
    design = designed(beside(awake, asleep, lag()))
    assert design.status == "optimal"
    assert design.gain[0, 0] < -2.0
    assert design.gain[1, 1] == 0.0
    assert design.certificate.achieved == pytest.approx(np.sqrt(0.5), rel=1e-4)


@pytest.mark.parametrize(("norm", "needed"), [("hinf", 1e4 - 1), ("h2", 1e8 - 1)])
def test_a_norm_that_falls_without_end_is_followed_to_a_share_with_a_small_gain(norm, needed):
    # 1/(1 + k), and 1/sqrt(2 (1 + k)): 1e-4 of the norm without control.
    design = designed(lag(price=0.0), norm)
    assert design.status == "infimum_not_attained"
    assert needed <= abs(design.gain.item()) < 1.5 * needed
    assert "(norm at gain of the first part: " in design.message
    for way_out in ("control_weight", "gain_bound", "pole_region"):
        assert way_out in design.message


def test_a_part_that_vanishes_beside_the_others_is_not_driven_to_zero():
    # Alone the free lag falls to 1e-4 of its own norm, 1; beside one of 100 to 1e-4 of that.
    design = designed(beside(lag(price=0.0), lag(price=0.0, watched=100.0)))
    assert design.status == "infimum_not_attained"
    assert 2e-3 < 1 / (1 - design.gain[0, 0]) <= 1e-2


def nulled(name):
    """Return a plant whose w some u keeps from z: A, B1, B2, C1, D12, sampling time."""
    A, B1, B2, C1, D12, dt = {
        # u = -x2 hides x2, which w moves, from z = x1
        "decoupled": ([[0, 1], [0, -1]], [[0], [1]], [[1], [0]], [[1, 0]], [[0]], 0),
        "in steps": ([[0, 1], [0, 0.5]], [[0], [1]], [[1], [0]], [[1, 0]], [[0]], 0.1),
        # what is hidden is unstable and the second control has to hold it
        "held": ([[0, 1], [0, 1]], [[0], [1]], [[1, 0], [0, 1]], [[1, 0]], [[0, 0]], 0),
        # two controls for one z, in which both count
        "wide D12": ([[0, 1], [0, 0.5]], [[1, 0], [0, 1]], [[0, 1], [1, 1]], [[1, 2]], [[1, 1]], 0),
        "wide D12 in steps": ([[1.1, 1], [0, 0.5]], [[1], [1]], [[0, 1], [1, 1]], [[1, 2]],
                              [[1, 1]], 1.0),
    }[name]  # fmt: skip
    n, w, u, z = len(A), len(B1[0]), len(B2[0]), len(C1)
    D = np.block([[np.zeros((z, w)), np.array(D12)], [np.zeros((n, w + u))]])
    whole = control.ss(A, np.hstack([B1, B2]), np.vstack([C1, np.eye(n)]), D, dt)
    return rp.GeneralizedPlant(whole, measurements=n, controls=u)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("name", ["decoupled", "in steps", "held", "wide D12", "wide D12 in steps"])
def test_a_norm_of_zero_that_is_attained_is_optimal(name, norm):
    plant = nulled(name)
    design = rp.state_feedback(plant, norm)
    assert design.status == "optimal"
    assert design.certificate.valid
    assert design.certificate.bound < 1e-11
    assert np.abs(design.gain).max() < 20


@pytest.mark.parametrize("zero", [1.0, -1.0])
def test_a_zero_in_the_right_half_plane_forbids_it(zero):
    # z = x1, where u = -x2 leaves x2' = zero x2 + w + u's share: x2 must not be hidden if it grows
    plant = rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0], [-zero]], [[1.0, 0.0]], np.eye(2)
    )
    design = rp.state_feedback(plant)
    assert (design.status == "optimal" and design.certificate.bound < 1e-11) == (zero < 0)


def test_a_norm_that_has_settled_is_told_apart():
    # What is disturbed and watched is a lag of its own; u has to stabilise another state.
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0.0], [0.0, 1.0]], [[1.0], [0.0]], [[0.0], [1.0]], [[1.0, 0.0]], np.eye(2)
    )
    design = designed(plant, split=False)
    assert design.status in ("optimal", "suboptimal")
    assert design.certificate.achieved == pytest.approx(1.0, rel=1e-4)
    assert np.linalg.norm(design.gain, 2) == pytest.approx(2.0, rel=0.01)  # from +1 to -1


def test_regions_are_kept_and_nothing_is_called_optimal():
    # k > 3 with sqrt(1 + k^2)/(1 + k) rising there.
    design = designed(lag(), method="lmi", pole_region=rp.HalfPlane(-4.0))
    assert design.gain.item() <= -3.0
    assert design.status == "suboptimal"
    assert "The poles lie in the region" in design.message
    assert design.certificate.achieved == pytest.approx(np.sqrt(10) / 4, rel=1e-3)
    assert design.lower_bound <= np.sqrt(0.5) * (1 + 1e-9)


@pytest.mark.parametrize(("norm", "expected"), [("hinf", 0.25), ("h2", 1 / np.sqrt(8))])
def test_where_control_is_free_the_whole_bound_is_used(norm, expected):
    # 1/(1 + 3), and 1/sqrt(2 (1 + 3)).
    design = designed(lag(price=0.0), norm, gain_bound=3.0)
    assert design.certificate.achieved == pytest.approx(expected, rel=1e-5)
    assert -3.0 <= design.gain.item() < -2.999
    assert "The bound 3 on the gain is kept" in design.message


def test_a_bound_beyond_the_optimum_leaves_it_alone_and_another_one_costs():
    design = designed(lag(), gain_bound=5.0)
    assert design.status == "optimal"
    assert abs(design.gain.item()) < 1.1
    design = designed(lag(), gain_bound=0.5)
    assert -0.5 <= design.gain.item() < -0.4999
    assert design.certificate.achieved == pytest.approx(np.sqrt(1.25) / 1.5, rel=1e-5)
    steps = {entry["step"] for entry in design.history}
    assert steps >= {"price", "descent on the true norm"}


@pytest.mark.parametrize(
    ("norm", "gamma", "least"),
    [
        # sqrt(1 + k^2) / (k - 1) = 4 for x' = x + w + u, z = (x, u).
        ("hinf", 4.0, (16 + np.sqrt(31)) / 15),
        # The squared norm with u = -k x is (1 + k^2) / (2 (k - 1)).
        ("h2", 2.0, 4 - np.sqrt(7)),
    ],
)
def test_the_smallest_gain_that_keeps_the_norm_asked_for(norm, gamma, least):
    design = designed(lag(a=1.0), norm, gamma=gamma)
    assert abs(design.gain.item()) == pytest.approx(least, rel=2e-3)
    assert design.certificate.bound <= gamma
    assert design.history[-1]["step"] == "descent on the gain"


def test_refusals_name_the_way_out():
    with pytest.raises(rp.SolverError, match=r"at most 0\.5 was found.*Raise gain_bound"):
        designed(lag(a=1.0), gain_bound=0.5)
    with pytest.raises(rp.SolverError, match=r"with the states x1.*Raise time_limit"):
        designed(unpriced_plant(), time_limit=1e-9)


def unpriced_plant():
    rng = np.random.default_rng(4)
    A, B1, B2 = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
    return rp.GeneralizedPlant.from_matrices(A, B1, B2, rng.normal(size=(2, 4)), np.eye(4))


@pytest.mark.long
@pytest.mark.parametrize("options", [{"gain_bound": 6.0}, {"method": "lmi"}])
def test_a_slow_machine_finds_the_same_gain(options, monkeypatch):
    """Four seconds pass with every look at the clock, as on a machine that is thousands slower."""
    plant = unpriced_plant()
    at_ease = rp.state_feedback(plant, time_limit=1e9, **options)
    real, looks = time.monotonic, iter(range(10**9))
    for clock in ("monotonic", "perf_counter", "process_time"):
        monkeypatch.setattr(time, clock, lambda: real() + 4.0 * next(looks))
    slow = rp.state_feedback(plant, time_limit=1e9, **options)
    assert slow.status == at_ease.status
    assert slow.gain.tobytes() == at_ease.gain.tobytes()


def test_the_end_of_the_work_is_no_lack_of_time(monkeypatch):
    from robustpolish.synthesis.state_feedback import state_feedback as module

    monkeypatch.setattr(module, "WORK", 4e2)
    design = rp.state_feedback(unpriced_plant(), gain_bound=6.0)
    assert design.certificate.valid
    assert design.status == "suboptimal"
    assert "ended with its work" in design.message


# State feedback for any norm below gamma, or the smallest within a range.


# x' = x + w + u, z = (x, u): |F| = k > 1 has the norm sqrt(1 + k^2)/(k - 1).
LAG = rp.GeneralizedPlant.from_matrices(
    [[1.0]], [[1.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], D12=[[0.0], [1.0]]
)


def spring_mass():
    """Two masses on springs with a disturbance and a force on each, of which only z = x counts."""
    A = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-np.array([[2.0, -1], [-1, 3]]), -0.02 * np.eye(2)]]
    )
    B = np.vstack([np.zeros((2, 2)), np.eye(2)])
    return rp.GeneralizedPlant.from_matrices(A, B, B, np.eye(2, 4), np.eye(4))


def size(design):
    return np.linalg.norm(design.gain, 2)


@pytest.mark.parametrize(("method", "gamma"), [("riccati", 1.5), ("riccati", 4.0), ("lmi", 4.0)])
def test_a_number_is_kept_with_a_gain_near_the_smallest(method, gamma):
    design = rp.state_feedback(LAG, method=method, gamma=gamma)
    assert design.certificate.valid
    assert design.certificate.bound <= gamma
    least = (np.sqrt(2 * gamma**2 - 1) + gamma**2) / (gamma**2 - 1)
    assert least * (1 - 1e-6) <= size(design) <= 1.3 * least
    assert f"a norm below gamma = {gamma:.6g}" in design.message
    assert design.details["gamma"] == (gamma, gamma)


@pytest.mark.parametrize(("norm", "gammas"), [("hinf", (3.0, 30.0)), ("h2", (1.0, 4.0))])
def test_the_more_is_allowed_the_smaller_the_gain_without_a_price(norm, gammas):
    tight, loose = (
        rp.state_feedback(spring_mass(), norm, "riccati", gamma=gamma) for gamma in gammas
    )
    for design, gamma in ((tight, gammas[0]), (loose, gammas[1])):
        assert design.certificate.bound <= gamma
        assert design.certificate.achieved > 0.6 * gamma
        assert design.status == "suboptimal"
        assert "given away for a smaller gain" in design.message
    assert size(loose) < 0.5 * size(tight)


def test_where_no_control_will_do_none_is_taken():
    design = rp.state_feedback(spring_mass(), method="riccati", gamma=1e4)
    assert size(design) == 0
    assert design.history[-1]["step"] == "no control"


def test_a_range_is_searched_down_to_its_low_end_only():
    best = rp.state_feedback(LAG, method="riccati")
    inside = rp.state_feedback(LAG, method="riccati", gamma=(0.5, 2.0))
    assert inside.status == "optimal"
    assert inside.certificate.achieved == pytest.approx(best.certificate.achieved, rel=1e-4)
    above = rp.state_feedback(LAG, method="riccati", gamma=(1.5, 2.0))
    assert above.certificate.bound <= 1.5
    assert size(above) < size(best)
    assert "within gamma = 1.5 to 2" in above.message


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_what_no_gain_reaches_is_refused_with_the_lower_bound(norm):
    least = rp.state_feedback(LAG, norm, "riccati").certificate.achieved
    with pytest.raises(InfeasibleError, match=r"no controller has a norm below gamma.*at least"):
        rp.state_feedback(LAG, norm, "riccati", gamma=0.9 * least)
    with pytest.raises(InfeasibleError, match=r"within gamma = 0.1 to"):
        rp.state_feedback(LAG, norm, "riccati", gamma=(0.1, 0.9 * least))


def test_an_infimum_that_is_a_limit_of_gains_is_bounded_from_below():
    # sqrt(1 + k^2)/(k - 1) falls towards 1.
    design = rp.state_feedback(LAG, method="riccati")
    assert 1 - 1e-4 < design.lower_bound < 1 < design.certificate.achieved < 1 + 1e-3


def test_a_bound_on_the_gain_is_kept_too_or_the_error_names_it():
    design = rp.state_feedback(LAG, method="riccati", gamma=2.0, gain_bound=3.0)
    assert design.certificate.bound <= 2.0
    assert size(design) <= 3.0
    with pytest.raises(rp.SolverError, match=r"below gamma = 1\.5 was found.*gain_bound"):
        rp.state_feedback(LAG, method="riccati", gamma=1.5, gain_bound=2.0)


def test_a_pole_region_is_kept_too():
    region = rp.HalfPlane(-1.5)
    design = rp.state_feedback(LAG, gamma=2.0, pole_region=region)
    assert design.certificate.bound <= 2.0
    assert design.certificate.poles.real.max() < -1.5


def test_discrete_plants_too():
    plant = rp.GeneralizedPlant.from_matrices(
        [[1.2]], [[1.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], D12=[[0.0], [1.0]], dt=0.1
    )
    best = rp.state_feedback(plant, method="riccati")
    gamma = 1.5 * best.certificate.achieved
    design = rp.state_feedback(plant, method="riccati", gamma=gamma)
    assert design.certificate.bound <= gamma
    assert size(design) < size(best)
