"""Free state spaces: sizes and what is free."""

import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def test_entries_are_free_but_for_a_feedthrough_that_is_not_wanted():
    whole, proper = (
        rp.tunable.fixed_order(order=2, feedthrough=f).stages[0] for f in (True, False)
    )
    assert len(whole.sized(3, 2).slots) == 4 * 5
    assert len(proper.sized(3, 2).slots) == 4 * 5 - 6
    assert whole.sized(3, 2).slots[-1].name == "D[1,2]"


@pytest.mark.parametrize("given", [{"order": 0}, {"order": 1.5}, {"order": True}])
def test_refuses_an_order_that_is_none(given):
    with pytest.raises(InvalidInputError, match=r"^order: got"):
        rp.tunable.fixed_order(**given)


def test_refuses_an_answer_that_is_neither_yes_nor_no():
    with pytest.raises(InvalidInputError, match=r"^feedthrough: got"):
        rp.tunable.fixed_order(order=1, feedthrough=0)
