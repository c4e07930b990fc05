"""Findings in files: the model as TOML inside, numbers and missing force beside it."""

from __future__ import annotations

from typing import Any

import xarray as xr

from robustpolish.effects import Effect, EffectKind, lookup, own_kind, own_table
from robustpolish.identification.findings.findings import (
    Confusion,
    Findings,
    FoundEffect,
    RankedCandidate,
    Value,
)
from robustpolish.identification.findings.force_map import ForceMap
from robustpolish.identification.findings.ledger import Entry, Ledger
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.saved_file import Fields
from robustpolish.validation import described, invalid

VERDICTS = (
    "adequate", "parameters", "missing_effect", "partly_explained", "unknown_law", "unexplained",
)  # fmt: skip


def content(found: Findings) -> dict[str, Any]:
    """Return what stands in the file."""
    covariance = found.covariance
    return {
        "verdict": found.verdict,
        "reasons": list(found.reasons),
        "notes": list(found.notes),
        "reproducible": found.reproducible,
        "model": found.model.to_toml().splitlines(),
        "effects": [
            {**_what(e), "at": e.at, "parameters": _values(e.parameters)} for e in found.effects
        ],
        "candidates": [
            {
                **_what(c),
                "at": c.at,
                "nrmse_held_out": c.nrmse_held_out,
                "score": c.score,
                "step": c.step,
                "parameters": dict(c.parameters),
                "remark": c.remark,
            }
            for c in found.candidates
        ],
        "indistinguishable": [
            {"first": _place(c.first), "second": _place(c.second), "experiment": c.experiment}
            for c in found.indistinguishable
        ],
        "ledger": [
            {
                "step": e.step,
                "nrmse": dict(e.nrmse),
                "model": None if e.model is None else e.model.to_toml().splitlines(),
            }
            for e in found.ledger.entries
        ],
        "noise_floor": dict(found.noise_floor),
        "parameters": _values(found.parameters),
        "sites": found.sites,
        "time": found.time,
        "missing_force": found.missing_force,
        "maps": [_table_of(item) for item in found.maps],
        "covariance": None
        if covariance is None
        else {"keys": covariance["parameter"].values, "values": covariance.values},
    }


def findings_from(fields: Fields) -> Findings:
    """Return the findings in a file.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, or names an effect that is not in the catalogue.
    """
    sites = tuple(Fields({"at": site}, fields.where).texts("at") for site in fields.items("sites"))
    ledger = Ledger(
        tuple(
            Entry(e.text("step"), e.numbers("nrmse"), _model(e)) for e in fields.tables("ledger")
        ),
        fields.numbers("noise_floor"),
    )
    for e in ledger.entries:
        if set(e.nrmse) != set(ledger.entries[0].nrmse):
            shown = described(f"errors of {', '.join(e.nrmse) or 'nothing'} at {e.step!r}")
            remedy = "The file is damaged or was edited; save it again."
            raise invalid(f"{fields.where}: ledger", shown, "errors of the same outputs", remedy)
    return Findings(
        verdict=fields.text("verdict", VERDICTS),
        model=MechanicalModel.from_toml(_text(fields)),
        effects=tuple(
            FoundEffect(*_kind(e)[:2], _read_values(e.table("parameters")), _kind(e)[2])
            for e in fields.tables("effects")
        ),
        candidates=tuple(
            RankedCandidate(
                *_kind(c)[:2],
                nrmse_held_out=c.number("nrmse_held_out"),
                score=c.number("score"),
                step=c.whole("step"),
                parameters=c.numbers("parameters"),
                remark=c.text("remark"),
                own=_kind(c)[2],
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
        covariance=_covariance(fields),
        reasons=fields.texts("reasons"),
        reproducible=fields.truth("reproducible"),
        time=fields.array("time", None),
        notes=fields.texts("notes") if "notes" in fields else (),
        maps=tuple(map(_map, fields.tables("maps"))) if "maps" in fields else (),
    )


def _text(fields: Fields) -> str:
    return "\n".join(fields.texts("model")) + "\n"


def _model(entry: Fields) -> MechanicalModel | None:
    """Return the model after a step; files of older versions hold none."""
    if "model" not in entry or entry.raw("model") is None:
        return None
    return MechanicalModel.from_toml(_text(entry))


def _map(table: Fields) -> ForceMap:
    shape = table.array("displacement", None), table.array("velocity", None)
    grid = (table.array(key, *(axis.size for axis in shape)) for key in ("force", "samples"))
    units = table.texts("units")
    dims = ("displacement", "velocity")
    surface = xr.Dataset(
        {key: (dims, values) for key, values in zip(("force", "samples"), grid, strict=True)},
        dict(zip(dims, shape, strict=True)),
    )
    for key, unit in zip((*dims, "force"), units, strict=True):
        surface[key].attrs["units"] = unit
    first, second = table.texts("at")
    return ForceMap((first, second), surface, table.number("size"), table.number("follows"))


def _covariance(fields: Fields) -> xr.DataArray | None:
    """Return the covariance of the fitted numbers; files of older versions hold none."""
    if "covariance" not in fields or fields.raw("covariance") is None:
        return None
    table = fields.table("covariance")
    keys = list(table.texts("keys"))
    values = table.array("values", len(keys), len(keys))
    return xr.DataArray(values, {"parameter": keys, "other": keys}, ("parameter", "other"))


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
    return {**_what(effect), "at": effect.at, "parameters": dict(effect.parameters)}


def _effect(table: Fields) -> Effect:
    kind, at, own = _kind(table)
    return Effect(kind, at, table.numbers("parameters"), own)


def _table_of(item: ForceMap) -> dict[str, Any]:
    keys = ("displacement", "velocity", "force")
    return {
        "at": item.at,
        "size": item.size,
        "follows": item.follows,
        "units": [str(item.surface[key].attrs.get("units", "")) for key in keys],
        **{key: item.surface[key].values for key in (*keys, "samples")},
    }


def _what(item: Effect | FoundEffect | RankedCandidate) -> dict[str, Any]:
    """Return the kind by name, and what it is if no catalogue knows it."""
    table = None if item.own is None else own_table(item.own)
    return {"kind": item.kind} if table is None else {"kind": item.kind, "own": table}


def _kind(table: Fields) -> tuple[str, tuple[str, ...], EffectKind | None]:
    """Return the name, the place and the kind itself, if no catalogue knows it."""
    at = table.texts("at")
    if "own" in table:
        own = table.table("own")
        kind = own_kind({key: own.raw(key) for key in own})
    else:
        kind = lookup(table.text("kind"))
    return kind.kind, at, Effect.of(kind, at).own
