"""List the modules without a file of tests of their own: ``python -m tests.structure.untested``.

The tests of ``robustpolish/room/sub_room/module.py`` belong into
``tests/room/sub_room/test_module.py``, and those of one effect into
``tests/effects``. This is a
report, not a failure: small helpers are tested through what they help.
"""

from collections import Counter
from pathlib import Path

from .imports import CATALOGUES, PACKAGE, modules_of

TESTS = Path(__file__).parents[1]


def untested(package: Path, tests: Path) -> list[str]:
    """Return the names of the modules without tests of their own, catalogues left out."""
    names = []
    for name, file in modules_of(package).items():
        room, _, module = name.rpartition(".")
        folders = room.split(".")[1:]
        if (
            file.name != "__init__.py"
            and room not in CATALOGUES
            and not tests.joinpath(*folders, f"test_{module}.py").is_file()
        ):
            names.append(name)
    return names


def main() -> None:
    """Print the names, and how many there are of how many in each room."""
    missing = untested(PACKAGE, TESTS)
    print(*missing, sep="\n")
    modules = [n for n, file in modules_of(PACKAGE).items() if file.name != "__init__.py"]
    modules = [n for n in modules if n.rpartition(".")[0] not in CATALOGUES]
    rooms, without = (Counter(n.split(".")[1] for n in names) for names in (modules, missing))
    print("\nroom: modules with a file of tests of their own, of all")
    for room, count in sorted(rooms.items()):
        print(f"{room}: {count - without[room]} of {count}")
    print(f"all: {len(modules) - len(missing)} of {len(modules)}")


if __name__ == "__main__":
    main()
