"""`robustpolish warm-up`: the command, and what it calls."""

from robustpolish.cli.warm_up.command import warm_up

__all__ = ["warm_up"]
