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
        from robustpolish.app.cli.main import main

        main(prog_name="robustpolish")
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            codes.append(end.code or 0)
        raise
    except BaseException as error:
        if not _comes_from_ctrl_c(error):
            raise
        codes.append(1)  # as click does
        sys.exit(1)


def _comes_from_ctrl_c(error: BaseException | None) -> bool:
    # Up to Python 3.11 a class whose making is interrupted (`__set_name__`) raises a RuntimeError
    # with the interruption as its cause; an import makes thousands of classes.
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


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
