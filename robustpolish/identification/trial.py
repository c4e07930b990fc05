"""Try one effect by hand: fit a model with and without it, and compare their held-out errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from robustpolish.base.budget import progress_bar, single_threaded_blas
from robustpolish.base.checks import described, invalid, one_of
from robustpolish.base.results import Card, Displayed, Table, estimate
from robustpolish.identification.findings import FoundEffect, Ledger, RankedCandidate, Value
from robustpolish.identification.fit.least_squares import (
    covariance_of,
    free_run_rms,
    short_window_rms,
)
from robustpolish.identification.fit.prepared import prepare, reduced_data
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.policy import POLICY, STRONG
from robustpolish.identification.record import require_time_data
from robustpolish.identification.refit import collect_warnings, with_start_values
from robustpolish.identification.search.conclude import found_effect
from robustpolish.identification.search.score import ScoredModel, nats
from robustpolish.identification.search.search import begin_search
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import EffectKind
from robustpolish.machines.mechanical.model import MechanicalModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Trial(Displayed):
    """One effect that was added to a model or removed from it by hand, and what that did.

    Attributes
    ----------
    model : MechanicalModel
        Fitted to the record without its held-out part; :func:`robustpolish.refit` fits it to all.
    effect : FoundEffect
        The effect, with the sizes and standard errors of the fit that has it.
    gain : float
        Score of the model with the effect over the one without it, in nats: above 5 is very strong
        evidence for the effect.
    refused : str
        Why the fit with the effect cannot be right, as a sign that is not physical or a size that
        the data do not determine; empty if it can.
    removed : bool
        Whether the effect was removed.
    ledger : Ledger
        Held-out error after every step, those of earlier trials included.
    notes : tuple of str
        Remarks of the record, and what looks wrong.
    """

    model: MechanicalModel
    effect: FoundEffect
    gain: float
    refused: str
    removed: bool
    ledger: Ledger
    notes: tuple[str, ...] = ()

    @property
    def worthwhile(self) -> bool:
        """Whether the data speak for the effect by very strong evidence."""
        return self.gain > STRONG and not self.refused

    def to_dict(self) -> dict[str, Any]:
        """Return the trial as plain data."""
        return {
            "kind": self.effect.kind,
            "at": list(self.effect.at),
            "parameters": {n: vars(v) for n, v in self.effect.parameters.items()},
            "worthwhile": self.worthwhile,
            "gain": self.gain,
            "refused": self.refused,
            "removed": self.removed,
            "ledger": self.ledger.to_list(),
            "notes": list(self.notes),
        }

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw the held-out error of one output after every step.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The first by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return self.ledger.plot(ax, output=output)

    def _card(self) -> Card:
        evidence = f"it gains {self.gain:.0f} nats, and above {STRONG:.0f} is very strong evidence"
        if self.refused:
            evidence = self.refused.partition(": ")[2] or self.refused
        verdict = f"{'' if self.worthwhile else 'not '}worth its numbers: {evidence}"
        head = ("parameter", "value", "standard error", "unit")
        sizes = [
            (n, *estimate(v.value, v.stderr), v.unit) for n, v in self.effect.parameters.items()
        ]
        (steps,) = self.ledger._card().tables
        title = "Held-out error of a free run over the standard deviation of each output"
        tables = (Table("Sizes", head, tuple(sizes)), Table(title, steps.columns, steps.rows))
        named = f"{self.effect.definition.title} at {', '.join(self.effect.at)}"
        return Card(f"{named}: {verdict}.", tables, self.notes)


@single_threaded_blas
def try_effect(
    model: MechanicalModel | Trial,
    data: Any,
    kind: str | EffectKind | Effect | FoundEffect | RankedCandidate,
    at: str | Sequence[str] | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    remove: bool = False,
    ledger: Ledger | None = None,
    progress: Callable[[str], None] | None = None,
    outputs: Sequence[str] | None = None,
) -> Trial:
    """Add one effect to a model, or remove it, and show the held-out error before and after.

    Parameters
    ----------
    model : MechanicalModel or Trial
        A trial continues: from its model, and its ledger is kept.
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        Inputs and outputs of the model over ``time``, as for :func:`robustpolish.diagnose`.
    kind : str, EffectKind, Effect, FoundEffect or RankedCandidate
        Name in the catalogue of effects, or a kind of your own. Or a step that a diagnosis
        proposes, one of its `effects` or `candidates`, with its place; of a set the first effect.
    at : str or sequence of str, optional
        Where it acts, such as ``("tool", "ground")``; left out of what has a place.
    parameters : mapping of str to float, optional
        Values from which the fit begins, SI units; by default those of the screening, or of the
        step.
    remove : bool, optional
        Remove the effect, which the model has, instead of adding it.
    ledger : Ledger, optional
        Errors of earlier steps, which are kept; by default those of a trial that continues.
    progress : callable, optional
        Called with a short text at every step.
    outputs : sequence of str, optional
        Outputs that are used and that the data must hold. By default those that the data hold, and
        ``notes`` names the others.

    Returns
    -------
    Trial

    Raises
    ------
    InvalidInputError
        If the kind or the place is unknown, or the effect that is to be removed is not there; if
        the data do not suit the model.

    Notes
    -----
    The model is fitted without the effect and with it, to the same part of the record; the rest of
    it judges both. The score is that of :func:`robustpolish.diagnose`.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> data = data.isel(time=slice(0, 500))
    >>> wrong = rp.try_effect(model, data, "quadratic_damping", ("x", "ground"))
    >>> right = rp.try_effect(wrong, data, "coulomb_friction", ("x", "ground"))
    >>> right.worthwhile, round(right.effect.parameters["force"].value, 1)
    (True, 3.0)
    >>> [entry.step for entry in right.ledger.entries]
    ['base', 'refit', 'quadratic_damping at x, ground', 'coulomb_friction at x, ground']
    """
    require_time_data(data)
    if not isinstance(kind, str | EffectKind):
        at = kind.at if at is None else at
        if parameters is None:
            sizes = kind.parameters.items()
            parameters = {n: v.value if isinstance(v, Value) else v for n, v in sizes}
        kind = kind.own or kind.kind
    if at is None:
        remedy = "Write, for instance, ('tool', 'ground')."
        raise invalid("at", described("nothing"), "where the effect acts", remedy)
    given = model.model if isinstance(model, Trial) else model
    extended = given if remove else given.with_effect(kind, at, parameters)
    effect = _named(given, kind, at) if remove else extended.effects[-1]
    fewer = reduced_data(extended, data, outputs)
    if effect.definition.domain == "output":
        one_of("at", effect.at[0], fewer.model.output_names, "Name an output that was measured.")
    # the effect may bring channels of its own, which both models have
    bare = tuple(e for e in fewer.model.effects if e != effect)
    without = replace(fewer.model, effects=bare)
    start = fewer.model if remove else without
    prepared = prepare(start, fewer.record, POLICY)
    with progress_bar("Fitting") if progress is None else nullcontext(progress) as say:
        run = begin_search(without, prepared, say, lambda: None)
        if not effect.parameters:
            begun = with_start_values(replace(run.base.model, effects=(*bare, effect)), prepared)
            effect = begun.effects[-1]
        say(f"refit with {effect}")
        fitted = run.fits.with_effects(run.base, effect)
    if fitted is None:
        raise ArithmeticError(f"no fit with {effect} ended with finite errors")
    size = np.std(prepared.record.Y, axis=0)
    names = start.output_names

    def entered(ledger: Ledger, step: str, error: Any, of: MechanicalModel) -> Ledger:
        shares = dict(zip(names, (error / size).tolist(), strict=True))
        return ledger.add(step, shares, fewer.restored(of))

    before, after = (fitted, run.base) if remove else (run.base, fitted)
    if ledger is None:
        ledger = model.ledger if isinstance(model, Trial) else Ledger()
    if not ledger.entries:
        measure = free_run_rms if run.base.fitted.reproducible else short_window_rms
        ledger = entered(ledger, "base", measure(start, prepared, prepared.held_out), start)
        ledger = entered(ledger, "refit", before.fitted.error, before.model)
    step = f"without {effect}" if remove else str(effect)
    ledger = entered(ledger, step, after.fitted.error, after.model)
    notes = (*fewer.notes, *collect_warnings(start, after.model, prepared))
    gain = nats(fitted, run.base)
    return Trial(
        fewer.restored(after.model), _found(fitted), gain, fitted.refusal[0], remove,
        ledger, notes,
    )  # fmt: skip


def _found(fitted: ScoredModel) -> FoundEffect:
    """Return the effect that was fitted last, with the standard errors of its sizes."""
    errors = stderr_from_covariance(covariance_of(fitted.fitted.fit))
    return found_effect(fitted.model, len(fitted.model.effects) - 1, errors)


def _named(model: MechanicalModel, kind: str | EffectKind, at: str | Sequence[str]) -> Effect:
    """Return the effect of a model that is of a kind and at a place."""
    name = kind if isinstance(kind, str) else kind.kind
    place = (at,) if isinstance(at, str) else tuple(at)
    for effect in model.effects:
        if effect.kind == name and set(effect.at) == set(place):
            return effect
    known = "; ".join(map(str, model.effects)) or "no effect"
    shown = described(f"{name} at {', '.join(place)}")
    raise invalid("kind", shown, f"an effect of the model, which has {known}", "Name one of these.")
