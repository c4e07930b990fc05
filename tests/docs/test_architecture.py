"""The page on the architecture names what is there, and leaves no folder out."""

import re
from pathlib import Path

PROJECT = Path(__file__).parents[2]
PACKAGE = PROJECT / "robustpolish"
PAGE = (PROJECT / "docs" / "architecture.md").read_text(encoding="utf-8")


def named_in_tables():
    """Yield the files and folders of the tables; a bare name lies beside the one before it."""
    for line in PAGE.split("## Inside the rooms")[1].splitlines():
        if not line.startswith("| `"):
            continue
        folder = PACKAGE
        for name in re.findall(r"`([\w/]+(?:\.py|/))`", line.split(" | ")[0]):
            path = PACKAGE / name if "/" in name else folder / name
            folder = path.parent
            yield path


def test_what_the_tables_name_is_there():
    named = list(named_in_tables())
    assert len(named) > 60
    assert [str(path) for path in named if not path.exists()] == []


def test_what_the_paths_name_is_there():
    text = PAGE.split("## Two paths")[1].split("## Three currencies")[0]
    names = re.findall(r"`((?:\w+/)+\w+\.py)`", text)
    assert len(names) > 25
    rooms = (PACKAGE, PACKAGE / "synthesis", PACKAGE / "identification")
    assert [n for n in names if not any((room / n).exists() for room in rooms)] == []


def test_every_folder_has_its_line():
    named = set(named_in_tables())
    inside = {parent for path in named for parent in path.parents} | named
    folders = {file.parent for file in PACKAGE.rglob("*.py")} - {PACKAGE}
    # Folders below a named one, such as those of matrix inequalities, are told in its line.
    missing = [f for f in folders if f not in inside and not named & set(f.parents)]
    assert sorted(map(str, missing)) == []
