"""The state of a search for missing effects, and how its errors are measured."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.discover.diagnosis import Confusion, RankedCandidate
from robustpolish.identification.discover.screening import Screening
from robustpolish.identification.fit.evaluation import free_errors
from robustpolish.identification.fit.homotopy import Stage
from robustpolish.identification.fit.prepared import Setting
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]


@dataclass
class Search:
    """What the search knows so far; `steps` are the entries of the ledger to come."""

    setting: Setting
    reference: MechanicalModel
    stage: Stage
    steps: list[tuple[str, MechanicalModel]]
    guided: MechanicalModel
    linear: Stage
    candidates: list[RankedCandidate] = field(default_factory=list)
    confusions: list[Confusion] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    screening: Screening | None = None


def whole_error(model: MechanicalModel, setting: Setting, steady: bool = True) -> Array:
    """Return the free-run error of each output over the whole record.

    A model whose long runs are not reproducible is run in windows.
    """
    pieces = setting.everything if steady else setting.windows
    errors = free_errors(
        model, pieces, setting.scales, setting.dt, setting.amplitude, setting.state_scale
    )
    rms = np.sqrt(np.mean(errors**2, axis=0))
    return np.where(np.isfinite(rms), rms, np.inf)


def by_output(model: MechanicalModel, values: Array, setting: Setting) -> dict[str, float]:
    """Return errors over the outputs' standard deviations, by name."""
    size = np.std(setting.record.Y, axis=0)
    return dict(zip(model.output_names, (values / size).tolist(), strict=True))


def steps(setting: Setting) -> int:
    """Return the most steps of a stage: short records can afford more."""
    return 15 if setting.record.samples < 4000 else 7
