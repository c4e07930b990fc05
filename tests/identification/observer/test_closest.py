import numpy as np
import pytest

from robustpolish.identification.observer.runs import StartedPiece, free_run, rest
from robustpolish.identification.observer.starts import (
    output_weights,
    refine_starts,
    squared_errors_of,
)
from tests.identification.observer.runs import case
from tests.identification.oscillators import PLACE

SIZES = np.array([1e-3, 0.02])


@pytest.mark.parametrize("effect", [None, ("cubic_stiffness", PLACE, {"stiffness": 1e7})])
def test_starts_are_improved_over_the_first_samples(effect):
    model, record = case(effect)
    run, weights = free_run(model, record), output_weights(record)
    pieces = [StartedPiece(record, rest(model)), StartedPiece(record.part(300, 900), rest(model))]
    found = refine_starts(run, pieces, 60, SIZES, weights)
    np.testing.assert_allclose(found[0].start.state, [2e-3, 0.1], rtol=1e-2)
    assert [piece.record for piece in found] == [piece.record for piece in pieces]
    before, after = (
        np.array(squared_errors_of(run, each, 60, weights)) for each in (pieces, found)
    )
    assert np.all(after < 1e-3 * before)


def test_a_start_that_is_right_stays():
    model, record = case(("cubic_stiffness", PLACE, {"stiffness": 1e7}))
    right = rest(model).with_vector(np.array([2e-3, 0.1]))
    run, weights = free_run(model, record), output_weights(record)
    (found,) = refine_starts(run, [StartedPiece(record, right)], 200, SIZES, weights)
    np.testing.assert_allclose(found.start.state, [2e-3, 0.1], rtol=1e-6)


def test_errors_are_weighed_by_the_size_of_each_output():
    _, record = case()
    assert output_weights(record)[0] == pytest.approx(1 / np.std(record.Y[:, 0]))
