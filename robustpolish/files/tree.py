"""What a tree of plain values out of a file may hold."""

from __future__ import annotations

from typing import Any

from robustpolish.validation import Key, described, invalid

_DEEPEST = 50
"""Tables in tables; files of the package have six."""

_LARGEST = 2**63
"""Integers from here on are written by nobody who means them, and have no place in arrays."""


def check_tree(tree: Any, where: str = "") -> None:
    r"""Refuse what later code would stumble over, wherever in the tree it stands.

    That is tables in more than 50 tables, integers that no array can hold, and text that is not
    Unicode.

    Parameters
    ----------
    tree : dict, list or plain value
        As JSON and TOML give it.
    where : str, optional
        Name of the file, for the message.

    Raises
    ------
    InvalidInputError
        With the key of the first one.

    Examples
    --------
    >>> check_tree({"dof": {"x": {"mass": 10**400}}})
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: dof.x.mass: got an integer of 401 digits, expected...
    """
    branches: list[tuple[Key, Any]] = [((), tree)] if isinstance(tree, dict | list) else []
    while branches:
        key, node = branches.pop()
        if len(key) > _DEEPEST:
            raise _refused(where, key[:3], "tables in more than 50 tables", "fewer")
        for name, item in node.items() if isinstance(node, dict) else enumerate(node):
            if isinstance(name, str):
                _check_text(where, key, name)
            if isinstance(item, dict | list):
                branches.append(((*key, name), item))
            elif isinstance(item, str):
                _check_text(where, (*key, name), item)
            elif isinstance(item, int) and abs(item) >= _LARGEST:
                shown = f"an integer of {_digits(item)} digits"
                raise _refused(where, (*key, name), shown, "a number below 9e18")


def _digits(number: int) -> int:
    """Return how many digits an integer has; Python refuses to write those of many."""
    count = int(abs(number).bit_length() * 0.30103)
    return count + (abs(number) >= 10**count)


def _check_text(where: str, key: Key, text: str) -> None:
    try:
        if not text.isascii():
            text.encode()
    except UnicodeEncodeError:
        raise _refused(where, key, "half a character", "text in Unicode") from None


def _refused(where: str, key: Key, shown: str, expected: str) -> Exception:
    found = invalid(key or ("file",), described(shown), expected, "Correct it.")
    return type(found)(f"{where}: {found}", key) if where else found
