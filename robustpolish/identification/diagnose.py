"""Learn which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from robustpolish.base.budget import same_bits, working
from robustpolish.identification.diagnosis.result import Diagnosis
from robustpolish.identification.fit.prepared import PreparedRecord, prepare, taken
from robustpolish.identification.policy import POLICY, Policy
from robustpolish.identification.record import long_enough, over_time, record_of
from robustpolish.identification.refit import (
    refit_own,
    split_holds,
    warned,
    with_holds,
    with_other_holds,
)
from robustpolish.identification.structure.moves_add import add_one
from robustpolish.identification.structure.moves_backtrack import Followed, second_look
from robustpolish.identification.structure.moves_special import add_wrong_gains, settle_damping
from robustpolish.identification.structure.score import more_left
from robustpolish.identification.structure.state import Search
from robustpolish.identification.structure.verdict import conclude, conclude_with_one_curve
from robustpolish.machines.mechanical.model import MechanicalModel


@same_bits
def diagnose(
    model: MechanicalModel,
    data: Any,
    progress: Callable[[str], None] | None = None,
    *,
    _policy: Policy = POLICY,
) -> Diagnosis:
    """Learn which physical effect a model lacks, and add it.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        Inputs and outputs of the model by name over uniform ``time``, SI units. Several records,
        such as blows of different strength, have the numbers of the machine in common, and each a
        start of its own. They may differ in length, and in sampling rate by whole factors.
    progress : callable, optional
        Called with a short text at every step.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InvalidInputError
        If columns are missing or a record is too short; if there is no record, or several that
        differ in their channels; if `data` holds frequency responses.

    Notes
    -----
    The model's own numbers are refitted first. Then every effect of the catalogue is
    screened at every place with an observer that has a leaking random-walk force as the
    competing explanation, and coloured sensor noise and noise on the inputs as others, and free
    runs are asked what each would take away, and two together. The best few are refitted over
    windows that grow and ranked on held-out blocks. An effect is added if
    the held-out error falls visibly, its sign is physical and its parameters are
    determined; then the search starts again.

    Of records that move alike, by the same inputs and within a factor of two in amplitude, a third
    is held out as a whole (one of two). Of those that have not their like blocks are held out, as
    of one record: a law that shows in the smallest motion alone is to be judged there. Records
    that repeat each other give the noise floor.

    What depends on time, such as an unbalance or a harmonic force, has one phase at time 0 of every
    record. Keep the time of the clock where one recording was cut into several; after triggers that
    are not locked to the phase each record needs a diagnosis of its own for that.

    The work is limited, counted in steps of simulation and not in seconds: a search that comes to
    its limit ends with what it has found, the same on every machine, and ``reasons`` says so.

    Of a long record as many samples are used as the fastest motion, the forces and the error ask
    for, or a part of it; ``notes`` of the result says so. The model holds for every sampling.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> diagnosis = rp.diagnose(model, data.isel(time=slice(0, 500)))
    >>> effect = diagnosis.effects[0]
    >>> diagnosis.verdict, effect.kind, round(effect.parameters["force"].value, 1)
    ('missing_effect', 'coulomb_friction', 3.0)
    """
    over_time(data)
    if progress is not None:
        return _diagnose(model, data, progress, _policy)
    with working("Diagnosing") as tell:
        return _diagnose(model, data, tell, _policy)


def _diagnose(
    model: MechanicalModel, data: Any, say: Callable[[str], None], policy: Policy
) -> Diagnosis:
    fewer = taken(model, long_enough(model, record_of(model, data)), policy)
    model, prepared = fewer.model, prepare(fewer.model, fewer.record, policy)
    say("how inputs act between their samples")
    # what its file says of the inputs is known
    known = fewer.thinned or bool(_orders(model))
    held = model if known else with_holds(model, prepared)

    begin = partial(_begun, model, prepared=prepared, say=say, known=known)
    anew: dict[tuple[float, ...], Search] = {}
    begun = {_orders(held)}
    settled = known

    def grown(search: Search, followed: Followed | None = None) -> Search:
        while search.added < policy.most_effects:
            if (followed is not None and followed.came_here(search)) or not add_one(search):
                break
            # noise alone asks for nothing: what its fine structure looks like is luck
            late = None if settled or search.at_floor(search.stage) else _late_holds(search)
            if late is None:
                continue
            if _orders(late) not in begun:
                begun.add(_orders(late))
                anew[_orders(late)] = grown(begin(late))
            if _orders(late) in anew and not _worse(anew[_orders(late)], search):
                return anew[_orders(late)].copy()
        return search

    search = grown(_first(model, held, begin))
    if search.added and not known:
        say("how inputs act between their samples, beside what was found")
        # where more than noise is left, likelihood believes whatever bends to that
        fall = 0.0 if search.noise_alone(policy.shape_above) else policy.visible_fall
        other = with_other_holds(search.stage.model, search.reference, prepared, fall)
        if other is not None:
            settled = True
            again = grown(begin(other))
            search = search if _worse(again, search) else again
    found = conclude_with_one_curve(search)
    if found is None:
        search = second_look(search, grown)
        # only now: as long as something is missing, a fit bends masses and springs alike
        add_wrong_gains(search)
        search = settle_damping(search)
        found = conclude(search, model)
    notes = (*fewer.notes, *warned(model, found.model, prepared))
    return replace(found, model=fewer.as_given(found.model), notes=notes)


def _worse(one: Search, other: Search) -> bool:
    """Return whether a search has come less far than another: it leaves visibly more."""
    return more_left(one.stage, other.stage) > -np.log(1 - one.policy.visible_fall)


def _first(
    model: MechanicalModel, held: MechanicalModel, begin: Callable[[MechanicalModel], Search]
) -> Search:
    """Return the search with the holds that innovations ask for, unless free runs speak against it.

    An innovation is what a sample tells beyond those before it, and there a missing jump of a force
    may look like a late input. Over many swings it does not.
    """
    search = begin(held)
    if held is model or search.at_floor(search.stage):
        return search
    linear = begin(model)
    less = np.log(linear.stage.error) - np.log(search.stage.error)
    return linear if np.mean(less) < np.log(1 - search.policy.visible_fall) else search


def _begun(
    model: MechanicalModel,
    held: MechanicalModel,
    prepared: PreparedRecord,
    say: Callable[[str], None],
    known: bool = False,
) -> Search:
    """Return a search that knows the model's own numbers only, with its inputs held as given.

    It may begin again with other holds, unless they are known.
    """
    say("refit of the model's own parameters")
    own, guided = refit_own(held, prepared)
    steps = [("base", model), ("refit", own.model)]
    begin = None if known else partial(_begun, model, prepared=prepared, say=say)
    search = Search(
        prepared, held, say, linear=own, stage=own, guided=guided, steps=steps, begin=begin
    )
    search.reasons += _of_records(prepared)
    return search


def _late_holds(search: Search) -> MechanicalModel | None:
    """Return the reference with other holds of its inputs, if they show beside an effect."""
    found, reference = with_holds(search.stage.model, search.prepared), search.reference
    if found is search.stage.model:
        return None
    holds, _ = split_holds(found.effects)
    _, own = split_holds(reference.effects)
    return replace(reference, effects=(*own, *holds))


def _orders(model: MechanicalModel) -> tuple[float, ...]:
    """Return the orders of the holds of a model's inputs; none if they are linear."""
    return tuple(hold.values["order"] for hold in split_holds(model.effects)[0])


def _of_records(prepared: PreparedRecord) -> list[str]:
    """Say what several records are used for."""
    said = []
    if prepared.repeats is not None:
        said.append(f"{prepared.repeats.names} repeat each other: their difference is the noise.")
    kept = {piece.record.name for piece in prepared.estimation}
    held = dict.fromkeys(piece.record.name for piece in prepared.held_out)
    whole = [name for name in held if name not in kept]
    if whole:
        blocks = [f"blocks of {name}" for name in held if name in kept]
        said.append(f"Held out to judge: {', '.join([*whole, *blocks])}.")
    return said
