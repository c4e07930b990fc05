"""Learn which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from robustpolish.base.budget import progress_bar, single_threaded_blas
from robustpolish.identification.diagnosis.result import Diagnosis
from robustpolish.identification.fit.least_squares import EvaluatedFit
from robustpolish.identification.fit.prepared import PreparedRecord, prepare, reduce_record
from robustpolish.identification.policy import POLICY, Policy
from robustpolish.identification.record import record_of, require_length, require_time_data
from robustpolish.identification.refit import (
    collect_warnings,
    fit_own_parameters,
    split_holds,
    with_reselected_holds,
    with_selected_holds,
)
from robustpolish.identification.structure.decays import extrapolation_error, split_decays
from robustpolish.identification.structure.moves_add import forward_step
from robustpolish.identification.structure.moves_replace import (
    backward_elimination,
    prune_indistinguishable,
    rebuild_steps,
    replace_kinds,
)
from robustpolish.identification.structure.moves_special import add_gain_errors, select_damping_laws
from robustpolish.identification.structure.score import (
    log_error_ratio,
    ranking_error,
    rejection_reason,
)
from robustpolish.identification.structure.state import RefittedEffect, Search, SelectionStep
from robustpolish.identification.structure.verdict import conclude, conclude_with_single_curve
from robustpolish.machines.mechanical.model import MechanicalModel

_SAME_ERRORS = 1e-6
"""Relative difference of all errors below which two fits are one motion, by rounding."""


@dataclass
class VisitedSearches:
    """Searches as they were when they went on.

    Another one that comes to the motion of one of them, as with an effect more that does nothing,
    has nothing to find that has not been found.
    """

    searches: list[Search] = field(default_factory=list)

    def already_visited(self, search: Search) -> bool:
        """Return whether another search went on from this motion; from now on one does."""
        for each in self.searches:
            if each.excluded_effects == search.excluded_effects and _same_errors(
                each.stage, search.stage
            ):
                return True
        self.searches.append(search.copy())
        return False


def _same_errors(one: EvaluatedFit, other: EvaluatedFit) -> bool:
    pairs = (one.error, other.error), (one.fit.rmse, other.fit.rmse)
    return one.reproducible == other.reproducible and all(
        np.isfinite(a).all() and np.allclose(a, b, rtol=_SAME_ERRORS, atol=0.0) for a, b in pairs
    )


def backtrack(search: Search, grow: Callable[[Search, VisitedSearches], Search]) -> Search:
    """Return the search, or the one in which a runner-up was followed and left visibly less.

    Parameters
    ----------
    search : Search
        At its end.
    grow : callable
        Goes on with a search until nothing more earns its place, or another one came there before.
    """
    first = search.stage
    followed = VisitedSearches([turn.before for turn in search.selection_steps])
    search = backward_elimination(search)
    for turn, item in _runners_up(search):
        if (
            search.residual_is_noise(search.policy.at_noise_floor)
            or not search.prepared.work.left()
        ):
            break
        instead = f" in place of {turn.added[0].effect}" if turn.added else ", to see what follows"
        search.say(f"{item.effect}{instead}")
        other = turn.before.copy()
        other.accept([item])
        search = _better_search(
            search, backward_elimination(grow(other, followed), last=not turn.added)
        )
    search = prune_indistinguishable(replace_kinds(_leave_one_out(search, grow, followed)))
    return search if search.stage is first else rebuild_steps(search)


def _leave_one_out(
    search: Search, grow: Callable[[Search, VisitedSearches], Search], followed: VisitedSearches
) -> Search:
    """Return the search, or the one in which others came in place of an effect that was found.

    Where there is but one, what came close in its place has been followed already.
    """
    places = [(e.kind, e.at) for e in search.added_to(search.stage.model)]
    for place in places:
        there = [(e.kind, e.at) for e in search.stage.model.effects]
        if (
            place not in there
            or len(places) < 2
            or search.residual_is_noise(search.policy.shape_above)
        ):
            continue
        if not search.prepared.work.left():
            break
        without = search.fit_without(search.stage.model, there.index(place))
        if without is None:
            continue
        search.say(f"what comes without {search.stage.model.effects[there.index(place)]}")
        other = replace(search.copy(), stage=without, excluded_effects=(place,))
        search = _better_search(
            search, replace(backward_elimination(grow(other, followed)), excluded_effects=())
        )
    return search


def _better_search(search: Search, other: Search) -> Search:
    """Return the other search if it left visibly less, each effect counted, and is sound.

    Where all records are decays, it has to predict their ends as well as the search does.
    """
    least = _penalised_error(search, other) + np.log(1 - search.policy.together)
    if not (_penalised_error(other, search) < least and _all_determined(other)):
        return search
    return search if _extrapolates_worse(search, other) else other


def _extrapolates_worse(search: Search, other: Search) -> bool:
    """Return whether the other search predicts visibly worse how decays go on."""
    prepared, reference = search.prepared, search.reference
    cut = split_decays(reference, prepared.record)
    if cut is None or not (search.stage.reproducible and other.stage.reproducible):
        return False
    here, there = (
        extrapolation_error(each.stage.model, prepared, reference, cut) for each in (search, other)
    )
    return there > here - np.log(1 - search.policy.visible_fall)


def _runners_up(search: Search) -> list[tuple[SelectionStep, RefittedEffect]]:
    """Return what is followed: what came closest when the search ended, and at the first turns.

    Of a family at one place the simplest kind stands for all but the one that was added.
    """
    found = []
    ended = [turn for turn in search.selection_steps if not turn.added]
    selection_steps = [*ended, *(turn for turn in search.selection_steps if turn.added)]
    most = [*[search.policy.followed[0]] * len(ended), *search.policy.followed]
    for turn, count in zip(selection_steps, most, strict=False):
        seen: dict[tuple[str, tuple[str, ...]], RefittedEffect] = {}
        for item in sorted(turn.others, key=lambda item: item.size):
            seen.setdefault(item.family, item)
        different = [item for item in turn.others if item in seen.values()]
        found += [(turn, item) for item in different[:count]]
    return found


def _all_determined(search: Search) -> bool:
    """Return whether the data determine every effect, and none is absurd, beside the others."""
    effects = search.stage.model.effects
    return not any(
        rejection_reason(search.linear, search.stage, search.prepared, place)
        for place in range(len(search.reference.effects), len(effects))
    )


def _penalised_error(search: Search, other: Search) -> float:
    """Return what counts: the held-out error, and what each effect has to make it fall."""
    error = ranking_error(search.stage, [other.stage])
    return error - search.added * float(np.log(1 - search.policy.together))


@single_threaded_blas
def diagnose(
    model: MechanicalModel,
    data: Any,
    progress: Callable[[str], None] | None = None,
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
    require_time_data(data)
    if progress is not None:
        return _diagnose(model, data, progress, POLICY)
    with progress_bar("Diagnosing") as tell:
        return _diagnose(model, data, tell, POLICY)


def _diagnose(
    model: MechanicalModel, data: Any, say: Callable[[str], None], policy: Policy
) -> Diagnosis:
    fewer = reduce_record(model, require_length(model, record_of(model, data)), policy)
    model, prepared = fewer.model, prepare(fewer.model, fewer.record, policy)
    say("how inputs act between their samples")
    # what its file says of the inputs is known
    known = fewer.thinned or bool(_hold_orders(model))
    held = model if known else with_selected_holds(model, prepared)

    begin = partial(_start_search, model, prepared=prepared, say=say, known=known)
    anew: dict[tuple[float, ...], Search] = {}
    begun = {_hold_orders(held)}
    settled = known

    def grown(search: Search, followed: VisitedSearches | None = None) -> Search:
        while search.added < policy.most_effects:
            if (followed is not None and followed.already_visited(search)) or not forward_step(
                search
            ):
                break
            # noise alone asks for nothing: what its fine structure looks like is luck
            late = (
                None
                if settled or search.at_noise_floor(search.stage)
                else _holds_beside_effects(search)
            )
            if late is None:
                continue
            if _hold_orders(late) not in begun:
                begun.add(_hold_orders(late))
                anew[_hold_orders(late)] = grown(begin(late))
            if _hold_orders(late) in anew and not _significantly_worse(
                anew[_hold_orders(late)], search
            ):
                return anew[_hold_orders(late)].copy()
        return search

    search = grown(_search_with_holds(model, held, begin))
    if search.added and not known:
        say("how inputs act between their samples, beside what was found")
        # where more than noise is left, likelihood believes whatever bends to that
        fall = 0.0 if search.residual_is_noise(policy.shape_above) else policy.visible_fall
        other = with_reselected_holds(search.stage.model, search.reference, prepared, fall)
        if other is not None:
            settled = True
            again = grown(begin(other))
            search = search if _significantly_worse(again, search) else again
    found = conclude_with_single_curve(search)
    if found is None:
        search = backtrack(search, grown)
        # only now: as long as something is missing, a fit bends masses and springs alike
        add_gain_errors(search)
        search = select_damping_laws(search)
        found = conclude(search, model)
    notes = (*fewer.notes, *collect_warnings(model, found.model, prepared))
    return replace(found, model=fewer.with_original_holds(found.model), notes=notes)


def _significantly_worse(one: Search, other: Search) -> bool:
    """Return whether a search has come less far than another: it leaves visibly more."""
    return log_error_ratio(one.stage, other.stage) > -np.log(1 - one.policy.visible_fall)


def _search_with_holds(
    model: MechanicalModel, held: MechanicalModel, begin: Callable[[MechanicalModel], Search]
) -> Search:
    """Return the search with the holds that innovations ask for, unless free runs speak against it.

    An innovation is what a sample tells beyond those before it, and there a missing jump of a force
    may look like a late input. Over many swings it does not.
    """
    search = begin(held)
    if held is model or search.at_noise_floor(search.stage):
        return search
    linear = begin(model)
    less = np.log(linear.stage.error) - np.log(search.stage.error)
    return linear if np.mean(less) < np.log(1 - search.policy.visible_fall) else search


def _start_search(
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
    own, short_window_model = fit_own_parameters(held, prepared)
    steps = [("base", model), ("refit", own.model)]
    begin = None if known else partial(_start_search, model, prepared=prepared, say=say)
    search = Search(
        prepared,
        held,
        say,
        linear=own,
        stage=own,
        short_window_model=short_window_model,
        steps=steps,
        begin=begin,
    )
    search.reasons += _describe_held_out(prepared)
    return search


def _holds_beside_effects(search: Search) -> MechanicalModel | None:
    """Return the reference with other holds of its inputs, if they show beside an effect."""
    found, reference = with_selected_holds(search.stage.model, search.prepared), search.reference
    if found is search.stage.model:
        return None
    holds, _ = split_holds(found.effects)
    _, own = split_holds(reference.effects)
    return replace(reference, effects=(*own, *holds))


def _hold_orders(model: MechanicalModel) -> tuple[float, ...]:
    """Return the orders of the holds of a model's inputs; none if they are linear."""
    return tuple(hold.values["order"] for hold in split_holds(model.effects)[0])


def _describe_held_out(prepared: PreparedRecord) -> list[str]:
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
