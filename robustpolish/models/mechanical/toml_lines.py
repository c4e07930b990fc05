"""Where in a TOML text a key stands, so that a message can say so.

`tomllib` gives values without positions. The keys of our errors, such as
``("spring", 1, "stiffness")`` or ``("input", "F_x", "gain")``, are enough to find the line.
"""

from __future__ import annotations

import re

from robustpolish.validation import Key

_HEADER = re.compile(r"^\s*\[(?P<list>\[)?\s*(?P<name>[^\]]+?)\s*\]")


def line_of(text: str, key: Key) -> int | None:
    r"""Return the line, counted from 1, on which a key stands.

    Parameters
    ----------
    text : str
        The TOML file.
    key : tuple of str or int
        As in `InvalidInputError.key`: the table, the name or number of its entry, then the way
        inside it.

    Returns
    -------
    int or None
        The line of the key, of its table if the key cannot be found, or None.

    Examples
    --------
    >>> line_of("[dof.x]\nmass = -1", ("dof", "x", "mass"))
    2
    """
    if not key:
        return None
    lines = text.splitlines()
    block, inside = _block(lines, key)
    if block is None:
        outermost = [part for part in key[:2] if isinstance(part, str)][-1]
        return _mention(lines, 0, len(lines), rf"(\[\[?\s*)?{_quoted(outermost)}\s*[\]=.]")
    first, last = block
    for part in reversed(inside):
        line = _mention(lines, first, last, rf"{_quoted(part)}\s*[=.]")
        if line is not None:
            return line
    return first


def _quoted(part: str | int) -> str:
    return rf"[\"']?{re.escape(str(part))}[\"']?"


def _mention(lines: list[str], first: int, last: int, pattern: str) -> int | None:
    """Return the first of the lines after `first` that begins like this, counted from 1."""
    begins = re.compile(rf"^\s*{pattern}")
    return next((i + 1 for i in range(first, last) if begins.match(lines[i])), None)


def _block(lines: list[str], key: Key) -> tuple[tuple[int, int] | None, Key]:
    """Return the line of a table's header, from 1, and that where the next table begins.

    And what is left of the key inside the table.
    """
    headers = [
        (i, _bare(found["name"]))
        for i, line in enumerate(lines, 1)
        if (found := _HEADER.match(line))
    ]
    ends = [i - 1 for i, _ in headers[1:]] + [len(lines)]
    blocks = [(i, end, name) for (i, name), end in zip(headers, ends, strict=False)]
    if len(key) < 2:
        return None, ()
    table, entry = key[:2]
    for length in range(len(key), 1, -1):  # a table in tables, such as [dof.x]
        dotted = _bare(".".join(map(str, key[:length])))
        for first, last, name in blocks:
            if name == dotted:
                return (first, last), key[length:]
    same = [block for block in blocks if block[2] == table]
    if isinstance(entry, int):
        chosen = same[entry : entry + 1]
    else:
        named = rf"name\s*=\s*{_quoted(entry)}\s*(#|$)"
        found = [b for b in same if _mention(lines, b[0], b[1], named)]
        chosen = found[-1:]  # of two with one name the later one is too many
        if not found and any(
            _mention(lines, b[0], b[1], rf"{_quoted(entry)}\s*[=.]") for b in same
        ):
            return (same[0][0], same[0][1]), key[1:]
    return ((chosen[0][0], chosen[0][1]) if chosen else None), key[2:]


def _bare(name: str) -> str:
    return re.sub(r"[\"' ]", "", name)
