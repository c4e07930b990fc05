"""The program that runs one routine: dictionary in, dictionary out, nothing of the package."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from robustpolish.synthesis.backends import slycot_worker


def lag(routine):
    """Return x' = -x + w1 + u, z = (x, u), y = x + w2 as a task."""
    return {
        "routine": routine,
        "sizes": (1, 3, 3, 1, 1),
        "matrices": (
            np.array([[-1.0]]),
            np.array([[1.0, 0.0, 1.0]]),
            np.array([[1.0], [0.0], [1.0]]),
            np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]]),
        ),
        "gamma": 1e10,
    }


def test_it_runs_without_the_package(tmp_path):
    pytest.importorskip("slycot")
    # -I leaves out the folder and PYTHONPATH; a copy shows that nothing beside it is needed.
    copy = tmp_path / "worker.py"
    copy.write_text(Path(slycot_worker.__file__).read_text(encoding="utf-8"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-I", copy],
        input=pickle.dumps(lag("SB10AD")),
        capture_output=True,
        cwd=tmp_path,
        check=True,
    )
    told = pickle.loads(done.stdout)
    # Without control the norm is 1; if y were x, 2 X = 1 + (1/gamma^2 - 1) X^2 would have to
    # have a solution, which ends at 1/sqrt(2).
    assert 1 / np.sqrt(2) < told["gamma"] < 1
