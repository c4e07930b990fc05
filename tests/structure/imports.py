"""Refuse import cycles and crowded folders: ``python -m tests.structure.imports``.

Every import statement counts, wherever it stands: at the top, inside a function, under
``TYPE_CHECKING`` or in a ``try``. import-linter, which checks the order of the wings, does not look
at cycles inside a wing; this does, on the same graph.
"""

import sys
from collections import Counter

import grimp
from scipy.sparse import lil_array
from scipy.sparse.csgraph import connected_components

MOST_MODULES = 20
"""Modules that a folder may hold: about what one list of a page shows at a glance."""
CATALOGUES = ("robustpolish.machines.effects.catalogue",)
"""Folders of any number of modules, because all are of one form: one effect per file."""


def cycles(graph: grimp.ImportGraph) -> list[list[str]]:
    """Return the groups of modules that import one another, directly or through others."""
    names = sorted(graph.modules)
    at = {name: i for i, name in enumerate(names)}
    imports = lil_array((len(names), len(names)))
    for name in names:
        for imported in graph.find_modules_directly_imported_by(name):
            imports[at[name], at[imported]] = 1
    _, labels = connected_components(imports, connection="strong")
    groups = [[n for n in names if labels[at[n]] == k] for k, c in Counter(labels).items() if c > 1]
    return sorted(groups)


def crowded(graph: grimp.ImportGraph) -> dict[str, int]:
    """Return the folders with too many modules, those below them not counted."""
    files = [name for name in graph.modules if not graph.find_children(name)]
    counts = Counter(name.rpartition(".")[0] for name in files)
    return {f: n for f, n in counts.items() if n > MOST_MODULES and f not in CATALOGUES}


def complaints(package: str) -> list[str]:
    """Return an entry for everything that is wrong with the layout of a package."""
    graph = grimp.build_graph(package, cache_dir=None)
    found = [f"import cycle: {' <-> '.join(group)}" for group in cycles(graph)]
    return found + [
        f"{folder} holds {count} modules; at most {MOST_MODULES} fit in one folder"
        for folder, count in crowded(graph).items()
    ]


if __name__ == "__main__":
    found = complaints("robustpolish")
    print(*found, f"{len(found)} complaints", sep="\n")
    sys.exit(bool(found))
