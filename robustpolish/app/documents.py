"""Reports that an engineer hands to a colleague."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr

from robustpolish.app.html import Report, Section, panels, paragraphs, picture, whole
from robustpolish.app.machine_design import MachineDesign
from robustpolish.base.results import Card, Table, as_text, prefix_power, prefixed
from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import Comparison, StepRun
from robustpolish.identification.diagnosis import Diagnosis, headline, shown_parameters
from robustpolish.identification.residual_tests import MAP_TELLS, MAPS_SHOWN
from robustpolish.identification.residuals import residual_analysis
from robustpolish.identification.tell_apart import ToldApart
from robustpolish.plots.time import plot_panels
from robustpolish.polishing.air_bearing import FORCES
from robustpolish.polishing.design import (
    ACTUATOR_LOSS,
    RATIO,
    STIFFNESS_ERROR,
    BuildableBrushDesign,
)
from robustpolish.polishing.ideal import BrushDesign

# What a report tells of a controller that is to be built: margins, limits, what could go wrong.


def buildability_section(job: BuildableBrushDesign) -> Section:
    """Tell margins, rates and effort, what the loop is like, and what each limit costs."""
    _, built, *relaxed, ideal = job.limits
    found = [row for row in relaxed if math.isfinite(row.norm)]
    best = min(found, key=lambda row: row.norm, default=None)
    values = {"h": job.hardware, "ratio": RATIO, "built": built, "ideal": ideal, "best": best}
    nyquist = picture(
        "The loops at the controls, one at a time, and the disk that they keep clear of.",
        lambda ax: job.loop.plot(ax, kind="nyquist"),
    )
    text = paragraphs("buildability", job=job, **values)
    tables = (job.tables()[0], hardware_limits_table(job))
    return Section("Can it be built?", text, (nyquist,), tables)


def hardware_limits_table(job: BuildableBrushDesign) -> Table:
    """Return the table of limits, each relaxed while the others stay."""
    built = job.limits[1]
    power = prefix_power(built.deviation)
    rows = tuple(
        (row.what, row.norm, row.norm / built.norm, row.deviation / 10.0**power, row.effort)
        for row in job.limits
    )
    deviation = f"largest deviation [{prefixed('m', power)}]"
    head = ("y", "norm [m/N]", "of that as built", deviation, "largest force [N]")
    caption = "What reality costs: one limit relaxed at a time, designed anew"
    return Table(caption, head, rows)


def assumptions_section(job: BuildableBrushDesign) -> Section:
    """List what was assumed, with the numbers at which it breaks."""
    h, controls = job.hardware, [job.run[name] for name in job.plant.control_names]
    crossover = max(c.frequency_hz for m in job.loop.margins for c in m.gain_crossovers)
    # A mode beyond the crossover is harmless while its response times the controller's gain is
    # below 1, up to half the sampling rate.
    turns = np.exp(2j * np.pi * np.linspace(crossover, h.sample_rate_hz / 2, 200) * h.period)
    gain = max(float(np.linalg.norm(np.atleast_2d(job.sampled.controller(z)), 2)) for z in turns)
    spin = float(job.disturbance.attrs.get("spin", 0.0)) / (2 * math.pi)
    points = paragraphs(
        "assumptions",
        job=job,
        h=h,
        actuator_loss=ACTUATOR_LOSS,
        stiffness_error=STIFFNESS_ERROR,
        modelled_hz=job.axis.problem.upper_mode_hz,
        crossover_hz=crossover,
        spillover_limit=1e6 / gain,
        spin_hz=spin,
        # T at the spindle's speed: how far the brush follows an error of the measurement
        following=float(abs(np.atleast_2d(job.loop.T(np.exp(2j * np.pi * spin * h.period)))[0, 0])),
        largest_force=max(float(np.abs(u).max()) for u in controls),
        clipped=max(float(u.attrs["at_limit"]) for u in controls),
    )
    survived = tuple((what, c.valid, c.achieved, c.bound) for what, c in job.survived.items())
    caption = "The same code on other machines, x and y, certified between samples"
    head = ("machine", "proven", "norm [m/N]", "proven below [m/N]")
    return Section("What could go wrong", tables=(Table(caption, head, survived),), points=points)


def z_deviation_section(job: BuildableBrushDesign) -> Section:
    """Explain z, where a percentage of the largest deviation tells little."""
    deviation = job.comparison.table["deviation"].sel(signal="z")
    first, last = (str(deviation["row"].values[i]) for i in (0, -1))
    without, ideal = float(deviation.sel(row=first)), float(deviation.sel(row=last))
    text = paragraphs(
        "z",
        job=job,
        static_nm=abs(job.static_deflection) * 1e9,
        without_nm=without * 1e9,
        ideal_nm=ideal * 1e9,
        gain_percent=100 * (1 - ideal / without) if without else math.nan,
        half_period_us=0.5e6 / (job.parameters.natural_frequencies()["z"][1] / (2 * math.pi)),
    )
    responses = {row: job.comparison.responses[row] for row in (first, last)}
    return Section("Why z is left alone", text, (panels("z without control.", responses, ("z",)),))


def actuator_forces_section(job: BuildableBrushDesign) -> Section:
    """Show the forces of the actuators."""
    controls, noise = job.plant.control_names, job.noise_effort
    rows = tuple(
        (*_sizes(job.run, name), noise[name], 100 * float(job.run[name].attrs["at_limit"]))
        for name in controls
    )
    head = ("control", "largest [N]", "RMS [N]", "by noise, RMS [N]", "samples at the limit [%]")
    responses = {"with control": job.comparison.responses["with control"]}
    pictures = (panels("Forces of the actuators.", responses, controls),)
    return Section(
        "Effort", (job.design.message,), pictures, (Table("Control effort", head, rows),)
    )


def _sizes(data: xr.Dataset, name: str) -> tuple[str, float, float]:
    """Return a signal's name, its largest absolute value and its root mean square."""
    return name, float(np.abs(data[name]).max()), float(np.sqrt((data[name] ** 2).mean()))


def buildable_summary(job: BuildableBrushDesign) -> dict[str, object]:
    """Return the figures of what is to be built for other programs."""
    survived = job.survived.items()
    figures = ("valid", "stable", "achieved", "bound", "period", "delay", "spectral_radius")
    sampled = _attributes(job.sampled.certificate, *figures)
    return {
        "hardware": {name: value for name, value, _, _ in job.hardware.table()},
        "good": job.good,
        "sampled": {**sampled, "largest_period": job.largest_period},
        "loop": job.loop.to_dict(),
        "words": job.loop.explain(),
        "ideal_delay_margin_s": job.ideal_loop.delay_margin,
        "survived": {what: _attributes(found, "valid", "achieved") for what, found in survived},
        "slowest_actuator_hz": job.slowest_actuator_hz,
        "largest_force": {n: float(np.abs(job.run[n]).max()) for n in job.plant.control_names},
        "noise_force_rms": job.noise_effort,
        "static_deflection_z": job.static_deflection,
        "limits": [dict(vars(row)) for row in job.limits],
    }


def _attributes(found: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(found, name) for name in names}


# The report and the files of a design against the brush.

AXES = ("x", "y", "z")


def brush_design_report(job: BrushDesign) -> Report:
    """Tell what was gained, at what effort, and why it can be trusted."""
    built = isinstance(job, BuildableBrushDesign)
    kinds: tuple[Any, ...] = (
        (buildability_section, assumptions_section, z_deviation_section, actuator_forces_section)
        if built
        else (_effort,)
    )
    sections = [part(job) for part in (_brush_gain, *kinds, _certificate, _load, _machine)]
    return Report("Controller for the polishing robot", job.verdict(), job.good, tuple(sections))


def brush_design_text(job: BrushDesign) -> str:
    """Return what a terminal shows."""
    words, parts = [job.verdict()], [str(job.comparison)]
    if isinstance(job, BuildableBrushDesign):
        words.append(job.loop.explain())
        parts += ["", as_text(Card("", (*job.tables(), hardware_limits_table(job))))]
    words.append(job.design.message)
    return "\n".join([*parts, "", *(textwrap.fill(text, 88) for text in words)])


def brush_design_summary(job: BrushDesign) -> dict[str, Any]:
    """Return the figures for other programs."""
    certificate, table, units = job.design.certificate, job.comparison.table, job.plant.units
    built, controls = isinstance(job, BuildableBrushDesign), job.plant.control_names
    figures = ("achieved", "claimed", "bound", "largest_gain", "frequencies_hz", "damping")

    def by_axis(figure: str, row: Any) -> dict[str, Any]:
        return dict(zip(AXES, table[figure].sel(row=row).values, strict=True))

    return {
        "realisation": "buildable" if built else "ideal",
        **_attributes(job.design, "status", "message", "method", "backend"),
        "norm": {
            "kind": job.design.norm,
            "open_loop": float(job.open_loop_norm),
            "closed_loop": float(job.closed_loop_norm),
        },
        **_attributes(job, "control_weight", "gain_bound"),
        "certificate": {
            "valid": certificate.valid,
            "reasons": list(certificate.reasons),
            **_attributes(certificate, "stable", *figures),
        },
        "gain": None if job.design.gain is None else job.design.controller.D,
        "controls": controls,
        "states": job.plant.states,
        "load": job.comparison.load,
        "units": {
            "deviation": {axis: units[axis] for axis in AXES},
            "improvement_percent": "%",
            "effort": ", ".join(sorted({units[name] for name in controls})),
            "controls": {name: units[name] for name in controls},
            "states": {name: units.get(name, "") for name in job.plant.states},
        },
        "rows": [
            {
                "row": str(row),
                "deviation": by_axis("deviation", row),
                "improvement_percent": by_axis("improvement", row),
                "effort": float(table["effort"].sel(row=row)),
            }
            for row in table["row"].values
        ],
        **({"built": buildable_summary(job)} if isinstance(job, BuildableBrushDesign) else {}),
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
        gain = pd.DataFrame(job.design.controller.D, job.plant.control_names, job.plant.states)
        gain.to_csv(folder / "gain.csv", index_label="u = F x")
    _save_figure(plot_panels(job.comparison.responses, AXES), folder)
    job.disturbance.to_netcdf(folder / "disturbance.nc")
    for row, response in job.comparison.responses.items():
        name = row.replace(" ", "-").replace("'", "")
        response.to_netcdf(folder / f"response-{name}.nc")


def _save_figure(figure: Any, folder: Path) -> None:
    figure.savefig(folder / "figure.png", dpi=150)
    plt.close(figure)


def _brush_gain(job: BrushDesign) -> Section:
    header, body = job.comparison.shown_rows()
    text = f"The brush's forces drive all loops from rest; {job.comparison.load}."
    caption = "Deviation of the brush, without and with control."
    pictures = (panels(caption, job.comparison.responses, AXES),)
    tables = (Table("Largest deviations", header, tuple(body)),)
    return Section("What was gained", (text,), pictures, tables)


def _effort(job: BrushDesign) -> Section:
    response, names = job.comparison.responses["with control"], job.plant.control_names
    controls = tuple(name for name in names if not name.endswith("_m"))
    unit = job.plant.units[controls[0]]
    gain = np.linalg.norm(job.design.controller.D, 2)
    text = paragraphs("effort", job=job, unit=unit, largest_gain=gain)
    pictures = (panels("Control at the brush.", {"control": response}, controls),)
    head = ("control", f"largest [{unit}]", f"RMS [{unit}]")
    rows = tuple(_sizes(response, name) for name in names)
    return Section("Effort and price", text, pictures, (Table("Control effort", head, rows),))


def _certificate(job: BrushDesign) -> Section:
    c, tables = job.design.certificate, []
    counted = "the price on u"
    if isinstance(job, BuildableBrushDesign):
        counted, s = "the sensors' noise", job.sampled.certificate
        rows = (
            ("proven stable, between samples too", s.valid),
            ("induced L2 norm, proven to be at least", s.lower),
            ("induced L2 norm, proven to be at most", s.bound),
            ("largest pole from sample to sample", s.spectral_radius),
            ("period [s]", s.period),
            ("computation delay [s]", s.delay),
            ("states of the controller", job.sampled.controller.nstates),
        )
        caption = "The sampled loop of x, y and z"
        tables.append(Table(caption, ("quantity", "value"), rows, digits=6))
    facts = (
        ("status of the design", job.design.status),
        ("all poles stable", "yes" if c.stable else "no"),
        (f"norm achieved by the loop, {counted} included", c.achieved),
        ("norm claimed by the solver", math.nan if c.claimed is None else c.claimed),
        ("norm proven as an upper bound", c.bound),
        ("largest entry of the gain", c.largest_gain),
    )
    # Pairs, equal axes and delays repeat poles: once each, as the table rounds them.
    poles = zip(c.frequencies_hz, c.damping, np.real(c.poles), strict=True)
    modes = Counter(
        tuple(float(f"{x:.4g}") for x in pole) for pole in sorted(poles, key=lambda pole: pole[0])
    )
    head = ("frequency [Hz]", "damping ratio", "real part [1/s]", "poles")
    tables += [
        Table("What was checked", ("quantity", "value"), facts, digits=6),
        Table("Closed-loop poles", head, tuple((*mode, n) for mode, n in modes.items())),
    ]
    pictures = (
        picture(f"Gain from the forces to the outputs, {counted} included.", job.design.plot),
        picture("Poles of the closed loop.", job.design.plot_poles),
    )
    text = (*paragraphs("certificate"), *c.reasons)
    return Section("Certificate", text, pictures, tuple(tables))


def _load(job: BrushDesign) -> Section:
    load = job.disturbance
    largest = tuple((*_sizes(load, name)[:2], float(load[name].mean())) for name in FORCES)
    forces = panels("Forces of the brush on the tool.", {"force": load}, FORCES[:3])
    text = f"Simulated by the brush model '{load.attrs.get('simulator', '')}'."
    head = ("force", "largest [N]", "mean [N]")
    return Section("Load", (text,), (forces,), (Table("Forces", head, largest),))


def _machine(job: BrushDesign) -> Section:
    head, parameters = ("value", "unit", "source"), tuple(job.parameters.table())
    tables = [Table("Parameters", ("parameter", *head), parameters)]
    if isinstance(job, BuildableBrushDesign):
        tables.insert(0, Table("Hardware", ("part", *head), tuple(job.hardware.table())))
    return Section("Machine", tables=tuple(tables))


# The report of a diagnosis: where the model failed, what is missing, how much, what to check.

_NUMBERS = ("parameter", "value", "standard error", "unit")
_GOOD = ("adequate", "parameters", "missing_effect")


def diagnosis_report(
    diagnosis: Diagnosis,
    before: Comparison | None = None,
    after: Comparison | None = None,
    *,
    runs: Sequence[StepRun] = (),
    experiments: Sequence[ToldApart] = (),
) -> Report:
    """Tell what a model lacks: the verdict, then where, which, how much, and what to check.

    Parameters
    ----------
    diagnosis : Diagnosis
    before, after : Comparison, optional
        The model as it was, and as it is now, held against the data; those of `runs` by default.
    runs : sequence of StepRun, optional
        The model of every step held against the data, of
        :func:`robustpolish.identification.step_runs`.
    experiments : sequence of ToldApart, optional
        Experiments for effects that the data cannot tell apart, of
        :func:`robustpolish.tell_apart`.

    Returns
    -------
    Report
    """
    if runs:
        before, after = before or runs[0].after, after or runs[-1].after
    numbers = [(key, v.value, _known(v.stderr), v.unit) for key, v in diagnosis.parameters.items()]
    sections = [
        _section("Look at the record and the numbers first", points=diagnosis.notes),
        _where(diagnosis, before),
        _which(diagnosis),
        _how_much(diagnosis, after),
        _steps(runs),
        _missing_force_section(diagnosis),
        _checks(diagnosis),
        _experiments_section(experiments),
        _candidates(diagnosis),
        _section("All fitted numbers", tables=[Table("", _NUMBERS, tuple(numbers))]),
    ]
    title = f"Diagnosis of {diagnosis.model.name or 'a mechanical model'}"
    verdict, good = " ".join([headline(diagnosis), *diagnosis.reasons]), diagnosis.verdict in _GOOD
    return Report(title, verdict, good, tuple(filter(None, sections)))


def _section(title: str, *parts: Iterable[Any], **named: Iterable[Any]) -> Section | None:
    """Return a section of text, pictures, tables and points, or None if it would be empty."""
    named |= dict(zip(("text", "pictures", "tables", "points"), parts, strict=False))
    return (
        Section(title, **{k: tuple(v) for k, v in named.items()}) if any(named.values()) else None
    )


def _where(diagnosis: Diagnosis, before: Comparison | None) -> Section | None:
    title = "Where the model failed"
    if before is None:
        return None
    try:
        analysis = residual_analysis(before)
    except InvalidInputError as error:
        return Section(title, (f"The error of the model as it was has no map. {error}",))
    head, *lines = analysis.explain().splitlines()
    # the shares are indented; what the tests say comes behind them
    shares = (line.strip() for line in takewhile(lambda line: line.startswith(" "), lines))
    ends = [set(effect.at) | {"ground"} for effect in diagnosis.effects]
    pictures = [picture(f"The error of {analysis.worst}, as the model was.", analysis.plot)]
    for name, place in analysis.places.items():
        # of the effects that were found, if their force was seen
        if any(set(place.at) <= at for at in ends) and place.surface["force"].notnull().any():
            draw = partial(analysis.plot_surface, place=name)
            pictures.append(picture(f"Force that the model lacked at {name}.", draw))
    return _section(title, [head], pictures, points=shares)


def _which(diagnosis: Diagnosis) -> Section | None:
    title = "Which effects were added"
    text, rows = [], []
    for effect in diagnosis.effects:
        kind, place = effect.definition, ", ".join(effect.at)
        text.append(f"{kind.title} at {place}. In the residual: {kind.looks_like}")
        rows += [
            (effect.kind, place, name, v.value, v.stderr, v.unit)
            for name, v in shown_parameters(effect).items()
        ]
    pictures, points = [], []
    for law in diagnosis.laws if diagnosis.effects else ():
        points += law.describe().splitlines()
        place = ", ".join(law.effect.at)
        caption = f"The {law.quantity} over {law.over} at {place} as learned."
        pictures.append(picture(caption, law.plot))
    tables = [Table("", ("effect", "at", *_NUMBERS), tuple(rows))] if rows else []
    return _section(title, text or ["None."], pictures, tables, points)


def _how_much(diagnosis: Diagnosis, after: Comparison | None) -> Section | None:
    ledger, names = diagnosis.ledger, tuple(diagnosis.noise_floor)
    pictures = [
        picture(f"How the error of {name} fell.", partial(ledger.plot, output=name))
        for name in names
    ]
    text = []
    if after is not None:
        worst = max(after.outputs.values(), key=lambda error: error.nrmse)
        text = [f"The model now fits {after.fit_percent:.2f} % of the data in a {after.method}."]
        caption = f"{worst.name} as measured and as the extended model makes it."
        pictures.append(picture(caption, after.plot))
    rows = [(e.step, *(e.nrmse[n] for n in names)) for e in ledger.entries]
    rows.append(("noise floor", *diagnosis.noise_floor.values()))
    table = Table("Free-run error over the standard deviation", ("step", *names), tuple(rows))
    return _section("How much of the error is gone", text, pictures, [table])


def _steps(runs: Sequence[StepRun]) -> Section | None:
    """Return free runs before and after each step that changed the model."""
    pictures, points = [], []
    for run in runs:
        if run.before is None:
            continue
        name, stretch = run.worst, run.stretch()
        what = "the refit of its own numbers" if run.step == "refit" else run.step
        caption = f"{name} as measured, and in a {run.after.method} before and after {what}."
        if stretch is not None:
            part = f"{stretch.start:.4g} to {stretch.stop:.4g} s"
            caption += f" Where it did most, {part}; below, the whole record."
        pictures.append(whole(caption, lambda width, r=run: r.plot_panels(width=width)))
        old, new = run.before.outputs[name], run.after.outputs[name]
        fall = f"from {old.rmse:.4g} to {new.rmse:.4g} {new.unit}"
        points.append(f"{run.step}: the error of {name} goes {fall}.")
    return _section("Step by step", (), pictures, points=points)


def _missing_force_section(diagnosis: Diagnosis) -> Section | None:
    """Return the force that is still missing, over time and over the motion, whatever was found."""
    if not diagnosis.missing_force.size:
        return None
    text = [
        "A force that follows from displacement and velocity at a place is a law that the model "
        "still lacks there; one that does not is noise, has a memory, or acts elsewhere."
    ]
    if diagnosis.maps and diagnosis.maps[0].follows < MAP_TELLS:
        text.append("Here the motion foretells next to nothing of what is left.")
    shown = {"each site": diagnosis.plot_missing_force}
    shown |= {item.name: item.plot for item in diagnosis.maps[:MAPS_SHOWN]}
    pictures = [
        picture(f"Force that is still missing at {at}.", draw) for at, draw in shown.items()
    ]
    return _section("What is left", text, pictures, points=[m.describe() for m in diagnosis.maps])


def _experiments_section(experiments: Sequence[ToldApart]) -> Section | None:
    """Return the experiments that would tell effects apart."""
    text, pictures, tables = [], [], []
    for found in experiments:
        names = " or ".join(found.machines.names)
        text.append(" ".join(found.explain().splitlines()))
        if found.tried:
            caption = f"{names}: the experiment that tells most for its amplitude."
            pictures += [
                whole(caption, lambda width, f=found: f.plot_panels(width=width)),
                picture(f"{names}: how far experiments take them apart.", found.plot),
            ]
            tables.append(found.table(names))
    title = "Which experiment would tell alike effects apart"
    return _section(title, text, pictures, tables)


def _checks(diagnosis: Diagnosis) -> Section | None:
    points = [
        f"{effect.definition.title} at {', '.join(effect.at)}: {check}"
        for effect in diagnosis.effects
        for check in effect.definition.checks
    ]
    text = [] if points else ["Nothing was found that could be checked on the machine."]
    alike = diagnosis.indistinguishable
    rows = tuple((str(c.first), str(c.second), c.experiment) for c in alike)
    table = Table("What this data cannot tell apart", ("effect", "or", "what would tell"), rows)
    return _section("What to check on the machine", text, (), [table] if alike else [], points)


def _candidates(diagnosis: Diagnosis) -> Section | None:
    if not diagnosis.candidates:
        return None
    rows = tuple(
        (c.step, str(c), _known(c.nrmse_held_out), c.score, c.sizes(), c.remark)
        for c in diagnosis.candidates
    )
    head = ("step", "effects", "held-out error", "score in nats", "sizes", "why not")
    text = ("What was tried, the best of each step first.",)
    return Section("Candidates", text, tables=(Table("", head, rows),))


def _known(value: float) -> float | None:
    """Return None for a number that was not found."""
    return value if math.isfinite(value) else None


# The report and the files of a design for any machine.


def machine_design_report(found: MachineDesign) -> Report:
    """Tell what was gained, whether it can be built, and why it can be trusted.

    Parameters
    ----------
    found : MachineDesign

    Returns
    -------
    Report
    """
    name, title = getattr(found.task.machine, "name", ""), "What was gained"
    analysis, c = found.analysis, found.design.certificate
    gain = Section(title, (found.design.message,))
    if found.channels:
        caption = "Largest gain from disturbances to outputs, without and with control."
        pictures = (picture(caption, found.plot),)
        gain = Section(title, (found.design.message,), pictures, found.tables()[:1])
    text = (analysis.explain(), *filter(None, [found.sampling]))
    pictures = (
        picture("The loops, each opened alone.", analysis.plot),
        picture(
            "Nyquist curves and the disks that they stay out of.",
            lambda ax: analysis.plot(ax, kind="nyquist"),
        ),
    )
    proof = f"Poles, norm and proof were computed from the closed loop: at most {c.bound:.6g}."
    sections = (
        gain,
        Section("Can it be built?", text, pictures, analysis.tables(), analysis.problems),
        Section("Why it can be trusted", (proof, *found.task.notes), points=c.reasons),
    )
    title = f"Controller for {name or 'a machine'}"
    return Report(title, found.verdict(), c.valid and analysis.buildable, sections)


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
    _save_figure(drawn.get_figure(), folder)
