"""The notebooks of the repository become pages: they are copied beside the other sources."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.config import Config

FOLDER = "notebooks"


def _copy(app: Sphinx, config: Config) -> None:
    source, target = Path(app.srcdir).parent / FOLDER, Path(app.srcdir) / FOLDER
    target.mkdir(exist_ok=True)
    names = {path.name for path in source.glob("*.md")}
    for old in target.glob("*.md"):
        if old.name not in names:
            old.unlink()
    for name in names:
        new, page = source / name, target / name
        # an unchanged page keeps its time, so that Sphinx need not read it again
        if not page.exists() or page.read_bytes() != new.read_bytes():
            shutil.copyfile(new, page)


def setup(app: Sphinx) -> dict[str, Any]:
    """Copy before Sphinx looks for sources."""
    app.connect("config-inited", _copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
