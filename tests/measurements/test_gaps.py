"""Missing values: filled in where they are few, refused where they are many."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.quality import ends_without_values, fill_gaps, marked_runs

TIME = np.arange(1000) / 1000
SIGNAL = np.sin(2 * np.pi * 5 * TIME)


def without(*missing):
    values = SIGNAL.copy()
    for each in missing:
        values[each] = np.nan
    return values


def test_a_whole_channel_is_left_alone():
    values, note = fill_gaps("x", SIGNAL, TIME)
    assert values is SIGNAL
    assert note == ""


def test_short_gaps_are_filled_with_a_note_that_says_where():
    holes = without(100, slice(300, 305), 700, 800)
    values, note = fill_gaps("x", holes, TIME, np.arange(1000) + 2)
    np.testing.assert_allclose(values, SIGNAL, atol=1e-5)
    assert note == (
        "x: 8 missing values filled in by cubic interpolation (at lines 102, 302 to 306, 702 and "
        "1 more)"
    )


@pytest.mark.parametrize("missing", [slice(300, 306), slice(None, None, 20), slice(0, 300)])
def test_what_is_missing_for_long_is_refused(missing):
    with pytest.raises(InvalidInputError, match=r"x: got \d+ missing values, the longest gap of"):
        fill_gaps("x", without(missing), TIME)


def test_the_longest_gap_is_named_by_its_lines():
    with pytest.raises(InvalidInputError, match=r"20 at lines 302 to 321 \(0.3 to 0.319 s\)"):
        fill_gaps("x", without(100, slice(300, 320)), TIME, np.arange(1000) + 2)


def test_short_ends_without_values_are_counted():
    assert ends_without_values([without(slice(0, 2)), without(0, 999)]) == (2, 1)
    assert ends_without_values([without(slice(0, 50)), SIGNAL]) == (0, 0)
    assert ends_without_values([np.full(9, np.nan)]) == (0, 0)


def test_runs_are_found_at_the_ends_too():
    assert marked_runs(np.array([True, True, False, True])) == [(0, 1), (3, 3)]
    assert marked_runs(np.zeros(3, bool)) == []
