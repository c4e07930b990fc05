"""Physical effects: the catalogue, kinds of your own, equivalent damping."""

from robustpolish.names import namespace

# The names stand in effects.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = namespace(__file__)
