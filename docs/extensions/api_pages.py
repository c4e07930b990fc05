"""The API reference, one page per namespace, written from what each namespace exports.

A name of the top level is listed as ``robustpolish.name``, the way it is meant to be used; the
others as ``robustpolish.namespace.name``, of the first namespace that exports them. Nothing public
can be forgotten.
"""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

import robustpolish

NAMESPACES = {
    "results": "Results",
    "polishing": "The polishing robot",
    "rotor": "Rotors",
    "tunable": "Tunable blocks",
    "uncertain": "Uncertain systems",
    "effects": "Physical effects",
    "simulation": "Simulation",
    "linear": "Linear systems",
    "loops": "Loops",
    "implementation": "Sampled and coded controllers",
    "identification": "Identification",
    "signals": "Measurements",
    "datasets": "Measured records",
    "plots": "Figures",
    "errors": "Errors",
}
KINDS = ("Functions", "Classes", "Errors and warnings", "Data")


def public_names(module: ModuleType) -> list[str]:
    """Return what a package exports: its `__all__`, or all names that it imports by name."""
    listed = getattr(module, "__all__", None)
    if listed is None:
        listed = [
            name
            for name, value in vars(module).items()
            if not name.startswith("_") and not inspect.ismodule(value) and name != "annotations"
        ]
    return sorted(listed, key=str.lower)


def kind_of(value: Any) -> str:
    """Return the heading under which a name is listed."""
    if inspect.isclass(value):
        return KINDS[2] if issubclass(value, Exception) else KINDS[1]
    return KINDS[0] if inspect.isroutine(value) else KINDS[3]


def room_page(title: str, intro: str, names: dict[str, str], values: dict[str, Any]) -> str:
    """Return one page: a table per kind of name, each with the place where it is described."""
    lines = [title, "=" * len(title), "", intro, ""]
    for kind in KINDS:
        chosen = [name for name, value in values.items() if kind_of(value) == kind]
        if not chosen:
            continue
        lines += [kind, "-" * len(kind), "", ".. autosummary::", "   :toctree: reference", ""]
        lines += [f"   {names[name]}" for name in chosen]
        lines.append("")
    return "\n".join(lines)


def pages() -> dict[str, str]:
    """Return all pages by name of file."""
    top = {
        name: getattr(robustpolish, name)
        for name in robustpolish.__all__
        if not inspect.ismodule(getattr(robustpolish, name))
    }
    intro = "Plants, analysis, synthesis, robustness, identification: what `rp.` shows first."
    described: dict[tuple[str, int], str] = {}

    def places(prefix: str, values: dict[str, Any]) -> dict[str, str]:
        """Return where each name is described: where its object was first listed by this name."""
        return {n: described.setdefault((n, id(v)), f"{prefix}.{n}") for n, v in values.items()}

    found = {"top.rst": room_page("Names at the top", intro, places("robustpolish", top), top)}
    for namespace, title in NAMESPACES.items():
        module = import_module(f"robustpolish.{namespace}")
        values = {name: getattr(module, name) for name in public_names(module)}
        intro = (inspect.getdoc(module) or "").splitlines()[0]
        names = places(module.__name__, values)
        found[f"{namespace}.rst"] = room_page(title, intro, names, values)
    return found


def _write(app: Sphinx, config: Config) -> None:
    folder = Path(app.srcdir) / "api"
    folder.mkdir(exist_ok=True)
    written = pages()
    for name, text in written.items():
        page = folder / name
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
    # what autosummary once wrote for names that are gone would be pages that nothing leads to
    listed = set(" ".join(written.values()).split())
    for old in (folder / "reference").glob("*.rst"):
        if old.stem not in listed:
            old.unlink()


def _resolve(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """Find a name that a docstring gives without its room, or with it where it has none here."""
    if node.get("refdomain") != "py":
        return None
    domain = env.domains.python_domain
    name = node["reftarget"]
    if name.startswith("robustpolish."):
        name = name.removeprefix("robustpolish.").split(".", 1)[-1]
    for prefix in ("robustpolish", *(f"robustpolish.{namespace}" for namespace in NAMESPACES)):
        found = domain.objects.get(f"{prefix}.{name}")
        if found is not None:
            place = node["refdoc"], found.docname, found.node_id
            return make_refnode(app.builder, *place, content, f"{prefix}.{name}")
    return None


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for sources."""
    app.connect("config-inited", _write)
    app.connect("missing-reference", _resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
