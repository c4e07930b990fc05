"""The plan of laws that no catalogue holds: it repeats, and each shows."""

import numpy as np

from tests.hidden_effects.laws import DEAD_ZONE, FARTHER, KINDS, LAWS, law_case
from tests.hidden_effects.motion import motion
from tests.hidden_effects.several import LEAST_LEFT
from tests.hidden_effects.visible import apart, change_without, sound


def test_the_plan_holds_as_many_of_each():
    assert {LAWS.count(kind) for kind in KINDS} == {6}


def test_a_case_repeats_and_shows():
    i = LAWS.index(DEAD_ZONE)
    case = law_case(i)
    assert repr(law_case.__wrapped__(i)) == repr(case)
    assert [kind for kind, _, _ in case.effects] == [DEAD_ZONE, "coulomb_friction"]
    assert case.effects[0][1] == case.effects[1][1]
    assert case.verdict == "unknown_law"
    assert sound(case)
    assert all(change_without(case, k).left >= LEAST_LEFT for k in range(2))
    ends = [np.ptp(apart(case.machine, case.effects[0][1], motion(case, k).displacement))
            for k in (0, 1)]  # fmt: skip
    assert ends[1] <= (1 + 2 * FARTHER) * ends[0]
