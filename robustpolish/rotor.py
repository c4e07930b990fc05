"""Rotors of shaft segments, discs and bearings."""

from robustpolish.names import namespace

# The names stand in rotor.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = namespace(__file__)
