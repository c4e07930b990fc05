"""Check the links between the repository's texts, and list those that lead outside.

Run with ``python docs/list_links.py``. Needs no network; `make linkcheck` calls it before Sphinx
follows the links outside.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
# Pages that the build writes into docs/: folder and what stands for it in the repository.
GENERATED = {"docs/notebooks": "notebooks", "docs/effects": "robustpolish/effects", "docs/api": "."}


def texts() -> list[Path]:
    """Return every Markdown file that people read."""
    folders = (ROOT, ROOT / "docs", ROOT / "notebooks")
    return sorted(path for folder in folders for path in folder.glob("*.md"))


def links(path: Path) -> Iterator[str]:
    """Yield the targets of the links of a text, those in code left out."""
    yield from LINK.findall(CODE.sub("", path.read_text(encoding="utf-8")))


def is_external(target: str) -> bool:
    """Whether a target lies outside the repository."""
    return target.startswith(("http://", "https://", "mailto:"))


def leads_somewhere(path: Path, target: str) -> bool:
    """Whether a link inside the repository has a target, generated pages included."""
    name = target.split("#")[0]
    if not name:
        return True
    found = (path.parent / name).resolve()
    if found.exists():
        return True
    if not found.is_relative_to(ROOT):
        return False
    folder = found.relative_to(ROOT).parent.as_posix()
    if folder == "docs/notebooks":
        return (ROOT / "notebooks" / found.name).exists()
    return folder in GENERATED


def broken() -> list[tuple[Path, str]]:
    """Return the links inside the repository that lead nowhere."""
    return [
        (path, target)
        for path in texts()
        for target in links(path)
        if not is_external(target) and not leads_somewhere(path, target)
    ]


def external() -> dict[str, list[Path]]:
    """Return the links that lead outside, with the texts that have them."""
    found: dict[str, list[Path]] = {}
    for path in texts():
        for target in links(path):
            if is_external(target):
                found.setdefault(target, []).append(path)
    return found


def main() -> int:
    """Print what was found; count the broken links."""
    for target, paths in sorted(external().items()):
        print(f"{target}  ({', '.join(str(path.relative_to(ROOT)) for path in paths)})")
    wrong = broken()
    for path, target in wrong:
        print(f"BROKEN: {path.relative_to(ROOT)}: {target}")
    return len(wrong)


if __name__ == "__main__":
    sys.exit(main())
