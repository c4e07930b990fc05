"""The notebooks of the repository become pages, downloads and the list of tutorials.

Their texts are copied beside the other sources, their pairs with outputs for download; each entry
of the list shows the question that the notebook opens with and the first picture that it draws.
"""

from __future__ import annotations

import base64
import re
import shutil
from pathlib import Path
from typing import Any

import nbformat
from sphinx.application import Sphinx
from sphinx.config import Config

FOLDER = "notebooks"
LIST = "list_of_tutorials.txt"  # no source of its own: tutorials.md includes it
# Links of a notebook lead through the repository; among the pages these stand for their targets.
PAGES = {
    b"](../docs/": b"](../",
    b"](../robustpolish/machines/effects/catalogue)": b"](../effects/index.md)",
}
ENTRY = """\
| [![first picture of {title}]({folder}/{name}.png){{width=180px}}]({folder}/{name}.md) | \
**[{title}]({folder}/{name}.md)**<br>{question}<br>{{download}}`notebook <{folder}/{name}.ipynb>` |
"""


def _copy(app: Sphinx, config: Config) -> None:
    source, target = Path(app.srcdir).parent / FOLDER, Path(app.srcdir) / FOLDER
    target.mkdir(exist_ok=True)
    texts = sorted(source.glob("*.md"))
    for old in target.iterdir():
        if old.is_file() and old.stem not in {path.stem for path in texts} and old.name != LIST:
            old.unlink()
    entries = ["| what it draws first | what it asks |\n|---|---|\n"]
    for path in texts:
        pair = path.with_suffix(".ipynb")
        text = path.read_bytes()
        for link, page in PAGES.items():
            text = text.replace(link, page)
        _write(target / path.name, text)
        shutil.copyfile(pair, target / pair.name)
        picture = _first_picture(pair)
        if picture:
            _write(target / f"{path.stem}.png", picture)
        entries.append(_entry(path))
    _write(target / LIST, "".join(entries).encode())


def _entry(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    title = re.search(r"^# (.+)$", text, re.MULTILINE)
    question = re.search(r"\*\*Question: (.+?)\*\*", text, re.DOTALL)
    if title is None or question is None:
        raise ValueError(f"{path.name} needs a title and a line **Question: ...**")
    words = " ".join(question[1].split())
    return ENTRY.format(
        title=title[1], folder=FOLDER, name=path.stem, question=words[:1].upper() + words[1:]
    )


def _first_picture(pair: Path) -> bytes | None:
    for cell in nbformat.read(pair, as_version=4).cells:
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                return base64.b64decode(output["data"]["image/png"])
    return None


def _write(path: Path, content: bytes) -> None:
    # an unchanged page keeps its time, so that Sphinx need not read it again
    if not path.exists() or path.read_bytes() != content:
        path.write_bytes(content)


def setup(app: Sphinx) -> dict[str, Any]:
    """Copy before Sphinx looks for sources."""
    app.connect("config-inited", _copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
