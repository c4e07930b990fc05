"""Controllers with certificates: one method per file, and the certificate that judges them all."""

from typing import Any

import lazy_loader

from robustpolish.names import find_moved

# The names stand in __init__.pyi; each is imported when it is first asked for.
_named, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    return _named(name) if name in __all__ else find_moved("synthesis", name)
