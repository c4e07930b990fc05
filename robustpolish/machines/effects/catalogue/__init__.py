"""The built-in kinds of effects, a file a family, which gives its ``KINDS``; and their words."""

import tomllib
from pathlib import Path
from typing import Any

_WORDS = tomllib.loads(Path(__file__).with_name("words.toml").read_text("utf-8"))


def told(kind: str) -> dict[str, Any]:
    """Return the name of a kind and its title, looks, checks and references from the file."""
    words = _WORDS[kind].items()
    return {"kind": kind} | {k: tuple(v) if isinstance(v, list) else v for k, v in words}
