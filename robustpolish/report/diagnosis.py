"""The report of a diagnosis: what is missing, and the evidence."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from robustpolish.effects import lookup
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.report.document import Picture, Report, Section, Table

_GOOD = ("adequate", "parameters", "missing_effect")


def diagnosis_report(diagnosis: Diagnosis) -> Report:
    """Tell what a model lacks, how the error fell, and what to check on the machine."""
    sections = [_ledger(diagnosis), _effects(diagnosis), _candidates(diagnosis)]
    if diagnosis.indistinguishable:
        sections.append(_confusions(diagnosis))
    sections.append(_numbers(diagnosis))
    if diagnosis.missing_force.size:
        sections.append(_rest(diagnosis))
    return Report(
        title=f"Diagnosis of {diagnosis.model.name or 'a mechanical model'}",
        verdict=verdict(diagnosis),
        good=diagnosis.verdict in _GOOD,
        sections=tuple(sections),
    )


def verdict(diagnosis: Diagnosis) -> str:
    """Say in one or two sentences what was found."""
    named = " and ".join(
        f"{lookup(e.kind).title.lower()} at {', '.join(e.at)}" for e in diagnosis.effects
    )
    opening = {
        "adequate": "The model is adequate: what is left is noise.",
        "parameters": "No effect is missing; the model's numbers were refitted.",
        "missing_effect": f"The model lacked {named}.",
        "unexplained": "Something is missing that no effect of the catalogue explains.",
    }[diagnosis.verdict]
    return " ".join([opening, *diagnosis.reasons])


def _ledger(diagnosis: Diagnosis) -> Section:
    pictures = []
    for output in diagnosis.noise_floor:
        figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
        diagnosis.ledger.plot(output, axes)
        pictures.append(Picture(f"Fall of the error of {output}", figure))
        plt.close(figure)
    names = tuple(diagnosis.noise_floor)
    rows = [(e.step, *(e.nrmse[n] for n in names)) for e in diagnosis.ledger.entries]
    rows.append(("noise floor", *diagnosis.noise_floor.values()))
    table = Table("Free-run error over the standard deviation", ("step", *names), tuple(rows))
    return Section("The error ledger", (), tuple(pictures), (table,))


def _effects(diagnosis: Diagnosis) -> Section:
    text, rows = [], []
    for effect in diagnosis.effects:
        kind = lookup(effect.kind)
        place = ", ".join(effect.at)
        text.append(f"{kind.title} at {place}. In the residual: {kind.looks_like}")
        text += [f"Check: {check}" for check in kind.checks]
        rows += [
            (effect.kind, place, name, v.value, v.stderr, v.unit)
            for name, v in effect.parameters.items()
        ]
    if not rows:
        return Section("Effects that were added", ("None.",))
    head = ("effect", "at", "parameter", "value", "standard error", "unit")
    return Section("Effects that were added", tuple(text), (), (Table("", head, tuple(rows)),))


def _candidates(diagnosis: Diagnosis) -> Section:
    rows = tuple(
        (c.step, c.kind, ", ".join(c.at), c.nrmse_held_out if np.isfinite(c.nrmse_held_out)
         else float("nan"), c.score, c.remark)
        for c in diagnosis.candidates
    )  # fmt: skip
    head = ("step", "effect", "at", "held-out error", "log odds", "remark")
    return Section("Candidates", (), (), (Table("", head, rows),))


def _confusions(diagnosis: Diagnosis) -> Section:
    rows = tuple((str(c.first), str(c.second), c.experiment) for c in diagnosis.indistinguishable)
    table = Table("", ("effect", "or", "what would tell"), rows)
    return Section("What this data cannot tell apart", (), (), (table,))


def _numbers(diagnosis: Diagnosis) -> Section:
    rows = tuple((key, v.value, v.stderr, v.unit) for key, v in diagnosis.parameters.items())
    head = ("parameter", "value", "standard error", "unit")
    return Section("All fitted numbers", (), (), (Table("", head, rows),))


def _rest(diagnosis: Diagnosis) -> Section:
    figure: Figure
    figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
    samples = diagnosis.missing_force.shape[1]
    thin = max(1, samples // 4000)
    for site, force in zip(diagnosis.sites, diagnosis.missing_force, strict=True):
        axes.plot(np.arange(samples)[::thin], force[::thin], lw=0.7, label=", ".join(site))
    axes.set_xlabel("sample")
    axes.set_ylabel("force in N or N m")
    axes.legend()
    plt.close(figure)
    return Section("Force that is still missing", (), (Picture("", figure),))
