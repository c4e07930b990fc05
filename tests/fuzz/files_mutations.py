"""Ways to damage a file: bytes of any, and numbers, lines, keys and cells of text."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable
from typing import Any

ABSURD = (
    "0", "-1", "1e308", "-1e308", "5e-324", "1e160", "1e-160", "1e400", "-0.0", "nan", "inf",
    "NaN", "Infinity", "1" + "0" * 400, "9" * 5000, "4294967296", "9223372036854775808",
    "1000000000", "2147483647", "0x10", "1_0", "true", "null", '""', '"x"', "[]", "{}", "[[]]",
    "1,5", "1e", "--", "#", "\x00", "\u00b5", "1979-05-27", "'", '"',
)  # fmt: skip
_VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 0.0, 1e308, -1e308, 5e-324, 1e-160, 1e160, float("nan"),
    float("inf"), 10**400, 2**63, 2**31, 10**9, "", "x", "inf", "nan", "\ud800", "\x00", [], {},
    [[]], [1], [None], {"x": {}}, {"array": [[1], [2, 3]]}, {"complex": [1]}, {"table": {}},
    {"system": {}}, {"region": ["Disk", 1]}, {"element": []}, {"blocks": {}}, "a" * 300,
)  # fmt: skip
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def mutated(chance: random.Random, name: str, content: bytes, others: list[bytes]) -> bytes:
    """Return a content after one to four damages; `others` are those that pieces come from."""
    for _ in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
        ways = [*_BYTES]
        if name.endswith(".json"):
            ways = [_json, _json, _json, _number, _lines, chance.choice(_BYTES)]
        elif name.endswith((".toml", ".csv", ".txt", ".lvm", ".obj", ".off", ".uff", "text.stl")):
            ways = [_number, _number, _lines, _token, chance.choice(_BYTES)]
        way = chance.choice(ways)
        content = _splice(chance, content, others) if way is _splice else way(chance, content)
    return content


def _flip(chance: random.Random, content: bytes) -> bytes:
    changed = bytearray(content or b"\0")
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _overwrite(chance: random.Random, content: bytes) -> bytes:
    """Put in what lengths, counts and types are made of."""
    piece = chance.choice(
        (b"\0" * 4, b"\xff" * 4, b"\xff" * 8, b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x01",
         b"\0\0\0\x80", b"\0" * 64, b"\0\0\0\0\0\0\xf0\x7f", b"\0\0\0\0\0\0\xf8\x7f")
    )  # fmt: skip
    start = chance.randrange(len(content) + 1)
    return content[:start] + piece + content[start + len(piece) :]


def _truncate(chance: random.Random, content: bytes) -> bytes:
    return content[: chance.randrange(len(content) + 1)]


def _insert(chance: random.Random, content: bytes) -> bytes:
    start = chance.randrange(len(content) + 1)
    piece = chance.randbytes(chance.choice((1, 4, 32)))
    return content[:start] + piece + content[start:]


def _remove(chance: random.Random, content: bytes) -> bytes:
    start = chance.randrange(len(content) + 1)
    return content[:start] + content[start + chance.choice((1, 2, 8, 100)) :]


def _repeat(chance: random.Random, content: bytes) -> bytes:
    start = chance.randrange(len(content) + 1)
    piece = content[start : start + chance.choice((1, 8, 100))]
    return content[:start] + piece * chance.choice((2, 3, 50)) + content[start:]


def _splice(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    other = chance.choice(others)
    return content[: chance.randrange(len(content) + 1)] + other[chance.randrange(len(other) + 1) :]


_BYTES: tuple[Callable[..., bytes], ...] = (
    _flip, _overwrite, _truncate, _insert, _remove, _repeat, _splice,
)  # fmt: skip


def _text(content: bytes) -> tuple[str, str]:
    encoding = "utf-16" if content.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8"
    return content.decode(encoding, "replace"), encoding


def _number(chance: random.Random, content: bytes) -> bytes:
    text, encoding = _text(content)
    found = list(_NUMBER.finditer(text))
    if not found:
        return content
    span = chance.choice(found).span()
    absurd = chance.choice(ABSURD)
    return (text[: span[0]] + absurd + text[span[1] :]).encode(encoding, "replace")


def _token(chance: random.Random, content: bytes) -> bytes:
    """Replace a whole value, or a word, wherever it stands."""
    text, encoding = _text(content)
    what = chance.choice((r"(?<=[=,;\t]) *[^\n,;\t]*|\w+", r"(?<== )[^\n]*", r"\{.*\}|\[.*\]"))
    found = list(re.finditer(what, text))
    if not found:
        return content
    first, second = chance.choice(found), chance.choice(found)
    absurd = chance.choice((chance.choice(ABSURD), second.group()))
    return (text[: first.start()] + absurd + text[first.end() :]).encode(encoding, "replace")


def _lines(chance: random.Random, content: bytes) -> bytes:
    text, encoding = _text(content)
    lines = text.split("\n")
    i, j = chance.randrange(len(lines)), chance.randrange(len(lines))
    way = chance.randrange(4)
    if way == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif way == 1:
        lines.insert(i, lines[j])
    elif way == 2:
        del lines[i]
    else:
        lines[i:j] = []
    return "\n".join(lines).encode(encoding, "replace")


def _json(chance: random.Random, content: bytes) -> bytes:
    """Change one node of a tree: its value, its key, its place, or whether it is there."""
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return _flip(chance, content)
    places = list(_nodes(tree))
    if not places:
        return content
    parent, key = chance.choice(places)
    way = chance.randrange(6)
    if way == 0:
        del parent[key]
    elif way == 1:
        other, there = chance.choice(places)
        parent[key] = json.loads(json.dumps(other[there]))
    elif way == 2 and isinstance(parent, list):
        parent.insert(key, json.loads(json.dumps(parent[key])))
    elif way == 2:
        parent[chance.choice(("x", "A", "dt", "", key + key))] = parent.pop(key)
    else:
        parent[key] = chance.choice(_VALUES)
    return json.dumps(tree).encode()


def _nodes(tree: Any) -> Any:
    """Yield every node as its parent and its key; long lists of numbers by their ends alone."""
    branches = [tree]
    while branches:
        node = branches.pop()
        if isinstance(node, dict):
            keys: Any = list(node)
        elif isinstance(node, list):
            keys = range(len(node)) if len(node) < 20 else (0, 1, len(node) - 1)
        else:
            continue
        for key in keys:
            yield node, key
            branches.append(node[key])
