import pytest

from robustpolish.plants.uncertain.elements import DynamicElement, RealElement, UncertainBlock


@pytest.mark.parametrize("value", [1.0, 2.0, 3.7, 5.0])
def test_delta_and_value_are_inverse(value):
    element = RealElement("m", 2.0, 1.0, 5.0)
    assert element.value(element.delta(value)) == pytest.approx(value)


def test_middle_has_no_skew():
    assert RealElement("m", 0.3, 0.3 * 0.9, 0.3 * 1.1).skew == 0


def test_block_signals():
    block = UncertainBlock(DynamicElement("d", (2, 3)), 2)
    assert (block.rows, block.columns) == (4, 6)
