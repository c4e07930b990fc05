"""Which version this is, and which versions it runs on."""

from __future__ import annotations

import os
import platform
import re
from importlib import metadata

from robustpolish.base.results import Card, as_text, quantities

__version__ = "0.1.0"

_OPTIONAL = ("npTDMS", "pyuff")


def show_versions() -> None:
    """Print the versions that a report of a defect should name.

    Python, the machine, this package, everything that it needs, and the optional readers.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.show_versions()
    Versions
      robustpolish  0.1.0
      Python        3...
    """
    rows = [
        ("robustpolish", __version__),
        ("Python", platform.python_version()),
        ("machine", f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors"),
        ("threads", os.environ.get("OMP_NUM_THREADS", "OMP_NUM_THREADS is not set")),
        *((name, _installed(name)) for name in (*_required(), *_OPTIONAL)),
    ]
    print(as_text(Card("Versions", (quantities(*rows),))))


def _required() -> tuple[str, ...]:
    """Return the names of the packages that an installation needs, optional ones left out."""
    try:
        requirements = metadata.requires("robustpolish") or []
    except metadata.PackageNotFoundError:  # run from a checkout that is not installed
        requirements = ["control", "cvxpy", "matplotlib", "numba", "numpy", "scipy", "xarray"]
    needed = [line for line in requirements if "extra ==" not in line]
    return tuple(re.split(r"[^A-Za-z0-9_.-]", line, maxsplit=1)[0] for line in needed)


def _installed(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
