"""Why there is no gain."""

import numpy as np
import pytest
from polytope_examples import solver

import robustpolish as rp
from robustpolish.synthesis.scheduled.polytope import (
    LyapunovFamily,
    PolytopeSpecification,
    polytope,
    scaled_vertices,
)
from robustpolish.synthesis.scheduled.robust_state_feedback import (
    GainProblem,
    feasible_share,
    refused_vertices,
)


def pushed(gain):
    """An unstable lag whose actuator has an uncertain gain."""
    return rp.GeneralizedPlant.from_matrices(
        [[1.0]], [[1.0]], [[gain]], [[1.0], [0.0]], [[1.0]], D12=[[0.0], [1.0]]
    )


def test_a_vertex_without_control_is_named():
    with pytest.raises(rp.InfeasibleError, match=r"vertex plants\[1\].*uncontrollable") as caught:
        refused_vertices(polytope([pushed(1.0), pushed(0.0)], None, None).with_full_state())
    assert caught.value.modes == pytest.approx((1.0,))
    refused_vertices(polytope([pushed(1.0), pushed(-1.0)], None, None).with_full_state())


@pytest.mark.long
def test_the_part_that_has_a_gain():
    # From -0.6 to 1: no gain beyond 0; towards the middle, 0.2, it does not change sign below 1/4.
    whole = polytope([pushed(1.0), pushed(-0.6)], None, None).with_full_state()
    _, vertices = scaled_vertices(whole)
    specification = PolytopeSpecification(LyapunovFamily.per_vertex(2), "hinf", False)
    share = feasible_share(GainProblem(vertices, specification), solver())
    assert 0.12 < share <= 0.25
    assert np.isfinite(share)
