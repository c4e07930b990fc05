"""What a search for missing effects knows so far, and the fits that it makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.diagnosis.findings import IndistinguishablePair, RankedCandidate
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    best_stage,
    homotopy,
    ranking_log_error,
)
from robustpolish.identification.fit.parameters import has_smoothing, makes_no_force, scaled_effect
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.policy import Policy
from robustpolish.identification.refit import with_resolved_delay
from robustpolish.identification.residual_tests import residual_noise_floor
from robustpolish.identification.structure.screening import ScreenedEffect, Screening
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel


def parameter_count(effect: Effect) -> int:
    """Return how many numbers of an effect that was found are fitted."""
    own = sum(p.fitted for p in effect.definition.parameters)
    return own + has_smoothing(effect)


@dataclass(frozen=True, eq=False)
class RefittedEffect:
    """A screened effect, and the model with it, fitted and judged."""

    screened: ScreenedEffect
    fitted: EvaluatedFit

    @property
    def effect(self) -> Effect:
        """The effect, with its first values."""
        return self.screened.effect

    @property
    def size(self) -> int:
        """Number of its fitted parameters."""
        return parameter_count(self.effect)

    @property
    def constant(self) -> bool:
        """Whether it never changes, as an offset or a preload."""
        return self.screened.constant

    @property
    def family(self) -> tuple[str, tuple[str, ...]]:
        """What kinds that do alike at one place share: the name of their family, and the place."""
        kind = self.effect.definition
        return kind.family or kind.kind, self.effect.at


class SelectionStep(NamedTuple):
    """An effect that was added, or two together, or none, and what could have been.

    Attributes
    ----------
    before : Search
        The search as it was.
    added : tuple of RefittedEffect
    others : tuple of RefittedEffect
        What had earned its place too, the best first; where nothing was added, what helped a bit.
    tried : tuple of RefittedEffect
        Where nothing was added, all that was refitted.
    """

    before: Search
    added: tuple[RefittedEffect, ...]
    others: tuple[RefittedEffect, ...]
    tried: tuple[RefittedEffect, ...] = ()


@dataclass
class Search:
    """State of a forward selection of effects.

    Attributes
    ----------
    prepared : PreparedRecord
    reference : MechanicalModel
        The model as it was, holds of its inputs included.
    say : callable
        Called with a short text at every step.
    linear, stage : EvaluatedFit
        The fit of the model's own numbers, and the best fit so far.
    short_window_model : MechanicalModel
        The refitted model of the second stage, over short windows.
    steps : list
        Names and models of the ledger to come.
    candidates : list of RankedCandidate
        Effects that were tried.
    indistinguishable_pairs : list of IndistinguishablePair
    reasons : list of str
    screening : Screening, optional
        Of the last step.
    selection_steps : list of SelectionStep
        The steps that led to the best fit so far.
    excluded_effects : tuple of (str, tuple of str)
        Kinds with their places that are not to be added: taken out, to see what comes instead.
    beside : dict
        Fits with a further effect, by the fit without, kind and place: they are asked for again.
    begin : callable, optional
        Begins a search beside other holds of the inputs; None where these are known.
    """

    prepared: PreparedRecord
    reference: MechanicalModel
    say: Callable[[str], None]
    linear: EvaluatedFit
    stage: EvaluatedFit
    short_window_model: MechanicalModel
    steps: list[tuple[str, MechanicalModel]]
    candidates: list[RankedCandidate] = field(default_factory=list)
    indistinguishable_pairs: list[IndistinguishablePair] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    screening: Screening | None = None
    selection_steps: list[SelectionStep] = field(default_factory=list)
    excluded_effects: tuple[tuple[str, tuple[str, ...]], ...] = ()
    beside: dict[tuple[EvaluatedFit, str, tuple[str, ...]], EvaluatedFit | None] = field(
        default_factory=dict
    )
    begin: Callable[[MechanicalModel], Search] | None = None

    @property
    def policy(self) -> Policy:
        """What it goes by."""
        return self.prepared.policy

    @property
    def added(self) -> int:
        """Number of effects that were added."""
        return len(self.added_to(self.stage.model))

    def added_to(self, model: MechanicalModel) -> tuple[Effect, ...]:
        """Return the effects of a model that the reference lacks."""
        return model.effects[len(self.reference.effects) :]

    def at_noise_floor(self, stage: EvaluatedFit) -> bool:
        """Return whether not even the noise alone would make the error fall visibly.

        What is held out of a decay is the quieter part of it: what was fitted counts too.
        """
        least = self.policy.at_noise_floor * self.prepared.scales.noise
        fitted = np.all(stage.fit.rmse < least) or not stage.reproducible
        return bool(np.all(stage.error < least) and fitted)

    def residual_is_noise(self, times: float) -> bool:
        """Return whether the model leaves noise alone, white or of the colour that it shows."""
        stage = self.stage
        if self.at_noise_floor(stage):
            return True
        floor = self.residual_noise_floor(stage.model, stage.reproducible)
        return bool(np.all(stage.error < times * floor))

    def residual_noise_floor(self, model: MechanicalModel, predictable: bool) -> Array:
        """Return the noise of each output that the errors of a fitted model show, shape (ny,)."""
        return residual_noise_floor(model, self.prepared, predictable)

    def copy(self) -> Search:
        """Return the search as it is, to go on in another way."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        lists: dict[str, Any] = {k: list(v) for k, v in values.items() if isinstance(v, list)}
        return replace(self, **lists)

    def fit_with(
        self, model: MechanicalModel, *effects: Effect, anew: bool = False, near: bool = False
    ) -> EvaluatedFit | None:
        """Return a model with more effects, fitted; None if no fit ended well.

        Where masses and springs were bent to what these do, they begin as they were known, too.
        With `anew` the first windows are begun anew as their law is found; with `near` they begin
        where the model comes closest to them, for its numbers are near those to be found.
        """
        found = self._fit_from_smaller_sizes(model, *effects, anew=anew, near=near)
        if not self._parameters_distorted(model, found, effects):
            return found
        known = replace(self.reference, effects=model.effects)
        again = self._fit_from_smaller_sizes(known, *effects, anew=anew, near=near)
        fits = [f for f in (found, again) if f is not None]
        return min(fits, key=lambda fitted: ranking_log_error(fitted, fits), default=None)

    def cached_fit_with(self, fitted: EvaluatedFit, effect: Effect) -> EvaluatedFit | None:
        """Return a fitted model with one more effect, fitted; None if no fit ended well."""
        key = (fitted, effect.kind, effect.at)
        if key not in self.beside:
            self.beside[key] = self.fit_with(fitted.model, effect)
        return self.beside[key]

    def _parameters_distorted(
        self, model: MechanicalModel, found: EvaluatedFit | None, effects: Sequence[Effect]
    ) -> bool:
        """Return whether fits without these effects may have moved masses and springs to theirs.

        The gain of a sensor looks like other masses; what swings by itself splits a mode in two,
        and a fit without it has one of them; and any law that is stronger than the springs moves
        them too far to be believed.
        """
        if any(effect.kind == "sensor_gain" for effect in effects):
            return True
        if found is not None and self.at_noise_floor(found):
            return False
        if any(effect.definition.swinging for effect in effects):
            return True
        if model.effects != self.reference.effects:
            return False
        far = self.policy.bent
        known, now = (
            [dof.mass for dof in m.dofs] + [spring.stiffness for spring in m.springs]
            for m in (self.reference, model)
        )
        return any(a > 0 and not a / far <= b <= a * far for a, b in zip(known, now, strict=True))

    def _fit_from_smaller_sizes(
        self, model: MechanicalModel, *effects: Effect, anew: bool = False, near: bool = False
    ) -> EvaluatedFit | None:
        """Return a model with more effects, fitted, begun with a share of their first sizes.

        Where these make runs diverge, as a softening spring does beyond its peak, smaller ones may
        not.
        """
        prepared, policy = self.prepared, self.policy
        first = [with_resolved_delay(effect, model, prepared) for effect in effects]
        pieces = prepared.trial
        steps = prepared.steps if model.free else 2 * prepared.steps
        spans = prepared.spans(pieces, policy.growth)
        found = None
        for share in policy.shares if first else policy.shares[:1]:
            extended = model
            for effect in first:
                values = scaled_effect(effect, share).values
                extended = extended.with_effect(effect.definition, effect.at, values)
            stages = homotopy(
                extended, prepared, pieces, self.reference, spans, steps,
                settled=policy.settled, anew=anew, known=near,
            )  # fmt: skip
            if stages:
                found = best_stage(stages, prepared)
                if np.isfinite(found.error).all():
                    return found
        return found

    def fit_without(self, model: MechanicalModel, at: int, *instead: Effect) -> EvaluatedFit | None:
        """Return a model without one of its effects, or with others in its place, fitted anew.

        None if no fit ended well. The others may be right as they are, where short windows would
        move them; or have been bent by what goes, where long ones would keep them.
        """
        rest = (*model.effects[:at], *model.effects[at + 1 :])
        bare = replace(model, effects=rest)
        if instead:
            return self.fit_with(bare, *instead, near=True)
        prepared = self.prepared
        tried = [self.fit_over_windows(bare, prepared.spans(prepared.trial)[-1:])]
        if not makes_no_force(model.effects[at]):
            tried.append(self.fit_with(bare))
        fits = [fitted for fitted in tried if fitted is not None]
        return min(fits, key=lambda fitted: ranking_log_error(fitted, fits), default=None)

    def fit_over_windows(self, model: MechanicalModel, spans: Sequence[int]) -> EvaluatedFit | None:
        """Return a model fitted from its numbers over windows of these lengths, one by one.

        None if no fit ended well.
        """
        prepared = self.prepared
        stages = homotopy(model, prepared, prepared.trial, self.reference, spans, known=True)
        return best_stage(stages, prepared) if stages else None

    def accept(self, earned: Sequence[RefittedEffect]) -> None:
        """Go on with the model that has the effects, each fitted with those before it."""
        for item in earned:
            self.stage = item.fitted
            self.steps.append((item.effect.kind, self.stage.model))
            refused = f"{item.effect} was not added"
            self.reasons = [reason for reason in self.reasons if not reason.startswith(refused)]

    def record_candidates(
        self,
        ranked: Sequence[RefittedEffect],
        screened: Sequence[ScreenedEffect],
        number: int,
        why: Mapping[tuple[str, tuple[str, ...]], str] | None = None,
    ) -> None:
        """Add what was refitted, then what was only screened, to the list of candidates.

        Parameters
        ----------
        ranked : sequence of RefittedEffect
            The best first.
        screened : sequence of ScreenedEffect
        number : int
            1 when the first effect is sought, and so on.
        why : mapping of (str, tuple of str) to str, optional
            By kind and place, why it was screened only.
        """
        size = np.std(self.prepared.record.Y, axis=0)
        for item in ranked:
            effect, error = item.fitted.model.effects[-1], float(np.mean(item.fitted.error / size))
            self._record_candidate(effect, error, item.screened.score, number)
        done = {item.screened.place for item in ranked}
        for other in screened:
            if other.place not in done and other.score > 0:
                remark = other.remark or (why or {}).get(other.place, "screened only")
                self._record_candidate(other.effect, np.inf, other.score, number, remark)

    def _record_candidate(
        self, effect: Effect, error: float, score: float, number: int, remark: str = ""
    ) -> None:
        place, values = (effect.kind, effect.at), effect.values
        self.candidates.append(
            RankedCandidate(*place, error, score, number, values, remark, effect.own)
        )
