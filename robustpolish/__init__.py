"""Robust control design with certificates, for machines with contact."""

import lazy_loader

from robustpolish.versions import __version__ as __version__

# The public names stand in __init__.pyi; each is imported when it is first asked for (SPEC 1).
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
