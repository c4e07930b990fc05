"""Why candidates were not refitted, in words, with the figures that decided."""

import pytest

from robustpolish.identification.structure.candidates import RefitCandidates, reasons_not_refitted
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.machines.effects.effect import Effect
from tests.identification.discover.searches import judged, refitted, search_of
from tests.identification.oscillators import PLACE, of_rig, rig


@pytest.fixture(scope="module")
def search():
    """Its error stands at 10 N."""
    found = search_of(rig(), of_rig(noise=1.0))
    found.stage = judged(rig(), 10.0)
    return found


def screened(kind, score, remark="", **values):
    return ScreenedEffect(Effect(kind, PLACE, values), score, 0.1, remark)


def cubic(free, score=400.0):
    return refitted(rig(), "cubic_stiffness", PLACE, {"stiffness": 3.0}, free, score=score)


DRAG = screened("quadratic_damping", 90.0)
COULOMB = screened("coulomb_friction", 150.0)
PLACE_OF_DRAG = ("quadratic_damping", PLACE)


def why(search, candidates, first, further, refits):
    return reasons_not_refitted(candidates, RefitCandidates(first, further, [], []), refits, search)


def test_odds_below_the_bar_are_told_with_both_numbers(search):
    best = cubic(9.5)
    found = why(
        search, [best.screened, screened("quadratic_damping", 8.08)], [best.screened], [], [best]
    )
    assert found == {PLACE_OF_DRAG: "screened only: log odds of 8.08, and a refit begins above 12"}


def test_far_below_the_best_is_told(search):
    best = cubic(9.5)
    found = why(search, [best.screened, DRAG], [best.screened], [], [best])
    assert found[PLACE_OF_DRAG] == (
        "screened only: log odds of 90, less than 0.25 of the 400 of cubic_stiffness at x, ground"
    )


def test_the_round_was_over_before_its_turn(search):
    best = cubic(9.5, score=200.0)
    found = why(search, [best.screened, COULOMB, DRAG], [best.screened, COULOMB], [], [best])
    assert found[PLACE_OF_DRAG] == (
        "screened only: 2 others had better odds, and the round was over before its turn"
    )


def test_another_earned_its_place_first(search):
    best = cubic(2.0, score=200.0)
    found = why(search, [best.screened, DRAG], [best.screened], [DRAG], [best])
    assert found[PLACE_OF_DRAG] == (
        "screened only: cubic_stiffness at x, ground had earned its place before its turn came"
    )


def test_another_had_left_nothing_but_noise(search):
    (noise,) = search.prepared.scales.noise
    best = cubic(noise, score=200.0)
    found = why(search, [best.screened, DRAG], [best.screened, DRAG], [], [best])
    assert found[PLACE_OF_DRAG] == (
        "screened only: cubic_stiffness at x, ground had left nothing but noise, and log odds of "
        "90 are less than 0.6 of the 200 of cubic_stiffness at x, ground"
    )


def test_a_fit_that_did_not_end_is_told_and_what_of_its_family_was_refitted(search):
    friction = {"force": 3.0, "static_force": 4.0, "velocity": 0.5}
    kin = refitted(rig(), "stribeck_friction", PLACE, friction, 9.5, score=200.0)
    found = why(search, [kin.screened, COULOMB], [kin.screened, COULOMB], [], [kin])
    assert found == {
        ("coulomb_friction", PLACE): "screened only: no fit with it ended; "
        "stribeck_friction at x, ground of its family was refitted there"
    }


def test_wrong_signs_and_refits_need_no_words(search):
    best = cubic(2.0)
    wrong = screened("quadratic_damping", 300.0, "its force has the wrong sign")
    assert why(search, [best.screened, wrong], [best.screened], [], [best]) == {}
