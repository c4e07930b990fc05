"""Run the command line, as the command ``robustpolish`` and by ``python -m robustpolish``."""

import atexit
import os
import sys


def run() -> None:
    """Run the command line; Ctrl-C ends it without a traceback, also while it is imported.

    What was to be done at the end is done; taking apart the modules, for which large packages
    need most of a second, is left to the operating system, so that the prompt is back at once.
    """
    codes: list[int] = []
    atexit.register(_leave, codes)  # the first that is registered runs last
    try:
        from robustpolish.cli import main

        main(prog_name="robustpolish")
    except KeyboardInterrupt:
        codes.append(1)  # as click does
        sys.exit(1)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            codes.append(end.code or 0)
        raise


def _leave(codes: list[int]) -> None:
    if not codes:  # an error that Python is to tell of
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:  # nobody reads any more: Python has a code for that
        return
    os._exit(codes[0])


if __name__ == "__main__":
    run()
