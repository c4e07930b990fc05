"""A diagnosis in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robustpolish.effects import lookup

if TYPE_CHECKING:
    from robustpolish.identification.discover.diagnosis import Diagnosis

_VERDICTS = {
    "adequate": "The model is adequate: what is left is noise.",
    "parameters": "Nothing is missing, but the model's numbers were wrong; they were refitted.",
    "missing_effect": "The model lacks a physical effect.",
    "unexplained": "Something is missing that no effect of the catalogue explains.",
}


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict as a sentence, with the effects by name."""
    if diagnosis.verdict == "missing_effect" and diagnosis.effects:
        named = " and ".join(
            f"{lookup(e.kind).title} at {', '.join(e.at)}" for e in diagnosis.effects
        )
        return f"The model lacked: {named}."
    return _VERDICTS[diagnosis.verdict]


def explain(diagnosis: Diagnosis) -> str:
    """Return the text of `Diagnosis.explain`."""
    lines = [headline(diagnosis), *diagnosis.reasons]
    for number, effect in enumerate(diagnosis.effects, 1):
        kind = lookup(effect.kind)
        lines += ["", f"{number}. {kind.title} at {', '.join(effect.at)}"]
        for name, v in effect.parameters.items():
            lines.append(f"   {name} = {v.value:.5g} +- {v.stderr:.2g} {v.unit}")
        lines += [f"   In the residual: {kind.looks_like}"]
        lines += [f"   Check: {check}" for check in kind.checks]
        lines += [f"   See {reference}" for reference in kind.references]
    if diagnosis.ledger.entries:
        lines += ["", "Error of a free run over the standard deviation of each output:"]
        for entry in diagnosis.ledger.entries:
            shown = ", ".join(f"{k} {v:.3g}" for k, v in entry.nrmse.items())
            lines.append(f"   {entry.step}: {shown}")
        shown = ", ".join(f"{k} {v:.3g}" for k, v in diagnosis.noise_floor.items())
        lines.append(f"   noise floor: {shown}")
    if diagnosis.indistinguishable:
        lines += ["", "This data cannot tell apart:"]
        for c in diagnosis.indistinguishable:
            lines.append(f"   {c.first} and {c.second}. {c.experiment}")
    if not diagnosis.reproducible:
        lines += [
            "",
            "A free run is not reproducible: a tiny change of the start grows beyond the noise, "
            "so its error judges nothing. Runs led by the data were used instead.",
        ]
    return "\n".join(lines)
