"""Any norm below gamma, or the smallest within a range, kept by a proven bound or refused."""

import numpy as np
import pytest
from output_tasks import LAG_H2, LAG_HINF, unstable_lag
from published_plants import scherer_1997

import robustpolish as rp
from robustpolish.errors import InfeasibleError, InvalidInputError

OPTIMUM = 9.508


def largest(design):
    K = design.controller
    return max(np.abs(M).max(initial=0.0) for M in (K.A, K.B, K.C, K.D))


@pytest.mark.parametrize("method", ["auto", "riccati", "lmi"])
@pytest.mark.parametrize("factor", [1.05, 1.5, 20.0])
def test_a_number_is_kept_and_the_rest_buys_a_smaller_gain(method, factor):
    design = rp.output_feedback(scherer_1997(), method=method, gamma=factor * OPTIMUM)
    assert design.certificate.valid
    assert design.certificate.bound <= factor * OPTIMUM
    assert f"a norm below gamma = {factor * OPTIMUM:.6g}" in design.message
    assert design.status == "suboptimal"
    assert design.lower_bound == pytest.approx(OPTIMUM, rel=1e-3)
    if method != "lmi":  # which has no central controller
        assert largest(design) <= largest(rp.output_feedback(scherer_1997(), method=method))


def test_what_no_controller_reaches_is_refused_with_the_lower_bound():
    with pytest.raises(InfeasibleError, match=r"below gamma = 9\..*at least 9\.50.*Riccati"):
        rp.output_feedback(scherer_1997(), gamma=9.0)
    with pytest.raises(InfeasibleError, match=r"within gamma = 1 to 9\."):
        rp.output_feedback(scherer_1997(), gamma=(1.0, 9.0))


def test_a_range_is_searched_down_to_its_low_end_only():
    inside = rp.output_feedback(scherer_1997(), gamma=(5.0, 12.0))
    assert inside.status == "optimal"
    assert inside.certificate.achieved <= OPTIMUM * 1.004
    above = rp.output_feedback(scherer_1997(), gamma=(11.0, 12.0))
    assert above.certificate.bound <= 11.0
    assert "within gamma = 11 to 12" in above.message
    assert above.details["gamma"] == (11.0, 12.0)


def test_at_the_optimum_a_number_is_optimal():
    design = rp.output_feedback(unstable_lag(), gamma=1.003 * LAG_HINF)
    assert design.status == "optimal"
    assert design.certificate.bound <= 1.003 * LAG_HINF


def test_the_h2_norm_too():
    design = rp.output_feedback(unstable_lag(), "h2", gamma=1.5 * LAG_H2)
    assert design.certificate.bound <= 1.5 * LAG_H2
    with pytest.raises(InfeasibleError, match=r"The H2 norm of every .* at least 4\."):
        rp.output_feedback(unstable_lag(), "h2", gamma=0.9 * LAG_H2)


def test_parts_that_share_no_signal_each_keep_it():
    one, other = unstable_lag(), unstable_lag(a=0.5)
    block = [
        np.block([[M, np.zeros((M.shape[0], N.shape[1]))], [np.zeros((N.shape[0], M.shape[1])), N]])
        for M, N in (
            (getattr(one, name), getattr(other, name))
            for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21")
        )
    ]
    both = rp.GeneralizedPlant.from_matrices(*block)
    design = rp.output_feedback(both, gamma=4.0)
    assert len(design.details["parts"]) == 2
    assert design.certificate.bound <= 4.0


@pytest.mark.parametrize("gamma", [0, -1, "2", np.nan, (3, 1), (1, 2, 3), True])
def test_bad_values(gamma):
    with pytest.raises(InvalidInputError, match=r"gamma: got .*low, high"):
        rp.output_feedback(unstable_lag(), gamma=gamma)
    with pytest.raises(InvalidInputError, match=r"gamma: got .*low, high"):
        rp.state_feedback(unstable_lag(), gamma=gamma)
