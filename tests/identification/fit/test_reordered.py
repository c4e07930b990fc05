"""The same fit with its effects in another order: the same runs, and the same numbers known."""

import numpy as np
import pytest

from robustpolish.identification.fit.least_squares import (
    covariance_of,
    stderr_from_covariance,
    with_effect_order,
)
from robustpolish.machines.effects.effect import Effect
from tests.identification.discover.searches import search_of
from tests.identification.oscillators import PLACE, oscillator, record

EFFECTS = (
    Effect("dahl_friction", PLACE, {"force": 0.2, "stiffness": 60.0}),
    Effect("cubic_stiffness", PLACE, {"stiffness": 30.0}),
    Effect("elastic_coulomb_friction", PLACE, {"force": 0.1, "stiffness": 20.0}),
)


@pytest.fixture(scope="module")
def fitted():
    model = oscillator()
    search = search_of(model, record(600, noise=0.002, cubic=30.0))
    found = search.fit_with(search.stage.model, *EFFECTS)
    return search, found.fit


def test_runs_and_errors_are_the_same(fitted):
    search, before = fitted
    after = with_effect_order(before, [2, 0, 1])
    kinds = [e.kind for e in before.model.effects]
    assert [e.kind for e in after.model.effects] == [kinds[2], kinds[0], kinds[1]]
    for one, other in zip(before.pieces, after.pieces, strict=True):
        np.testing.assert_array_equal(one.start.internal[[1, 0]], other.start.internal)
    runs = [
        search.prepared.runner(item.model).run(item.model).all_errors(item.pieces)
        for item in (before, after)
    ]
    np.testing.assert_allclose(*runs, rtol=1e-9, atol=1e-9 * np.max(np.abs(runs[0])))


def test_standard_errors_follow_their_numbers(fitted):
    _, before = fitted
    after = with_effect_order(before, [2, 0, 1])
    one, other = (stderr_from_covariance(covariance_of(item)) for item in (before, after))
    assert len(one) == len(other)
    for old, new in ((2, 0), (0, 1)):
        for name in ("force", "stiffness"):
            assert other[f"effect[{new}].{name}"] == one[f"effect[{old}].{name}"]
    assert other["spring[0].stiffness"] == one["spring[0].stiffness"]


def test_the_order_as_it_is_changes_nothing(fitted):
    _, before = fitted
    after = with_effect_order(before, [0, 1, 2])
    assert after.model == before.model
    assert [f.key for f in after.free] == [f.key for f in before.free]
