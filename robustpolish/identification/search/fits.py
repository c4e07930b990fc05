"""Fits of models with sets of effects: begun where slopes lead to the data, each made once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    best_stage,
    homotopy,
    ranking_log_error,
)
from robustpolish.identification.fit.parameters import makes_no_force, scaled_effect
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.policy import STRONG
from robustpolish.identification.refit import with_resolved_delay
from robustpolish.identification.search.equivalents import with_rounded_turn
from robustpolish.identification.search.score import Place, ScoredModel, nats
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel


def _better(one: ScoredModel | None, other: ScoredModel | None) -> bool:
    """Return whether a model is better than another one by very strong evidence."""
    return one is not None and (other is None or nats(one, other) > STRONG)


@dataclass
class Fits:
    """Fitted models by their sets of effects.

    Attributes
    ----------
    prepared : PreparedRecord
    reference : MechanicalModel
        As it was given, holds of its inputs included.
    check : callable
        Called between the steps of every fit; raises to stop.
    done : dict
        What was fitted, None where no fit ended well, by the kinds and places that were added.
    begun : dict
        The kinds and places of the model from which it was fitted.
    """

    prepared: PreparedRecord
    reference: MechanicalModel
    check: Callable[[], None]
    done: dict[frozenset[Place], ScoredModel | None] = field(default_factory=dict)
    begun: dict[frozenset[Place], frozenset[Place]] = field(default_factory=dict)

    def scored(self, fitted: EvaluatedFit | None) -> ScoredModel | None:
        """Return a fit with its errors over the folds."""
        return None if fitted is None else ScoredModel(fitted, self.reference)

    def with_effects(self, start: ScoredModel, *effects: Effect) -> ScoredModel | None:
        """Return a model with more effects, fitted; None if no fit ended well.

        Where the fit without them, or with them, had to move the model's own numbers by what would
        surprise their owner, it begins from the numbers as they were known, too.
        """
        key = start.places | {(e.kind, e.at) for e in effects}
        if not self.settled(key, start):
            self.begun[key] = start.places
            found = [self._grown(start.model, effects)]
            first = self.scored(found[0])
            unsure = start.surprise > STRONG or any(e.definition.swinging for e in effects)
            sound = first is not None and self.at_noise_floor(first.fitted)
            if (unsure and not sound) or (first is not None and first.surprise > STRONG):
                known = replace(self.reference, effects=start.model.effects)
                found.append(self._grown(known, effects))
            self.done[key] = self._best(found, self.done.get(key))
        return self.done[key]

    def settled(self, key: frozenset[Place], start: ScoredModel) -> bool:
        """Return whether a set was fitted, and a model shows no wrong minimum of that fit.

        From the model's own set no other fit would come. A fit of more effects that is no better
        than the model, or of fewer than which the model is better, ended in a wrong minimum.
        """
        if key not in self.done or self.begun.get(key, start.places) == start.places:
            return key in self.done
        if key > start.places:
            return _better(self.done[key], start)
        return not (key < start.places and _better(start, self.done[key]))

    def grown(self, model: MechanicalModel, effects: Sequence[Effect]) -> ScoredModel | None:
        """Return a model with learned laws, fitted; None if no fit ended well.

        A step runs the model once for every coefficient: few have to do.
        """
        return self.scored(self._grown(model, effects, steps=self.prepared.policy.few_steps))

    def near(self, model: MechanicalModel) -> ScoredModel | None:
        """Return a model whose numbers are nearly right, fitted over the longest windows."""
        return self.scored(self._over(model, self.prepared.spans(self.prepared.trial)[-2:]))

    def beside_known_numbers(self, start: ScoredModel, effect: Effect) -> ScoredModel | None:
        """Return a model with one more effect, fitted from the own numbers as they were known."""
        known = replace(self.reference, effects=start.model.effects)
        return self.scored(self._grown(known, (effect,)))

    def replaced(
        self, start: ScoredModel, effect: Effect, *instead: Effect, anew: bool = False
    ) -> ScoredModel | None:
        """Return a model with others in place of one of its effects, or with none.

        A set that was fitted from elsewhere is fitted `anew` only if that is asked for.
        """
        gone = {(effect.kind, effect.at)}
        key = (start.places - gone) | {(e.kind, e.at) for e in instead}
        if self.settled(key, start) and not anew:
            return self.done[key]
        self.begun[key] = start.places
        bare = replace(
            start.model, effects=tuple(e for e in start.model.effects if e is not effect)
        )
        if instead:
            found = [self._grown(bare, instead, near=True)]
        else:
            spans = self.prepared.spans(self.prepared.trial)[-1:]
            found = [self._over(bare, spans)]
            if not makes_no_force(effect):
                found.append(self._grown(bare, ()))
        self.done[key] = self._best(found, self.done.get(key))
        return self.done[key]

    def _best(
        self, found: Sequence[EvaluatedFit | None], known: ScoredModel | None
    ) -> ScoredModel | None:
        fits = [f for f in found if f is not None] + ([known.fitted] if known else [])
        best = min(fits, key=lambda fitted: ranking_log_error(fitted, fits), default=None)
        return self.scored(best)

    def rounded(self, scored: ScoredModel | None) -> ScoredModel | None:
        """Return a model with those turns of its friction rounded that are better so by far.

        Where a turn is felt, all other numbers of a sharp one are bent to it, and its kind may look
        like a wrong one.
        """
        if scored is None or self.at_noise_floor(scored.fitted):
            return scored
        for at in range(len(self.reference.effects), len(scored.model.effects)):
            begun = with_rounded_turn(scored.model, at, self.prepared)
            if begun is not None and not begun.sharpest:
                rounded = self.near(begun.model)
                if rounded is not None and nats(rounded, scored) > STRONG:
                    self.done[scored.places] = scored = rounded
        return scored

    def at_noise_floor(self, stage: EvaluatedFit) -> bool:
        """Return whether not even the noise alone would make the error fall visibly.

        What is held out of a decay is the quieter part of it: what was fitted counts too.
        """
        least = self.prepared.policy.at_noise_floor * self.prepared.scales.noise
        fitted = np.all(stage.fit.rmse < least) or not stage.reproducible
        return bool(np.all(stage.error < least) and fitted)

    def _grown(
        self,
        model: MechanicalModel,
        effects: Sequence[Effect],
        near: bool = False,
        steps: int | None = None,
    ) -> EvaluatedFit | None:
        """Return a model with more effects, fitted, begun with a share of their first sizes.

        Where these make runs diverge, as a softening spring does beyond its peak, smaller ones may
        not. With `near` the windows begin where the model comes closest to them, for its numbers
        are near those to be found.
        """
        prepared, policy = self.prepared, self.prepared.policy
        first = [with_resolved_delay(effect, model, prepared) for effect in effects]
        steps = steps or (prepared.steps if model.free else 2 * prepared.steps)
        spans = prepared.spans(prepared.trial, policy.growth)
        found = None
        for share in policy.shares if first else policy.shares[:1]:
            extended = model
            for effect in first:
                values = scaled_effect(effect, share).values
                extended = extended.with_effect(effect.definition, effect.at, values)
            stages = homotopy(
                extended, prepared, prepared.trial, self.reference, spans, steps, self.check,
                settled=policy.settled, known=near,
            )  # fmt: skip
            if stages:
                found = best_stage(stages, prepared)
                if np.isfinite(found.error).all():
                    return found
        return found

    def _over(self, model: MechanicalModel, spans: Sequence[int]) -> EvaluatedFit | None:
        prepared = self.prepared
        stages = homotopy(
            model, prepared, prepared.trial, self.reference, spans, progress=self.check, known=True
        )
        return best_stage(stages, prepared) if stages else None
