"""The findings of a diagnosis, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.effects import Effect, EffectKind, lookup
from robustpolish.identification.findings.force_map import ForceMap
from robustpolish.identification.findings.ledger import Ledger
from robustpolish.models.mechanical import MechanicalModel


@dataclass(frozen=True)
class Value:
    """A fitted number with its standard error and unit."""

    value: float
    stderr: float
    unit: str


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added, with fitted parameters; `own` is its kind, if no catalogue's."""

    kind: str
    at: tuple[str, ...]
    parameters: Mapping[str, Value]
    own: EffectKind | None = None

    @property
    def definition(self) -> EffectKind:
        """The kind's description."""
        return self.own or lookup(self.kind)


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
    own : EffectKind or None
        Its kind, if no catalogue's.
    """

    kind: str
    at: tuple[str, ...]
    nrmse_held_out: float
    score: float
    step: int
    parameters: Mapping[str, float]
    remark: str = ""
    own: EffectKind | None = None


@dataclass(frozen=True)
class Confusion:
    """Two effects that this data cannot tell apart, and an experiment that would."""

    first: Effect
    second: Effect
    experiment: str


@dataclass(frozen=True, eq=False, repr=False)
class Findings:
    """What :class:`Diagnosis` tells, draws and saves; its attributes are described there."""

    verdict: str
    model: MechanicalModel
    effects: tuple[FoundEffect, ...]
    candidates: tuple[RankedCandidate, ...]
    indistinguishable: tuple[Confusion, ...]
    ledger: Ledger
    missing_force: Array
    sites: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, Value] = field(default_factory=dict)
    covariance: xr.DataArray | None = None
    reasons: tuple[str, ...] = ()
    reproducible: bool = True
    time: Array = field(default_factory=lambda: np.zeros(0))
    notes: tuple[str, ...] = ()
    maps: tuple[ForceMap, ...] = ()

    @property
    def noise_floor(self) -> Mapping[str, float]:
        """Noise over each output's standard deviation."""
        return self.ledger.noise_floor
