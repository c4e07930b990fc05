"""Result of a diagnosis: report in words, pictures, and its JSON file."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid
from robustpolish.base.results import Card, Displayed, Table, estimate, plus_minus, tables
from robustpolish.base.saved import Fields, read_saved, write_saved
from robustpolish.identification import findings
from robustpolish.identification.fit.result import Fitted
from robustpolish.machines.effects.effect import Effect, lookup
from robustpolish.machines.effects.learned_law import LearnedLaw
from robustpolish.machines.effects.user_defined import own_kind, own_table
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import UNITS
from robustpolish.plots.time import plot_time_series

# JSON files of findings: the model as TOML inside, numbers and missing force beside it.

_VERDICTS = tables(__file__)["verdicts"]
VERDICTS = tuple(_VERDICTS)
STATUSES = ("complete", "stopped")
_TRIED = ("nrmse_held_out", "step", "score", "remark")
"""What is told of a candidate beside its kind, its place and its numbers."""


def content(found: Diagnosis) -> dict[str, Any]:
    """Return what stands in the file."""
    covariance = found.covariance
    as_they_are = (
        "verdict", "reasons", "notes", "reproducible", "status", "sites", "time", "missing_force",
    )  # fmt: skip
    return {
        **{name: getattr(found, name) for name in as_they_are},
        "model": found.model.to_toml().splitlines(),
        "effects": [{**_what(e), "parameters": _values(e.parameters)} for e in found.effects],
        "candidates": [
            {
                **_place(c),
                **{name: getattr(c, name) for name in _TRIED},
                "beside": [_place(e) for e in c.beside],
            }
            for c in found.candidates
        ],
        "indistinguishable": [
            {"first": _place(c.first), "second": _place(c.second), "experiment": c.experiment}
            for c in found.indistinguishable
        ],
        "ledger": [
            {**vars(e), "model": None if e.model is None else e.model.to_toml().splitlines()}
            for e in found.ledger.entries
        ],
        "noise_floor": dict(found.noise_floor),
        "parameters": _values(found.parameters),
        "maps": [_table_of(item) for item in found.maps],
        "covariance": None
        if covariance is None
        else {"keys": covariance["parameter"].values, "values": covariance.values},
    }


def ledger_from(fields: Fields) -> findings.Ledger:
    """Return the errors of every step in a file."""
    ledger = findings.Ledger(
        tuple(
            findings.Entry(e.text("step"), e.numbers("nrmse"), _model(e))
            for e in fields.tables("ledger")
        ),
        fields.numbers("noise_floor"),
    )
    for e in ledger.entries:
        if set(e.nrmse) != set(ledger.entries[0].nrmse):
            shown = described(f"errors of {', '.join(e.nrmse) or 'nothing'} at {e.step!r}")
            remedy = "The file is damaged or was edited; save it again."
            raise invalid(f"{fields.where}: ledger", shown, "errors of the same outputs", remedy)
    return ledger


def diagnosis_from(fields: Fields) -> Diagnosis:
    """Return the diagnosis in a file.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, or names an effect that is not in the catalogue.
    """
    sites = tuple(Fields({"at": site}, fields.where).texts("at") for site in fields.items("sites"))
    return Diagnosis(
        verdict=fields.text("verdict", VERDICTS),
        model=MechanicalModel.from_toml(_text(fields)),
        effects=tuple(
            findings.FoundEffect(**_kind(e), parameters=_read_values(e.table("parameters")))
            for e in fields.tables("effects")
        ),
        candidates=tuple(
            findings.RankedCandidate(
                **_kind(c),
                nrmse_held_out=c.number("nrmse_held_out"),
                score=c.number("score"),
                step=c.whole("step"),
                parameters=c.numbers("parameters"),
                remark=c.text("remark"),
                beside=tuple(map(_effect, c.tables("beside"))) if "beside" in c else (),
            )
            for c in fields.tables("candidates")
        ),
        indistinguishable=tuple(
            findings.IndistinguishablePair(
                _effect(c.table("first")), _effect(c.table("second")), c.text("experiment")
            )
            for c in fields.tables("indistinguishable")
        ),
        ledger=ledger_from(fields),
        missing_force=fields.array("missing_force", len(sites), None),
        sites=sites,
        parameters=_read_values(fields.table("parameters")),
        covariance=_covariance(fields),
        reasons=fields.texts("reasons"),
        reproducible=fields.truth("reproducible"),
        time=fields.array("time", None),
        notes=fields.texts("notes") if "notes" in fields else (),
        maps=tuple(map(_map, fields.tables("maps"))) if "maps" in fields else (),
        status=fields.text("status", STATUSES) if "status" in fields else "complete",
    )


def _text(fields: Fields) -> str:
    return "\n".join(fields.texts("model")) + "\n"


def _model(entry: Fields) -> MechanicalModel | None:
    """Return the model after a step; files of older versions hold none."""
    if "model" not in entry or entry.raw("model") is None:
        return None
    return MechanicalModel.from_toml(_text(entry))


def _map(table: Fields) -> findings.ForceMap:
    dims, units = ("displacement", "velocity"), table.texts("units")
    axes = {dim: table.array(dim, None) for dim in dims}
    size = [axis.size for axis in axes.values()]
    cells = {key: (dims, table.array(key, *size)) for key in ("force", "samples")}
    surface = xr.Dataset(cells, axes)
    for key, unit in zip((*dims, "force"), units, strict=True):
        surface[key].attrs["units"] = unit
    first, second = table.texts("at")
    return findings.ForceMap(
        (first, second), surface, table.number("size"), table.number("follows")
    )


def _covariance(fields: Fields) -> xr.DataArray | None:
    """Return the covariance of the fitted numbers; files of older versions hold none."""
    if "covariance" not in fields or fields.raw("covariance") is None:
        return None
    table = fields.table("covariance")
    keys = list(table.texts("keys"))
    values = table.array("values", len(keys), len(keys))
    return xr.DataArray(values, {"parameter": keys, "other": keys}, ("parameter", "other"))


def _read_values(table: Fields) -> dict[str, findings.Value]:
    found = {key: table.table(key) for key in table}
    return {
        key: findings.Value(item.number("value"), item.number("stderr"), item.text("unit"))
        for key, item in found.items()
    }


def _place(effect: Effect | findings.RankedCandidate) -> dict[str, Any]:
    return {**_what(effect), "parameters": dict(effect.parameters)}


def _effect(table: Fields) -> Effect:
    return Effect(**_kind(table), parameters=table.numbers("parameters"))


def _table_of(item: findings.ForceMap) -> dict[str, Any]:
    keys = ("displacement", "velocity", "force")
    return {
        "at": item.at,
        "size": item.size,
        "follows": item.follows,
        "units": [str(item.surface[key].attrs.get("units", "")) for key in keys],
        **{key: item.surface[key].values for key in (*keys, "samples")},
    }


def _what(item: Effect | findings.FoundEffect | findings.RankedCandidate) -> dict[str, Any]:
    """Return the kind by name with its place, and what it is if no catalogue knows it."""
    own = {} if item.own is None else {"own": own_table(item.own)}
    return {"kind": item.kind, "at": item.at, **own}


def _kind(table: Fields) -> dict[str, Any]:
    """Return the name, the place and the kind itself, if no catalogue knows it."""
    at = table.texts("at")
    if "own" in table:
        own = table.table("own")
        kind = own_kind({key: own.raw(key) for key in own})
    else:
        kind = lookup(table.text("kind"))
    return {"kind": kind.kind, "at": at, "own": Effect.of(kind, at).own}


def _values(values: Mapping[str, findings.Value]) -> dict[str, dict[str, Any]]:
    """Return numbers with their standard errors and units."""
    return {key: dict(vars(value)) for key, value in values.items()}


def _finite(value: Any) -> Any:
    """Return plain data without infinity, which JSON has not: what is not known is null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return float(value) if np.isfinite(value) else None
    return value


def _kind_and_place(
    effect: Effect | findings.FoundEffect | findings.RankedCandidate,
) -> dict[str, Any]:
    return {"kind": effect.kind, "at": list(effect.at)}


# A diagnosis in words.

# Verdicts that leave more than noise.
_LEFT = ("partly_explained", "unknown_law", "unexplained")
_FAR = 3.0
"""Times the noise from which what is left is named beside what was found."""


def headline(found: Diagnosis) -> str:
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


def _far_from_noise(found: Diagnosis) -> bool:
    """Return whether the error of the final model is several times the noise of a sensor."""
    floor, entries = found.noise_floor, found.ledger.entries
    left = entries[-1].nrmse if entries else {}
    return any(error > _FAR * floor[name] > 0 for name, error in left.items() if name in floor)


def _wrap(text: str) -> list[str]:
    """Return lines that no notebook and no terminal breaks in the middle of a word."""
    return textwrap.wrap(text, 88, initial_indent=" " * 3, subsequent_indent=" " * 6)


def shown_parameters(effect: findings.FoundEffect) -> Mapping[str, findings.Value]:
    """Return the numbers that tell something about an effect: the coefficients of a law do not."""
    return {} if effect.definition.over else effect.parameters


# The result of a diagnosis.


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Fitted, Displayed):
    """Diagnosis of a model: the effects that it lacks, with their evidence.

    Attributes
    ----------
    verdict : str
        ``adequate``, ``parameters``, ``missing_effect``, ``partly_explained`` (what was found is
        there, and something else is missing), ``unknown_law`` (a force that no catalogue describes
        was learned, see `laws`) or ``unexplained``.
    model : MechanicalModel
        The refitted model with the effects that were found.
    effects : tuple of FoundEffect
        In the order in which they were added.
    candidates : tuple of RankedCandidate
        Those of the first step first, the best first.
    indistinguishable : tuple of IndistinguishablePair
    ledger : Ledger
    missing_force : ndarray, shape (sites, samples)
        Force that is still missing in the end, at each of `sites`.
    sites : tuple of tuple of str
    parameters : mapping
        All fitted numbers of the model.
    covariance : xarray.DataArray or None
        Covariance of these numbers, over their keys twice, in SI units.
    reasons : tuple of str
        Why this verdict.
    reproducible : bool
        Whether free runs of the model judge anything.
    time : ndarray, shape (samples,)
        When `missing_force` acts, in s.
    notes : tuple of str
        Remarks of the record, and what looks wrong: numbers that moved by decades, signs, units,
        clipped peaks.
    status : str
        ``complete``, or ``stopped`` before all was tried: the best so far.
    maps : tuple of ForceMap
        Force that is still missing in the end over displacement and velocity, whatever the
        verdict; the place first where the motion foretells most of it.

    Examples
    --------
    >>> import os, tempfile
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> diagnosis = rp.diagnose(model, data.isel(time=slice(0, 500)))
    >>> print(diagnosis.explain().splitlines()[0])
    The model lacked: Coulomb friction at x, ground.
    >>> diagnosis.to_dict()["effects"][0]["kind"]
    'coulomb_friction'
    >>> diagnosis.plot().get_ylabel(), diagnosis.plot_missing_force().get_xlabel()
    ('relative error of x', 'time [ms]')
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     diagnosis.save(os.path.join(folder, "slide.json"))
    ...     again = rp.results.Diagnosis.load(os.path.join(folder, "slide.json"))
    >>> again.effects == diagnosis.effects
    True
    """

    verdict: str
    model: MechanicalModel
    effects: tuple[findings.FoundEffect, ...]
    candidates: tuple[findings.RankedCandidate, ...]
    indistinguishable: tuple[findings.IndistinguishablePair, ...]
    ledger: findings.Ledger
    missing_force: Array
    sites: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, findings.Value] = field(default_factory=dict)
    covariance: xr.DataArray | None = None
    reasons: tuple[str, ...] = ()
    reproducible: bool = True
    time: Array = field(default_factory=lambda: np.zeros(0))
    notes: tuple[str, ...] = ()
    maps: tuple[findings.ForceMap, ...] = ()
    status: str = "complete"

    @property
    def noise_floor(self) -> Mapping[str, float]:
        """Noise over each output's standard deviation."""
        return self.ledger.noise_floor

    @property
    def laws(self) -> tuple[LearnedLaw, ...]:
        """The learned laws of the model, each with its curve, its words and its picture."""
        return findings.learned_laws_of(self.model, self.covariance)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as the command line writes it.

        Returns
        -------
        dict
        """
        told = {
            "verdict": self.verdict,
            "effects": [
                {**_kind_and_place(e), "parameters": _values(e.parameters)} for e in self.effects
            ],
            "laws": [
                {
                    **_kind_and_place(law.effect),
                    "words": law.describe().splitlines(),
                    "formula": None if law.formula() is None else str(law.formula()),
                }
                for law in self.laws
            ],
            "candidates": [
                {
                    **_kind_and_place(c),
                    **{name: getattr(c, name) for name in _TRIED},
                    "beside": [_kind_and_place(e) for e in c.beside],
                }
                for c in self.candidates
            ],
            "indistinguishable": [
                [_kind_and_place(c.first), _kind_and_place(c.second)]
                for c in self.indistinguishable
            ],
            "experiments": [c.experiment for c in self.indistinguishable],
            "ledger": self.ledger.to_list(),
            "noise_floor": dict(self.noise_floor),
            "parameters": _values(self.parameters),
            "reasons": list(self.reasons),
            "notes": list(self.notes),
            "missing_force": [
                {"at": list(m.at), "rms": m.size, "unit": m.unit, "follows": m.follows}
                for m in self.maps
            ],
            "free_run_reproducible": self.reproducible,
        }
        return _finite(told)

    def explain(self) -> str:
        """Say in words what was found, why, and what to check on the machine.

        Returns
        -------
        str
        """
        lines = [headline(self), *self.reasons]
        if self.notes:
            lines += ["", "Look at the record and the numbers first:"]
            lines += [f"   {note}." if note[-1:].isalnum() else f"   {note}" for note in self.notes]
        for number, effect in enumerate(self.effects, 1):
            kind = effect.definition
            lines += ["", f"{number}. {kind.title} at {', '.join(effect.at)}"]
            for law in self.laws:
                if (law.effect.kind, law.effect.at) == (effect.kind, effect.at):
                    lines += [f"   {line}" for line in law.describe().splitlines()]
            for name, v in shown_parameters(effect).items():
                lines.append(f"   {name} = {plus_minus(v.value, v.stderr)} {v.unit}")
            lines += _wrap(f"In the residual: {kind.looks_like}")
            lines += [line for check in kind.checks for line in _wrap(f"Check: {check}")]
            lines += [line for source in kind.references for line in _wrap(f"See {source}")]
        if self.maps and self.verdict in _LEFT:
            lines += ["", "What is left, where displacement and velocity foretell it best:"]
            lines += [f"   {item.describe()}" for item in self.maps[:2]]
        if self.ledger.entries:
            lines += ["", "Error of a free run over the standard deviation of each output:"]
            for entry in self.ledger.entries:
                shown = ", ".join(f"{k} {v:.3g}" for k, v in entry.nrmse.items())
                lines.append(f"   {entry.step}: {shown}")
            shown = ", ".join(f"{k} {v:.3g}" for k, v in self.noise_floor.items())
            lines.append(f"   noise floor: {shown}")
        if self.indistinguishable:
            lines += ["", "This data cannot tell apart:"]
            for c in self.indistinguishable:
                lines.append(f"   {c.first} and {c.second}. {c.experiment}")
        if not self.reproducible:
            lines += [
                "",
                "A free run is not reproducible: a tiny change of the start grows beyond the "
                "noise, so its error judges nothing. Runs led by the data were used instead.",
            ]
        return "\n".join(lines)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the diagnosis, its model included, to one JSON file, whole or not at all.

        Parameters
        ----------
        path : path
            Ends in ``.json``; its folder has to exist.
        force : bool, optional
            Replace an existing file.

        Raises
        ------
        InvalidInputError
            If the file exists and `force` is not set, or it cannot be written there.
        """
        write_saved(path, "diagnosis", content(self), force)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, max_bytes: float | None = None) -> Diagnosis:
        """Read a diagnosis from a file that :meth:`save` wrote.

        Parameters
        ----------
        path : path
        max_bytes : float, optional
            Largest size of the file in bytes, 2e8 by default.

        Returns
        -------
        Diagnosis

        Raises
        ------
        InvalidInputError
            If it is no such file; the message names the key that is wrong.
        """
        return diagnosis_from(read_saved(path, "diagnosis", max_bytes))

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw how the error of one output fell, as :meth:`Ledger.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The first by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return self.ledger.plot(ax, output=output)

    def plot_missing_force(self, ax: Axes | None = None) -> Axes:
        """Draw the force that is still missing in the end, at every site.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        time = self.time if self.time.size else np.arange(float(self.missing_force.shape[1]))
        signals = {
            " - ".join(site): xr.DataArray(
                force,
                {"time": time},
                "time",
                "missing force",
                {"units": UNITS[self.model.is_rotational(site)]["force"]},
            )
            for site, force in zip(self.sites, self.missing_force, strict=True)
        }
        return plot_time_series(signals, ax)

    def _card(self) -> Card:
        found = [
            (effect.kind, ", ".join(effect.at), name, *estimate(v.value, v.stderr), v.unit)
            for effect in self.effects
            for name, v in shown_parameters(effect).items()
        ]
        found += [
            (law.effect.kind, ", ".join(law.effect.at), f"largest {law.quantity}",
             float(abs(law.curve()[law.quantity]).max()), None, law.unit)
            for law in self.laws
        ]  # fmt: skip
        head = ("effect", "at", "parameter", "value", "standard error", "unit")
        tables = [Table("Added effects", head, tuple(found))] if found else []
        ledger = self.ledger._card()
        tables += [Table(ledger.title, t.columns, t.rows) for t in ledger.tables]
        return Card(headline(self), tuple(tables), (*self.reasons, *self.notes))
