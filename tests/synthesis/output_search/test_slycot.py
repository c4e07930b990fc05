"""SLICOT as an engine: its optima where it is right, remarks where it is not."""

import numpy as np
import pytest
from output_tasks import LAG_H2, LAG_HINF, settings, task, unstable_lag

from robustpolish.base.budget import Budget
from robustpolish.synthesis.backends.slycot_backend import SlycotAnswer
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.engine import POLICY
from robustpolish.synthesis.output_feedback import lmi as slycot


def search(norm: Norm = "hinf", plant=None):
    problem = task(unstable_lag() if plant is None else plant, norm, bounded=False)
    return slycot.Slycot(settings(norm, "slycot")).search(problem, Budget(seconds=60.0))


@pytest.mark.parametrize(("norm", "optimum"), [("hinf", LAG_HINF), ("h2", LAG_H2)])
def test_optima_in_closed_form(norm, optimum):
    pytest.importorskip("slycot")
    found = search(norm)
    (candidate,) = found.candidates
    assert candidate.achieved == pytest.approx(optimum, rel=0.02)
    assert not found.history[0]["regularised"]
    assert found.remarks == []


def answering(monkeypatch, answer):
    """Let the routine answer this, and return what it is given."""
    given = {}

    def routine(name, sizes, matrices, time_limit):
        given.update(name=name, sizes=sizes, matrices=matrices, time_limit=time_limit)
        return answer

    monkeypatch.setattr(slycot, "synthesise", routine)
    return given


def static(gain):
    none = np.zeros
    return none((0, 0)), none((0, 1)), none((1, 0)), np.array([[gain]])


def test_a_false_claim_becomes_a_remark(monkeypatch):
    answering(monkeypatch, SlycotAnswer(static(-3.0), 0.5, ""))
    found = search()
    (candidate,) = found.candidates
    assert candidate.achieved >= 3.0  # u alone passes the noise on with 3
    assert f"SB10AD claimed a norm {candidate.achieved / 0.5:.4g} times smaller" in found.remarks[0]


def test_a_controller_that_does_not_stabilise_is_none(monkeypatch):
    answering(monkeypatch, SlycotAnswer(static(-0.5), 0.5, ""))
    found = search()
    assert found.candidates == []
    assert found.remarks == ["The controller of SB10AD does not stabilise the plant."]


def test_a_routine_that_fails_is_quoted(monkeypatch):
    given = answering(monkeypatch, SlycotAnswer(None, None, "SB10HD ended with 4"))
    found = search("h2")
    assert found.candidates == []
    assert found.remarks == ["SB10HD ended with 4."]
    assert given["name"] == "SB10HD"
    assert 0 < given["time_limit"] <= 60.0


def test_singular_plants_are_regularised_and_regular_ones_left_alone(monkeypatch):
    given = answering(monkeypatch, SlycotAnswer(None, None, "no"))
    search()
    A, B, C, D = given["matrices"]
    assert (A.shape, B.shape, C.shape) == ((1, 1), (1, 3), (3, 1))
    assert D.tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    search(plant=unstable_lag(price=0.0))
    nx, nu, ny = given["sizes"]
    D12 = given["matrices"][3][:-ny, -nu:]
    assert np.linalg.norm(D12) == pytest.approx(POLICY.slycot_epsilon)
    assert given["matrices"][0].shape == (nx, nx)
