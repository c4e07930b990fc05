"""Random plants with all the troubles that plants have: no false word about any of them."""

import numpy as np
import pytest
from hard_plants import wild_plant
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import robustpolish as rp
from robustpolish.synthesis import output_feedback

SEEDS = st.integers(min_value=0, max_value=2**32 - 1)
QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck), "derandomize": True}


def design_and_judge(seed, norm):
    """Design for one plant; judge a success from outside."""
    plant = wild_plant(np.random.default_rng(seed))
    try:
        design = output_feedback(plant, norm, time_limit=5.0)
    except (rp.InfeasibleError, rp.SolverError):
        return
    certificate = design.certificate
    assert certificate.valid
    assert certificate.stable
    assert not certificate.reasons
    assert certificate.bound <= 1.002 * certificate.achieved
    loop = plant.closed_loop(design.controller)
    poles = np.linalg.eigvals(loop.A)
    assert (np.abs(poles) < 1).all() if plant.is_discrete else (poles.real < 0).all()
    if norm == "hinf":
        assert rp.hinf_norm(loop).value <= 1.002 * certificate.achieved
    else:
        assert rp.h2_norm(loop).value <= 1.002 * certificate.achieved


@settings(max_examples=20, **QUIET)
@given(SEEDS)
def test_some_random_plants(seed):
    design_and_judge(seed, "hinf")


@settings(max_examples=10, **QUIET)
@given(SEEDS)
def test_some_random_plants_for_h2(seed):
    design_and_judge(seed, "h2")


@pytest.mark.slow
@pytest.mark.timeout(7200)
@settings(max_examples=2000, **QUIET)
@given(SEEDS)
def test_two_thousand_random_plants(seed):
    design_and_judge(seed, "hinf")


@pytest.mark.slow
@pytest.mark.timeout(3600)
@settings(max_examples=500, **QUIET)
@given(SEEDS)
def test_five_hundred_random_plants_for_h2(seed):
    design_and_judge(seed, "h2")
