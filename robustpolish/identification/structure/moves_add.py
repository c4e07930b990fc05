"""One step of the search: screen, look at free runs, refit the hopeful, judge, add the best."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from robustpolish.identification.diagnosis.findings import indistinguishable_pair
from robustpolish.identification.fit.least_squares import EvaluatedFit
from robustpolish.identification.fit.parameters import connected, makes_no_force, scaled_effect
from robustpolish.identification.structure.candidates import (
    RefitCandidates,
    family_alternatives,
    reasons_not_refitted,
    select_candidates,
    stick_slip_candidates,
)
from robustpolish.identification.structure.moves_replace import fits_with_smoothing
from robustpolish.identification.structure.score import (
    equivalence_tolerance,
    exceeds_noise_floor,
    improves_fitted_pieces,
    motion_line_reason,
    ranking_error,
    rejection_reason,
    required_advantage,
)
from robustpolish.identification.structure.screening import (
    ScreenedEffect,
    mutually_exclusive,
    null_score,
    places,
    screen,
)
from robustpolish.identification.structure.state import RefittedEffect, Search, SelectionStep
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.mechanical.model import MechanicalModel

# Selection among refitted effects: which is added, with which other, and which are equivalent.


def select_effect(refits: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Return the effect that is to be added, none if none earns its place; note what is like it.

    Parameters
    ----------
    refits : sequence of RefittedEffect
        The best first.
    search : Search
    """
    refits = _drop_no_better_than_periodic(refits, search)
    earned = _first_accepted(refits, search)
    if earned is None:
        return []
    if earned.constant:
        beside = _select_with_constant(earned, refits, search)
        if beside:
            return beside
    here = ranking_error(earned.fitted, refits)
    for item in refits:
        apart = ranking_error(item.fitted, refits) - here
        if item.screened.place != earned.screened.place and apart < equivalence_tolerance(search):
            pair = (each.fitted.model.effects[-1] for each in (earned, item))  # as fitted
            search.indistinguishable_pairs.append(indistinguishable_pair(*pair))
    return [earned]


def _drop_no_better_than_periodic(
    refits: Sequence[RefittedEffect], search: Search
) -> list[RefittedEffect]:
    """Leave out what shows in free runs alone, and there no better than a mere repetition.

    Where a force that only repeats with the inputs explains as much, and the fine structure of
    the missing force speaks against an effect, the motion has a law that this effect is not.
    """
    record = search.prepared.record
    if not search.reference.inputs:
        return list(refits)
    lines = [
        item
        for item in refits
        if motion_line_reason(item.fitted.model.effects[-1], search.reference, record)
    ]
    least = min((ranking_error(item.fitted, refits) for item in lines), default=np.inf)
    limit = least + np.log(1 - search.policy.visible_fall)
    beaten = [
        item
        for item in refits
        if item.screened.score < 0
        and ranking_error(item.fitted, refits) > limit
        and item not in lines
    ]
    why = "a force that merely repeats with the inputs explains as much"
    search.reasons += [f"{item.effect} was not added: {why}." for item in beaten]
    return [item for item in refits if item not in beaten]


def _selection_order(ranked: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Return the candidates by error; among equals the one with the fewest parameters first."""
    if not ranked:
        return []
    limit = ranking_error(ranked[0].fitted, ranked) + equivalence_tolerance(search)
    joined = connected(search.reference)

    def order(item: RefittedEffect) -> tuple[bool, int, bool, float]:
        error = ranking_error(item.fitted, ranked)
        if error > limit:
            return True, 0, False, error
        ends = set(item.effect.at) - {"ground"}
        apart = item.effect.definition.domain == "pair" and not any(ends <= g for g in joined)
        return False, item.size, apart, error

    return _prefer_simpler(_prefer_loud_part(sorted(ranked, key=order), search), search)


def _prefer_loud_part(ordered: list[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Put what does better in the louder part of decays ahead if the quiet one hardly differs.

    What is held out of a decay is its quieter part, where a wrong place may do as well.
    """
    best, policy = ordered[0], search.policy
    if search.reference.inputs:
        return ordered
    limit = ranking_error(best.fitted, ordered) + np.log(1 + policy.together)
    louder = [
        item
        for item in ordered[1:]
        if item.size <= best.size
        and ranking_error(item.fitted, ordered) < limit
        and improves_fitted_pieces(best.fitted, item.fitted, policy)
    ]
    if not louder:
        return ordered
    first = min(louder, key=lambda item: float(np.sum(np.log(item.fitted.fitted))))
    return [first, *(item for item in ordered if item is not first)]


def _prefer_simpler(ordered: list[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Put a simpler kind of the same family ahead if the first is not better enough."""
    best = ordered[0]
    error = ranking_error(best.fitted, ordered)
    simpler = [
        item
        for item in ordered
        if mutually_exclusive(item.effect.definition, best.effect.definition)
        and item.effect.at == best.effect.at
        and item.size < best.size
        and ranking_error(item.fitted, ordered)
        < error + required_advantage(best, item.size, search)
    ]
    if not simpler:
        return ordered
    first = min(simpler, key=lambda item: (item.size, ranking_error(item.fitted, ordered)))
    # what is like the simpler kind, and simpler still, may be of any family: one that never slips
    # is a preload
    most = ranking_error(first.fitted, ordered) + equivalence_tolerance(search)
    like = [i for i in ordered if i.size < first.size and ranking_error(i.fitted, ordered) < most]
    first = min([first, *like], key=lambda item: (item.size, ranking_error(item.fitted, ordered)))
    return [first, *(item for item in ordered if item is not first)]


def _first_accepted(refits: Sequence[RefittedEffect], search: Search) -> RefittedEffect | None:
    """Return the first candidate that earns its place; those that are refused set no measure."""
    left = list(refits)
    while left:
        item = _selection_order(left, search)[0]
        remark = rejection_reason(search.stage, item.fitted, search.prepared)
        if not remark:
            return item
        search.reasons.append(f"{item.effect} was not added: {remark}.")
        left = [other for other in left if other is not item]
    return None


def _select_with_constant(
    constant: RefittedEffect, ranked: Sequence[RefittedEffect], search: Search
) -> list[RefittedEffect]:
    """Return what earns its place beside a constant, and the constant; none if nothing does.

    An offset or a preload hides how well other effects do, and friction that never slips takes its
    place if it is left for later. Beside a law that is not linear an offset and a preload are no
    longer alike, so both are tried.
    """
    found: list[tuple[float, list[RefittedEffect]]] = []
    for item in _best_of_each_family(ranked)[: search.policy.most_paired]:
        for effect in constant_candidates(constant, ranked, search):
            both = search.cached_fit_with(item.fitted, effect)
            if both is None or rejection_reason(constant.fitted, both, search.prepared, place=-2):
                continue
            later = RefittedEffect(ScreenedEffect(effect, 0.0, 0.0), both)
            stays = not rejection_reason(item.fitted, both, search.prepared)
            found.append((ranking_error(both, [both]), [item, later] if stays else [item]))
    return min(found, key=lambda pair: pair[0])[1] if found else []


def _best_of_each_family(ranked: Sequence[RefittedEffect]) -> list[RefittedEffect]:
    """Return the first of each family at each place, constants left out."""
    first: dict[tuple[str, tuple[str, ...]], RefittedEffect] = {}
    for item in ranked:
        if not item.constant:
            first.setdefault(item.family, item)
    return list(first.values())


def constant_candidates(
    constant: RefittedEffect, ranked: Sequence[RefittedEffect], search: Search
) -> list[Effect]:
    """Return a constant as fitted, and the likeliest one of each other kind.

    Where it is one of the refits, with the values that were fitted.
    """
    refitted = [item.fitted.model.effects[-1] for item in ranked if item.constant]
    likely = [candidate.effect for candidate in _likely_constants(search)]
    found = [constant.fitted.model.effects[-1], *refitted, *likely]
    return list({effect.kind: effect for effect in reversed(found)}.values())[::-1]


def together(
    refits: Sequence[RefittedEffect],
    pairs: Sequence[tuple[ScreenedEffect, ...]],
    search: Search,
) -> list[RefittedEffect]:
    """Return two effects that earn their places only beside each other, none if there are none.

    Parameters
    ----------
    refits : sequence of RefittedEffect
        Of single effects, none of which earned its place, the best first.
    pairs : sequence of tuple of ScreenedEffect
        What free runs ask for.
    search : Search
    """
    policy, known = search.policy, {item.screened.place: item for item in refits}
    limit = ranking_error(search.stage, refits) + np.log(1 - policy.hiding_fall)
    near = [i for i in refits[: policy.most_paired] if ranking_error(i.fitted, refits) < limit]
    if near and not any(item.constant for item in near):
        near += _likeliest_constant(refits, search)
    tried = [*pairs, *((a.screened, b.screened) for a, b in combinations(near, 2))]
    tried += _pairs_with_simple_laws(near)
    known |= {item.screened.place: item for item in near}
    found: list[tuple[float, list[RefittedEffect]]] = []
    for pair in tried:
        if mutually_exclusive(pair[0].effect.definition, pair[1].effect.definition):
            continue
        alone = [_single_effect_fit(candidate, known, search) for candidate in pair]
        if None in alone:
            continue
        one, other = (item for item in alone if item is not None)
        search.say(f"refit with {one.effect} and {other.effect}")
        both = search.cached_fit_with(one.fitted, pair[1].effect)
        first = search.fit_with(search.stage.model, pair[0].effect, pair[1].effect)
        fits = [fitted for fitted in (both, first) if fitted is not None]
        if not fits:
            continue
        both = min(fits, key=lambda fitted: ranking_error(fitted, fits))
        kept = rejection_reason(other.fitted, both, search.prepared, place=-2)
        if not kept and not rejection_reason(one.fitted, both, search.prepared):
            found.append((ranking_error(both, [both]), [one, RefittedEffect(other.screened, both)]))
    if not found:
        return []
    earned = min(found, key=lambda item: item[0])[1]
    search.reasons.append(f"{earned[0].effect} earns its place only beside {earned[1].effect}.")
    return earned


def _pairs_with_simple_laws(
    near: Sequence[RefittedEffect],
) -> list[tuple[ScreenedEffect, ScreenedEffect]]:
    """Return pairs of what is absurd by itself with the laws of one number at its place.

    What else is missing there bends it: a friction beside a drag falls with speed, to nothing.
    """
    found = []
    for item in near:
        effect = item.fitted.model.effects[-1]
        if not effect.definition.implausible(effect.values):
            continue
        for kind in kinds().values():
            numbers = [p.name for p in kind.parameters if p.fitted]
            if kind.domain == "pair" and kind.linear_in == tuple(numbers) and len(numbers) == 1:
                law = Effect(kind.kind, effect.at, {numbers[0]: 0.0})
                found.append((item.screened, ScreenedEffect(law, 0.0, 0.0)))
    return found


def _single_effect_fit(
    candidate: ScreenedEffect,
    known: dict[tuple[str, tuple[str, ...]], RefittedEffect],
    search: Search,
) -> RefittedEffect | None:
    """Return the fit of an effect without the other, made now if there is none yet."""
    if candidate.place not in known:
        fitted = search.fit_with(search.stage.model, candidate.effect)
        if fitted is None:
            return None
        known[candidate.place] = RefittedEffect(candidate, fitted)
    return known[candidate.place]


def _likeliest_constant(ranked: Sequence[RefittedEffect], search: Search) -> list[RefittedEffect]:
    """Return an offset or preload, which alone shows next to nothing of what it hides."""
    refitted = [item for item in ranked if item.constant]
    if refitted:
        return refitted[:1]
    for candidate in _likely_constants(search)[:1]:
        fitted = search.fit_with(search.stage.model, candidate.effect)
        if fitted is not None:
            refitted.append(RefittedEffect(candidate, fitted))
    return refitted


def _likely_constants(search: Search) -> list[ScreenedEffect]:
    """Return what was screened and never changes, the likeliest first."""
    screened = search.screening.candidates if search.screening is not None else ()
    return sorted((each for each in screened if each.constant), key=lambda each: -each.score)


_VANISHED_STIFFNESS = 0.03
"""Share of a spring as it was known that is hardly anything: one may be ten times too stiff."""


def forward_step(search: Search) -> bool:
    """Try to add one effect; return whether one earned its place."""
    if search.at_noise_floor(search.stage) or not search.prepared.work.left():
        return False
    number = search.added + 1
    for start in _screening_models(search):
        search.say(f"screening for effect {number}")
        screening = search.screening = screen(start, search.prepared)
        search.say(f"a look at free runs for effect {number}")
        found = select_candidates(screening, search.stage.fit, search.prepared).without(
            search.excluded_effects
        )
        refits = _refit_with_new_windows(_refit_candidates(search, start, found), start, search)
        refits += _refit_alternatives(refits, found, start, search)
        ranked = sorted(refits, key=lambda item: ranking_error(item.fitted, refits))
        why = reasons_not_refitted(screening.candidates, found, refits, search)
        search.record_candidates(ranked, screening.candidates, number, why)
        others = [
            r for r in ranked if not rejection_reason(search.stage, r.fitted, search.prepared)
        ]
        near = _insufficient_improvements(ranked, search)
        before = search.copy()
        room = search.policy.most_effects - search.added
        earned = (
            select_effect(ranked, search)[:room]
            or (together(ranked, found.pairs, search) if room > 1 else [])
            or select_effect(_refit_preloads(refits, start, search), search)
        )
        if earned:
            search.accept(earned)
            others = [item for item in others if item not in earned]
            search.selection_steps.append(SelectionStep(before, tuple(earned), tuple(others)))
            return True
        search.selection_steps = [turn for turn in search.selection_steps if turn.added]
        search.selection_steps.append(SelectionStep(before, (), tuple(near), tuple(ranked)))
        if screening.level.force <= search.policy.silent:
            break  # no missing force is seen: another start will not show one
    return False


def _insufficient_improvements(
    ranked: Sequence[RefittedEffect], search: Search
) -> list[RefittedEffect]:
    """Return what makes the error fall, if not enough to be added: another may hide what it does.

    A constant hides nothing but constants, and these are tried beside each other anyway.
    """
    here = ranking_error(search.stage, ranked)
    return [r for r in ranked if ranking_error(r.fitted, ranked) < here and not r.constant]


def _refit_alternatives(
    refits: Sequence[RefittedEffect], found: RefitCandidates, start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Refit what could stand for the effect that would be added: elsewhere, or another kind there.

    Of which kind a friction is shows in runs, once there is friction at all; and where it is, an
    effect that explains everything may hide.
    """
    assert search.screening is not None
    earned = _forward_choice(refits, search)
    if earned is None:
        return _refit_with_smoothing(refits, start, search)
    if earned.constant:
        return []
    effect, policy = earned.effect, search.policy
    candidates = found.candidates_elsewhere(effect, policy.near_error)[: policy.most_elsewhere]
    if effect.definition.swinging:
        # what hangs there and hardly loses energy pulls as a force from outside does
        candidates += [c for c, _ in search.screening.lines if c.effect.at == effect.at]
    tried = _refit_untried(candidates, refits, start, search)
    if effect.definition.swinging or effect.definition.line:
        # what sticks and slips swings by itself, and its velocity while it sticks is noise
        stuck = stick_slip_candidates(search.stage.fit, search.prepared, search.screening)
        tried += _refit_untried(stuck, [*refits, *tried], start, search)
    earned = _forward_choice([*refits, *tried], search) or earned
    effect = earned.effect
    if effect.definition.timing is not None:  # a delay may be a lag, or the other way round
        late = [c for c in search.screening.late if c.effect.at == effect.at]
        tried += _refit_untried(late, [*refits, *tried], start, search)
    if effect.definition.family:
        # less than a visible fall tells its kinds apart: all of them if more than noise is left
        alike = (
            family_alternatives(effect, search.stage.fit, search.prepared, search.screening)
            if exceeds_noise_floor(earned.fitted, search)
            else _similarly_likely_kinds(earned, found, policy.near_score)
        )
        tried += _refit_untried(alike, [*refits, *tried], start, search)
    here = [item for item in [*refits, *tried] if item.effect.at == effect.at]
    return tried + fits_with_smoothing(here, start, search)


def _similarly_likely_kinds(
    earned: RefittedEffect, found: RefitCandidates, near: float
) -> list[ScreenedEffect]:
    """Return the kinds of an effect's family at its place that screening finds about as likely.

    A kind that leaves noise alone may be one to which another comes close.
    """
    return [
        c
        for c in [*found.first, *found.further]
        if c.effect.at == earned.effect.at
        and mutually_exclusive(c.effect.definition, earned.effect.definition)
        and c.score > near * earned.screened.score
    ]


def _forward_choice(refits: Sequence[RefittedEffect], search: Search) -> RefittedEffect | None:
    """Return the effect that would be added as things stand; nothing is noted."""
    ranked = sorted(refits, key=lambda item: ranking_error(item.fitted, refits))
    earned = select_effect(ranked, search.copy())
    return earned[0] if earned else None


def _refit_untried(
    candidates: Sequence[ScreenedEffect],
    refits: Sequence[RefittedEffect],
    start: MechanicalModel,
    search: Search,
) -> list[RefittedEffect]:
    """Refit the candidates that have not been refitted yet."""
    done = {item.screened.place for item in refits}.union(search.excluded_effects)
    tried = []
    for candidate in candidates:
        if candidate.place not in done:
            search.say(f"refit with {candidate.effect} instead")
            fitted = search.fit_with(start, candidate.effect)
            if fitted is not None:
                tried.append(RefittedEffect(candidate, fitted))
            done.add(candidate.place)
    return tried


def _refit_with_smoothing(
    refits: Sequence[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Refit dry frictions that turn over gently where jumps help what was fitted, and only that.

    What is held out of a decay may be so slow that a friction does no more there than a damper.
    """
    helpful = [
        item
        for item in refits
        if item.effect.definition.turns_over
        and improves_fitted_pieces(search.stage, item.fitted, search.policy)
    ]
    places = dict.fromkeys(item.effect.at for item in helpful)
    here = ([item for item in helpful if item.effect.at == at] for at in places)
    return [rounded for some in here for rounded in fits_with_smoothing(some, start, search)]


def _refit_candidates(
    search: Search, start: MechanicalModel, found: RefitCandidates
) -> list[RefittedEffect]:
    """Refit the candidates that deserve it, as long as it can change anything."""
    refits: list[RefittedEffect] = []
    in_turn = [*found.first, *found.further]
    likeliest = max((candidate.score for candidate in in_turn), default=0.0)
    for candidate in in_turn:
        # one that explains all with absurd numbers leaves its place to others
        sound = [r for r in refits if not rejection_reason(search.stage, r.fitted, search.prepared)]
        explained = any(search.at_noise_floor(item.fitted) for item in sound)
        if explained and candidate.score < search.policy.near_score * found.first[0].score:
            continue
        if candidate in found.further and sound:
            break
        search.say(f"refit with {candidate.effect}")
        fitted = search.fit_with(start, candidate.effect)
        if fitted is not None and candidate.score == likeliest:
            fitted = _fit_from_larger_size(candidate, fitted, start, search)
        if fitted is not None:
            refits.append(RefittedEffect(candidate, fitted))
    refits += _refit_other_constants(refits, start, search)
    return _refit_resonators_at_lines(
        [*refits, *_refit_resonators_elsewhere(refits, start, search)], start, search
    )


def _refit_with_new_windows(
    refits: list[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Fit what would be added, or is likeliest, once more if it leaves far more than noise.

    The windows of its first fit begin where a motion was that was smoothed without its law: of one
    that is far stronger than the springs they are lost, and the fit with them.
    """
    first = _forward_choice(refits, search) or max(
        refits, key=lambda item: item.screened.score, default=None
    )
    least = search.policy.far * search.prepared.scales.noise
    if first is None or not np.all(first.fitted.fitted > least):
        return refits
    search.say(f"refit with {first.effect}, its windows begun anew")
    again = search.fit_with(start, first.effect, anew=True)
    if again is None or ranking_error(again, [first]) >= ranking_error(first.fitted, [again]):
        return refits
    better = RefittedEffect(first.screened, again)
    return [better if item is first else item for item in refits]


def _fit_from_larger_size(
    candidate: ScreenedEffect, fitted: EvaluatedFit, start: MechanicalModel, search: Search
) -> EvaluatedFit:
    """Return the fit of an effect, begun with more of it if nothing of it is left.

    Of a law that is stronger than all springs, a motion that was smoothed without it shows but a
    hundredth.
    """
    if not makes_no_force(fitted.model.effects[-1]):
        return fitted
    fits = [fitted]
    for times in search.policy.larger:
        search.say(f"refit with {candidate.effect}, {times:g} times as large")
        larger = search.fit_with(start, scaled_effect(candidate.effect, times))
        fits += [larger] if larger is not None else []
    return min(fits, key=lambda each: ranking_error(each, fits))


def _refit_other_constants(
    refits: Sequence[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Refit constants of the other kinds beside one, where a law was found that tells them apart.

    To a linear machine an offset is a preload; one with a clearance or a cubic spring feels the
    preload alone.
    """
    first = next((item for item in refits if item.constant), None)
    if first is None or not any(e.definition.domain == "pair" for e in start.effects):
        return []
    beside = constant_candidates(first, refits, search)
    return _refit_untried([ScreenedEffect(e, 0.0, 0.0) for e in beside], refits, start, search)


def _refit_resonators_at_lines(
    refits: list[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Refit what swings by itself at the lines of the missing force too, if nothing else helps.

    It pulls most at the frequency of its own, but a motion that is smoothed without it lacks its
    notch there, so that screening may prefer a slow and heavy one.
    """
    helped = any(not rejection_reason(search.stage, r.fitted, search.prepared) for r in refits)
    if helped or search.screening is None:
        return refits
    policy = search.policy
    swinging = [(kind, kind.swinging) for kind in kinds().values() if kind.swinging]
    lines = search.screening.lines[: policy.most_lines]
    masses = {dof.name: dof.mass for dof in start.dofs if dof.mass > 0}
    found = {item.screened.place: item for item in refits}
    for (kind, values), (line, frequency) in itertools.product(swinging, lines):
        at = line.effect.at
        if (kind.kind, at) in search.excluded_effects or at[0] not in masses or frequency <= 0:
            continue
        effect = Effect.of(kind, at, values(policy.light * masses[at[0]], frequency))
        search.say(f"refit with {effect} at {frequency:.3g} Hz")
        fitted = search.fit_with(start, effect)
        if fitted is None:
            continue
        tried = RefittedEffect(ScreenedEffect(effect, 0.0, 0.0), fitted)
        both = [found.get((kind.kind, at), tried), tried]
        found[kind.kind, at] = min(both, key=lambda item: ranking_error(item.fitted, both))
    return list(found.values())


def _refit_preloads(
    refits: Sequence[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Refit constant forces where a law was found that a preload would show in.

    A linear machine seen by accelerometers shows none, and that is what screening knows of it.
    """
    bent = {at for e in start.effects if e.definition.domain == "pair" for at in e.at}
    done = {item.screened.place for item in refits}.union(search.excluded_effects)
    done |= {(e.kind, e.at) for e in start.effects}
    tried: list[RefittedEffect] = []
    for name in start.free:
        load = Effect("constant_force", (name,), {"force": 0.0})
        if name not in bent or (load.kind, load.at) in done:
            continue
        search.say(f"refit with {load}")
        fitted = search.fit_with(start, load)
        if fitted is not None:
            tried.append(RefittedEffect(ScreenedEffect(load, 0.0, 0.0), fitted))
    return sorted(tried, key=lambda item: ranking_error(item.fitted, tried))


def _refit_resonators_elsewhere(
    refits: Sequence[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Refit what swings by itself, and would earn its place, at all other places.

    Near a mode of the machine it splits that in two. No motion that a model shows without it has
    both, so that a look along such a motion does not tell where it is.
    """
    if any(search.at_noise_floor(item.fitted) for item in refits):
        return []
    moved = []
    for item in refits:
        kind = item.effect.definition
        if not kind.swinging or rejection_reason(search.stage, item.fitted, search.prepared):
            continue
        values = item.fitted.model.effects[-1].values
        for at in places(start, kind):
            moved.append(ScreenedEffect(Effect(kind.kind, at, values), 0.0, 0.0))
    return _refit_untried(moved, refits, start, search)


def _screening_models(search: Search) -> list[MechanicalModel]:
    """Return the models from which to screen, the more likely one first.

    A free-run fit bends the model's numbers to what is missing; one that is led by the data
    leaves that to the free force, but may wander off where the data say little. Where it left
    hardly anything of a spring, which then gives way to the offset of a sensor, the numbers as they
    were known lead.
    """
    if search.stage.model.effects != search.short_window_model.effects:
        return [search.stage.model]
    pair = [search.stage.model, search.short_window_model]
    springs = zip(search.reference.springs, search.stage.model.springs, strict=True)
    gone = any(now.stiffness < _VANISHED_STIFFNESS * was.stiffness for was, now in springs)
    known = [search.reference] if gone else []
    return [*known, *sorted(pair, key=lambda model: null_score(model, search.prepared))]
