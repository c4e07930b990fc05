"""Shares of made-up rows."""

import numpy as np

from tests.hidden_effects.cases import Case, one
from tests.hidden_effects.figures import Share, by_number, figures, law_learned, share
from tests.hidden_effects.made_up import row_of

EFFECT = [("cubic_stiffness", ("x", "ground"), [1.0])]
CASE = Case("cubic", one(), EFFECT)
WILD = Case("wild", one(), EFFECT, chaotic=True)
NOTHING = Case("nothing", one(), verdict="adequate")
INSIDE, OUTSIDE = ["cubic_stiffness.stiffness", 1.0, 1.1, 0.1], ["coulomb.force", 1.0, 1.5, 0.1]


def test_shares_count():
    assert share([True, False, 1]) == Share(2, 3)
    assert str(share([True, False])) == "1 of 2 (50.0 %)"
    assert str(share([])) == "0 of 0"
    assert np.isnan(share([]).value)


def test_figures_of_rows():
    rows = [
        (row_of(CASE, True, numbers=[INSIDE, INSIDE], own=[INSIDE, OUTSIDE],
                floors={"x": 1.4, "y": 0.7}), CASE),
        (row_of(CASE, True, numbers=[OUTSIDE], swapped=1, ratio=2.0, floors={"x": 1.6}), CASE),
        (row_of(CASE, False, numbers=[INSIDE, OUTSIDE], wrong=["backlash at x"], named=1,
                floors={"x": 0.6, "y": 1.0}), CASE),
        (row_of(WILD, True, ratio=9.0, numbers=[INSIDE, OUTSIDE], floors={"x": 1.0}), WILD),
        (row_of(NOTHING, True), NOTHING),
        (row_of(NOTHING, False, verdict="missing_effect", named=1, wrong=["backlash"]), NOTHING),
        (row_of(NOTHING, False, verdict="error"), NOTHING),
    ]  # fmt: skip
    found = figures(rows)
    assert found.right == Share(4, 7)
    assert found.confident == Share(2, 7)
    assert found.quiet == Share(1, 3)
    assert found.covered == Share(3, 4)
    assert found.covered_all == Share(4, 7)
    assert found.cases_covered == Share(1, 2)
    assert found.own_covered == Share(1, 2)
    assert found.floors == Share(4, 6)
    assert found.cases_floors == Share(2, 7)
    assert found.calm == Share(1, 2)
    held, size = by_number(rows)["coulomb.force"]
    assert (held, round(size, 6)) == (Share(0, 3), 5.0)


def test_a_law_has_to_be_right_everywhere():
    assert law_learned(row_of(CASE, True, curves=[0.95, 0.92], ratio=1.4))
    assert not law_learned(row_of(CASE, False, curves=[0.95], ratio=1.4))
    assert not law_learned(row_of(CASE, True, curves=[0.95, 0.8], ratio=1.4))
    assert not law_learned(row_of(CASE, True, curves=[0.95], ratio=1.6))
    assert not law_learned(row_of(CASE, True, curves=[], ratio=1.0))
