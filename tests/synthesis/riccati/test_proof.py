"""Bounds that are proven, however wrong the guess was."""

import pytest

import robustpolish as rp
from robustpolish.base.budget import DeadlineError
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati import lower_bound as proof
from robustpolish.synthesis.riccati.lower_bound import proven_lower_bound


def plant():
    return PlantMatrices.of(
        rp.GeneralizedPlant.from_matrices(
            [[0.0, 1.0], [0.0, 0.0]],
            [[0.0, 0.0], [1.0, 0.0]],
            [[0.0], [1.0]],
            [[1.0, 0.0], [0.0, 0.0]],
            [[1.0, 0.0]],
            D12=[[0.0], [1.0]],
            D21=[[0.0, 1.0]],
        )
    )


@pytest.mark.parametrize("guess", [0.0, 1e-20, 1.0, 2.6, 1e20])
def test_a_wrong_guess_takes_longer_only(guess):
    found = proven_lower_bound(plant(), guess, 1e-3)
    assert found == pytest.approx(proven_lower_bound(plant(), 2.58, 1e-4), rel=1.2e-3)


def test_more_digits_are_taken_where_they_do_not_suffice(monkeypatch):
    monkeypatch.setattr(proof, "_BITS", (64, 768))
    assert proven_lower_bound(plant(), 2.58, 1e-3) > 2.5


def test_without_digits_nothing_is_proven(monkeypatch):
    monkeypatch.setattr(proof, "_BITS", ())
    assert proven_lower_bound(plant(), 2.58, 1e-3) == 0


def test_when_the_time_is_over_what_was_proven_is_returned(monkeypatch):
    full = proven_lower_bound(plant(), 2.0, 1e-3)
    looks = [True, True, True]

    def look():
        if not looks:
            raise DeadlineError
        looks.pop()

    monkeypatch.setattr(proof, "check_deadline", look)
    assert 1.9 < proven_lower_bound(plant(), 2.0, 1e-3) < 0.999 * full
    assert proven_lower_bound(plant(), 2.0, 1e-3) == 0


def test_no_controller_comes_below():
    bound = proven_lower_bound(plant(), 1.0, 1e-4)
    found = rp.output_feedback(
        rp.GeneralizedPlant.from_matrices(
            *(getattr(plant(), name) for name in ("A", "B1", "B2", "C1", "C2")),
            D12=plant().D12,
            D21=plant().D21,
        )
    )
    assert bound <= found.certificate.achieved <= bound * 1.011
