"""The figures of a loop as tables."""

import control
import numpy as np

import robustpolish as rp
from robustpolish.loops.report import tables_of
from tests.loops.loops_for_tests import TEXTBOOK


def test_tables_of_a_loop_have_numbers_and_heads():
    tables = tables_of(rp.loop_analysis(TEXTBOOK, -1))
    captions = [table.caption for table in tables]
    assert captions[:3] == ["Margins, one loop at a time", "Margins, all at once", "Bandwidths"]
    assert captions[-1] == "Sampling"
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    assert tables[0].rows[0][3] == 20 * np.log10(3.0) or np.isclose(tables[0].rows[0][3], 9.5424)


def test_many_rows_are_shortened_to_the_strongest_source():
    plant = control.append(*(control.tf([1], [1, i + 1]) for i in range(4)))
    coupled = -0.1 * (np.ones((4, 4)) + np.diag([1.0, 2.0, 3.0, 4.0]))
    noise = next(t for t in tables_of(rp.loop_analysis(plant, coupled)) if "Noise" in t.caption)
    assert len(noise.rows) == 4
    assert "strongest" in noise.caption
    assert [row[:2] for row in noise.rows] == [(f"y[{i}]", f"u[{i}]") for i in range(4)]


def test_an_unstable_loop_has_none():
    assert tables_of(rp.loop_analysis(TEXTBOOK, 1)) == ()
