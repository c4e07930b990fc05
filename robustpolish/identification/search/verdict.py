"""What a search found, in words: structure in the residual, noise floor, and the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import coherence, welch

from robustpolish.base.arrays import Array
from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.policy import NEGLIGIBLE, STRONG
from robustpolish.identification.residual_tests import force_maps, residual_noise_floor
from robustpolish.identification.search.search import EffectSearch
from robustpolish.machines.mechanical.model import MechanicalModel

NEAR_NOISE = 1.5
"""Times the noise floor up to which a residual may be that noise."""
DRIVEN = 0.2
"""Share of the residual's power that follows linearly from inputs, or of the missing force's power
that follows from displacement and velocity, from which it is no noise."""
MATTERS = 0.05
"""Share of an output's deviation from which what is foretold of the rest is a missing part."""
EXPLAINED = 0.85
"""Share of the error's power above the noise that has to go for effects to be the whole answer."""
IMPROVED = 1.1
"""Times by which the error fell if the model's numbers were wrong."""
LOUDEST = 0.4
"""Noise over the deviation of an output from which nothing can be called noise."""
_SEGMENTS, _SHORTEST = 16, 32


def _counts(error: Array, size: Array) -> np.ndarray:
    """Return of which outputs the error is large enough to count, shape (ny,)."""
    return error >= NEGLIGIBLE * size


class FinalFit(NamedTuple):
    """A model fitted to the whole record, and its free-run error there, shape (ny,).

    A model that is not `predictable`, whose long runs are not reproducible, is run in windows.
    """

    fit: Fit
    error: Array
    predictable: bool

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        return self.fit.model


@dataclass(frozen=True, eq=False)
class Residual:
    """What a model leaves of a record.

    Attributes
    ----------
    error : ndarray, shape (ny,)
        Root mean square of each output.
    floor : ndarray, shape (ny,)
        Noise of each output, of the colour that the errors show; at most the error.
    sensor : ndarray, shape (ny,)
        Noise of each output that the record shows without any model.
    size : ndarray, shape (ny,)
        Deviation of each output.
    foretold : tuple of str
        Which parts of it the inputs or the motion foretell.
    matters : bool
        Whether one of these parts is large beside the output.
    """

    error: Array
    floor: Array
    sensor: Array
    size: Array
    foretold: tuple[str, ...]
    matters: bool

    @property
    def times(self) -> float:
        """Largest error over its floor, of those that are large enough to count; 0 without any."""
        counts = _counts(self.error, self.size)
        return float(np.max(np.where(counts, self.error / self.floor, 0.0)))

    @property
    def structure(self) -> tuple[str, ...]:
        """Why it is no noise; empty if nothing speaks against that."""
        if self.times == 0:
            return ()
        loud = (f"What is left is {self.times:.3g} times the noise.",)
        return (*self.foretold, *(loud if self.times > NEAR_NOISE else ()))


def residual_of(final: FinalFit, prepared: PreparedRecord) -> Residual:
    """Return what a model leaves of a record, and the structure that it has.

    Noise is what neither the inputs nor the motion foretell. The coherence with the inputs, by
    frequency, shows what a linear model could still take; the map of the missing force over
    displacement and velocity, made from one half of the record and tried on the other, shows a law.
    """
    model, record = final.model, prepared.record
    pieces = prepared.everything if final.predictable else prepared.windows
    run, started = prepared.run_with_fitted_starts(model, pieces)
    errors = run.all_errors(started)
    floor = residual_noise_floor(model, prepared, final.predictable)
    size = np.std(record.Y, axis=0)
    relative = final.error / np.where(size > 0, size, 1.0)
    counts, said, largest = _counts(final.error, size), [], 0.0
    above = np.maximum(1 - (prepared.scales.noise / np.maximum(final.error, 1e-300)) ** 2, 0.0)
    for i, name in enumerate(model.output_names):
        share = above[i] * coherent_share(errors[:, i], record.signals(model), record.dt)
        if share > DRIVEN and counts[i]:
            largest = max(largest, float(np.sqrt(share) * relative[i]))
            said.append(
                f"{100 * share:.0f} % of the power that is left of {name} follows linearly from "
                "the inputs: a motion that they drive is missing."
            )
    # a force that is as small as the noise of the sensors makes it says nothing
    if np.any(counts & (final.error > NEAR_NOISE * prepared.scales.noise)):
        maps = force_maps(model, prepared.motion(model, record))
        if maps and maps[0].follows > DRIVEN:
            largest = max(largest, float(np.sqrt(maps[0].follows) * np.max(relative)))
            said.append(maps[0].describe())
    matters = largest > MATTERS
    return Residual(final.error, floor, prepared.scales.noise, size, tuple(said), matters)


def coherent_share(error: Array, inputs: Array, dt: float) -> float:
    """Return the share of a signal's power that follows linearly from one of the inputs.

    Welch's coherence is biased by one over the number of independent segments where there is none.

    Parameters
    ----------
    error : ndarray, shape (samples,)
    inputs : ndarray, shape (samples, nu)
    dt : float
        Sampling step in s.
    """
    length = len(error) // _SEGMENTS
    if length < _SHORTEST or not np.isfinite(error).all():
        return 0.0
    _, power = welch(error, 1 / dt, nperseg=length)
    total, best = float(np.sum(power)), 0.0
    for u in inputs.T:
        if np.ptp(u) == 0 or total == 0:
            continue
        _, seen = coherence(u, error, 1 / dt, nperseg=length)
        unbiased = np.clip((np.nan_to_num(seen) * _SEGMENTS - 1) / (_SEGMENTS - 1), 0.0, 1.0)
        best = max(best, float(np.sum(unbiased * power)) / total)
    return best


class Verdict(NamedTuple):
    """The verdict, its reasons, and the noise floor of each output in its unit."""

    word: str
    reasons: list[str]
    floor: Array


NO_EFFECT = "No effect of the catalogue makes the error fall by very strong evidence."


def verdict_on(
    run: EffectSearch, final: FinalFit, residual: Residual, base: Array, refitted: Array
) -> Verdict:
    """Choose the verdict.

    Parameters
    ----------
    run : EffectSearch
    final : FinalFit
    residual : Residual
        That of the final fit.
    base, refitted : ndarray, shape (ny,)
        Errors of the model as it was, and refitted; of windows where `final` is not predictable.
    """
    error, floor, structure = residual.error, residual.floor, list(residual.structure)
    into = []
    if structure and noise_on_inputs(run, residual):
        into = [
            f"What is left is {residual.times:.3g} times the noise of the sensors, "
            "and like a noise on the inputs."
        ]
        structure, floor = [], error
    if final.model.effects[len(run.reference.effects) :]:
        share = explained(refitted, error, floor)
        told = [*into, *structure]
        told.append(f"The effects explain {100 * share:.0f} % of the error above the noise.")
        explains = share > EXPLAINED and not residual.matters
        if not structure or explains or not final.predictable:
            return Verdict("missing_effect", told if share > 0 else [], floor)
        return Verdict("partly_explained", told, floor)
    if structure:
        return Verdict("unexplained", [NO_EFFECT, *structure], floor)
    if not np.all(error < NEAR_NOISE * residual.sensor):
        into.append(
            "The error is as small as a model of this kind gets. How much of it is noise of the "
            "sensors is not known: repeat a record, or measure at rest."
        )
    wrong = np.any(base > IMPROVED * error)
    return Verdict("parameters" if wrong else "adequate", into, floor)


def noise_on_inputs(run: EffectSearch, residual: Residual) -> bool:
    """Return whether the last screening saw noise on the inputs, and no missing force.

    It is none if anything that was tried, though refused, leaves less by very strong evidence.
    """
    if run.screening is None or not np.all(residual.error < LOUDEST * residual.size):
        return False
    if any(t.scored is not None and run.gain(t.scored) > STRONG for t in run.tried):
        return False
    level = run.screening.level
    return level.force <= run.prepared.policy.silent and level.input_noise > 0


def explained(before: Array, after: Array, noise: Array) -> float:
    """Return the share of the error's power above the noise that went away."""
    excess = float(np.sum((before**2 - noise**2) / noise**2))
    left = float(np.sum(np.maximum(after**2 - noise**2, 0) / noise**2))
    return 1 - left / excess if excess > 0 else 1.0
