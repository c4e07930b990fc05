"""Run the command line, as the command ``robustpolish`` and by ``python -m robustpolish``."""

import sys


def run() -> None:
    """Run the command line; Ctrl-C ends it without a traceback, also while it is imported."""
    try:
        from robustpolish.cli import main
    except KeyboardInterrupt:
        sys.exit(1)  # as click does from here on
    main(prog_name="robustpolish")


if __name__ == "__main__":
    run()
