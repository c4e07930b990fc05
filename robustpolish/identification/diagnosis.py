"""The result of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.ledger import Ledger
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Value:
    """A fitted number with its standard error and unit."""

    value: float
    stderr: float
    unit: str


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added, with fitted parameters."""

    kind: str
    at: tuple[str, ...]
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class RankedCandidate:
    """An effect that was tried.

    Attributes
    ----------
    step : int
        1 when it was tried as the first effect, and so on.
    nrmse_held_out : float
        Error on held-out blocks over the deviation, the mean over the outputs.
    score : float
        Log odds from screening.
    remark : str
        Why it was not taken, if there is a reason.
    """

    kind: str
    at: tuple[str, ...]
    nrmse_held_out: float
    score: float
    step: int
    parameters: Mapping[str, float]
    remark: str = ""


@dataclass(frozen=True)
class Confusion:
    """Two effects that this data cannot tell apart, and an experiment that would."""

    first: Effect
    second: Effect
    experiment: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a model lacks.

    Attributes
    ----------
    verdict : str
        ``adequate``, ``parameters``, ``missing_effect`` or ``unexplained``.
    model : MechanicalModel
        The refitted model with the effects that were found.
    effects : tuple of FoundEffect
        In the order in which they were added.
    candidates : tuple of RankedCandidate
        Those of the first step first, the best first.
    indistinguishable : tuple of Confusion
    ledger : Ledger
    missing_force : ndarray, shape (sites, samples)
        Force that is still missing in the end, at each of `sites`.
    sites : tuple of tuple of str
    parameters : mapping
        All fitted numbers of the model.
    reasons : tuple of str
        Why this verdict.
    reproducible : bool
        Whether free runs of the model judge anything.
    """

    verdict: str
    model: MechanicalModel
    effects: tuple[FoundEffect, ...]
    candidates: tuple[RankedCandidate, ...]
    indistinguishable: tuple[Confusion, ...]
    ledger: Ledger
    missing_force: Array
    sites: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, Value] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    reproducible: bool = True

    @property
    def noise_floor(self) -> Mapping[str, float]:
        """Noise over each output's standard deviation."""
        return self.ledger.noise_floor

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as the command line writes it."""
        return {
            "verdict": self.verdict,
            "effects": [
                {
                    "kind": e.kind,
                    "at": list(e.at),
                    "parameters": {k: _plain(v) for k, v in e.parameters.items()},
                }
                for e in self.effects
            ],
            "candidates": [
                {
                    "kind": c.kind,
                    "at": list(c.at),
                    "nrmse_held_out": _number(c.nrmse_held_out),
                    "step": c.step,
                    "score": _number(c.score),
                    "remark": c.remark,
                }
                for c in self.candidates
            ],
            "indistinguishable": [
                [_place(c.first), _place(c.second)] for c in self.indistinguishable
            ],
            "experiments": [c.experiment for c in self.indistinguishable],
            "ledger": [
                {"step": e.step, "nrmse": {k: _number(v) for k, v in e.nrmse.items()}}
                for e in self.ledger.entries
            ],
            "noise_floor": {k: _number(v) for k, v in self.noise_floor.items()},
            "parameters": {k: _plain(v) for k, v in self.parameters.items()},
            "reasons": list(self.reasons),
            "free_run_reproducible": self.reproducible,
        }

    def explain(self) -> str:
        """Say in words what was found, why, and what to check on the machine."""
        from robustpolish.identification.explain import explain

        return explain(self)


def _plain(value: Value) -> dict[str, Any]:
    return {"value": _number(value.value), "stderr": _number(value.stderr), "unit": value.unit}


def _number(value: float) -> float | None:
    """JSON has no infinity: what is not known is null."""
    return float(value) if np.isfinite(value) else None


def _place(effect: Effect) -> dict[str, Any]:
    return {"kind": effect.kind, "at": list(effect.at)}
