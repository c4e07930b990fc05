"""What tests of controllability say."""

import numpy as np
import pytest

from robustpolish.linear.controllability import ModeTest, PbhTest
from robustpolish.linear.eigen import pair_text

DRIFT = ModeTest(0j, 0.0, "drift", True, False)
DECAY = ModeTest(-1 + 0j, 0.0, "heat", True, True)
SWING = ModeTest(-1 + 2j, 0.1, "q", False, True)


def test_only_deficient_modes_that_stay_are_harmful():
    found = PbhTest("controllability", (DRIFT, DECAY, SWING))
    assert not found
    assert found.distance == 0.0
    assert found.deficient == (DRIFT, DECAY)
    assert found.harmful == (DRIFT,)
    assert "drift" in found.reason


def test_without_deficient_modes_it_is_true():
    found = PbhTest("observability", (SWING,))
    assert found
    assert (found.distance, found.deficient) == (0.1, ())
    assert PbhTest("observability", ()).distance == np.inf


@pytest.mark.parametrize(
    ("value", "text"), [(2 + 0j, "2"), (-1 + 2j, "-1 +/- 2j"), (-1 - 2j, "-1 +/- 2j")]
)
def test_eigenvalues_in_words(value, text):
    assert pair_text(value) == text
