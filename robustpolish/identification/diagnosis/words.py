"""Report of a diagnosis as text."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping

from robustpolish.base.results import plus_minus
from robustpolish.identification.diagnosis.findings import (
    Findings,
    FoundEffect,
    Value,
    learned_laws_of,
)
from robustpolish.machines.effects.learned_law import LearnedLaw

_VERDICTS = {
    "adequate": "The model is adequate: what is left is noise.",
    "parameters": "Nothing is missing, but the model's numbers were wrong; they were refitted.",
    "missing_effect": "The model lacks a physical effect.",
    "partly_explained": "The model lacks physical effects; a part of the error is left.",
    "unknown_law": "The model lacks a force that no effect of the catalogue describes; it was "
    "learned as a curve.",
    "unexplained": "Something is missing that no effect of the catalogue explains.",
}

# Verdicts that leave more than noise.
_LEFT = ("partly_explained", "unknown_law", "unexplained")
_FAR = 3.0
"""Times the noise from which what is left is named beside what was found."""


def headline(found: Findings) -> str:
    """Return the verdict as a sentence, with the effects by name."""
    told = ("missing_effect", "partly_explained", "unknown_law")
    if found.effects and found.verdict in told:
        named = " and ".join(f"{e.definition.title} at {', '.join(e.at)}" for e in found.effects)
        if found.verdict == "unknown_law":
            return f"The model lacked a force that no catalogue describes: {named}."
        more = " Far more than noise is left." if _far_from_noise(found) else ""
        if found.verdict == "partly_explained":
            more = " And something else is missing."
        return f"The model lacked: {named}.{more}"
    return _VERDICTS[found.verdict]


def _far_from_noise(found: Findings) -> bool:
    """Return whether the error of the final model is several times the noise of a sensor."""
    floor, entries = found.noise_floor, found.ledger.entries
    left = entries[-1].nrmse if entries else {}
    return any(error > _FAR * floor[name] > 0 for name, error in left.items() if name in floor)


def explain(found: Findings) -> str:
    """Return the text of `Diagnosis.explain`."""
    lines = [headline(found), *found.reasons]
    if found.notes:
        lines += ["", "Look at the record and the numbers first:"]
        lines += [f"   {note}." if note[-1:].isalnum() else f"   {note}" for note in found.notes]
    for number, effect in enumerate(found.effects, 1):
        kind = effect.definition
        lines += ["", f"{number}. {kind.title} at {', '.join(effect.at)}"]
        law = learned_law_of(found, effect)
        if law is not None:
            lines += [f"   {line}" for line in law.describe().splitlines()]
        for name, v in shown_parameters(effect).items():
            lines.append(f"   {name} = {plus_minus(v.value, v.stderr)} {v.unit}")
        lines += _wrap(f"In the residual: {kind.looks_like}")
        lines += [line for check in kind.checks for line in _wrap(f"Check: {check}")]
        lines += [line for source in kind.references for line in _wrap(f"See {source}")]
    if found.maps and found.verdict in _LEFT:
        lines += ["", "What is left, where displacement and velocity foretell it best:"]
        lines += [f"   {item.describe()}" for item in found.maps[:2]]
    if found.ledger.entries:
        lines += ["", "Error of a free run over the standard deviation of each output:"]
        for entry in found.ledger.entries:
            shown = ", ".join(f"{k} {v:.3g}" for k, v in entry.nrmse.items())
            lines.append(f"   {entry.step}: {shown}")
        shown = ", ".join(f"{k} {v:.3g}" for k, v in found.noise_floor.items())
        lines.append(f"   noise floor: {shown}")
    if found.indistinguishable:
        lines += ["", "This data cannot tell apart:"]
        for c in found.indistinguishable:
            lines.append(f"   {c.first} and {c.second}. {c.experiment}")
    if not found.reproducible:
        lines += [
            "",
            "A free run is not reproducible: a tiny change of the start grows beyond the noise, "
            "so its error judges nothing. Runs led by the data were used instead.",
        ]
    return "\n".join(lines)


def _wrap(text: str) -> list[str]:
    """Return lines that no notebook and no terminal breaks in the middle of a word."""
    return textwrap.wrap(text, 88, initial_indent=" " * 3, subsequent_indent=" " * 6)


def learned_law_of(found: Findings, effect: FoundEffect) -> LearnedLaw | None:
    """Return the learned law that an effect is, None if it has a name."""
    laws = learned_laws_of(found.model, found.covariance)
    same = (law for law in laws if (law.effect.kind, law.effect.at) == (effect.kind, effect.at))
    return next(same, None)


def shown_parameters(effect: FoundEffect) -> Mapping[str, Value]:
    """Return the numbers that tell something about an effect: the coefficients of a law do not."""
    return {} if effect.definition.over else effect.parameters
