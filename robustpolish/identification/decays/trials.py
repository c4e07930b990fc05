"""Fits of decays with sets of damping laws: how well each fits, and predicts what lies ahead.

How well a law fits says little of it as long as something else can do its work. A law that is not
that of the machine is found out where the motion becomes smaller than any that it was fitted to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from robustpolish.identification.decays.ahead import error_on, fitted_to, pieces_of
from robustpolish.identification.decays.cut import Cut
from robustpolish.identification.decays.laws import DampingLaws, Laws
from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.fit.polished import polished, rounded, speeds_of_turns
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.run import StartedPiece
from robustpolish.models.mechanical import MechanicalModel


@dataclass(eq=False)
class Trials:
    """Fits with sets of laws, each made once.

    Attributes
    ----------
    prepared : PreparedRecord
    reference : MechanicalModel
        The model before any fit.
    found : DampingLaws
    cut : Cut
        What is fitted to predict, and what is predicted.
    """

    prepared: PreparedRecord
    reference: MechanicalModel
    found: DampingLaws
    cut: Cut
    fits: dict[Laws, Fit] = field(default_factory=dict)
    errors: dict[Laws, float] = field(default_factory=dict)
    ahead: dict[Laws, float] = field(default_factory=dict)

    def error(self, laws: Laws) -> float:
        """Return the mean log of the errors of a fit to everything; infinite if none ends well."""
        if laws not in self.errors:
            fitted = self._fitted(self.found.model_with(laws), laws, self.prepared.everything)
            self.errors[laws] = np.inf
            if fitted is not None:
                self.fits[laws] = fitted
                self.errors[laws] = float(np.mean(np.log(fitted.rmse)))
        return self.errors[laws]

    def error_ahead(self, laws: Laws) -> float:
        """Return the mean log of the errors with which a fit to the early parts predicts."""
        if laws not in self.ahead:
            model = self.fits[laws].model
            fitted = self._fitted(model, laws, pieces_of(model, self.cut.early, self.prepared))
            self.ahead[laws] = np.inf
            if fitted is not None:
                self.ahead[laws] = error_on(fitted.model, self.cut.late, self.prepared)
        return self.ahead[laws]

    def possible(self, sound: Callable[[Laws], bool] = lambda laws: True) -> list[Laws]:
        """Return the sets of laws that fit about as well as the best; each has an effect.

        What a set cannot fit, visibly, none of its parts can. Those that were found are asked
        anyway: from where a larger set begins, a fit may end badly, beside a backlash for instance.

        Parameters
        ----------
        sound : callable, optional
            Whether a fitted set can be believed; others are no measure of what fits well.
        """
        policy, laws = self.prepared.policy, range(len(self.found.laws))
        hopeless: set[Laws] = set()
        if not self._empty(self.found.found):
            self.error(self.found.found)
        for size in range(len(laws), 0, -1):
            for some in map(frozenset, combinations(laws, size)):
                if self.found.crowded(some):
                    continue
                more = [some | {i} for i in laws if i not in some]
                limit = -np.log(1 - policy.visible_fall)
                if (
                    self._empty(some)
                    or hopeless.intersection(more)
                    or self.error(some) - limit > min(self.errors.values())
                ):
                    hopeless.add(some)
        believed = {some: error for some, error in self.errors.items()
                    if some in self.fits and sound(some)}  # fmt: skip
        limit = min(believed.values(), default=np.inf) - np.log(1 - policy.together)
        return [some for some, error in believed.items() if error < limit]

    def _empty(self, laws: Laws) -> bool:
        """Return whether a set leaves out all effects though there are some."""
        return bool(self.found.here) and not self.found.effects(laws)

    @property
    def same(self) -> float:
        """Relative difference below which two predictions are one to the data."""
        return self.prepared.policy.same(sum(part.samples for part in self.cut.late))

    def _fitted(
        self, model: MechanicalModel, laws: Laws, pieces: Sequence[StartedPiece]
    ) -> Fit | None:
        jumps = speeds_of_turns(self.found.model_with(laws))
        held, reference = self.found.held(laws) | jumps, self.reference
        prepared = replace(self.prepared, held=held)
        model = rounded(model, prepared)
        fitted = fitted_to(pieces, model, prepared, reference)
        return None if fitted is None else polished(fitted, prepared, reference)
