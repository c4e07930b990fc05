"""The way of a public call through the files: ``python -m tests.structure.call_path``.

What is counted, on small fixed cases, of the Python functions of the package that are really called
(comprehensions are functions up to Python 3.11; compiled functions are not seen):

- *files*: distinct files whose functions were entered;
- *depth*: the most functions of the package that were on the stack at once;
- *returns*: the distinct ways, as lists of files from the public call down, that end in a file they
  had already left. This is what makes a reader shuttle.

Code that runs because a module is imported does not count. Another copy of the package is measured
by ``cd OTHER; PYTHONPATH=HERE python -m tests.structure.call_path``.
"""

import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

import robustpolish as rp
from tests.hidden_effects.cases import Case, model_of, one, records

Way = tuple[str, ...]


@dataclass
class CallPath:
    """What a call went through."""

    files: set[str] = field(default_factory=set)
    deepest: Way = ()
    returns: set[Way] = field(default_factory=set)

    def __str__(self) -> str:
        return (
            f"{len(self.files)} files, {len(self.deepest)} functions deep, "
            f"{len(self.returns)} ways that return to a file they had left"
        )


@dataclass(frozen=True)
class _Place:
    """Where a frame is: the functions and the files from the public call down to it."""

    functions: Way = ()
    files: Way = ()
    counts: bool = True  # False below an import


class _Watcher:
    """A profile function. It goes by the frames, because compiled functions hide some events."""

    def __init__(self, package: Path) -> None:
        self.path = CallPath()
        self._root = f"{package}/"
        self._places: dict[FrameType, _Place] = {}
        self._names: dict[str, str] = {}

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        if event == "return":
            self._places.pop(frame, None)
        elif event == "call":
            file = self._file(frame.f_code.co_filename)
            if frame.f_code.co_name == "<module>":
                self._places[frame] = _Place(counts=False)
            elif file:
                above = self._above(frame)
                self._places[frame] = self._entered(file, frame, above) if above.counts else above

    def _file(self, path: str) -> str:
        """Return the name of a file within the package, empty for any other."""
        if path not in self._names:
            inside = path.startswith(self._root)
            self._names[path] = path.removeprefix(self._root) if inside else ""
        return self._names[path]

    def _above(self, frame: FrameType) -> _Place:
        """Return the place of the nearest caller within the package."""
        caller = frame.f_back
        while caller is not None and caller not in self._places:
            caller = caller.f_back
        return _Place() if caller is None else self._places[caller]

    def _entered(self, file: str, frame: FrameType, above: _Place) -> _Place:
        functions = (*above.functions, f"{file}: {frame.f_code.co_qualname}")
        files = above.files if above.files[-1:] == (file,) else (*above.files, file)
        self.path.files.add(file)
        if len(functions) > len(self.path.deepest):
            self.path.deepest = functions
        if len(files) > len(above.files) and file in above.files:
            self.path.returns.add(files)
        return _Place(functions, files)


def path_of(call: Callable[[], object]) -> CallPath:
    """Return the way that a call takes through the files of the package."""
    watcher = _Watcher(Path(rp.__file__).parent)
    threading.setprofile(watcher)
    sys.setprofile(watcher)
    try:
        call()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return watcher.path


def design_for_two_states() -> rp.results.Design:
    """The example of ``output_feedback``: a double integrator."""
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [0, 0]], [[0, 0], [1, 0]], [[0], [1]], [[1, 0], [0, 0]], [[1, 0]],
        D12=[[0], [1]], D21=[[0, 1]],
    )  # fmt: skip
    return rp.output_feedback(plant)


def design_for_four_states() -> rp.results.Design:
    """Two masses on springs, the first one pushed, the second one measured with noise."""
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 0, 1, 0], [0, 0, 0, 1], [-2, 1, -0.1, 0.05], [1, -1, 0.05, -0.05]],
        [[0, 0], [0, 0], [0, 0], [1, 0]],
        [[0], [0], [1], [0]],
        [[0, 1, 0, 0], [0, 0, 0, 0]],
        [[0, 1, 0, 0]],
        D12=[[0], [0.3]],
        D21=[[0, 0.2]],
    )
    return rp.output_feedback(plant)


def diagnosis() -> rp.results.Diagnosis:
    """One mass on a spring that hardens, with a model whose mass and stiffness are wrong."""
    effect = ("cubic_stiffness", ("x", "ground"), [4e6])
    case = Case("cubic", one(), [effect], drive=8.0, samples=4000, seed=1)
    (data, _), _ = records(case)
    model = model_of(replace(case, wrong={"mass": 0.03, "stiffness": 0.1}))
    return rp.diagnose(model, data)


CALLS = (design_for_two_states, design_for_four_states, diagnosis)


def main() -> None:
    """Print the way of every case; with ``-v`` the files, the deepest stack and the returns too."""
    for call in CALLS:
        path = path_of(call)
        print(f"{call.__name__}: {path}")
        if "-v" in sys.argv[1:]:
            for title, lines in (
                ("files", sorted(path.files)),
                ("deepest", path.deepest),
                ("returns", sorted(" > ".join(way) for way in path.returns)),
            ):
                print(f"  {title}", *lines, sep="\n    ")


if __name__ == "__main__":
    main()
