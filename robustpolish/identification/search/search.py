"""The search for missing effects: sets are fitted, the most promising first, and scored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.base.results import plus_minus
from robustpolish.identification.fit.least_squares import covariance_of
from robustpolish.identification.fit.parameters import chain_keys
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.observer.runs import Chains
from robustpolish.identification.policy import NEGLIGIBLE, STRONG
from robustpolish.identification.record import output_sizes
from robustpolish.identification.refit import fit_own_parameters
from robustpolish.identification.search.equivalents import find_force_equivalents
from robustpolish.identification.search.fits import Fits
from robustpolish.identification.search.score import (
    Place,
    ScoredModel,
    nats,
    scores,
    simplest_of_best,
)
from robustpolish.identification.search.screening import (
    Screening,
    null_score,
    places,
    screen,
)
from robustpolish.identification.search.sets import (
    EffectSet,
    problem_along_motion,
    problem_of_free_runs,
)
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.kind import CONSTANT, Timing
from robustpolish.machines.mechanical.data import connected, effect_unit
from robustpolish.machines.mechanical.model import MechanicalModel

MOST_EFFECTS = 4
"""Effects that are added at most, constants aside: with more the data decide nothing."""
TOGETHER = 3
"""Effects of a set that is proposed at once, constants aside."""
REFITS, SHOWN = 5, 5
"""Sets that are fitted in a round, and whose expected gains are told before."""
PROMISING = 0.75
"""Share of the nats gained so far that is to be expected of a set that is fitted too."""
REACHED = 0.5
"""Share of the nats expected of a set that its fit has to gain, or larger sets are tried too."""
ELSEWHERE, CONSTANTS, ALTERNATIVES = 2, 4, 3
"""Other places of an effect that are fitted, other constants in place of one, and other kinds."""
NEAR = 0.5
"""Share of the force of an effect that another kind may leave to be fitted in its place."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A set of effects that was fitted, or why it was not.

    Attributes
    ----------
    effects : tuple of Effect
        All that were added to the model, with the values of the fit, the new ones first.
    step : int
        In the search for the how-manieth effect it was tried.
    scored : ScoredModel or None
    refused : str
        Why it cannot be the answer; empty if it could.
    """

    effects: tuple[Effect, ...]
    step: int
    scored: ScoredModel | None
    refused: str = ""


@dataclass
class EffectSearch:
    """State of the search, complete after every step.

    Attributes
    ----------
    fits : Fits
    say : callable
        Called with a short text at every step.
    base, best : ScoredModel
        The model's own numbers refitted, and the best so far.
    led : MechanicalModel
        The refitted model of a fit that was led by the data.
    steps : list of (str, ScoredModel)
    tried : list of Tried
    screening : Screening, optional
        Of the last step.
    expected : dict
        Sets with the gain that linear least squares expected in the last step, by kinds and places.
    most : int
        Effects that are added at most.
    enough : ndarray, shape (ny,), optional
        Errors at which nothing more is added.
    """

    fits: Fits
    say: Callable[[str], None]
    base: ScoredModel
    best: ScoredModel
    led: MechanicalModel
    steps: list[tuple[str, ScoredModel]] = field(default_factory=list)
    tried: list[Tried] = field(default_factory=list)
    screening: Screening | None = None
    expected: dict[frozenset[Place], EffectSet] = field(default_factory=dict)
    most: int = MOST_EFFECTS
    enough: Array | None = None

    @property
    def prepared(self) -> PreparedRecord:
        """The record."""
        return self.fits.prepared

    @property
    def reference(self) -> MechanicalModel:
        """The model as it was given."""
        return self.fits.reference

    def at_noise_floor(self, scored: ScoredModel) -> bool:
        """Return whether the noise alone is left, or so little that it does not matter."""
        enough = NEGLIGIBLE * np.std(self.prepared.record.Y, axis=0)
        if self.enough is not None:
            enough = np.maximum(enough, self.enough)
        # what is held out of a decay is the quieter part of it
        left = np.maximum(scored.fitted.error, np.sqrt(np.mean(scored.sizes**2, axis=0)))
        return bool(np.all(left <= enough)) or self.fits.at_noise_floor(scored.fitted)

    def gain(self, other: ScoredModel) -> float:
        """Return the nats by which another model is better than the best so far."""
        return nats(other, self.best)

    def note(self, scored: ScoredModel | None, effects: Sequence[Effect]) -> str:
        """Enter a fit among what was tried, and return why it cannot be the answer."""
        step = 1 + self.best.laws
        refused = scored.refusal[0] if scored is not None else "no fit ended well"
        told = scored.added if scored is not None else (*self.best.added, *effects)
        told = tuple(sorted(told, key=lambda e: (e.kind, e.at) in self.best.places))
        self.tried.append(Tried(told, step, scored, refused))
        return refused

    def accept(self, chosen: ScoredModel) -> None:
        """Go on with a model."""
        new = [e for e in chosen.added if (e.kind, e.at) not in self.best.places]
        name = " and ".join(map(str, new)) or "fewer effects"
        size = output_sizes(self.prepared.record.Y)
        errors = [(m.fitted.error / size).tolist() for m in (self.best, chosen)]
        fell = ", ".join(
            f"{output} {before:.3g} -> {after:.3g}"
            for output, before, after in zip(chosen.model.output_names, *errors, strict=True)
        )
        self.best = chosen
        self.steps.append((name, chosen))
        found = "; ".join(described_effects(chosen)) or "nothing"
        self.say(f"found {found}; held-out error over the output's deviation: {fell}")


def described_effects(scored: ScoredModel) -> list[str]:
    """Return the effects that were added, each with its sizes and their standard errors."""
    errors = stderr_from_covariance(covariance_of(scored.fitted.fit))
    first, said = len(scored.reference.effects), []
    for index, effect in enumerate(scored.added, first):
        sizes = [
            f"{p.name} = {plus_minus(effect.values[p.name], errors[key])} "
            f"{effect_unit(scored.model, effect, p.name)}"
            for p in effect.definition.parameters
            if (key := f"effect[{index}].{p.name}") in errors
        ]
        said.append(f"{effect}: {', '.join(sizes)}" if sizes else str(effect))
    return said


def begin_search(
    reference: MechanicalModel,
    prepared: PreparedRecord,
    say: Callable[[str], None],
    check: Callable[[], None],
    most: int = MOST_EFFECTS,
    enough: Array | None = None,
) -> EffectSearch:
    """Return a search that knows the model's own numbers only."""
    say("refit of the model's own parameters")
    own, led = fit_own_parameters(reference, prepared)
    fits = Fits(prepared, reference, check)
    base = ScoredModel(own, reference)
    fits.done[frozenset()] = base
    return EffectSearch(fits, say, base, base, led, [("refit", base)], most=most, enough=enough)


def search(run: EffectSearch) -> None:
    """Add, replace and remove effects until no step is worth very strong evidence."""
    while _forward(run) or _exchange(run):
        pass
    _remove(run)
    _explain_surprise(run)


def _forward(run: EffectSearch) -> bool:
    """Add one effect, or several together, if that gains very strong evidence."""
    step = 1 + run.best.laws
    if step > run.most or run.at_noise_floor(run.best) or not run.prepared.work.left():
        return False
    found: list[ScoredModel] = []
    at_floor: tuple[int, set[str]] | None = None
    for proposed, problem, rival in _proposals(run, step):
        kinds_of = {e.kind for e in proposed.effects}
        # the error is at the noise: the others that this problem expects to be as good stay rivals,
        # and the same kinds at other places
        if at_floor is not None:
            alike = problem == at_floor[0] or kinds_of == at_floor[1]
            if not (rival and alike):
                continue
        reached = max((run.gain(f) for f in found), default=0.0)
        if found and not rival and proposed.nats < PROMISING * reached:
            continue
        if found and not run.prepared.work.left():
            break
        named = " and ".join(map(str, proposed.effects))
        run.say(f"refit with {named}, expected to gain {proposed.nats:.0f} nats")
        fitted = run.fits.with_effects(run.best, *proposed.effects)
        if rival:
            fitted = run.fits.rounded(fitted)
        good = _determined_part(run, proposed, fitted)
        found += [good] if good is not None and good not in found else []
        if good is not None and run.at_noise_floor(good) and good.laws <= step:
            at_floor = problem, kinds_of
    better = [f for f in found if run.gain(f) > STRONG]
    if not better:
        return False
    chosen = simplest_of_best(better, run.best)
    chosen = _best_alternative(run, chosen)
    run.accept(chosen)
    return True


def _proposals(run: EffectSearch, step: int) -> Iterator[tuple[EffectSet, int, bool]]:
    """Yield the sets that are to be fitted, their problem, and whether one is among its best.

    The problems are about different runs, so that their nats cannot be compared: each has its turn,
    the one with the largest expected gain first. A set that is expected to gain less than very
    strong evidence is not fitted, nor one of which a part with as large an expected gain was
    fitted, unless that fit gained far less. What swings by itself is fitted last, however much is
    expected of others.
    """
    run.say(f"screening for effect {step}")
    prepared = run.prepared
    models = [run.best.model]
    if not run.best.added:  # a fit of free runs bends the model's numbers to what is missing
        models = sorted([run.best.model, run.led], key=lambda m: null_score(m, prepared))
    run.screening = screening = screen(models[0], prepared)
    problems = [problem_of_free_runs(run.best.fitted.fit, prepared, screening.finalists)]
    problems += [problem_along_motion(seen, screening.finalists) for seen in screening.runs]
    most = min(TOGETHER, run.most - step + 1)
    sources = [[s for s in p.best_sets(most) if s.nats > STRONG] for p in problems if p is not None]
    sources.sort(key=lambda source: -max((s.nats for s in source), default=0.0))
    run.expected = {s.places: s for source in reversed(sources) for s in source}
    likeliest = sorted(run.expected.values(), key=lambda s: -s.nats)[:SHOWN]
    gains = (f"{' and '.join(map(str, s.effects))} {s.nats:.0f}" for s in likeliest)
    run.say(f"expected gains in nats: {'; '.join(gains) or 'none'}")
    done: list[EffectSet] = []
    while len(done) < REFITS:
        turn = [_next_of(run, source, done) for source in sources]
        for problem, proposed in enumerate(turn):
            if proposed is not None and all(proposed.places != d.places for d in done):
                done.append(proposed)
                yield proposed, problem, proposed.nats >= sources[problem][0].nats - STRONG
        if not any(turn):
            break
    # a motion that lacks a mode tells little of it, and friction's laws resemble each other: what
    # swings has a turn of its own
    for proposed in run.expected.values():
        swings = len(proposed.effects) == 1 and proposed.effects[0].definition.swinging
        if swings and all(proposed.places != d.places for d in done):
            yield proposed, -1, True


def _next_of(
    run: EffectSearch, source: Sequence[EffectSet], done: Sequence[EffectSet]
) -> EffectSet | None:
    """Return the smallest of the sets whose expected gain is near the best that is left, if any."""
    kept = [d for d in done if _gained_as_expected(run, d)]
    left = [
        s
        for s in source
        if all(s.places != d.places for d in done)
        and not any(k.places < s.places and s.nats < k.nats + STRONG for k in kept)
    ]
    near = [s for s in left if s.nats > max(other.nats for other in left) - STRONG]
    return min(near, key=lambda s: (len(s.places), -s.nats), default=None)


def _gained_as_expected(run: EffectSearch, proposed: EffectSet) -> bool:
    """Return whether the fit of a set gained a good part of what was expected."""
    fitted = run.fits.done.get(run.best.places | proposed.places)
    return fitted is not None and run.gain(fitted) > REACHED * proposed.nats


def _determined_part(
    run: EffectSearch, proposed: EffectSet, scored: ScoredModel | None
) -> ScoredModel | None:
    """Return a fitted set, less the effects whose numbers the data leave open beside the others.

    In place of such an effect a simpler kind that makes nearly its force is tried first.
    """
    while True:
        refused = run.note(scored, proposed.effects)
        if scored is None:
            return None
        culprit = scored.refusal[1]
        if culprit is None:
            return None if refused else scored
        simpler = _simpler(run, scored, culprit)
        if simpler is not None:
            run.say(f"refit with {simpler} in place of {culprit}")
            scored = run.fits.replaced(scored, culprit, simpler)
            continue
        fewer = scored.places - {(culprit.kind, culprit.at)}
        if not fewer or fewer == run.best.places:
            return None
        if run.fits.settled(fewer, scored):
            again = run.fits.done[fewer]
            return again if again is not None and not again.refusal[0] else None
        run.say(f"refit without {culprit}")
        scored = run.fits.replaced(scored, culprit)


def _simpler(run: EffectSearch, scored: ScoredModel, culprit: Effect) -> Effect | None:
    """Return the kind of fewer numbers that comes nearest to the force of an effect, if any."""
    numbers = sum(p.fitted for p in culprit.definition.parameters)
    for other in _alternatives(run, scored, culprit, near=1.0):
        key = (scored.places - {(culprit.kind, culprit.at)}) | {(other.kind, other.at)}
        if (
            key not in run.fits.done
            and sum(p.fitted for p in other.definition.parameters) < numbers
        ):
            return other
    return None


def _best_alternative(run: EffectSearch, chosen: ScoredModel) -> ScoredModel:
    """Return a model, or the best with other kinds or places for its new effects."""
    while True:
        found = [chosen]
        for effect in [e for e in chosen.added if (e.kind, e.at) not in run.best.places]:
            for other in _instead(run, chosen, effect):
                scored = _replaced(run, chosen, effect, other)
                if scored is not None:
                    found.append(scored)
        best = simplest_of_best(found, run.best)
        gone, new = chosen.places - best.places, best.places - chosen.places
        if best.numbers > chosen.numbers and len(gone) == len(new) == 1:
            # the kind of fewer numbers may have ended in a wrong minimum
            simpler = next(e for e in chosen.added if (e.kind, e.at) in gone)
            instead_of = next(e for e in best.added if (e.kind, e.at) in new)
            run.say(f"refit with {simpler} in place of {instead_of}")
            again = run.fits.replaced(best, instead_of, simpler, anew=True)
            if again is not None and not run.note(again, (simpler,)):
                best = simplest_of_best([best, again], run.best)
        if best.places == chosen.places:
            return best
        chosen = best


def _instead(run: EffectSearch, chosen: ScoredModel, effect: Effect) -> list[Effect]:
    """Return what may stand in place of one of the new effects of a model.

    At the noise it is only what is simpler, or expected to gain very strong evidence all the same:
    the noise is known to a share only.
    """
    elsewhere = _elsewhere(run, chosen, effect)
    if not run.at_noise_floor(chosen):
        return elsewhere + _alternatives(run, chosen, effect)[:ALTERNATIVES]
    simpler = _simpler(run, chosen, effect)
    return elsewhere + ([] if simpler is None else [simpler]) + _beside(run, chosen, effect)


def _elsewhere(run: EffectSearch, chosen: ScoredModel, effect: Effect) -> list[Effect]:
    """Return the effect at other places of as large an expected gain, and what acts alike by kind.

    These are other constants in place of one, and other timings of an input.
    """
    kind = effect.definition
    if kind.family == CONSTANT:
        constants = [k for k in kinds().values() if k.family == CONSTANT]
        tried = [Effect.of(k, at) for k in constants for at in places(run.reference, k)]
        return [e for e in tried if (e.kind, e.at) not in chosen.places][:CONSTANTS]
    new = chosen.places - run.best.places
    here = run.expected.get(new)
    found = []
    for places_of, elsewhere in sorted(run.expected.items(), key=lambda item: -item[1].nats):
        moved = next((e for e in elsewhere.effects if e.kind == effect.kind), None)
        if here is None or moved is None or elsewhere.nats < here.nats - STRONG:
            continue
        if moved.at != effect.at and places_of - {(moved.kind, moved.at)} == new - {
            (effect.kind, effect.at)
        }:
            found.append(moved)
    if kind.domain == "output" and "gain" in effect.values:  # or the others are off, inversely
        others = (o.name for o in run.reference.outputs if o.name != effect.at[0])
        found = [Effect.of(kind, (o,), {"gain": 1 / effect.values["gain"]}) for o in others]
    late = Timing(*kind.timing(effect.values)) if kind.timing is not None else None
    if late is not None and late.order is None:
        found += [
            Effect.of(other, effect.at, {p.name: late.delay + late.lag})
            for other in kinds().values()
            for p in other.parameters[:1]
            if other.timing is not None and other.kind != effect.kind and p.dimension == "T"
        ]
    return found[:ELSEWHERE]


def _beside(run: EffectSearch, chosen: ScoredModel, effect: Effect) -> list[Effect]:
    """Return effects of the same chain that would gain very strong evidence beside a model."""
    if run.screening is None:
        return []
    chains, own = Chains(chosen.model), {(e.kind, e.at) for e in chosen.added}
    entries = [
        c
        for c in run.screening.finalists
        if (c.kind.kind, c.at) not in own
        and chains.effect(Effect.of(c.kind, c.at)) in (-1, chains.effect(effect))
    ]
    problem = problem_of_free_runs(chosen.fitted.fit, run.prepared, entries)
    found = [] if problem is None else [s for s in problem.best_sets(1) if s.nats > STRONG]
    return [s.effects[0] for s in found][:ELSEWHERE]


def _replaced(
    run: EffectSearch, scored: ScoredModel, effect: Effect, other: Effect
) -> ScoredModel | None:
    """Return a model with another effect in place of one, if it can be the answer."""
    key = (scored.places - {(effect.kind, effect.at)}) | {(other.kind, other.at)}
    new = key not in run.fits.done
    if new:
        run.say(f"refit with {other} in place of {effect}")
    found = run.fits.replaced(scored, effect, other)
    if new:
        run.note(found, (other,))
    return None if found is None or found.refusal[0] else found


def _alternatives(
    run: EffectSearch, scored: ScoredModel, effect: Effect, near: float = NEAR
) -> list[Effect]:
    """Return other kinds that make nearly the force of an effect, or it at other places.

    They leave at most the share `near` of its force.
    """
    kind, at = effect.definition, scored.model.effects.index(effect)
    if kind.swinging:
        free = (p for p in places(run.reference, kind) if p != effect.at)
        return [Effect.of(kind, p, effect.values) for p in free]
    if kind.domain in ("input", "output") or not kind.family or kind.family == CONSTANT:
        return []
    found = find_force_equivalents(scored.model, at, run.prepared)
    return [m.effect for m in found if m.left < near]


def _exchange(run: EffectSearch) -> bool:
    """Put another kind in the place of an effect that was found, if it is better by far."""
    if run.at_noise_floor(run.best) or run.best.laws < 2:
        return False
    before = run.best
    for effect in before.added:
        for other in _alternatives(run, before, effect)[:ALTERNATIVES]:
            scored = _replaced(run, before, effect, other)
            if scored is not None and run.gain(scored) > STRONG:
                run.accept(scored)
    return run.best is not before


def _remove(run: EffectSearch) -> None:
    """Remove effects one by one while the model stays within very strong evidence of the best."""
    best, again = run.best, True
    while again and run.best.added:
        again = False
        fewer = [run.fits.replaced(run.best, effect) for effect in run.best.added]
        near = [f for f in fewer if f is not None and nats(best, f) < STRONG]
        if near:
            run.accept(min(near, key=lambda f: nats(best, f)))
            again = True


def _explain_surprise(run: EffectSearch) -> None:
    """Add the gain of an input or sensor that spares the model's own numbers a large surprise.

    All masses and springs do not err by one factor by chance.
    """
    tried = []
    for chain in connected(run.reference):
        own = (key for keys in chain_keys(run.reference, chain) for key in keys)
        if run.best.surprise_of(own) < STRONG:
            continue
        factor = _common_factor(run, chain)
        tried += [
            Effect("input_gain", (i.name,), {"gain": 1 / factor})
            for i in run.reference.inputs
            if i.imposes is None and i.on[0] in chain
        ]
        tried += [
            Effect("sensor_gain", (o.name,), {"gain": gain})
            for o in run.reference.outputs
            if chain.intersection(o.of)
            for gain in (factor, 1 / factor)
        ]
    found = []
    for effect in tried:
        key = run.best.places | {(effect.kind, effect.at)}
        if key == run.best.places:
            continue  # the model has this gain already
        run.say(f"refit with {effect}")
        scored = run.fits.beside_known_numbers(run.best, effect)
        known_one = run.fits.done.get(key)
        if scored is None or (known_one is not None and nats(known_one, scored) > 0):
            continue
        run.fits.done[key] = scored
        if not run.note(scored, (effect,)):
            found.append(scored)
    if found:
        best = simplest_of_best(found, run.best)
        if run.gain(best) > STRONG:
            run.accept(best)


def _common_factor(run: EffectSearch, chain: set[str]) -> float:
    """Return the factor by which the fit has scaled the masses of a chain, in the mean."""
    values, known = run.best.model.parameters, run.reference.parameters
    keys = [k for k in chain_keys(run.reference, chain)[0] if known[k] > 0 and values[k] > 0]
    return float(np.exp(np.mean([np.log(values[k] / known[k]) for k in keys]))) if keys else 1.0


def told_alike(run: EffectSearch) -> list[tuple[Effect, Effect]]:
    """Return effects of the best model, each with one that the data do not tell from it.

    A set that was fitted and came within very strong evidence of the best one, and differs from it
    in one effect.
    """
    pairs = []
    sound = [t for t in run.tried if t.scored is not None and not t.refused]
    models = [t.scored for t in sound if t.scored is not None and t.scored is not run.best]
    gains = scores([run.best, *models], run.base)
    for model, gain in zip(models, gains[1:], strict=True):
        ours, theirs = run.best.places - model.places, model.places - run.best.places
        if gain > gains[0] - STRONG and len(ours) == len(theirs) == 1:
            one = next(e for e in run.best.added if (e.kind, e.at) in ours)
            other = next(e for e in model.added if (e.kind, e.at) in theirs)
            if all(p[1].kind != other.kind or p[1].at != other.at for p in pairs):
                pairs.append((one, other))
    return pairs
