"""The switches of the listings' mistakes."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.thesis import listing as equations
from robustpolish.polishing.thesis.listing import ListingDefects


@pytest.mark.parametrize("but", ["bearing_gate", ("unknown",)])
def test_unknown_mistakes_are_refused(but) -> None:
    with pytest.raises(InvalidInputError, match="but"):
        ListingDefects.none(but=but)
    with pytest.raises(InvalidInputError, match="tilt_cosine"):
        ListingDefects(tilt_cosine="no")


def test_switches_stand_in_the_order_in_which_compiled_code_reads_them() -> None:
    for place, name in enumerate(ListingDefects().names()):
        assert getattr(equations, name.upper()) == place
        flags = ListingDefects.none(but=(name,)).as_flags()
        assert np.flatnonzero(flags).tolist() == [place]
    assert ListingDefects().as_flags().all()
    assert ListingDefects.none().names() == ()
