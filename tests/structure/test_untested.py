"""Which modules have tests of their own is told by the tree."""

from .imports import PACKAGE
from .untested import TESTS, untested


def test_a_module_without_tests_of_its_own_is_listed(tmp_path):
    package, tests = tmp_path / "house", tmp_path / "tests"
    for name in ("__init__", "top", "room/__init__", "room/a", "room/b", "room/below/c"):
        file = package / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    for name in ("test_top", "room/test_a", "room/test_c", "test_b"):
        file = tests / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    assert untested(package, tests) == ["house.room.b", "house.room.below.c"]


def test_the_tests_of_the_house_are_found():
    missing = untested(PACKAGE, TESTS)
    assert "robustpolish.saving" not in missing
    assert "robustpolish.measurements.quality" not in missing
    assert not any(name.startswith("robustpolish.effects.catalogue.") for name in missing)
