"""Everything that writes results, made cheap: what is computed is computed once, before."""

from __future__ import annotations

import functools
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.figure import Figure

import robustpolish as rp
from robustpolish.app.cli.main import main
from robustpolish.base.atomic_writes import new_folder
from robustpolish.synthesis.lmi.program import run_with_time_limit
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.machine_design.machines import DESIGN, SPINDLE

Write = Callable[[Path, bool], Any]


@dataclass(frozen=True)
class Job:
    """A command or a method that writes.

    Attributes
    ----------
    write : callable
        Takes the folder and whether to replace what is there.
    targets : tuple of str
        What it writes there; a name without an ending is a folder.
    asks : bool
        Whether it replaces only by force.
    ends : bool
        Whether it ends by itself.
    """

    write: Write
    targets: tuple[str, ...]
    asks: bool = True
    ends: bool = True


def put_old(place: Path) -> None:
    """Put an earlier result at a place."""
    if place.suffix:
        place.write_bytes(b"old\n")
        return
    with new_folder(place, force=True) as folder:
        for name in ("design.json", "old.txt"):
            (folder / name).write_bytes(b"old\n")


@functools.cache
def jobs() -> dict[str, Job]:
    """Compute what is to be written, and return what writes it."""
    inputs = Path(tempfile.mkdtemp(prefix="robustpolish-faults-"))
    machine = inputs / "machine.toml"
    machine.write_text(SPINDLE + DESIGN)
    found = rp.design_machine(rp.read_design_task(machine))
    sampled = found.design.discretize(5e-5)
    case = Case("nothing hidden", one(), [], drive=20.0, samples=400, seed=11)
    (seen, _), _ = records(case)
    model, record = model_of(case), inputs / "seen.csv"
    model.to_toml(inputs / "model.toml")
    table = np.column_stack([seen["time"], seen["F_x"], seen["x"]])
    np.savetxt(record, table, delimiter=",", header="time [s],F_x [N],x [m]", comments="")
    diagnosis = rp.diagnose(model, seen)
    drawn = found.plot().get_figure(root=True)
    assert drawn is not None, "axes that are drawn have a figure"
    drawn.savefig(picture := inputs / "picture.png", dpi=150)
    for name in ("design", "diagnose"):  # faults are for what writes, not for imports
        import_module(f"robustpolish.app.cli.main.{name}")
    computed = {
        "robustpolish.app.machine_design.design_machine": found,
        "robustpolish.app.report.documents.machine_design_report": None,
        "robustpolish.app.report.html.render_html": "<p>" + 100_000 * "words ",
        "robustpolish.identification.diagnose.diagnose": diagnosis,
        "robustpolish.app.machine_design.MachineDesign.plot": _Drawn(picture.read_bytes()),
    }

    def design(at: Path, force: bool) -> None:
        _command(computed, force, "design", "--model", machine, "--out", at / "results")

    def design_and_report(at: Path, force: bool) -> None:
        places = ("--out", at / "results", "--report", at / "page.html", "--json", at / "all.json")
        _command(computed, force, "design", "--model", machine, *places)

    def diagnose(at: Path, force: bool) -> None:
        places = ("--save", at / "refined.toml", "--json", at / "all.json")
        _command(computed, force, "diagnose", record, "--model", inputs / "model.toml", *places)

    def with_a_worker(at: Path, force: bool) -> None:
        with new_folder(at / "results", force) as folder:
            (folder / "design.json").write_text("begun")
            run_with_time_limit(lambda: time.sleep(60), 60.0)

    return {
        "design": Job(design, ("results",)),
        "design, report": Job(design_and_report, ("results", "page.html", "all.json")),
        "diagnose": Job(diagnose, ("refined.toml", "all.json")),
        "save design": Job(lambda at, f: found.design.save(at / "a.json", force=f), ("a.json",)),
        "save diagnosis": Job(lambda at, f: diagnosis.save(at / "a.json", force=f), ("a.json",)),
        "save plant": Job(lambda at, f: found.machine.save(at / "a.json", force=f), ("a.json",)),
        "save model": Job(lambda at, f: model.to_toml(at / "a.toml"), ("a.toml",), asks=False),
        "export": Job(
            lambda at, f: sampled.export_c(at / "a.c", test_vectors=20, force=f),
            ("a.c", "a_vectors.csv"),
        ),
        "with a worker": Job(with_a_worker, ("results",), ends=False),
    }


class _Drawn(Figure):
    """A figure that is drawn already; axes and figure in one."""

    def __init__(self, picture: bytes) -> None:
        super().__init__()
        self._picture = picture

    def get_figure(self, root: bool = False) -> _Drawn:
        return self

    def savefig(self, fname: Any, **_: Any) -> None:
        Path(fname).write_bytes(self._picture)


def _command(computed: dict[str, Any], force: bool, *arguments: Any) -> None:
    """Call the command as a user would; what takes long is at hand."""
    patches = [mock.patch(name, lambda *_, r=r, **__: r) for name, r in computed.items()]
    for patch in patches:
        patch.start()
    try:
        main([*map(str, arguments), *(["--force"] if force else [])])
    finally:
        for patch in patches:
            patch.stop()
