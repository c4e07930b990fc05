"""Where in a TOML text a key stands, so that a message can say so.

`tomllib` gives values without positions. The keys in our messages, such as
``spring[1].stiffness`` or ``input.F_x.gain``, are enough to find the line.
"""

from __future__ import annotations

import re

_HEADER = re.compile(r"^\s*\[(?P<list>\[)?\s*(?P<name>[^\]]+?)\s*\]")
_PATH = re.compile(
    r"^(?P<table>dof|spring|damper|input|output|effect|name|spin_frequency)"
    r"(?:\[(?P<index>\d+)\])?(?: and output)?(?P<rest>[^:]*)"
)


def line_of(text: str, message: str) -> int | None:
    r"""Return the line, counted from 1, of the key that `message` begins with.

    Parameters
    ----------
    text : str
        The TOML file.
    message : str
        A message that begins with a key, such as ``"dof.x.mass: got ..."``.

    Returns
    -------
    int or None
        The line of the key, of its table if the key cannot be found, or None.

    Examples
    --------
    >>> line_of("[dof.x]\nmass = -1", "dof.x.mass: got -1, ...")
    2
    """
    found = _PATH.match(message)
    if not found:
        return _first_mention(text, message)
    table, index = found["table"], found["index"]
    names = [part.strip("'\" ") for part in re.split(r"[.\s]", found["rest"]) if part]
    lines = text.splitlines()
    block = _block(lines, table, index, names)
    if block is None:
        pattern = re.compile(rf"^\s*{re.escape(names[0] if names else table)}\s*=")
        return next((i for i, line in enumerate(lines, 1) if pattern.match(line)), None)
    first, last = block
    for name in reversed(names):
        pattern = re.compile(rf"^\s*[\"']?{re.escape(name)}[\"']?\s*[=.]")
        for i in range(first, last):
            if pattern.match(lines[i]):
                return i + 1
    return first


def _first_mention(text: str, message: str) -> int | None:
    """Return the line of a table or key that the format does not know."""
    name = re.escape(message.split(":")[0])
    pattern = re.compile(rf"^\s*(\[\[?\s*)?[\"']?{name}[\"']?\s*[\]=.]")
    return next((i for i, line in enumerate(text.splitlines(), 1) if pattern.match(line)), None)


def _block(
    lines: list[str], table: str, index: str | None, names: list[str]
) -> tuple[int, int] | None:
    """Return the line of a table's header, from 1, and the line where the next table begins."""
    headers = [
        (i, found["name"].replace('"', "").replace("'", "").replace(" ", ""))
        for i, line in enumerate(lines, 1)
        if (found := _HEADER.match(line))
    ]
    if not headers:
        return None
    ends = [i - 1 for i, _ in headers[1:]] + [len(lines)]
    blocks = [(i, end, name) for (i, name), end in zip(headers, ends, strict=True)]
    wanted = [block for block in blocks if block[2] == table]
    if index is not None:
        chosen = wanted[int(index)] if int(index) < len(wanted) else None
    elif names and table == "dof":
        key = f"dof.{names[0]}"
        chosen = next((block for block in blocks if block[2] == key), None)
    elif names:
        named = re.compile(rf"^\s*name\s*=\s*[\"']{re.escape(names[0])}[\"']")
        same = [b for b in wanted if any(named.match(line) for line in lines[b[0] : b[1]])]
        chosen = same[-1] if same else None  # of two with one name the later one is too many
    else:
        chosen = None
    return None if chosen is None else (chosen[0], chosen[1])
