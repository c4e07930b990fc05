"""No strong word of messages and docs is without a test that backs it."""

from tests.words import backing, exists, listed


def test_every_strong_word_has_its_test():
    every = listed()
    assert [row[:4] for row in every if row[4] is None or not exists(row[4])] == []
    assert {"exact", "proven", "optimal", "not attained"} <= {row[0] for row in every}


def test_what_nothing_backs_is_found():
    table = {"exact": {"docs/": "a", "docs/faq.md": "b"}}
    places = ("docs/faq.md", "docs/house.md", "robustpolish/errors.py")
    assert [backing(table, "exact", place) for place in places] == ["b", "a", None]
    assert not exists("tests/test_words.py::test_of_another_name")
