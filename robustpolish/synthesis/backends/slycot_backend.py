"""SLICOT's synthesis routines through slycot (GPL), kept at arm's length.

SB10AD (H-infinity) and SB10HD (H2) want D12 and D21 of full rank, may run without end, and on
singular problems return controllers that do not stabilise or do not have the norm they claim.
So they run in a process of their own, which is ended in time, and whoever calls them checks
the loop.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robustpolish.errors import MissingDependencyError

_WORKER = Path(__file__).with_name("slycot_worker.py")
_LARGE = 1e10


class SlycotAnswer(NamedTuple):
    """What a routine returned; nothing in it has been verified.

    ``controller`` is (A, B, C, D) or None; ``gamma`` the claimed norm, None for SB10HD;
    ``message`` tells what went wrong.
    """

    controller: tuple[Any, ...] | None
    gamma: float | None
    message: str


def synthesise(
    routine: str,
    sizes: tuple[int, int, int],
    matrices: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]],
    time_limit: float,
) -> SlycotAnswer:
    """Run a routine.

    Parameters
    ----------
    routine : {"SB10AD", "SB10HD"}
    sizes : (int, int, int)
        Number of states, controls and measurements.
    matrices : tuple of ndarray
        A, B, C, D of the whole plant, w before u and z before y.
    time_limit : float
        Seconds until the process is ended.

    Returns
    -------
    SlycotAnswer

    Raises
    ------
    MissingDependencyError
        If slycot is not installed.
    """
    if find_spec("slycot") is None:
        raise MissingDependencyError(
            "method: slycot is not installed. Install it with `pip install slycot`, or choose "
            "another method."
        )
    n, controls, measurements = sizes
    m, outputs = matrices[1].shape[1], matrices[2].shape[0]
    task = {
        "routine": routine,
        "sizes": (n, m, outputs, controls, measurements),
        "matrices": tuple(np.asfortranarray(M) for M in matrices),
        "gamma": _LARGE,
    }
    if time_limit <= 0:
        return SlycotAnswer(None, None, f"no time was left for {routine}")
    worker = subprocess.Popen(
        [sys.executable, str(_WORKER), str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    out, complaints = b"", b""
    life, worker.stdin = worker.stdin, None  # stays open: its end would be ours for the worker
    assert life is not None
    try:
        with contextlib.suppress(BrokenPipeError):  # a worker that cannot start says why
            life.write(pickle.dumps(task))
            life.flush()
        out, complaints = worker.communicate(timeout=time_limit)
    except subprocess.TimeoutExpired:
        return SlycotAnswer(None, None, f"{routine} was ended after {time_limit:.3g} s, its time")
    finally:
        worker.kill()
        worker.communicate()
        with contextlib.suppress(BrokenPipeError):
            life.close()
    if worker.returncode != 0 or not out:
        lines = complaints.decode(errors="replace").strip().splitlines() or ["it crashed"]
        return SlycotAnswer(None, None, f"{routine} refused: {lines[-1][:200]}")
    answer = pickle.loads(out)
    gamma = None if answer["gamma"] is None else float(answer["gamma"])
    return SlycotAnswer(tuple(map(np.atleast_2d, answer["controller"])), gamma, "")
