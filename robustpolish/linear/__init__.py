"""Modes, norms, scaling, observability: what a linear system is like."""

import lazy_loader

from robustpolish.base.pickling import register

# The names stand in __init__.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register()  # whatever holds a linear system imports this package
