"""Free decays: where they are cut, and which laws of damping they show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.fit.least_squares import (
    Fit,
    free_run_rms,
    homotopy,
    refine_to_minimum,
    smoothing_velocity_keys,
    with_rounded_friction,
)
from robustpolish.identification.fit.prepared import PreparedRecord, with_initial_memory
from robustpolish.identification.observer.missing_force import SmoothedMotion
from robustpolish.identification.observer.runs import StartedPiece
from robustpolish.identification.record import Record, least_samples
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.mechanical.data import motion_at, port_rows
from robustpolish.machines.mechanical.model import MechanicalModel

# Free decays: detection, and the cut into a fitted beginning and a predicted end.

_EXCITATION_ENERGY = 0.99
"""Share of an input's energy after which the machine is left to itself."""
_FREE_SHARE = 0.5
"""Share of a record that it is left to itself at least."""
_DECAY_RATIO = 1.5
"""Times by which the motion falls at least: laws of damping differ in how they go with it."""
_OVER = 0.05
"""Share of the largest motion that has to be left: what comes after may be nothing but noise."""
_FIT_SHARE = 0.6
"""Share of the time to fit to."""


class DecaySplit(NamedTuple):
    """Parts of decays: what is fitted to predict how they go on, and what is predicted."""

    early: list[Record]
    late: list[Record]


def split_decays(model: MechanicalModel, record: Record) -> DecaySplit | None:
    """Return the early and the late parts of records all of which are free decays, or None.

    Parameters
    ----------
    model : MechanicalModel
        Its inputs, if it has any, have to be over early, as a blow is.
    record : Record

    Returns
    -------
    Cut or None
        Of each record; the early part with what moved it.
    """
    early, late = [], []
    inputs = record.signals(model)
    for part in record.parts:
        alone = _end_of_excitation(part.own(inputs))
        size = _motion(part)[alone:]
        tenth = size.size // 10
        if size.size < _FREE_SHARE * part.samples or not tenth:
            return None
        first, last = (float(np.sqrt(np.mean(x**2))) for x in (size[:tenth], size[-tenth:]))
        end = int(np.flatnonzero(size >= _OVER * size.max())[-1]) + 1
        cut = round(_FIT_SHARE * end)
        if first < _DECAY_RATIO * last or min(cut, end - cut) < least_samples(model):
            return None
        early.append(part.part(0, alone + cut))
        late.append(part.part(alone + cut, alone + end))
    return DecaySplit(early, late)


def _end_of_excitation(inputs: Array) -> int:
    """Return the sample from which inputs have done what they do."""
    energy = np.cumsum((inputs - np.median(inputs, axis=0)) ** 2, axis=0)
    moving = energy[:, energy[-1] > 0]
    if not moving.size:
        return 0
    return int(max(np.searchsorted(e, _EXCITATION_ENERGY * e[-1]) for e in moving.T)) + 1


def _motion(part: Record) -> Array:
    """Return how far the outputs are from where they end, each by its size, shape (samples,)."""
    away = np.abs(part.Y - part.Y[-max(1, part.samples // 10) :].mean(axis=0))
    largest = away.max(axis=0)
    return np.sum(away / np.where(largest > 0, largest, 1.0), axis=1)


# Extrapolation error: models fitted to the beginning of decays, run over the rest.
#
# The end of a decay is smaller than all that came before it: a model whose forces only bend to the
# motion that they were fitted to shows a large error there.


def extrapolation_error(
    model: MechanicalModel, prepared: PreparedRecord, reference: MechanicalModel, cut: DecaySplit
) -> float:
    """Return the mean log of the errors with which a model predicts late parts from early ones.

    Parameters
    ----------
    model : MechanicalModel
        Where the fit to the early parts begins.
    prepared : PreparedRecord
    reference : MechanicalModel
        The model before any fit.
    cut : DecaySplit

    Returns
    -------
    float
        Infinite if no fit ends well.
    """
    fitted = fit_decays(
        with_smoothed_starts(model, cut.early, prepared), model, prepared, reference
    )
    return np.inf if fitted is None else log_error_on(fitted.model, cut.late, prepared)


def fit_decays(
    pieces: Sequence[StartedPiece],
    model: MechanicalModel,
    prepared: PreparedRecord,
    reference: MechanicalModel,
) -> Fit | None:
    """Return a fit to pieces of decays, None if none ends well; arguments as above."""
    spans = prepared.spans(pieces, prepared.policy.growth)
    started, settled = with_initial_memory(model, pieces), prepared.policy.settled
    fits = homotopy(model, prepared, started, reference, spans, prepared.steps, settled=settled)
    return fits[-1] if fits else None


def log_error_on(
    model: MechanicalModel, parts: Sequence[Record], prepared: PreparedRecord
) -> float:
    """Return the mean log of the errors of a model's free runs over parts of a record."""
    errors = free_run_rms(model, prepared, with_smoothed_starts(model, parts, prepared))
    with np.errstate(divide="ignore"):
        return float(np.mean(np.log(errors)))


def with_smoothed_starts(
    model: MechanicalModel, parts: Sequence[Record], prepared: PreparedRecord
) -> list[StartedPiece]:
    """Return parts of a record with starts, from the motion that is smoothed before any fit."""
    linear, motion = model.without_effects(), prepared.linear_motion
    return [StartedPiece(part, motion.start(linear, part.first)) for part in parts]


# Damping laws at a place of a model, and models with subsets of them.

_SIZE_PARAMETERS = {
    "coulomb_friction": "force",
    "quadratic_damping": "coefficient",
    "displacement_dependent_damping": "coefficient",
}
"""Laws that differ in how a decay goes with its amplitude, and what their forces are sizes of."""
_FIRST = "coulomb_friction"
_DRY = kinds()["coulomb_friction"].family
_LEAST = 0.1
"""Share of all that is lost with which laws begin beside one that stays as it was found."""

LawSet = frozenset[int]


@dataclass(frozen=True)
class DampingLaw:
    """One law of damping: an effect, or the model's own damper.

    Attributes
    ----------
    effect : Effect or None
        None for the own damper.
    size : str
        The parameter, or the key of the damper, that the force is proportional to. Friction with
        memory has none: it begins as it was found.
    power : float
        What it takes from the motion, in W, at a size of one or as it was found.
    """

    effect: Effect | None
    size: str
    power: float


@dataclass(frozen=True, eq=False)
class DampingLaws:
    """What can damp a place of a model, and what does.

    Attributes
    ----------
    model : MechanicalModel
        As it was found.
    at : tuple of str
    places : tuple of int
        Where the laws that it has stand among its effects.
    laws : list of DampingLaw
        Those that were found, and others that could be there.
    found : frozenset of int
        Which of them the model has.
    dissipated_power : float
        What these take from the motion, in W.
    alike : tuple of Effect
        What could as well stand for one that was found, as it was fitted.
    """

    model: MechanicalModel
    at: tuple[str, ...]
    places: tuple[int, ...]
    laws: list[DampingLaw]
    found: LawSet
    dissipated_power: float
    alike: tuple[Effect, ...] = ()

    @property
    def first(self) -> int:
        """Where the first of them stands among the effects, or would."""
        return self.places[0] if self.places else len(self.model.effects)

    @property
    def here(self) -> list[Effect]:
        """The effects that were found, as they were."""
        return [self.model.effects[i] for i in self.places]

    @property
    def damper(self) -> str | None:
        """The key of the own damper, if the place has one."""
        return next((law.size for law in self.laws if law.effect is None), None)

    def held(self, laws: LawSet) -> frozenset[str]:
        """Return the keys of what stays at nothing in models with a set of laws."""
        out = {law.size for i, law in enumerate(self.laws) if i not in laws and law.effect is None}
        return frozenset(out)

    def has_two_dry_frictions(self, laws: LawSet) -> bool:
        """Return whether a set has two kinds of dry friction, of which a place has one."""
        chosen = [self.laws[i].effect for i in laws]
        return sum(e is not None and e.definition.family == _DRY for e in chosen) > 1

    def effects(self, laws: LawSet) -> list[Effect]:
        """Return the effects of a set of laws, each with an even share of all that is lost."""
        return [effect for effect, _ in self._scaled_to_power(laws) if effect is not None]

    def model_with(self, laws: LawSet) -> MechanicalModel:
        """Return the model with a set of laws in place of those that were found."""
        first, known = self.first, self.model.effects
        after = [e for i, e in enumerate(known) if i >= first and i not in self.places]
        effects = (*known[:first], *self.effects(laws), *after)
        model = replace(self.model, effects=effects)
        if self.damper is None:
            return model
        own = [size for effect, size in self._scaled_to_power(laws) if effect is None]
        return model.with_parameters({self.damper: own[0] if own else 0.0})

    def _scaled_to_power(self, laws: LawSet) -> list[tuple[Effect | None, float]]:
        """Return effects and sizes with which a set of laws takes what was lost before."""
        chosen = [self.laws[i] for i in sorted(laws)]
        known = sum(law.power for law in chosen if not law.size)
        shared = [law for law in chosen if law.size and law.power > 0]
        each = max(self.dissipated_power - known, _LEAST * self.dissipated_power) / max(
            len(shared), 1
        )
        found = []
        for law in chosen:
            size = each / law.power if law in shared else 0.0
            effect = law.effect
            if effect is not None and law.size:
                effect = effect.with_values({**effect.parameters, law.size: size})
            found.append((effect, size))
        return found


def damped_places(model: MechanicalModel, known: int) -> list[tuple[str, ...]]:
    """Return where damping is to be settled.

    Parameters
    ----------
    model : MechanicalModel
    known : int
        How many of its effects were there before any was found.

    Returns
    -------
    list of tuple of str
        Where laws of damping were found; if nowhere, the place of the only damper. What is lost at
        one of several dampers could as well be lost at another.
    """
    found = {frozenset(e.at): e.at for e in model.effects[known:] if _is_damping_law(e)}
    own = {frozenset(d.between): d.between for d in model.dampers}
    return list((found or (own if len(own) == 1 else {})).values())


def damping_laws(
    model: MechanicalModel,
    known: int,
    at: tuple[str, ...],
    motion: SmoothedMotion,
    record: Record,
    alike: Sequence[Effect] = (),
) -> DampingLaws:
    """Return the laws of damping that a place of a model has or could have.

    Parameters
    ----------
    model : MechanicalModel
    known : int
        How many of its effects were there before any was found: those stay.
    at : tuple of str
    motion : SmoothedMotion
        Of the model along the record.
    record : Record
    alike : sequence of Effect, optional
        What could as well stand for one that was found there, as it was fitted: beside the right
        kind of friction no other law may be needed.
    """
    there = [i for i, e in enumerate(model.effects) if _is_damping_law(e) and set(e.at) == set(at)]
    places = tuple(i for i in there if i >= known)
    here = [model.effects[i] for i in places]
    taken = {model.effects[i].kind for i in there}
    dry = any(model.effects[i].definition.family == _DRY for i in there if i < known)
    others = [
        kind
        for kind in _SIZE_PARAMETERS
        if kind not in taken and not (dry and kinds()[kind].family)
    ]
    told = [
        e
        for e in alike
        if _is_damping_law(e) and set(e.at) == set(at) and e.kind not in _SIZE_PARAMETERS
    ]
    laws: list[DampingLaw] = []
    dissipated_power = 0.0
    for effect in [*here, *(Effect(kind, at) for kind in others), *told]:
        size = _SIZE_PARAMETERS.get(effect.kind, "")
        unit = effect.with_values({**effect.parameters, size: 1.0}) if size else effect
        power = _power(model, unit, motion, record)
        laws.append(DampingLaw(unit, size, power))
        if effect in here:
            dissipated_power += power * (effect.values[size] if size else 1.0)
    found = set(range(len(here)))
    for i, damper in enumerate(model.dampers):
        if set(damper.between) == set(at) and damper.damping >= 0:
            rows = port_rows(model, Effect(_FIRST, at))
            power = float(np.mean((rows @ motion.v) ** 2))
            found.add(len(laws))
            laws.append(DampingLaw(None, f"damper[{i}].damping", power))
            dissipated_power += power * damper.damping
            break
    return DampingLaws(model, at, places, laws, frozenset(found), dissipated_power, tuple(alike))


def _is_damping_law(effect: Effect) -> bool:
    if effect.definition.domain != "pair" or effect.own is not None:
        return False
    return effect.kind in _SIZE_PARAMETERS or effect.definition.family == _DRY


def _power(model: MechanicalModel, effect: Effect, motion: SmoothedMotion, record: Record) -> float:
    """Return what an effect takes from a motion on average, in W."""
    along = motion_at(model, effect, record.time, motion.q, motion.v, record.dt / 4)
    force = force_with(effect.definition, effect.values, along)
    return max(-float(np.mean(force * along.v)), 0.0)


# Fits of decays with sets of damping laws: fit error and extrapolation error of each.
#
# How well a law fits says little of it as long as something else can do its work. A law that is not
# that of the machine errs where the motion becomes smaller than any that it was fitted to.


@dataclass(eq=False)
class DampingFits:
    """Fits with sets of damping laws, each made once.

    Attributes
    ----------
    prepared : PreparedRecord
    reference : MechanicalModel
        The model before any fit.
    found : DampingLaws
    cut : DecaySplit
        What is fitted to predict, and what is predicted.
    fits, errors, ahead : dict
        By the set of laws: the fit, the mean log of its errors, and that of its extrapolation.
    """

    prepared: PreparedRecord
    reference: MechanicalModel
    found: DampingLaws
    cut: DecaySplit
    fits: dict[LawSet, Fit] = field(default_factory=dict)
    errors: dict[LawSet, float] = field(default_factory=dict)
    ahead: dict[LawSet, float] = field(default_factory=dict)

    def error(self, laws: LawSet) -> float:
        """Return the mean log of the errors of a fit to everything; infinite if none ends well."""
        if laws not in self.errors:
            fitted = self._fit_set(self.found.model_with(laws), laws, self.prepared.everything)
            self.errors[laws] = np.inf
            if fitted is not None:
                self.fits[laws] = fitted
                self.errors[laws] = float(np.mean(np.log(fitted.rmse)))
        return self.errors[laws]

    def extrapolation_error(self, laws: LawSet) -> float:
        """Return the mean log of the errors with which a fit to the early parts predicts."""
        if laws not in self.ahead:
            model = self.fits[laws].model
            fitted = self._fit_set(
                model, laws, with_smoothed_starts(model, self.cut.early, self.prepared)
            )
            self.ahead[laws] = np.inf
            if fitted is not None:
                self.ahead[laws] = log_error_on(fitted.model, self.cut.late, self.prepared)
        return self.ahead[laws]

    def plausible_sets(self, sound: Callable[[LawSet], bool] = lambda laws: True) -> list[LawSet]:
        """Return the sets of laws that fit about as well as the best; each has an effect.

        What a set cannot fit, visibly, none of its parts can. Those that were found are asked
        anyway: from where a larger set begins, a fit may end badly, beside a backlash for instance.

        Parameters
        ----------
        sound : callable, optional
            Whether a fitted set can be believed; others are no measure of what fits well.
        """
        policy, laws = self.prepared.policy, range(len(self.found.laws))
        hopeless: set[LawSet] = set()
        if not self._lacks_effects(self.found.found):
            self.error(self.found.found)
        for size in range(len(laws), 0, -1):
            for some in map(frozenset, combinations(laws, size)):
                if self.found.has_two_dry_frictions(some):
                    continue
                more = [some | {i} for i in laws if i not in some]
                limit = -np.log(1 - policy.visible_fall)
                if (
                    self._lacks_effects(some)
                    or hopeless.intersection(more)
                    or self.error(some) - limit > min(self.errors.values())
                ):
                    hopeless.add(some)
        believed = {some: error for some, error in self.errors.items()
                    if some in self.fits and sound(some)}  # fmt: skip
        limit = min(believed.values(), default=np.inf) - np.log(1 - policy.together)
        return [some for some, error in believed.items() if error < limit]

    def _lacks_effects(self, laws: LawSet) -> bool:
        """Return whether a set leaves out all effects though there are some."""
        return bool(self.found.here) and not self.found.effects(laws)

    @property
    def same(self) -> float:
        """Relative difference below which two predictions are one to the data."""
        return self.prepared.policy.same(sum(part.samples for part in self.cut.late))

    def _fit_set(
        self, model: MechanicalModel, laws: LawSet, pieces: Sequence[StartedPiece]
    ) -> Fit | None:
        jumps = smoothing_velocity_keys(self.found.model_with(laws))
        held, reference = self.found.held(laws) | jumps, self.reference
        prepared = replace(self.prepared, held=held)
        model = with_rounded_friction(model, prepared)
        fitted = fit_decays(pieces, model, prepared, reference)
        return None if fitted is None else refine_to_minimum(fitted, prepared, reference)
