"""Scripts in fresh processes, and a machine on which others spin."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path


def output_of(script, *arguments, threads=1, **environment):
    """Run a script in a fresh process and return what it prints."""
    limits = {f"{library}_NUM_THREADS": str(threads) for library in ("OMP", "OPENBLAS")}
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=False,
        env={**os.environ, **limits, **environment}, cwd=Path(__file__).parents[1],
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def busy_machine(count):
    """Let processes spin, and end them whatever happens."""
    spinning = []
    try:
        for _ in range(count):
            spinning.append(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
        yield
        assert all(process.poll() is None for process in spinning)
    finally:
        for process in spinning:
            process.kill()
        for process in spinning:
            process.wait()
