"""Results show themselves in one way: aligned text, and an HTML table."""

import math

import pytest

from robustpolish.base.results import (
    Card,
    Displayed,
    Table,
    as_html,
    as_text,
    estimate,
    quantities,
    shown,
)


class Answer(Displayed):
    def _card(self):
        table = Table("Forces", ("name", "value [N]"), (("F <x>", 12.34567), ("F_long", None)))
        return Card("Answer", (table, quantities(("sound", True))), ("A & B.",))


def test_text_is_aligned_and_numbers_are_flush_right():
    assert repr(Answer()) == str(Answer())
    assert repr(Answer()).splitlines() == [
        "Answer",
        "  Forces",
        "  name    value [N]",
        "  F <x>       12.35",
        "  F_long          -",
        "  sound  yes",
        "  A & B.",
    ]


def test_html_is_one_block_of_tables_and_escaped():
    page = Answer()._repr_html_()
    assert page.count("<table>") == 2
    assert "<strong>Answer</strong>" in page
    assert "<caption>Forces</caption>" in page
    assert '<td>F &lt;x&gt;</td><td style="text-align: right">12.35</td>' in page
    assert "<p>A &amp; B.</p>" in page


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (float("nan"), "-"),
        (None, "-"),
        (float("inf"), "inf"),
        (True, "yes"),
        (12, "12"),
        (0.000123456, "0.0001235"),
        ((1.0, "a"), "1, a"),
        (1 + 2j, "1+2j"),
    ],
)
def test_cells(value, text):
    assert shown(value) == text


def test_an_empty_card_shows_its_title():
    assert as_text(Card("Nothing", (Table("", (), ()),))) == "Nothing"
    assert as_html(Card("Nothing")) == "<div><strong>Nothing</strong></div>"


@pytest.mark.parametrize(
    ("value", "error", "texts"),
    [
        (12.3456, 0.034, ["12.346", "0.034"]),
        (12.3456, 0.0996, ["12.35", "0.10"]),  # rounds up to a further place
        (0.2, 35.4, ["0", "35"]),
        (123456.7, 89.0, ["123457", "89"]),
        (123456.7, 891.0, ["1.2346e+05", "8.9e+02"]),
        (4e6, 1e5, ["4.00e+06", "1.0e+05"]),
        (-2.345e-7, 1.2e-9, ["-2.345e-07", "1.2e-09"]),
        (0.0, 1.2e-9, ["0.0e+00", "1.2e-09"]),
        (1.0, 1e-20, ["1.000000000e+00", "1.0e-20"]),
    ],
)
def test_a_value_ends_where_its_standard_error_does(value, error, texts):
    cells = estimate(value, error)
    assert cells == (value, error)
    assert [shown(cell) for cell in cells] == texts


@pytest.mark.parametrize("error", [0.0, math.inf, math.nan])
def test_a_value_without_a_known_error_stays_as_it_is(error):
    assert shown(estimate(1.23456789, error)[0]) == "1.235"
