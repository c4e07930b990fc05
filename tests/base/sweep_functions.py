"""Functions that worker processes of the tests import."""

import os
import signal
import time
from pathlib import Path

import numpy as np


def product(a, b):
    return a * b


def drawn(a, rng):
    if a == 3:
        raise ValueError("three is refused")
    return {"draws": rng.normal(size=2), "same": a}


def slow_draw(a, log, rng):
    """Draw after a while, and leave a byte for every call."""
    with Path(log).open("ab") as file:
        file.write(b"x")
    time.sleep(0.02)
    return float(rng.normal()) * a


def kills_once(a, mark, rng):
    """Kill its worker at a = 5, but only the first time."""
    if a == 5 and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return float(rng.normal())


def kills_always(a):
    if a == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return np.array([a, a + 0.5])


def slowest_pole(plant, factor):
    return factor * float(plant.system.poles().real.max())
