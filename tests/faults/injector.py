"""Run a job in a forked child of this warm process, with one fault at its n-th file operation.

Operations are seen by an audit hook before they take place: folders made and removed, files opened
for writing, renamed, linked and removed, locks taken. What happens inside a write is reached by a
limit on the size of files, at which the kernel ends the process.
"""

from __future__ import annotations

import contextlib
import errno
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from robustpolish.base import atomic_writes as renames
from robustpolish.errors import RobustPolishError

OPERATIONS = {
    "os.mkdir", "os.rmdir", "os.remove", "os.rename", "os.link", "os.chmod", "os.truncate",
    "fcntl.flock",
}  # fmt: skip
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_REFUSED, _DONE = 3, 0


@dataclass(frozen=True)
class Fault:
    """What goes wrong.

    Attributes
    ----------
    kind : {"none", "kill", "size", "time", "denied", "full", "clock"}
        Killed before operation `at`, in the write that passes byte `at` of a file, or after `at`
        milliseconds on a slow disk; refused from operation `at` on (permission, or space);
        the clock jumps there by three years to and fro.
    at : int
    exchange : bool
        Whether the kernel exchanges folders.
    """

    kind: str = "none"
    at: int = 0
    exchange: bool = True


@dataclass(frozen=True)
class Outcome:
    """How the child ended, how many operations it had come to, and its session."""

    killed: bool
    refused: bool
    operations: int
    session: int


def suffer(job: Callable[[], None], fault: Fault) -> Outcome:
    """Run the job in a child in a session of its own and wait until the child has ended."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _suffer_here(job, fault, writer)
    os.close(writer)
    if fault.kind == "time":
        time.sleep(fault.at / 1e3)
        os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    # A worker that lives on holds the other end open: its end is not waited for.
    os.set_blocking(reader, False)
    told = b""
    with contextlib.suppress(BlockingIOError):
        told = os.read(reader, 65536)
    os.close(reader)
    code = os.waitstatus_to_exitcode(status)
    if code not in (_DONE, _REFUSED) and code >= 0:
        raise AssertionError(f"the job broke: exit code {code} under {fault}")
    return Outcome(code < 0, code == _REFUSED, len(told), child)


def _suffer_here(job: Callable[[], None], fault: Fault, writer: int) -> None:
    code, complaints = 1, sys.stderr
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        silence = os.open(os.devnull, os.O_WRONLY)
        complaints = os.fdopen(os.dup(2), "w")
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        if not fault.exchange:
            renames._system_call = lambda: None
        if fault.kind == "size":
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_FSIZE, (fault.at, fault.at))
        _arm(fault, writer)
        try:
            job()
            code = _DONE
        except SystemExit as refusal:
            code = _REFUSED if refusal.code else _DONE
        except RobustPolishError:
            code = _REFUSED
        except Exception:
            if fault.kind not in ("denied", "full"):
                raise
            code = _REFUSED
    except BaseException:
        traceback.print_exc(file=complaints)
        complaints.flush()
    finally:
        os._exit(code)


def _arm(fault: Fault, writer: int) -> None:
    count = 0

    def before_operation() -> None:
        nonlocal count
        count += 1
        os.write(writer, b".")
        if fault.kind == "time":
            time.sleep(2e-3)
        if count < fault.at:
            return
        if fault.kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if fault.kind == "clock":
            jump = 1e8 if count % 2 else -1e8
            time.time = lambda real=time.time: real() + jump
        if fault.kind in ("denied", "full"):
            number = errno.EACCES if fault.kind == "denied" else errno.ENOSPC
            raise OSError(number, os.strerror(number))

    def hook(event: str, arguments: tuple) -> None:
        if event in OPERATIONS or (event == "open" and _writes(arguments)):
            before_operation()

    sys.addaudithook(hook)
    exchange = renames._renameat2

    def observed(source: Path, target: Path, flags: int) -> bool:
        before_operation()
        return exchange(source, target, flags)

    renames._renameat2 = observed


def _writes(arguments: tuple) -> bool:
    path, _, flags = arguments
    return isinstance(flags, int) and bool(flags & _WRITING) and path != os.devnull


def living(session: int) -> list[int]:
    """Return the processes of a session that still live."""
    found = []
    for each in Path("/proc").iterdir():
        if each.name.isdigit():
            try:
                fields = (each / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] not in "ZX":
                found.append(int(each.name))
    return found
