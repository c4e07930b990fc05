"""Tunable blocks of a structured controller."""

import sys
import warnings
from types import ModuleType
from typing import Any

from robustpolish.names import namespace

# The names stand in tunable.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = namespace(__file__)


class _Callable(ModuleType):
    """The module, which was the function :func:`tunable` in version 0.1.0."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        text = "robustpolish.tunable(...) is now robustpolish.tunable.tunable(...)"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return self.tunable(*args, **kwargs)


sys.modules[__name__].__class__ = _Callable
