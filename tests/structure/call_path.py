"""The files that a public call enters: ``python -m tests.structure.call_path [-v]``.

Counted are the Python functions of the package that are really called, on small fixed cases
(compiled functions are not seen): *files* are the distinct files whose functions were entered,
*depth* is the most functions of the package that were on the stack at once. What runs because a
module is imported does not count.
"""

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import xarray as xr

import robustpolish as rp
from tests.synthesis.small_plants import double_integrator


class CallPath:
    """A profile function that notes the files that are entered, and the deepest stack."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        self.deepest: list[str] = []
        self._root = f"{Path(rp.__file__).parent}/"

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        """Look at a frame that is entered, and at all that called it."""
        if event != "call" or not frame.f_code.co_filename.startswith(self._root):
            return
        stack, caller = [], frame
        while caller is not None:
            code = caller.f_code
            if code.co_filename.startswith(self._root):
                if code.co_name == "<module>":
                    return
                stack.append(f"{code.co_filename.removeprefix(self._root)}: {code.co_qualname}")
            caller = caller.f_back
        self.files.add(stack[0].split(":")[0])
        if len(stack) > len(self.deepest):
            self.deepest = stack[::-1]


def path_of(call: Callable[[], object]) -> CallPath:
    """Return what a call goes through."""
    path = CallPath()
    threading.setprofile(path)
    sys.setprofile(path)
    try:
        call()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return path


def output_feedback() -> object:
    """Return an H-infinity controller of a double integrator."""
    return rp.output_feedback(double_integrator())


def state_feedback() -> object:
    """Return a state feedback of the same plant."""
    return rp.state_feedback(double_integrator())


def refit() -> object:
    """Return a mass on a spring fitted to its motion under noise."""
    time = np.arange(1000) * 0.01
    rng = np.random.default_rng(0)
    force, noise = rng.standard_normal(time.size), 1e-3 * rng.standard_normal(time.size)

    def oscillator(stiffness: float) -> rp.MechanicalModel:
        return rp.MechanicalModel(
            [rp.Dof("x", 1.0)],
            [rp.Spring(("x", "ground"), stiffness)],
            [rp.Damper(("x", "ground"), 0.4)],
            [rp.Input("F", ("x", "ground"))],
            [rp.Output("x", ("x", "ground"))],
        )

    system = oscillator(25.0).state_space()
    moved = rp.simulation.linear_response(system, time, force[:, None]).outputs[:, 0]
    data = xr.Dataset({"F": ("time", force), "x": ("time", moved + noise)}, {"time": time})
    return rp.refit(oscillator(22.0), data)


def robust_stability() -> object:
    """Return the stability margin of a mass with uncertain damping."""
    damping = rp.uncertain.real("c", 1, range=(0, 2))
    return rp.robust_stability(rp.uncertain.system([[0, 1], [-1, -damping]], [[0], [1]], [[1, 0]]))


def robust_output_feedback() -> object:
    """Return a controller of one state with an uncertain input."""
    gain = rp.uncertain.real("b", 1.0, percent=20)
    plant = rp.uncertain.system([[-1.0]], [[1.0, gain]], [[1.0], [1.0]])
    return rp.robust_output_feedback(plant, measurements=1, controls=1, gamma=0.9, order=0)


CALLS = (output_feedback, state_feedback, refit, robust_stability, robust_output_feedback)


def main() -> None:
    """Print the counts of every case; with ``-v`` the files and the deepest stack too."""
    for call in CALLS:
        call()  # what is loaded or compiled at first use is no part of the way
        path = path_of(call)
        print(f"{call.__name__}: {len(path.files)} files, {len(path.deepest)} functions deep")
        if "-v" in sys.argv[1:]:
            print("  files", *sorted(path.files), "  deepest", *path.deepest, sep="\n    ")


if __name__ == "__main__":
    main()
