"""Names that are looked up where the package has none: old ones, and those of other toolboxes."""

from __future__ import annotations

import ast
import re
import sys
import warnings
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

NAMESPACES = (
    "results", "polishing", "rotor", "tunable", "uncertain", "effects", "simulation", "linear",
    "signals", "implementation", "errors", "plots", "machines", "plants", "synthesis", "robust",
    "loops", "identification", "closed_loop", "report",
)  # fmt: skip
"""Modules whose names stood at the top, in this order of search."""
OLD_PACKAGES = {
    "analysis": ("linear",),
    "models": ("machines", "plants", "polishing", "rotor", "uncertain"),
    "brush": ("polishing",),
    "measurements": ("signals",),
    "plotting": ("plots",),
    "machine_design": ("app.machine_design", "app.design_task"),
    "sweeps": ("base.sweep",),
    "report": ("app.html", "base.results"),
}
"""Packages of version 0.1.0 and the modules that hold their names now."""
MOVED = {
    "closed_loop": ("polishing",),
    "synthesis": ("polishing",),
}
"""Packages some of whose names have moved, and the modules that hold these."""


@cache
def other_toolboxes() -> dict[str, str]:
    """Return calls that do what functions of MATLAB's toolboxes or of python-control do."""
    text = Path(__file__).with_name("other_toolboxes.txt").read_text("utf-8")
    return dict(re.findall(r"(\w+) +(.*)", text))


def namespace(file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a module of names from elsewhere.

    The stub beside `file` says from where; each name is imported when it is first asked for.
    :mod:`lazy_loader` does this for packages only.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text("utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    places = {a.asname or a.name: (node.module, a.name) for node in imports for a in node.names}
    names = sorted(places)

    def get(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {Path(file).stem!r} of robustpolish has no {name!r}")
        module, original = places[name]
        found = getattr(import_module(f"robustpolish.{module}"), original)
        vars(sys.modules[f"robustpolish.{Path(file).stem}"])[name] = found
        return found

    return get, lambda: names, names


def find(name: str) -> Any:
    """Return what `name` meant in version 0.1.0, with a warning, or raise an AttributeError."""
    if name in OLD_PACKAGES:
        return sys.modules[f"robustpolish.{name}"]
    if name in NAMESPACES:
        return import_module(f"robustpolish.{name}")
    if name.startswith("uncertain_"):
        return _moved(f"robustpolish.{name}", import_module("robustpolish.uncertain"), name[10:])
    if not name.startswith("_"):
        for module in NAMESPACES:
            found = import_module(f"robustpolish.{module}")
            if name in dir(found):
                return _moved(f"robustpolish.{name}", found, name)
    hint = f"; use rp.{other_toolboxes()[name]}" if name in other_toolboxes() else ""
    raise AttributeError(f"module 'robustpolish' has no attribute {name!r}{hint}")


def find_moved(package: str, name: str) -> Any:
    """Return a name that has moved from `package`, with a warning; else raise AttributeError."""
    for place in (*OLD_PACKAGES.get(package, ()), *MOVED.get(package, ())):
        if name.startswith("__"):
            break
        found = import_module(f"robustpolish.{place}")
        if hasattr(found, name):
            return _moved(f"robustpolish.{package}.{name}", found, name)
    raise AttributeError(f"module 'robustpolish.{package}' has no attribute {name!r}")


def _moved(old: str, module: ModuleType, name: str) -> Any:
    text = f"{old} is now {module.__name__}.{name}; the old name goes with version 0.3"
    warnings.warn(text, DeprecationWarning, stacklevel=4)
    return getattr(module, name)


class _OldPackage(ModuleType):
    """A package of version 0.1.0, so that `from robustpolish.models import ...` still works."""

    def __getattr__(self, name: str) -> Any:
        return find_moved(self.__name__.rpartition(".")[2], name)


def register_old_packages() -> None:
    """Make the packages of version 0.1.0 importable; nothing is imported for it."""
    for name in OLD_PACKAGES:
        full = f"robustpolish.{name}"
        sys.modules.setdefault(full, _OldPackage(full, "Names of version 0.1.0."))
