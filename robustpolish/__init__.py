"""Robust control design with certificates, for machines with contact."""

from typing import Any

import lazy_loader

from robustpolish.base.versions import __version__ as __version__
from robustpolish.names import find, register_old_packages

# The public names stand in __init__.pyi; each is imported when it is first asked for (SPEC 1).
_named, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    return _named(name) if name in __all__ else find(name)


register_old_packages()
