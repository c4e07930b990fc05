"""State feedback for any norm below gamma, or the smallest within a range."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InfeasibleError

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
