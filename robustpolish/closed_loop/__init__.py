"""Simulation of closed loops under disturbances, and Monte Carlo over machines and loads.

The names stand in `__init__.pyi`, and each is imported when it is first asked for: a worker that
simulates loops waits for neither the brush nor the control of force.
"""

from typing import Any

import lazy_loader

from robustpolish.names import find_moved

# The names stand in __init__.pyi; each is imported when it is first asked for.
_named, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    return _named(name) if name in __all__ else find_moved("closed_loop", name)
