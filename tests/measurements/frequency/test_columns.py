"""Heads of columns that hold frequency responses."""

import numpy as np
import pytest

from robustpolish.signals.frequency_response import responses_of
from robustpolish.signals.raw import RawTable


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("x/F real", "x/F imag"),
        ("Re(x/F)", "Im(x/F)"),
        ("x/F_re", "x/F_im"),
        ("real x/F", "imaginary x/F"),
    ],
)
def test_parts_are_known_before_and_behind_the_pair(first, second):
    table = RawTable()
    for head, values in (("f [Hz]", [1.0, 2]), (first, [3.0, 4]), (second, [5.0, 6])):
        table.add(head, np.array(values))
    (found,) = responses_of(table)
    assert (found.output, found.input, found.kind) == ("x", "F", "response")
    np.testing.assert_allclose(found.values, [3 + 5j, 4 + 6j])


def test_a_single_pair_needs_no_name():
    table = RawTable()
    for head in ("omega", "magnitude [m/N]", "phase [rad]"):
        table.add(head, np.array([1.0, 2.0]))
    (found,) = responses_of(table)
    assert (found.output, found.input, found.unit) == ("output", "input", "m/N")
    assert found.frequency_unit == "rad/s"
    np.testing.assert_allclose(found.values, [1, 2] * np.exp(1j * np.array([1.0, 2.0])))


def test_an_imaginary_part_in_another_unit_is_converted():
    table = RawTable()
    for head in ("f", "x/F real [um/N]", "x/F imag [mm/N]"):
        table.add(head, np.array([1.0, 2.0]))
    (found,) = responses_of(table)
    np.testing.assert_allclose(found.values, [1 + 1000j, 2 + 2000j])


def test_a_stroke_stands_in_a_pair_unless_it_cannot():
    table = RawTable()
    for head in ("f/kHz", "magnitude x/V", "phase x/V"):
        table.add(head, np.array([1.0, 2.0]), fraction=True)
    (found,) = responses_of(table)
    assert (found.output, found.input, found.unit) == ("x", "V", "")
    assert found.frequency_unit == "kHz"
    table = RawTable()
    for head in ("f/Hz", "magnitude/(um/N)", "phase/rad"):
        table.add(head, np.array([1.0, 2.0]), fraction=True)
    (found,) = responses_of(table)
    assert (found.output, found.input, found.unit) == ("output", "input", "um/N")
    np.testing.assert_allclose(found.values, [1, 2] * np.exp(1j * np.array([1.0, 2.0])))
