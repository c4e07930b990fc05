import numpy as np
import pytest

from robustpolish.identification.observer.runs import StartedPiece, free_run, rest
from robustpolish.identification.observer.starts import (
    doubling_lengths,
    fitted_start,
    fitted_starts,
)
from tests.identification.observer.runs import case
from tests.identification.oscillators import PLACE


@pytest.mark.parametrize("effect", [None, ("cubic_stiffness", PLACE, {"stiffness": 1e7})])
def test_the_start_is_found_from_rest(effect):
    model, record = case(effect)
    run = free_run(model, record)
    found = fitted_start(run, record, [rest(model)], np.array([1e-3, 0.02]))
    np.testing.assert_allclose(found.state, [2e-3, 0.1], rtol=1e-3)
    assert np.max(np.abs(run.errors(StartedPiece(record, found)))) < 1e-6


def test_the_best_guess_is_where_the_search_begins():
    model, record = case(("coulomb_friction", PLACE, {"force": 0.2}))
    run = free_run(model, record)
    right, wrong = rest(model).with_vector(np.array([2e-3, 0.1])), rest(model)
    sizes = np.array([1e-3, 0.02])
    for guesses in ([wrong, right], [right, wrong]):
        found = fitted_start(run, record, guesses, sizes)
        np.testing.assert_allclose(found.state, [2e-3, 0.1], rtol=1e-2)


def test_stretches_grow_twofold_up_to_the_whole():
    assert doubling_lengths(30) == [30]
    assert doubling_lengths(8000) == [62, 125, 250, 500, 1000, 2000, 4000, 8000]


def test_of_two_starts_the_one_that_comes_closer_is_followed():
    """A hardening spring from far too large a start stays lost in a wrong phase."""
    model, record = case(("cubic_stiffness", PLACE, {"stiffness": 1e9}))
    run, sizes = free_run(model, record), np.array([1e-3, 0.02])
    lost = [StartedPiece(record, rest(model).with_vector(np.array([-0.02, -1.0])))]
    near = [StartedPiece(record, rest(model).with_vector(np.array([1.9e-3, 0.11])))]
    (alone,) = fitted_starts(run, lost, sizes)
    assert not np.std(run.errors(alone)) < 1e-4
    for one, other in ((lost, near), (near, lost)):
        (found,) = fitted_starts(run, one, sizes, other)
        np.testing.assert_allclose(found.start.state, [2e-3, 0.1], rtol=1e-2)


@pytest.mark.parametrize("guess", [(0.01, 0.5), (6e-3, -0.3), (0.02, 0.3), (-6e-3, 0.1)])
def test_a_start_that_is_wrong_begins_anew_over_very_short_stretches(guess):
    """Over the first usual stretch a spring that stiffens swings too often to be followed."""
    model, record = case(("cubic_stiffness", PLACE, {"stiffness": 1e8}))
    run, sizes = free_run(model, record), np.array([1e-3, 0.02])
    wrong = [StartedPiece(record, rest(model).with_vector(np.array(guess)))]
    (found,) = fitted_starts(run, wrong, sizes)
    np.testing.assert_allclose(found.start.state, [2e-3, 0.1], rtol=1e-6)


@pytest.mark.parametrize("effect", [None, ("coulomb_friction", PLACE, {"force": 0.2})])
def test_starts_of_windows_are_those_of_each_alone(effect):
    model, record = case(effect)
    run, sizes = free_run(model, record), np.array([1e-3, 0.02])
    parts = [record.part(*part) for part in ((0, 400), (400, 800), (800, 1200))]
    pieces = [StartedPiece(part, rest(model)) for part in parts]
    together = fitted_starts(run, pieces, sizes)
    for part, found in zip(parts, together, strict=True):
        (alone,) = fitted_starts(run, [StartedPiece(part, rest(model))], sizes)
        # the weights of the outputs differ, and one output has but one
        np.testing.assert_allclose(found.start.state, alone.start.state, rtol=1e-4, atol=1e-8)
        assert found.record is part
    assert np.max(np.abs(run.errors(together[0]))) < 2e-5
    assert fitted_starts(run, [], sizes) == []
    assert fitted_starts(run, pieces, np.zeros(0)) == pieces
