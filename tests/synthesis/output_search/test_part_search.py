"""A large plant is searched with fewer states where that is harmless, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from hard_plants import heat_rod

import robustpolish as rp
from robustpolish.synthesis import driver

POINTS = 80


@pytest.fixture
def small_is_large(monkeypatch):
    def limits(**changed):
        policy = replace(driver.POLICY, truncated_states=POINTS - 1, **changed)
        monkeypatch.setattr(driver, "POLICY", policy)

    return limits


def priced_rod():
    return rp.output_feedback(heat_rod(POINTS), control_weight=1e-3, measurement_noise=1e-3)


def test_few_states_give_the_same_norm_and_a_short_controller(small_is_large):
    whole = priced_rod()
    small_is_large()
    short = priced_rod()
    assert short.certificate.valid
    assert short.certificate.achieved == pytest.approx(whole.certificate.achieved, rel=2e-3)
    assert short.controller.nstates <= POINTS / 2
    assert f"of the {POINTS} states" in short.message
    assert "Hankel bound" in short.message
    assert short.lower_bound is None  # that of the shorter plant proves nothing of this one
    assert short.status == "suboptimal"


def test_a_large_plant_gets_a_short_controller():
    plant = heat_rod(105)
    design = rp.output_feedback(plant, control_weight=1e-3, measurement_noise=1e-3)
    assert design.certificate.valid
    assert design.controller.nstates <= 52
    poles = np.linalg.eigvals(design.closed_loop.A)
    assert poles.size == 105 + design.controller.nstates
    assert poles.real.max() < 0


def test_all_states_are_searched_where_leaving_some_out_does_harm(small_is_large):
    small_is_large(harmless=-1.0)
    design = priced_rod()
    assert design.certificate.valid
    assert "Hankel" not in design.message


def test_all_states_are_searched_where_the_bound_does_not_hold(small_is_large, monkeypatch):
    small_is_large()
    monkeypatch.setattr(driver, "is_out_of_reach", lambda plant, gamma: False)
    assert "Hankel" not in priced_rod().message


def test_all_states_are_searched_where_no_certificate_is_had(small_is_large, monkeypatch):
    small_is_large()
    choose, refused = driver.choose_controller, []

    def refusing(part, problem, searches, enough, budget, prove):
        if problem.plant.nx < part.matrices.nx:
            refused.append(problem.plant.nx)
            return None, ["it was refused"]
        return choose(part, problem, searches, enough, budget, prove)

    monkeypatch.setattr(driver, "choose_controller", refusing)
    design = priced_rod()
    assert len(refused) == 1
    assert design.certificate.valid
    assert "Hankel" not in design.message
