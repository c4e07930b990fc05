"""Names that are looked up where the package has none: old ones, and those of other toolboxes."""

from __future__ import annotations

import ast
import sys
import warnings
from collections.abc import Callable
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
OTHER_TOOLBOXES = {
    "hinfsyn": 'output_feedback(plant, norm="hinf")',
    "h2syn": 'output_feedback(plant, norm="h2")',
    "hinfstruct": "structured_output_feedback(plant, ...)",
    "systune": "structured_output_feedback(plant, ...)",
    "musyn": 'robust_output_feedback(plant, "y", "u")',
    "dksyn": 'robust_output_feedback(plant, "y", "u")',
    "lqr": 'state_feedback(plant, norm="h2")',
    "lqg": 'output_feedback(plant, norm="h2")',
    "loopsyn": "loop_shaping(plant, ...)",
    "ncfsyn": "loop_shaping(plant, ...)",
    "mixsyn": "mixed_sensitivity(plant, ...)",
    "augw": "mixed_sensitivity(plant, ...)",
    "makeweight": "weight(...)",
    "robstab": "robust_stability(system)",
    "robgain": "robust_performance(system, ...)",
    "wcgain": "worst_case_gain(system)",
    "mussv": "structured_singular_value(M, ...)",
    "ureal": "uncertain.real(...)",
    "ucomplex": "uncertain.complex(...)",
    "ultidyn": "uncertain.dynamics(...)",
    "ucover": "uncertain.cover(...)",
    "gapmetric": "uncertain.nu_gap(...)",
    "ncfmargin": "uncertain.ncf_margin(...)",
    "hinfnorm": "hinf_norm(system)",
    "norm": "hinf_norm(system) or rp.h2_norm(system)",
    "sigma": "singular_values(system, ...)",
    "damp": "modes(system)",
    "ctrb": "controllability(system)",
    "obsv": "observability(system)",
    "ssbal": "linear.scale_system(system)",
    "prescale": "linear.prescale(system)",
    "margin": "loop_analysis(plant, controller)",
    "allmargin": "loop_analysis(plant, controller)",
    "diskmargin": "loop_analysis(plant, controller)",
    "loopsens": "loop_analysis(plant, controller)",
    "bode": "plots.plot_bode(...) or control.bode_plot(system)",
    "nyquist": "plots.plot_nyquist(...) or control.nyquist_plot(system)",
    "pid": "tunable.pid(...)",
    "c2d": "implementation.certify_sampled(plant, ...)",
    "lsim": "simulation.linear_response(system, ...)",
    "iddata": "read_measurement(path)",
    "greyest": "refit(model, data)",
    "resid": "residual_analysis(model, data)",
    "spafdr": "estimate_frequency_response(data, ...)",
    "tfestimate": "estimate_frequency_response(data, ...)",
}
"""Calls that do what a function of MATLAB's toolboxes or of python-control does."""


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
        return getattr(import_module(f"robustpolish.{module}"), original)

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
    hint = f"; use rp.{OTHER_TOOLBOXES[name]}" if name in OTHER_TOOLBOXES else ""
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
