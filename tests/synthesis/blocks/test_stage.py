"""What all stages share: sizes and names."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.structured.blocks import Notch


def test_a_filter_has_one_input_and_one_output():
    stage = Notch()
    assert stage.sized(1, 1) is stage
    with pytest.raises(InvalidInputError, match="a notch from 2 to 1 signals"):
        stage.sized(2, 1)


def test_named():
    assert Notch().named("n").name == "n"
    assert Notch().integrators == ()
    assert Notch().in_unit_of_time(3.0).kind == "notch"
