"""The report and the files of a design for any machine."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from robustpolish.machine_design import MachineDesign
from robustpolish.report.document import Picture, Report, Section
from robustpolish.report.pictures import picture


def machine_design_report(found: MachineDesign) -> Report:
    """Tell what was gained, whether it can be built, and why it can be trusted.

    Parameters
    ----------
    found : MachineDesign

    Returns
    -------
    Report
    """
    machine = found.task.machine
    name = getattr(machine, "name", "")
    return Report(
        title=f"Controller for {name}" if name else "Controller for a machine",
        verdict=found.verdict(),
        good=found.design.certificate.valid and found.analysis.buildable,
        sections=(_gained(found), _built(found), _trusted(found)),
    )


def save_machine_design(found: MachineDesign, folder: Path) -> None:
    """Write design, plant, table and figure into a folder.

    Parameters
    ----------
    found : MachineDesign
    folder : path
        It exists.
    """
    found.design.save(folder / "design.json")
    found.machine.save(folder / "plant.json")
    pd.DataFrame([vars(channel) for channel in found.channels]).to_csv(
        folder / "table.csv", index=False
    )
    drawn = found.plot() if found.channels else found.analysis.plot()
    figure = drawn.get_figure()
    assert figure is not None, "axes that are drawn have a figure"
    figure.savefig(folder / "figure.png", dpi=150)  # type: ignore[union-attr]
    plt.close(figure)  # type: ignore[arg-type]


def _gained(found: MachineDesign) -> Section:
    pictures: tuple[Picture, ...] = ()
    if found.channels:
        caption = "Largest gain from disturbances to outputs, without and with control."
        pictures = (picture(caption, found.plot),)
    own = found.tables()[:1] if found.channels else ()
    return Section("What was gained", (found.design.message,), pictures, own)


def _built(found: MachineDesign) -> Section:
    said = [found.analysis.explain()]
    if found.sampling:
        said.append(found.sampling)
    loop = picture("The loops, each opened alone.", lambda ax: found.analysis.plot(ax))
    disk = picture(
        "Nyquist curves and the disks that they stay out of.",
        lambda ax: found.analysis.plot(ax, kind="nyquist"),
    )
    tables = found.analysis.tables()
    return Section("Can it be built?", tuple(said), (loop, disk), tables, found.analysis.problems)


def _trusted(found: MachineDesign) -> Section:
    c = found.design.certificate
    proof = f"Poles, norm and proof were computed from the closed loop: at most {c.bound:.6g}."
    return Section("Why it can be trusted", (proof, *found.task.notes), points=c.reasons)
