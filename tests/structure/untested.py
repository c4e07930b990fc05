"""List the modules without a file of tests of their own: ``python -m tests.structure.untested``.

The tests of ``robustpolish/room/sub_room/module.py`` belong into
``tests/room/sub_room/test_module.py``, and those of one effect into
``tests/effects``. Modules without a function or method, which hold data or only
gather the names of others, need none. This is a report, not a failure: small helpers are tested
through what they help.
"""

import ast
from collections import Counter
from pathlib import Path

from .imports import CATALOGUES, PACKAGE, modules_of

TESTS = Path(__file__).parents[1]


def testable(package: Path) -> dict[str, Path]:
    """Return the modules with behaviour of their own by name, catalogues left out."""
    return {
        name: file
        for name, file in modules_of(package).items()
        if file.name != "__init__.py"
        and name.rpartition(".")[0] not in CATALOGUES
        and any(
            isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        )
    }


def untested(package: Path, tests: Path) -> list[str]:
    """Return the names of the modules with behaviour but without tests of their own."""
    names = []
    for name in testable(package):
        room, _, module = name.rpartition(".")
        if not tests.joinpath(*room.split(".")[1:], f"test_{module}.py").is_file():
            names.append(name)
    return names


def main() -> None:
    """Print the names, and how many there are of how many in each room."""
    modules, missing = testable(PACKAGE), untested(PACKAGE, TESTS)
    print(*missing, sep="\n")
    rooms, without = (Counter(n.split(".")[1] for n in names) for names in (modules, missing))
    print("\nroom: modules with a file of tests of their own, of all with behaviour")
    for room, count in sorted(rooms.items()):
        print(f"{room}: {count - without[room]} of {count}")
    print(f"all: {len(modules) - len(missing)} of {len(modules)}")


if __name__ == "__main__":
    main()
