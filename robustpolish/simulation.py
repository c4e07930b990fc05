"""Simulation of linear systems, of models with effects and of closed loops."""

from robustpolish.names import namespace

# The names stand in simulation.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = namespace(__file__)
