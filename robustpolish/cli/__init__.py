"""The command line: one file per subcommand, no mathematics."""

from robustpolish.cli.main import main

__all__ = ["main"]
