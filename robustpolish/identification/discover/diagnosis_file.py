"""Diagnoses in files: the model as TOML inside, numbers and missing force beside it."""

from __future__ import annotations

import os
from typing import Any

from robustpolish.effects import Effect, lookup
from robustpolish.identification.discover.diagnosis import (
    Confusion,
    Diagnosis,
    FoundEffect,
    RankedCandidate,
    Value,
)
from robustpolish.identification.discover.ledger import Entry, Ledger
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.saved_file import Fields, read_saved, write_saved

VERDICTS = ("adequate", "parameters", "missing_effect", "unexplained")


def save_diagnosis(diagnosis: Diagnosis, path: str | os.PathLike[str], force: bool = False) -> None:
    """Write a diagnosis; see :meth:`Diagnosis.save`."""
    content = {
        "verdict": diagnosis.verdict,
        "reasons": list(diagnosis.reasons),
        "reproducible": diagnosis.reproducible,
        "model": diagnosis.model.to_toml().splitlines(),
        "effects": [
            {"kind": e.kind, "at": e.at, "parameters": _values(e.parameters)}
            for e in diagnosis.effects
        ],
        "candidates": [
            {
                "kind": c.kind,
                "at": c.at,
                "nrmse_held_out": c.nrmse_held_out,
                "score": c.score,
                "step": c.step,
                "parameters": dict(c.parameters),
                "remark": c.remark,
            }
            for c in diagnosis.candidates
        ],
        "indistinguishable": [
            {"first": _place(c.first), "second": _place(c.second), "experiment": c.experiment}
            for c in diagnosis.indistinguishable
        ],
        "ledger": [{"step": e.step, "nrmse": dict(e.nrmse)} for e in diagnosis.ledger.entries],
        "noise_floor": dict(diagnosis.noise_floor),
        "parameters": _values(diagnosis.parameters),
        "sites": diagnosis.sites,
        "time": diagnosis.time,
        "missing_force": diagnosis.missing_force,
    }
    write_saved(path, "diagnosis", content, force)


def diagnosis_from(fields: Fields) -> Diagnosis:
    """Return the diagnosis in a file.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, or names an effect that is not in the catalogue.
    """
    sites = tuple(Fields({"at": site}, fields.where).texts("at") for site in fields.items("sites"))
    ledger = Ledger(
        tuple(Entry(e.text("step"), e.numbers("nrmse")) for e in fields.tables("ledger")),
        fields.numbers("noise_floor"),
    )
    return Diagnosis(
        verdict=fields.text("verdict", VERDICTS),
        model=MechanicalModel.from_toml("\n".join(fields.texts("model")) + "\n"),
        effects=tuple(
            FoundEffect(_kind(e), e.texts("at"), _read_values(e.table("parameters")))
            for e in fields.tables("effects")
        ),
        candidates=tuple(
            RankedCandidate(
                kind=_kind(c),
                at=c.texts("at"),
                nrmse_held_out=c.number("nrmse_held_out"),
                score=c.number("score"),
                step=c.whole("step"),
                parameters=c.numbers("parameters"),
                remark=c.text("remark"),
            )
            for c in fields.tables("candidates")
        ),
        indistinguishable=tuple(
            Confusion(_effect(c.table("first")), _effect(c.table("second")), c.text("experiment"))
            for c in fields.tables("indistinguishable")
        ),
        ledger=ledger,
        missing_force=fields.array("missing_force", len(sites), None),
        sites=sites,
        parameters=_read_values(fields.table("parameters")),
        reasons=fields.texts("reasons"),
        reproducible=fields.truth("reproducible"),
        time=fields.array("time", None),
    )


def load_diagnosis(path: str | os.PathLike[str]) -> Diagnosis:
    """Read a diagnosis; see :meth:`Diagnosis.load`."""
    return diagnosis_from(read_saved(path, "diagnosis"))


def _values(values: Any) -> dict[str, Any]:
    return {
        key: {"value": v.value, "stderr": v.stderr, "unit": v.unit} for key, v in values.items()
    }


def _read_values(table: Fields) -> dict[str, Value]:
    found = {key: table.table(key) for key in table}
    return {
        key: Value(item.number("value"), item.number("stderr"), item.text("unit"))
        for key, item in found.items()
    }


def _place(effect: Effect) -> dict[str, Any]:
    return {"kind": effect.kind, "at": effect.at, "parameters": dict(effect.parameters)}


def _effect(table: Fields) -> Effect:
    return Effect(_kind(table), table.texts("at"), table.numbers("parameters"))


def _kind(table: Fields) -> str:
    return lookup(table.text("kind")).kind
