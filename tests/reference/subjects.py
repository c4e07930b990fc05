"""What is frozen, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from . import control_subjects as control
from . import examples
from . import program_subjects as program


@dataclass(frozen=True)
class Subject:
    """A name for many answers.

    Attributes
    ----------
    about : str
    cases : callable
        Yields the name of each answer and the call that computes it.
    shared : bool
        Whether the plants in ../shared are needed.
    improves : str
        Differences that end like this are no harm.
    """

    about: str
    cases: Callable[[], Iterator[tuple[str, Callable[[], Any]]]]
    shared: bool = False
    long: bool = False
    improves: str = ""

    def available(self) -> bool:
        """Whether the data are here."""
        return not self.shared or (examples.DATA / "compleib").is_dir()

    def allowed(self, line: str) -> bool:
        """Whether a difference is no harm."""
        return bool(self.improves) and line.endswith(self.improves)


SUBJECTS = {
    "signatures": Subject("every public name and what it takes", program.signatures),
    "rooms": Subject("the names that the packages inside offer", program.rooms),
    "start_up": Subject(
        "heavy imports of the first calls; fewer are allowed", program.start_up,
        improves="true -> false",
    ),
    "saved": Subject("saved files of version 0.1.0, and files saved now", control.saved),
    "exports": Subject("C, test vectors, MAT, JSON, FMU", control.exports),
    "norms": Subject("norms of hard systems", control.norms),
    "plant_norms": Subject("norms of the benchmark plants", control.norms_of_plants, True),
    "robust": Subject("public examples of mu, notebook 09", control.robust),
    "commands": Subject("JSON of every subcommand, and --help", program.commands),
    "hidden": Subject("quick cases of the hidden effects", program.hidden),
    "plants": Subject("controllers for 24 benchmark plants", control.plants, True),
    "special": Subject("plants on which something went wrong once", control.special_plants, True),
    "page": Subject("the validation page, line by line", program.page, long=True),
    "larger": Subject("controllers for ten larger plants", control.larger_plants, True),
}  # fmt: skip
