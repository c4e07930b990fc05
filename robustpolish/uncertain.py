"""Uncertain elements and systems."""

from robustpolish.names import namespace

# The names stand in uncertain.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = namespace(__file__)
