"""The report and the files of a design against the brush."""

from __future__ import annotations

import textwrap
from collections import Counter
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from robustpolish.closed_loop import BrushDesign, BuildableBrushDesign
from robustpolish.display import Card, Table, as_text
from robustpolish.models.machines.air_bearing import FORCES
from robustpolish.plotting import plot_panels
from robustpolish.report.can_it_be_built import (
    buildable_summary,
    can_it_be_built,
    effort_of,
    hardware_table,
    sampled_certificate,
    what_could_go_wrong,
    what_reality_costs,
    why_z_stays,
)
from robustpolish.report.document import Report, Section
from robustpolish.report.pictures import panels, picture

AXES = ("x", "y", "z")


def brush_design_report(job: BrushDesign) -> Report:
    """Tell what was gained, at what effort, and why it can be trusted."""
    if isinstance(job, BuildableBrushDesign):
        sections = (
            _gained(job),
            can_it_be_built(job),
            what_could_go_wrong(job),
            why_z_stays(job),
            effort_of(job),
        )
    else:
        sections = (_gained(job), _effort(job))
    return Report(
        title="Controller for the polishing robot",
        verdict=job.verdict(),
        good=job.good,
        sections=(*sections, _certificate(job), _load(job), _machine(job)),
    )


def brush_design_text(job: BrushDesign) -> str:
    """Return what a terminal shows."""
    words, parts = [job.verdict()], [str(job.comparison)]
    if isinstance(job, BuildableBrushDesign):
        words.append(job.loop.explain())
        parts += ["", as_text(Card("", (*job.tables(), what_reality_costs(job))))]
    words.append(job.design.message)
    return "\n".join([*parts, "", *(textwrap.fill(text, 88) for text in words)])


def brush_design_summary(job: BrushDesign) -> dict[str, Any]:
    """Return the figures for other programs."""
    certificate, table = job.design.certificate, job.comparison.table
    built = isinstance(job, BuildableBrushDesign)
    return {
        "realisation": "buildable" if built else "ideal",
        "status": job.design.status,
        "message": job.design.message,
        "method": job.design.method,
        "backend": job.design.backend,
        "norm": {
            "kind": job.design.norm,
            "open_loop": float(job.open_loop_norm),
            "closed_loop": float(job.closed_loop_norm),
        },
        "control_weight": job.control_weight,
        "gain_bound": job.gain_bound,
        "certificate": {
            "valid": certificate.valid,
            "reasons": list(certificate.reasons),
            "stable": certificate.stable,
            "achieved": certificate.achieved,
            "claimed": certificate.claimed,
            "bound": certificate.bound,
            "largest_gain": certificate.largest_gain,
            "frequencies_hz": certificate.frequencies_hz,
            "damping": certificate.damping,
        },
        "gain": None if job.design.gain is None else job.design.controller.D,
        "controls": job.plant.control_names,
        "states": job.plant.states,
        "load": job.comparison.load,
        "units": {
            "deviation": {axis: job.plant.units[axis] for axis in AXES},
            "improvement_percent": "%",
            "effort": ", ".join(
                sorted({job.plant.units[name] for name in job.plant.control_names})
            ),
            "controls": {name: job.plant.units[name] for name in job.plant.control_names},
            "states": {name: job.plant.units.get(name, "") for name in job.plant.states},
        },
        "rows": [
            {
                "row": str(row),
                "deviation": dict(zip(AXES, table["deviation"].sel(row=row).values, strict=True)),
                "improvement_percent": dict(
                    zip(AXES, table["improvement"].sel(row=row).values, strict=True)
                ),
                "effort": float(table["effort"].sel(row=row)),
            }
            for row in table["row"].values
        ],
        **({"built": buildable_summary(job)} if built else {}),
    }


def save_brush_design(job: BrushDesign, folder: Path) -> None:
    """Write table, figure, signals and the controller, as a gain or as code, into a folder."""
    header, body = job.comparison.rows()
    pd.DataFrame(body, columns=("row", *header[1:])).to_csv(folder / "table.csv", index=False)
    if isinstance(job, BuildableBrushDesign):
        pd.DataFrame([vars(row) for row in job.limits]).to_csv(folder / "limits.csv", index=False)
        job.sampled.export_c(folder / "controller.c")
        job.sampled.export_json(folder / "controller.json")
    else:
        gain = pd.DataFrame(
            job.design.controller.D, index=job.plant.control_names, columns=job.plant.states
        )
        gain.to_csv(folder / "gain.csv", index_label="u = F x")
    figure = plot_panels(job.comparison.responses, AXES)
    figure.savefig(folder / "figure.png", dpi=150)
    plt.close(figure)
    job.disturbance.to_netcdf(folder / "disturbance.nc")
    for row, response in job.comparison.responses.items():
        name = row.replace(" ", "-").replace("'", "")
        response.to_netcdf(folder / f"response-{name}.nc")


def _gained(job: BrushDesign) -> Section:
    header, body = job.comparison.shown_rows()
    return Section(
        "What was gained",
        ("The brush's forces drive all loops from rest; " + job.comparison.load + ".",),
        (
            panels(
                "Deviation of the brush, without and with control.", job.comparison.responses, AXES
            ),
        ),
        (Table("Largest deviations", header, tuple(body)),),
    )


def _effort(job: BrushDesign) -> Section:
    response = job.comparison.responses["with control"]
    largest_gain = np.linalg.norm(job.design.controller.D, 2)
    controls = tuple(name for name in job.plant.control_names if not name.endswith("_m"))
    unit = job.plant.units[controls[0]]
    if job.control_weight is not None:
        price = f"A control of 1 {unit} was priced like a deviation of {job.control_weight:.3g} m."
    elif job.gain_bound is not None:
        price = f"The gain was kept below {job.gain_bound:.4g} (largest singular value)."
    else:
        price = "Neither a price on the control nor a bound on the gain was set."
    rows = tuple(
        (name, float(np.abs(response[name]).max()), float(np.sqrt((response[name] ** 2).mean())))
        for name in job.plant.control_names
    )
    return Section(
        "Effort and price",
        (
            price,
            f"The gain's largest singular value is {largest_gain:.4g}.",
            job.design.message,
        ),
        (panels("Control at the brush.", {"control": response}, controls),),
        (Table("Control effort", ("control", f"largest [{unit}]", f"RMS [{unit}]"), rows),),
    )


def _certificate(job: BrushDesign) -> Section:
    c = job.design.certificate
    built = isinstance(job, BuildableBrushDesign)
    counted = "the sensors' noise" if built else "the price on u"
    facts = (
        ("status of the design", job.design.status),
        ("all poles stable", "yes" if c.stable else "no"),
        (f"norm achieved by the loop, {counted} included", c.achieved),
        ("norm claimed by the solver", float("nan") if c.claimed is None else c.claimed),
        ("norm proven as an upper bound", c.bound),
        ("largest entry of the gain", c.largest_gain),
    )
    order = np.argsort(c.frequencies_hz)
    # Pairs, equal axes and delays repeat poles: once each, as the table rounds them.
    modes = Counter(
        tuple(float(f"{x:.4g}") for x in (c.frequencies_hz[i], c.damping[i], c.poles[i].real))
        for i in order
    )
    sampled = (sampled_certificate(job),) if built else ()
    text = (
        "Computed afresh from the closed loop; nothing is taken over from the solver. A matrix "
        "that proves stability and norm was checked in ball arithmetic.",
        *c.reasons,
    )
    return Section(
        "Certificate",
        text,
        (
            picture(f"Gain from the forces to the outputs, {counted} included.", job.design.plot),
            picture("Poles of the closed loop.", job.design.plot_poles),
        ),
        (
            *sampled,
            Table("What was checked", ("quantity", "value"), facts, digits=6),
            Table(
                "Closed-loop poles",
                ("frequency [Hz]", "damping ratio", "real part [1/s]", "poles"),
                tuple((*mode, count) for mode, count in modes.items()),
            ),
        ),
    )


def _load(job: BrushDesign) -> Section:
    largest = tuple(
        (name, float(np.abs(job.disturbance[name]).max()), float(job.disturbance[name].mean()))
        for name in FORCES
    )
    forces = panels("Forces of the brush on the tool.", {"force": job.disturbance}, FORCES[:3])
    simulator = job.disturbance.attrs.get("simulator", "")
    return Section(
        "Load",
        (f"Simulated by the brush model '{simulator}'.",),
        (forces,),
        (Table("Forces", ("force", "largest [N]", "mean [N]"), largest),),
    )


def _machine(job: BrushDesign) -> Section:
    rows = tuple(job.parameters.table())
    head = ("parameter", "value", "unit", "source")
    parts = (hardware_table(job),) if isinstance(job, BuildableBrushDesign) else ()
    return Section("Machine", tables=(*parts, Table("Parameters", head, rows)))
