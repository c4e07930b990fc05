"""Results show themselves in one way: aligned text, and an HTML table."""

import pytest

from robustpolish.display import Card, Displayed, Table, as_html, as_text, quantities, shown


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
