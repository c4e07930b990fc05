"""Workers end with the process that started them, whatever ended it.

Nothing of the package is imported here, so that a worker which is a program of its own can use it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading

_PR_SET_PDEATHSIG = 1


def exit_with_parent(parent: int, life: int) -> None:
    """End this process at once when its parent does; to be called in the child.

    On Linux the kernel sees to it, even while a solver computes and lets no other thread run.
    Everywhere a thread waits for the end of a pipe as well, which only the parent holds open.

    Parameters
    ----------
    parent : int
        The parent's process id, as the parent knows it.
    life : int
        File descriptor of the reading end of a pipe that the parent writes nothing more to.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it ended before the line above
            os._exit(1)
    threading.Thread(target=_watch, args=(life,), daemon=True).start()


def _watch(life: int) -> None:
    while os.read(life, 1 << 16):
        pass
    os._exit(1)
