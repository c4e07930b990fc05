"""The report of a diagnosis: where the model failed, what is missing, how much, what to check."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robustpolish.display import Table
from robustpolish.errors import InvalidInputError
from robustpolish.identification import (
    Comparison,
    ResidualAnalysis,
    StepRun,
    ToldApart,
    residual_analysis,
)
from robustpolish.identification.findings.diagnosis import Diagnosis
from robustpolish.identification.findings.words import headline, told_numbers
from robustpolish.identification.residuals.force_maps import MAPS
from robustpolish.report.document import Report, Section
from robustpolish.report.pictures import picture, whole

_GOOD = ("adequate", "parameters", "missing_effect")


def diagnosis_report(
    diagnosis: Diagnosis,
    before: Comparison | None = None,
    after: Comparison | None = None,
    *,
    runs: Sequence[StepRun] = (),
    told: Sequence[ToldApart] = (),
) -> Report:
    """Tell what a model lacks: the verdict, then where, which, how much, and what to check.

    Parameters
    ----------
    diagnosis : Diagnosis
    before, after : Comparison, optional
        The model as it was, and as it is now, held against the data; those of `runs` by default.
    runs : sequence of StepRun, optional
        The model of every step held against the data, of :func:`robustpolish.step_runs`.
    told : sequence of ToldApart, optional
        Experiments for effects that the data cannot tell apart, of
        :func:`robustpolish.tell_apart`.

    Returns
    -------
    Report
    """
    if runs:
        before, after = before or runs[0].after, after or runs[-1].after
    sections = [
        _notes(diagnosis),
        _where(diagnosis, before),
        _which(diagnosis),
        _how_much(diagnosis, after),
        _steps(runs),
        _left(diagnosis),
        _checks(diagnosis),
        _apart(told),
        _candidates(diagnosis),
        _numbers(diagnosis),
    ]
    return Report(
        title=f"Diagnosis of {diagnosis.model.name or 'a mechanical model'}",
        verdict=" ".join([headline(diagnosis), *diagnosis.reasons]),
        good=diagnosis.verdict in _GOOD,
        sections=tuple(section for section in sections if section is not None),
    )


def _notes(diagnosis: Diagnosis) -> Section | None:
    """Return what an engineer would look at before believing the rest."""
    if not diagnosis.notes:
        return None
    return Section("Look at the record and the numbers first", points=diagnosis.notes)


def _where(diagnosis: Diagnosis, before: Comparison | None) -> Section | None:
    title = "Where the model failed"
    if before is None:
        return None
    try:
        analysis = residual_analysis(before)
    except InvalidInputError as error:
        return Section(title, (f"The error of the model as it was has no map. {error}",))
    head, *lines = analysis.explain().splitlines()
    shares = [line.strip() for line in lines[: lines.index(_tests(lines))]]
    pictures = [
        picture(f"The error of {analysis.worst}, as the model was.", analysis.plot),
        *(
            picture(
                f"Force that the model lacked at {place}.",
                lambda axes, p=place: analysis.plot_surface(axes, place=p),
            )
            for place in _places(diagnosis, analysis)
        ),
    ]
    return Section(title, (head,), tuple(pictures), points=tuple(shares))


def _tests(lines: list[str]) -> str:
    return next(line for line in lines if not line.startswith(" "))


def _places(diagnosis: Diagnosis, analysis: ResidualAnalysis) -> list[str]:
    """Return the places of the effects that were found, if their force was seen."""
    ends = [set(effect.at) | {"ground"} for effect in diagnosis.effects]
    return [
        name
        for name, place in analysis.places.items()
        if any(set(place.at) <= at for at in ends) and place.surface["force"].notnull().any()
    ]


def _which(diagnosis: Diagnosis) -> Section:
    title = "Which effects were added"
    if not diagnosis.effects:
        return Section(title, ("None.",))
    text, rows = [], []
    for effect in diagnosis.effects:
        kind = effect.definition
        place = ", ".join(effect.at)
        text.append(f"{kind.title} at {place}. In the residual: {kind.looks_like}")
        rows += [
            (effect.kind, place, name, v.value, v.stderr, v.unit)
            for name, v in told_numbers(effect).items()
        ]
    pictures, points = [], []
    for law in diagnosis.laws:
        place = ", ".join(law.effect.at)
        points += law.describe().splitlines()
        pictures.append(
            picture(f"The {law.quantity} over {law.over} at {place} as learned.", law.plot)
        )
    head = ("effect", "at", "parameter", "value", "standard error", "unit")
    tables = (Table("", head, tuple(rows)),) if rows else ()
    return Section(title, tuple(text), tuple(pictures), tables, tuple(points))


def _how_much(diagnosis: Diagnosis, after: Comparison | None) -> Section:
    ledger = diagnosis.ledger
    pictures = [
        picture(f"How the error of {name} fell.", lambda axes, n=name: ledger.plot(axes, output=n))
        for name in diagnosis.noise_floor
    ]
    text = ()
    if after is not None:
        worst = max(after.outputs.values(), key=lambda error: error.nrmse)
        text = (f"The model now fits {after.fit_percent:.2f} % of the data in a {after.method}.",)
        caption = f"{worst.name} as measured and as the extended model makes it."
        pictures.append(picture(caption, after.plot))
    names = tuple(diagnosis.noise_floor)
    rows = [(e.step, *(e.nrmse[n] for n in names)) for e in ledger.entries]
    rows.append(("noise floor", *diagnosis.noise_floor.values()))
    table = Table("Free-run error over the standard deviation", ("step", *names), tuple(rows))
    return Section("How much of the error is gone", text, tuple(pictures), (table,))


def _steps(runs: Sequence[StepRun]) -> Section | None:
    """Return free runs before and after each step that changed the model."""
    pictures, points = [], []
    for run in runs:
        if run.before is None:
            continue
        name, stretch = run.worst, run.stretch()
        what = "the refit of its own numbers" if run.step == "refit" else run.step
        where = "" if stretch is None else (
            f" Where it did most, {stretch.start:.4g} to {stretch.stop:.4g} s; below, the whole "
            "record."
        )  # fmt: skip
        caption = f"{name} as measured, and in a {run.after.method} before and after {what}.{where}"
        pictures.append(whole(caption, lambda width, r=run: r.plot_panels(width=width)))
        old, new = run.before.outputs[name], run.after.outputs[name]
        fall = f"from {old.rmse:.4g} to {new.rmse:.4g} {new.unit}"
        points.append(f"{run.step}: the error of {name} goes {fall}.")
    return Section("Step by step", (), tuple(pictures), points=tuple(points)) if points else None


def _left(diagnosis: Diagnosis) -> Section | None:
    """Return the force that is still missing, over time and over the motion, whatever was found."""
    if not diagnosis.missing_force.size:
        return None
    text = [
        "A force that follows from displacement and velocity at a place is a law that the model "
        "still lacks there; one that does not is noise, has a memory, or acts elsewhere."
    ]
    if diagnosis.maps and diagnosis.maps[0].follows < MAPS.tells:
        text.append("Here the motion foretells next to nothing of what is left.")
    pictures = [
        picture("Force that is still missing at each site.", diagnosis.plot_missing_force),
        *(
            picture(f"Force that is still missing at {item.name}.", item.plot)
            for item in diagnosis.maps[: MAPS.shown]
        ),
    ]
    points = tuple(item.describe() for item in diagnosis.maps)
    return Section("What is left", tuple(text), tuple(pictures), points=points)


def _apart(told: Sequence[ToldApart]) -> Section | None:
    """Return the experiments that would tell effects apart."""
    if not told:
        return None
    text, pictures, tables = [], [], []
    for found in told:
        names = " or ".join(found.machines.names)
        text.append(" ".join(found.explain().splitlines()))
        if not found.tried:
            continue
        caption = f"{names}: the experiment that tells most for its amplitude."
        pictures += [
            whole(caption, lambda width, f=found: f.plot_panels(width=width)),
            picture(f"{names}: how far experiments take them apart.", found.plot),
        ]
        tables.append(found.table(names))
    title = "Which experiment would tell alike effects apart"
    return Section(title, tuple(text), tuple(pictures), tuple(tables))


def _checks(diagnosis: Diagnosis) -> Section:
    points = [
        f"{effect.definition.title} at {', '.join(effect.at)}: {check}"
        for effect in diagnosis.effects
        for check in effect.definition.checks
    ]
    tables = ()
    text = () if points else ("Nothing was found that could be checked on the machine.",)
    if diagnosis.indistinguishable:
        rows = tuple(
            (str(c.first), str(c.second), c.experiment) for c in diagnosis.indistinguishable
        )
        head = ("effect", "or", "what would tell")
        tables = (Table("What this data cannot tell apart", head, rows),)
    return Section("What to check on the machine", text, (), tables, tuple(points))


def _candidates(diagnosis: Diagnosis) -> Section | None:
    if not diagnosis.candidates:
        return None
    rows = tuple(
        (c.step, c.kind, ", ".join(c.at), _known(c.nrmse_held_out), c.score, c.remark)
        for c in diagnosis.candidates
    )
    head = ("step", "effect", "at", "held-out error", "log odds", "remark")
    text = ("What was tried, the best of each step first.",)
    return Section("Candidates", text, tables=(Table("", head, rows),))


def _numbers(diagnosis: Diagnosis) -> Section:
    rows = tuple(
        (key, v.value, _known(v.stderr), v.unit) for key, v in diagnosis.parameters.items()
    )
    head = ("parameter", "value", "standard error", "unit")
    return Section("All fitted numbers", tables=(Table("", head, rows),))


def _known(value: float) -> float | None:
    """Return None for a number that was not found."""
    return value if math.isfinite(value) else None
