"""Score of a model in nats: log likelihood of its free runs over folds, less what numbers cost.

The errors of a free run over a fold k of output i are taken as Gaussian with the variance that
they show there, of which as many are counted as are independent, n_ki. A model B is better than a
model A by

    sum over k, i of n_ki ln(s_ki(A) / s_ki(B))
        - ln(n)/2 for every number that B fits more
        - ln(20) for every effect that B adds between coordinates that nothing joins
        - the negative log prior of the masses, springs, dampers and gains of B, less that of A.

No model of a machine is exact, so that its errors are never independent samples of a noise, however
long a record is: `MOST_SAMPLES` of one output count, more where noise is the larger part of what is
left. Errors whose powers differ by less than that of a share of the motion are the same. The prior
of a mass or gain is normal about what was known, mixed with a wide distribution: one number in a
thousand has been written down wrong. Springs and dampers are guessed rather than weighed: their
prior is Cauchy's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    Fit,
    covariance_of,
    effective_samples,
    most_counted,
)
from robustpolish.identification.fit.parameters import (
    free_parameters,
    has_smoothing,
    is_guessed,
)
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.observer.runs import StartedPiece
from robustpolish.identification.policy import NEGLIGIBLE, STRONG
from robustpolish.identification.record import Record, input_period, poles_of
from robustpolish.identification.refit import held_inputs
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import CONSTANT
from robustpolish.machines.mechanical.data import inertia_of
from robustpolish.machines.mechanical.model import MechanicalModel

# Whether an effect of a fitted model can be the answer: its signs, sizes, lines and numbers.

DETERMINED = 0.5
"""Largest standard error of a size, as a share of it: what the data leave open is no finding."""
_HEAVY = 10.0
"""Times the mass of a machine from which what would hang on it is the ground."""
_FREQUENCY_SHIFT = 0.1
"""Share by which the frequency of a decay may shift with its amplitude."""
_UNEXPLAINED_DELAY = 0.75
"""Samples by which an input acts later than a linear one, that no hold explains."""
_LINE_STDERRS = 5.0
"""Standard errors from which a fitted frequency is none of the lines of the inputs."""


def implausible(fitted: Fit, index: int, record: Record, errors: dict[str, float]) -> str:
    """Say why an effect of a fitted model cannot be what is missing; empty if it can.

    Parameters
    ----------
    fitted : Fit
    index : int
        Where the effect stands.
    record : Record
    errors : dict of str to float
        Standard errors of the fit.

    Returns
    -------
    str
    """
    model = fitted.model
    effect = model.effects[index]
    lead = undetermined_parameter(fitted, index, errors)
    return (
        effect.definition.implausible(effect.values)
        or _outside_line(effect, model, record, errors.get(f"effect[{index}].{_line(effect)}"))
        or _short_delay(model, effect, record)
        or _heavy_mass(model, effect)
        or (f"its {lead} is not determined" if lead else "")
    )


def undetermined_parameter(fitted: Fit, index: int, errors: dict[str, float] | None = None) -> str:
    """Return the first size of an effect, if the data leave it open; empty if they do not.

    Parameters
    ----------
    fitted : Fit
    index : int
    errors : dict of str to float, optional
        Standard errors of the fit.
    """
    effect = fitted.model.effects[index]
    # of an input that is held, an accelerometer sees no difference until a delay comes to a sample
    if effect.definition.timing is not None:
        return ""
    if errors is None:
        errors = stderr_from_covariance(covariance_of(fitted))
    numbers = [p for p in effect.definition.parameters if p.fitted]
    # of a stop, the gap says where it is and the stiffness whether it is there
    sizes = [p for p in numbers if p.counts_force]
    signal = effect.definition.domain in ("input", "output")
    for lead in dict.fromkeys((*numbers[:1], *sizes[:1])):
        error = errors.get(f"effect[{index}].{lead.name}", 0.0)
        size = effect.values[lead.name] - (lead.default if signal else 0.0)  # a gain of 1 is none
        if not error < DETERMINED * abs(size):
            return lead.name
    return ""


def _short_delay(model: MechanicalModel, effect: Effect, record: Record) -> str:
    """Say whether an effect delays an input by less than a record can tell from a hold.

    A held input is half a sample late by itself. What is as near to that as to a whole sample no
    hold explains: a velocity that is the difference of two positions is late by half a sample, too.
    """
    if effect.definition.domain != "input":
        return ""
    held = effect.at[0] in held_inputs(model)
    for number in effect.definition.parameters:
        late = effect.values[number.name] if number.dimension == "T" else np.inf
        if late < (_UNEXPLAINED_DELAY - 0.5 * held) * record.dt:
            samples = late / record.dt
            return f"a {number.name} of {samples:.2g} samples is what its input does between them"
    return ""


def _heavy_mass(model: MechanicalModel, effect: Effect) -> str:
    """Say whether an effect hangs far more mass on a machine than that has.

    What cannot be moved is the ground: as a resonator it drifts for ever, as the offset of a sensor
    makes a motion seem to.
    """
    mass = effect.values.get("mass", 0.0) if effect.definition.swinging else 0.0
    known = inertia_of(model, False) + inertia_of(model, True)
    if known > 0 and mass > _HEAVY * known:  # of a motion that is imposed none is known
        return f"a mass of {mass:.3g} kg is far more than the machine has"
    return ""


def _line(effect: Effect) -> str | None:
    return effect.definition.line


def _outside_line(
    effect: Effect, model: MechanicalModel, record: Record, error: float | None
) -> str:
    """Say whether a force from outside has a line that the motion has by itself.

    What depends on the motion repeats with the inputs, so such a line may be any law of motion. It
    is one of the inputs' lines if it is nearer than the record's length resolves, or than some
    standard errors of its frequency. Without inputs the motion has the lines of the modes.
    """
    name = _line(effect)
    if name is None:
        return ""
    frequency = effect.values[name]
    if not model.inputs and _has_mode_at(model, frequency, record):
        return "in a free decay the machine swings at this frequency by itself"
    inputs = record.signals(model)
    for part in record.parts:
        period = input_period(part.own(inputs), part.dt)
        turns = frequency * (period or np.nan)
        resolved = 0.5 / (part.samples * part.dt)
        near = min(resolved, _LINE_STDERRS * (np.inf if error is None else error))
        if period and abs(turns - round(turns)) <= near * period:
            return f"the inputs repeat every {period:.4g} s, and what they move has this line too"
    return ""


def _has_mode_at(model: MechanicalModel, frequency: float, record: Record) -> bool:
    """Return whether a model has a mode that its record cannot tell from a line."""
    poles = poles_of(model)
    apart = np.abs(np.abs(np.imag(poles)) / (2 * np.pi) - frequency)
    width = np.abs(np.real(poles)) / np.pi + 2 / (record.samples * record.dt)
    return bool(np.any(apart < np.maximum(width, _FREQUENCY_SHIFT * frequency)))


WRITTEN_WRONG, WIDE = 1e-3, 20.0
"""Share of masses and gains that are wrong altogether, and how many times wider these scatter."""
UNJOINED = float(np.log(20))
"""Nats that an effect costs between two coordinates that neither a spring nor a damper joins."""

Place = tuple[str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class ScoredModel:
    """A fitted model and its errors over the folds of a record.

    Attributes
    ----------
    fitted : EvaluatedFit
    reference : MechanicalModel
        The model as it was given; what it has more than this was added.
    """

    fitted: EvaluatedFit
    reference: MechanicalModel

    @property
    def prepared(self) -> PreparedRecord:
        """The record."""
        return self.fitted.prepared

    @property
    def model(self) -> MechanicalModel:
        """The fitted model."""
        return self.fitted.model

    @property
    def added(self) -> tuple[Effect, ...]:
        """The effects that the reference lacks."""
        return self.model.effects[len(self.reference.effects) :]

    @property
    def curves(self) -> list[Effect]:
        """The learned laws among them."""
        return [e for e in self.added if e.definition.over]

    @property
    def places(self) -> frozenset[Place]:
        """Kinds and places of what was added."""
        return frozenset((e.kind, e.at) for e in self.added)

    @property
    def laws(self) -> int:
        """How many effects were added that are no constants."""
        return sum(e.definition.family != CONSTANT for e in self.added)

    @property
    def unjoined(self) -> int:
        """How many effects were added between coordinates that nothing joins in the model."""
        joined = {frozenset(e.between) for e in (*self.reference.springs, *self.reference.dampers)}
        pairs = [frozenset(e.at) for e in self.added if e.definition.domain == "pair"]
        return sum("ground" not in pair and pair not in joined for pair in pairs)

    @cached_property
    def whole(self) -> tuple[Array, Array]:
        """Sizes of errors, and independent samples, over whole folds, shape (folds, ny)."""
        return self._over(self.prepared.folds)

    @property
    def sizes(self) -> Array:
        """Sizes of errors over the folds that judge, shape (folds, ny)."""
        return (self.whole if self.fitted.reproducible else self.short)[0]

    @cached_property
    def short(self) -> tuple[Array, Array]:
        """The same over short windows, for models whose long runs are not reproducible."""
        cut = [
            self.prepared.cut_windows(self.model, [fold], self.prepared.short)
            for fold in self.prepared.folds
        ]
        found = [self._over(windows, joined=True) for windows in cut]
        return np.vstack([s for s, _ in found]), np.vstack([n for _, n in found])

    def _over(self, pieces: Sequence[StartedPiece], joined: bool = False) -> tuple[Array, Array]:
        run, started = self.prepared.run_with_fitted_starts(self.model, pieces)
        errors = run.all_errors(started)
        marks = [len(errors)] if joined else np.cumsum([p.record.samples for p in started])
        sizes, counts = [], []
        for part in np.split(errors, marks[:-1]):
            with np.errstate(over="ignore", invalid="ignore"):
                size = np.sqrt(np.mean(part**2, axis=0))
            sizes.append(np.where(np.isfinite(size), size, np.inf))
            counts.append(effective_samples(np.nan_to_num(part)))
        return np.array(sizes), np.array(counts)

    @cached_property
    def numbers(self) -> float:
        """How many numbers of added effects are fitted; of a learned curve as many as are free."""
        first = len(self.reference.effects)
        return sum(self._numbers(index) for index in range(first, len(self.model.effects)))

    def _numbers(self, index: int) -> float:
        effect, fit = self.model.effects[index], self.fitted.fit
        fitted = sum(p.fitted for p in effect.definition.parameters) + has_smoothing(effect)
        if not effect.definition.over or not fit.sensitivity.size:
            return fitted
        # with a prior those count that the data determine: the trace of (J'J + P)^-1 J'J
        own = [j for j, f in enumerate(fit.free) if f.key.startswith(f"effect[{index}].")]
        share = np.linalg.pinv(fit.information, hermitian=True) @ (
            fit.sensitivity.T @ fit.sensitivity
        )
        return float(np.clip(np.trace(share[np.ix_(own, own)]), 1.0, fitted))

    @cached_property
    def refusal(self) -> tuple[str, Effect | None]:
        """Why it cannot be the answer, and for which effect; empty if it can.

        An effect has a sign that is not physical, an absurd size, or a size that the data leave
        open.
        """
        if not np.isfinite(self.fitted.error).all():
            return "its runs diverge", None
        errors = stderr_from_covariance(covariance_of(self.fitted.fit)) if self.added else {}
        for index, effect in enumerate(self.added, len(self.reference.effects)):
            refused = implausible(self.fitted.fit, index, self.prepared.record, errors)
            if refused:
                return f"{effect}: {refused}", effect
        return "", None

    @cached_property
    def deviations(self) -> dict[str, float]:
        """How far the model's own numbers are from what was known, in standard deviations."""
        values, prepared = self.model.parameters, self.prepared
        free = free_parameters(
            self.reference, prepared.scales.bandwidth, prepared.policy, self.reference
        )
        known = [f for f in free if np.isfinite(f.prior) and not f.is_effect]
        return {f.key: (values[f.key] - f.centre) / f.prior for f in known}

    @cached_property
    def surprise(self) -> float:
        """Nats that the deviations of the model's own numbers cost."""
        return self.surprise_of(self.deviations)

    def surprise_of(self, keys: Iterable[str]) -> float:
        """Return the nats that the deviations of some of the model's own numbers cost."""
        known = {k: z for k in keys if (z := self.deviations.get(k)) is not None}
        guessed = np.array([z for k, z in known.items() if is_guessed(k)])
        z = np.array([z for k, z in known.items() if not is_guessed(k)])
        right, wrong = np.log(1 - WRITTEN_WRONG), np.log(WRITTEN_WRONG / WIDE)
        weighed = np.logaddexp(right - z**2 / 2, wrong - (z / WIDE) ** 2 / 2)
        return float(np.sum(np.logaddexp(right, wrong) - weighed) + np.sum(np.log1p(guessed**2)))


def nats(after: ScoredModel, before: ScoredModel, best: ScoredModel | None = None) -> float:
    """Return by how many nats one model is better than another one.

    Parameters
    ----------
    after, before : ScoredModel
    best : ScoredModel, optional
        The one whose errors tell how many samples are independent; `after` by default. All models
        that are ranked are compared with the same one.
    """
    counting = best or after
    whole = all(m.fitted.reproducible for m in (after, before, counting))
    (one, _), (other, _), (_, counts) = (
        (m.whole if whole else m.short) for m in (after, before, counting)
    )
    if not np.isfinite(one).all():
        return -np.inf
    most = most_counted(np.mean(counting.sizes**2, axis=0), counting.prepared.scales.noise)
    counts = counts * np.minimum(1.0, most / np.sum(counts, axis=0))
    least = NEGLIGIBLE * np.std(after.prepared.record.Y, axis=0)
    with np.errstate(divide="ignore"):
        falls = np.log([other / np.hypot(one, least), one / np.hypot(other, least)])
    fall, rise = np.clip(falls, 0.0, 50.0)
    likelihood = float(np.sum(counts * (fall - rise)))
    cost = 0.5 * np.log(np.sum(counts)) * (after.numbers - before.numbers)
    cost += UNJOINED * (after.unjoined - before.unjoined)
    return likelihood - cost - (after.surprise - before.surprise)


def scores(models: Sequence[ScoredModel], base: ScoredModel) -> list[float]:
    """Return by how many nats each model is better than the base, all counted alike."""
    if not models:
        return []
    first = [nats(m, base) for m in models]
    best = models[int(np.argmax(first))]
    # what is the same within a share of the motion is the same beside the best
    return [nats(best, base) + nats(m, best, best) for m in models]


def simplest_of_best(models: Sequence[ScoredModel], base: ScoredModel) -> ScoredModel:
    """Return the model with the fewest numbers among those that are nearly as good as the best."""
    gains = scores(models, base)
    near = [(m, g) for m, g in zip(models, gains, strict=True) if g > max(gains) - STRONG]
    return min(near, key=lambda pair: (pair[0].numbers, -pair[1]))[0]
