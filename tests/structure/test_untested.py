"""Which modules have tests of their own is told by the tree."""

from .imports import PACKAGE
from .untested import TESTS, untested


def written(folder, *names, text=""):
    for name in names:
        file = folder / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def test_a_module_without_tests_of_its_own_is_listed(tmp_path):
    package, tests = tmp_path / "house", tmp_path / "tests"
    written(package, "__init__", "top", "room/__init__", "room/a", "room/b", "room/below/c",
            text="def give():\n    return 1\n")  # fmt: skip
    written(tests, "test_top", "room/test_a", "room/test_c", "test_b")
    assert untested(package, tests) == ["house.room.b", "house.room.below.c"]


def test_modules_without_behaviour_need_no_tests(tmp_path):
    package = tmp_path / "house"
    written(package, "__init__")
    written(package, "numbers", text="STEP = 0.1\n")
    written(package, "form", text="class Point:\n    x: float = 0.0\n")
    written(package, "table", text="TABLE = {'a': lambda x: 2 * x}\n")
    written(package, "method", text="class Point:\n    def length(self): ...\n")
    assert untested(package, tmp_path) == ["house.method", "house.table"]


def test_the_tests_of_the_house_are_found():
    missing = untested(PACKAGE, TESTS)
    assert "robustpolish.base.atomic_writes" not in missing
    assert "robustpolish.signals.quality" not in missing
    assert not any(name.startswith("robustpolish.machines.effects.catalogue.") for name in missing)
