"""Texts with values filled in: templates that stand beside the modules that use them."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import resources
from typing import Any

import jinja2


def templates(package: str, **filters: Callable[..., Any]) -> jinja2.Environment:
    """Return the templates in a package's folder; `filters` come beside ``f`` and ``g``.

    ``f`` writes a number with fixed decimals, ``g`` with significant digits.
    """
    folder = resources.files(package)
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        autoescape=jinja2.select_autoescape(),
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "f": lambda value, digits: f"{value:.{digits}f}",
        "g": lambda value, digits=6: f"{value:.{digits}g}",
        **filters,
    }
    return environment


def paragraphs(template: jinja2.Template, block: str, **values: Any) -> tuple[str, ...]:
    """Return the paragraphs of a block, which blank lines part, with values filled in."""
    text = "".join(template.blocks[block](template.new_context(values)))
    return tuple(" ".join(part.split()) for part in re.split(r"\n\s*\n", text) if part.strip())
