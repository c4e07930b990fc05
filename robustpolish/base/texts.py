"""Tables of words in TOML and templates in jinja, stored beside the modules that use them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2


def tables(module: str, name: str = "words.toml") -> dict[str, Any]:
    """Return the tables of a TOML file in the folder of a module, whose ``__file__`` is given."""
    return tomllib.loads(Path(module).with_name(name).read_text("utf-8"))


def templates(
    package: str, filters: Mapping[str, Callable[..., Any]], **options: Any
) -> jinja2.Environment:
    """Return the templates in a package's folder; `filters` are added to ``f`` and ``g``.

    ``f`` writes a number with fixed decimals, ``g`` with significant digits.
    """
    import jinja2  # it takes a while, and only words need it

    folder = resources.files(package)
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        autoescape=jinja2.select_autoescape(),
        undefined=jinja2.StrictUndefined,
        **options,
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
