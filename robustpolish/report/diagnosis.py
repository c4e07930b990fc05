"""The report of a diagnosis: what is missing, and the evidence."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from robustpolish.display import Table
from robustpolish.effects import lookup
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.identification.explain import headline
from robustpolish.report.document import Picture, Report, Section

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
        verdict=" ".join([headline(diagnosis), *diagnosis.reasons]),
        good=diagnosis.verdict in _GOOD,
        sections=tuple(sections),
    )


def _ledger(diagnosis: Diagnosis) -> Section:
    pictures = []
    for output in diagnosis.noise_floor:
        figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
        diagnosis.ledger.plot(axes, output=output)
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
    figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
    diagnosis.plot_missing_force(axes)
    plt.close(figure)
    return Section("Force that is still missing", (), (Picture("At each site.", figure),))
