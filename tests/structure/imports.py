"""Refuse import cycles and crowded folders: ``python -m tests.structure.imports``.

Every import statement of a module counts, wherever it stands: at the top, inside a function, under
``TYPE_CHECKING`` or in a ``try``, and so does ``import_module("...")`` with a name written out.
Relative imports are resolved. What an import leads to:

- ``import package.module`` and ``from package.module import name`` lead to the module;
- ``from package import module`` leads to the module, not to the ``__init__`` of the package;
- ``from package import name`` leads to the ``__init__``, which in turn leads to everything that it
  imports itself. A module that takes a name from the ``__init__`` of its own room is therefore in
  a cycle with it. If ``name`` is a module and is bound in the ``__init__`` too (as a function
  called like its module is), the import leads to both.

That Python runs the ``__init__`` of every package on the way to a module does not count: it would
put every module of a room in a cycle with the room. import-linter, which checks the order of the
rooms, does not look at cycles inside a layer; this does.
"""

import ast
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "robustpolish"

MOST_MODULES = 14
"""Modules of its own that a folder may hold, its ``__init__`` not counted: about what one list of
a documentation page shows at a glance. Folders below count by themselves."""

CATALOGUES = ("robustpolish.machines.effects.catalogue",)
"""Folders of any number of modules, because all are of one form: one effect per file."""

ALLOWED: dict[tuple[str, str], str] = {}
"""Imports (importer, imported) that may close a cycle, each with its reason."""

MOST_ALLOWED = 3


@dataclass(frozen=True)
class Import:
    """One module imports another, in a line of its file."""

    importer: str
    imported: str
    line: int

    def __str__(self) -> str:
        return f"{self.importer} (line {self.line}) imports {self.imported}"


def modules_of(package: Path) -> dict[str, Path]:
    """Return the files of a package by dotted name; a package goes by the name of its folder."""
    names = {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package.parent).with_suffix("").parts
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return names


def imports_of(package: Path) -> list[Import]:
    """Return all imports within a package, one for each pair of modules."""
    files = modules_of(package)
    trees = {name: ast.parse(file.read_text(encoding="utf-8")) for name, file in files.items()}
    bound = {
        name: _bound_names(name, trees[name], files)
        for name, file in files.items()
        if file.name == "__init__.py"
    }
    found: dict[tuple[str, str], Import] = {}
    for name, tree in trees.items():
        for target, line in _targets(name, tree, files, bound):
            if target != name:
                found.setdefault((name, target), Import(name, target, line))
    return list(found.values())


def _targets(
    name: str, tree: ast.AST, files: Mapping[str, Path], bound: Mapping[str, set[str]]
) -> Iterator[tuple[str, int]]:
    """Yield what a module imports from its own package, and in which line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from ((m, node.lineno) for m in _nearest(alias.name, files))
        elif isinstance(node, ast.ImportFrom):
            source = _absolute(name, node, files)
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                if inner in files:
                    yield inner, node.lineno
                if inner not in files or alias.name in bound.get(source, ()):
                    yield from ((m, node.lineno) for m in _nearest(source, files))
        elif isinstance(node, ast.Call) and _is_import_module(node.func):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield from ((m, node.lineno) for m in _nearest(argument.value, files))


def _absolute(name: str, node: ast.ImportFrom, files: Mapping[str, Path]) -> str:
    """Return the module that a ``from`` names, without its leading dots."""
    if not node.level:
        return node.module or ""
    parts = name.split(".")
    above = node.level - (files[name].name == "__init__.py")
    base = parts[: len(parts) - above]
    return ".".join([*base, node.module] if node.module else base)


def _nearest(name: str, files: Mapping[str, Path]) -> list[str]:
    """Return the module of this name, or the one that an attribute of this name belongs to."""
    while name and name not in files:
        name = name.rpartition(".")[0]
    return [name] if name else []


def _is_import_module(function: ast.expr) -> bool:
    return "import_module" in (getattr(function, "id", ""), getattr(function, "attr", ""))


def _bound_names(name: str, tree: ast.AST, files: Mapping[str, Path]) -> set[str]:
    """Return what an ``__init__`` defines or takes from elsewhere, its own modules left out."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and _absolute(name, node, files) != name:
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
    return names


def cycles(imports: list[Import]) -> list[list[Import]]:
    """Return one shortest cycle for every group of modules that import each other."""
    ahead = _ahead(imports)
    return [
        min((_shortest_round(name, group, ahead) for name in sorted(group)), key=len)
        for group in _groups(imports)
    ]


def _ahead(imports: list[Import]) -> dict[str, list[Import]]:
    ahead: dict[str, list[Import]] = {}
    for one in imports:
        ahead.setdefault(one.importer, []).append(one)
    return ahead


def _groups(imports: list[Import]) -> list[set[str]]:
    """Return the sets of two or more modules that all lead to one another."""
    ahead = _ahead(imports)
    reached = {name: _reachable(name, ahead) for name in ahead}
    groups: list[set[str]] = []
    for name in ahead:
        if name in reached[name] and not any(name in group for group in groups):
            groups.append({other for other in reached[name] if name in reached.get(other, ())})
    return groups


def _reachable(start: str, ahead: Mapping[str, list[Import]]) -> set[str]:
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        for one in ahead.get(waiting.pop(), ()):
            if one.imported not in seen:
                seen.add(one.imported)
                waiting.append(one.imported)
    return seen


def _shortest_round(start: str, group: set[str], ahead: Mapping[str, list[Import]]) -> list[Import]:
    """Return the shortest way from a module back to itself within its group."""
    ways: list[list[Import]] = [[one] for one in ahead[start] if one.imported in group]
    seen: set[str] = set()
    for way in ways:  # grows while it is walked through: breadth first
        here = way[-1].imported
        if here == start:
            return way
        if here not in seen:
            seen.add(here)
            ways += [[*way, one] for one in ahead.get(here, ()) if one.imported in group]
    raise AssertionError(f"{start} is in a group but in no cycle")


def crowded(package: Path, most: int = MOST_MODULES) -> dict[str, int]:
    """Return the folders with too many modules of their own, and how many they hold."""
    counts: dict[str, int] = {}
    for name, file in modules_of(package).items():
        if file.name != "__init__.py":
            folder = name.rpartition(".")[0]
            counts[folder] = counts.get(folder, 0) + 1
    return {f: n for f, n in counts.items() if n > most and f not in CATALOGUES}


def complaints(package: Path, allowed: Mapping[tuple[str, str], str]) -> list[str]:
    """Return an entry for everything that is wrong with the layout of a package."""
    imports = imports_of(package)
    found = [
        "import cycle:\n" + "\n".join(f"  {one}" for one in way)
        for way in cycles([i for i in imports if (i.importer, i.imported) not in allowed])
    ]
    if len(allowed) > MOST_ALLOWED:
        found.append(f"{len(allowed)} imports may close a cycle; at most {MOST_ALLOWED} are agreed")
    for importer, imported in allowed:
        if not any(importer == i.importer and imported == i.imported for i in _within(imports)):
            found.append(f"the exception {importer} imports {imported} closes no cycle")
    for folder, count in crowded(package).items():
        found.append(f"{folder} holds {count} modules; at most {MOST_MODULES} fit in one folder")
    return found


def _within(imports: list[Import]) -> list[Import]:
    """Return the imports that lie on a cycle."""
    groups = _groups(imports)
    return [i for i in imports if any({i.importer, i.imported} <= group for group in groups)]


def main() -> int:
    """Print what is wrong; the number of complaints decides whether ``make lint`` goes on."""
    found = complaints(PACKAGE, ALLOWED)
    for complaint in found:
        print(complaint)
    modules, imports = len(modules_of(PACKAGE)), len(imports_of(PACKAGE))
    print(f"{modules} modules, {imports} imports between them, {len(found)} complaints")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
