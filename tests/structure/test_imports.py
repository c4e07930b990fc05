"""Cycles are seen however an import is written, and the package has none."""

import pytest

from .imports import ALLOWED, PACKAGE, complaints, crowded, cycles, imports_of

PLAIN = "from house.room.b import name\n"


def house(tmp_path, files):
    """Write a package called house; every folder gets an ``__init__`` if it has none."""
    for name, text in files.items():
        file = tmp_path / "house" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    for folder in [tmp_path / "house", *(tmp_path / "house").rglob("*/")]:
        (folder / "__init__.py").touch()
    return tmp_path / "house"


def pairs(package):
    return {(i.importer.removeprefix("house."), i.imported) for i in imports_of(package)}


@pytest.mark.parametrize(
    "back",
    [
        "from house.room.a import name",
        "import house.room.a",
        "import house.room.a as a",
        "from house.room import a",
        "from . import a",
        "from .a import name",
        "from ..room import a",
        "from ..room.a import name",
        "def late():\n    from house.room.a import name\n",
        "def late():\n    import house.room.a\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.room.a import name\n",
        "try:\n    from .a import name\nexcept ImportError:\n    name = None\n",
        "from importlib import import_module\na = import_module('house.room.a')\n",
        "import importlib\ndef late():\n    return importlib.import_module('house.room.a')\n",
    ],
)
def test_a_cycle_is_caught_however_it_is_written(tmp_path, back):
    package = house(tmp_path, {"room/a.py": PLAIN, "room/b.py": back})
    (way,) = cycles(imports_of(package))
    assert {(i.importer, i.imported) for i in way} == {
        ("house.room.a", "house.room.b"),
        ("house.room.b", "house.room.a"),
    }
    (complaint,) = complaints(package, {})
    assert "house.room.a (line 1) imports house.room.b" in complaint


def test_imports_one_way_are_no_cycle(tmp_path):
    package = house(
        tmp_path,
        {
            "room/a.py": PLAIN + "from house.other import c\nimport numpy\n",
            "room/b.py": "from house.other.c import name\n",
            "room/__init__.py": "from house.room.a import name\nfrom . import b\n",
            "other/c.py": "import house_of_another.room.a\n",
        },
    )
    assert complaints(package, {}) == []
    assert pairs(package) == {
        ("room", "house.room.a"),
        ("room", "house.room.b"),
        ("room.a", "house.room.b"),
        ("room.a", "house.other.c"),
        ("room.b", "house.other.c"),
    }


def test_a_name_from_the_own_room_closes_a_cycle_with_its_init(tmp_path):
    package = house(
        tmp_path,
        {
            "room/__init__.py": "from house.room.a import name\n",
            "room/a.py": "from house.room.b import other\n",
            "room/b.py": "def late():\n    from house.room import name\n",
        },
    )
    (way,) = cycles(imports_of(package))
    assert [i.importer for i in way] == ["house.room", "house.room.a", "house.room.b"]


def test_a_function_called_like_its_module_comes_from_the_init(tmp_path):
    package = house(
        tmp_path,
        {
            "room/__init__.py": "from house.room.a import a\nfrom house.room.b import b\n",
            "room/a.py": "def a(): ...\n",
            "room/b.py": "from house.other.c import name\n",
            "other/c.py": "from house.room import a\n",
        },
    )
    assert {("other.c", "house.room"), ("other.c", "house.room.a")} <= pairs(package)
    assert len(cycles(imports_of(package))) == 1


def test_the_shortest_way_round_is_shown_for_each_group(tmp_path):
    package = house(
        tmp_path,
        {
            "a.py": "import house.b\n",
            "b.py": "import house.c\n",
            "c.py": "import house.a\nimport house.b\n",
            "d.py": "import house.e\nimport house.a\n",
            "e.py": "import house.d\n",
        },
    )
    ways = [{i.importer for i in way} for way in cycles(imports_of(package))]
    assert ways == [{"house.b", "house.c"}, {"house.d", "house.e"}]


def test_an_exception_needs_a_cycle_and_there_are_three_at_most(tmp_path):
    package = house(tmp_path, {"room/a.py": PLAIN, "room/b.py": "from . import a\n", "c.py": ""})
    needed = {("house.room.b", "house.room.a"): "made up"}
    assert complaints(package, needed) == []
    unneeded = {**needed, ("house.c", "house.room.a"): "made up"}
    assert complaints(package, unneeded) == [
        "the exception house.c imports house.room.a closes no cycle"
    ]
    many = {**needed, **{("house.c", f"house.{i}"): "made up" for i in range(3)}}
    assert "4 imports may close a cycle; at most 3 are agreed" in complaints(package, many)


def test_a_crowded_folder_is_refused(tmp_path):
    files = {f"room/m{i}.py": "" for i in range(14)} | {"room/below/one.py": ""}
    package = house(tmp_path, files)
    assert crowded(package) == {}
    (package / "room" / "one_more.py").touch()
    assert crowded(package) == {"house.room": 15}
    assert complaints(package, {}) == ["house.room holds 15 modules; at most 14 fit in one folder"]


def test_the_package_is_in_order():
    assert complaints(PACKAGE, ALLOWED) == []


def test_the_whole_package_is_read():
    seen = {(i.importer, i.imported) for i in imports_of(PACKAGE)}
    ball = ("robustpolish.implementation.sampled.proof", "robustpolish.linear.arithmetic.balls")
    assert ball in seen  # from package import module
    assert ("robustpolish.app.cli.main", "robustpolish") in seen  # import package
    assert {name for name, _ in seen} >= {"robustpolish.machines", "robustpolish.synthesis"}
