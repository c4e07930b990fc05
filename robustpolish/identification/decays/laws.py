"""The laws of damping at a place of a model, and models with some of them in place of others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.effects import Effect, force_with, kinds
from robustpolish.identification.observer.missing_force import Smoothed
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import motion_at, port_rows

_SIZES = {
    "coulomb_friction": "force",
    "quadratic_damping": "coefficient",
    "displacement_dependent_damping": "coefficient",
}
"""Laws that differ in how a decay goes with its amplitude, and what their forces are sizes of."""
_FIRST = "coulomb_friction"
_DRY = kinds()["coulomb_friction"].family
_LEAST = 0.1
"""Share of all that is lost with which laws begin beside one that stays as it was found."""

Laws = frozenset[int]


@dataclass(frozen=True)
class Law:
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
    laws : list of Law
        Those that were found, and others that could be there.
    found : frozenset of int
        Which of them the model has.
    lost : float
        What these take from the motion, in W.
    alike : tuple of Effect
        What could as well stand for one that was found, as it was fitted.
    """

    model: MechanicalModel
    at: tuple[str, ...]
    places: tuple[int, ...]
    laws: list[Law]
    found: Laws
    lost: float
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

    def held(self, laws: Laws) -> frozenset[str]:
        """Return the keys of what stays at nothing in models with a set of laws."""
        out = {law.size for i, law in enumerate(self.laws) if i not in laws and law.effect is None}
        return frozenset(out)

    def crowded(self, laws: Laws) -> bool:
        """Return whether a set has two kinds of dry friction, of which a place has one."""
        chosen = [self.laws[i].effect for i in laws]
        return sum(e is not None and e.definition.family == _DRY for e in chosen) > 1

    def effects(self, laws: Laws) -> list[Effect]:
        """Return the effects of a set of laws, each with an even share of all that is lost."""
        return [effect for effect, _ in self._sized(laws) if effect is not None]

    def model_with(self, laws: Laws) -> MechanicalModel:
        """Return the model with a set of laws in place of those that were found."""
        first, known = self.first, self.model.effects
        after = [e for i, e in enumerate(known) if i >= first and i not in self.places]
        effects = (*known[:first], *self.effects(laws), *after)
        model = replace(self.model, effects=effects)
        if self.damper is None:
            return model
        own = [size for effect, size in self._sized(laws) if effect is None]
        return model.with_parameters({self.damper: own[0] if own else 0.0})

    def _sized(self, laws: Laws) -> list[tuple[Effect | None, float]]:
        """Return effects and sizes with which a set of laws takes what was lost before."""
        chosen = [self.laws[i] for i in sorted(laws)]
        known = sum(law.power for law in chosen if not law.size)
        shared = [law for law in chosen if law.size and law.power > 0]
        each = max(self.lost - known, _LEAST * self.lost) / max(len(shared), 1)
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
    found = {frozenset(e.at): e.at for e in model.effects[known:] if _damps(e)}
    own = {frozenset(d.between): d.between for d in model.dampers}
    return list((found or (own if len(own) == 1 else {})).values())


def damping_laws(
    model: MechanicalModel,
    known: int,
    at: tuple[str, ...],
    motion: Smoothed,
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
    motion : Smoothed
        Of the model along the record.
    record : Record
    alike : sequence of Effect, optional
        What could as well stand for one that was found there, as it was fitted: beside the right
        kind of friction no other law may be needed.
    """
    there = [i for i, e in enumerate(model.effects) if _damps(e) and set(e.at) == set(at)]
    places = tuple(i for i in there if i >= known)
    here = [model.effects[i] for i in places]
    taken = {model.effects[i].kind for i in there}
    dry = any(model.effects[i].definition.family == _DRY for i in there if i < known)
    others = [kind for kind in _SIZES if kind not in taken and not (dry and kinds()[kind].family)]
    told = [e for e in alike if _damps(e) and set(e.at) == set(at) and e.kind not in _SIZES]
    laws: list[Law] = []
    lost = 0.0
    for effect in [*here, *(Effect(kind, at) for kind in others), *told]:
        size = _SIZES.get(effect.kind, "")
        unit = effect.with_values({**effect.parameters, size: 1.0}) if size else effect
        power = _power(model, unit, motion, record)
        laws.append(Law(unit, size, power))
        if effect in here:
            lost += power * (effect.values[size] if size else 1.0)
    found = set(range(len(here)))
    for i, damper in enumerate(model.dampers):
        if set(damper.between) == set(at) and damper.damping >= 0:
            rows = port_rows(model, Effect(_FIRST, at))
            power = float(np.mean((rows @ motion.v) ** 2))
            found.add(len(laws))
            laws.append(Law(None, f"damper[{i}].damping", power))
            lost += power * damper.damping
            break
    return DampingLaws(model, at, places, laws, frozenset(found), lost, tuple(alike))


def _damps(effect: Effect) -> bool:
    if effect.definition.domain != "pair" or effect.own is not None:
        return False
    return effect.kind in _SIZES or effect.definition.family == _DRY


def _power(model: MechanicalModel, effect: Effect, motion: Smoothed, record: Record) -> float:
    """Return what an effect takes from a motion on average, in W."""
    along = motion_at(model, effect, record.time, motion.q, motion.v, record.dt / 4)
    force = force_with(effect.definition, effect.values, along)
    return max(-float(np.mean(force * along.v)), 0.0)
