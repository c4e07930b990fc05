"""What no tree of values may hold."""

import pytest

from robustpolish.base.input_files import check_tree
from robustpolish.errors import InvalidInputError


def nested(depth):
    tree = [1]
    for _ in range(depth):
        tree = [tree]
    return tree


def test_what_is_written_by_the_package_passes():
    check_tree({"a": [1.5, "µ", None, True, 2**63 - 1], "b": {"c": nested(20)}})
    for plain in (3, "text", None):
        check_tree(plain)


@pytest.mark.parametrize(
    ("tree", "key", "message"),
    [
        ({"a": [1, 10**400]}, ("a", 1), "an integer of 401 digits"),
        ({"a": -(10**5000)}, ("a",), "an integer of 5001 digits"),
        ({"a": {"b": "\ud800"}}, ("a", "b"), "half a character"),
        ({"\ud800": 1}, (), "half a character"),
        ({"a": nested(5000)}, ("a", 0, 0), "tables in more than 50 tables"),
    ],
)
def test_what_nobody_means_is_refused(tree, key, message):
    with pytest.raises(InvalidInputError, match=message) as found:
        check_tree(tree, "a.json")
    assert found.value.key == key
    assert str(found.value).startswith("a.json: ")
