"""The package has no import cycle; what measures its layout measures right."""

import sys

import grimp
import pytest

import robustpolish as rp

from .call_path import path_of
from .imports import complaints, cycles
from .size import main


@pytest.fixture
def house(tmp_path, monkeypatch):
    """Write a package of two files in a folder, the second of which imports as it is told."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(back):
        room = tmp_path / "house" / "room"
        room.mkdir(parents=True)
        (room.parent / "__init__.py").touch()
        (room / "__init__.py").touch()
        (room / "a.py").write_text("from house.room.b import name\n")
        (room / "b.py").write_text(back)
        return room.parent

    yield write
    for name in [name for name in sys.modules if name.split(".")[0] == "house"]:
        del sys.modules[name]


def test_the_package_has_no_cycle_and_no_crowded_folder():
    assert complaints("robustpolish") == []


@pytest.mark.parametrize(
    "back",
    [
        "import house.room.a as a",
        "from . import a",
        "from ..room.a import name",
        "def late():\n    from house.room.a import name\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.room.a import name\n",
    ],
)
def test_a_cycle_is_found_however_it_is_written(house, back):
    house(back)
    graph = grimp.build_graph("house", cache_dir=None)
    assert cycles(graph) == [["house.room.a", "house.room.b"]]


def test_code_is_counted_without_comments_and_docstrings(house, capsys):
    text = '"""Title."""\n\n# why\ndef f():\n    """Say."""\n    return """a\nb"""  # here\n'
    package = house(text)
    assert main(["--package", str(package), "--lines", "4", "--folders", "2"]) == 0
    assert "lines: 4, files: 4, folders: 2, median: 1" in capsys.readouterr().out
    assert main(["--package", str(package), "--lines", "3"]) == 1
    assert main(["--package", str(package), "--files", "3"]) == 1


def test_a_call_is_followed_through_the_files():
    requirements = rp.LoopRequirements  # imported before the call is followed
    path = path_of(lambda: requirements().disk)
    assert path.files == {"base/checks.py", "loops/requirements.py"}
    assert path.deepest[-1].startswith("base/checks.py")
