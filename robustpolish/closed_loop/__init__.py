"""Controllers meet disturbances.

The names stand in `__init__.pyi`, and each is imported when it is first asked for: a worker that
simulates loops waits for neither the brush nor the control of force.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
