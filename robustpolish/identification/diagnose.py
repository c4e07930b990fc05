"""Learn which physical effect a model lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.base.budget import Budget, progress_bar, single_threaded_blas
from robustpolish.base.checks import one_of, positive
from robustpolish.identification.compare import compare, comparison_window
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.identification.findings import Ledger
from robustpolish.identification.fit.least_squares import evaluate_fit
from robustpolish.identification.fit.prepared import ReducedRecord, prepare, reduced_data
from robustpolish.identification.policy import POLICY, STRONG
from robustpolish.identification.record import Record, require_time_data
from robustpolish.identification.refit import (
    collect_warnings,
    split_holds,
    with_reselected_holds,
    with_selected_holds,
)
from robustpolish.identification.search.conclude import conclude
from robustpolish.identification.search.score import ScoredModel, nats
from robustpolish.identification.search.search import (
    MOST_EFFECTS,
    EffectSearch,
    begin_search,
    search,
)
from robustpolish.machines.mechanical.model import MechanicalModel


class _StoppedError(Exception):
    """The time is over."""


@single_threaded_blas
def diagnose(
    model: MechanicalModel,
    data: Any,
    progress: Callable[[str], None] | None = None,
    *,
    time_limit: float | None = None,
    max_effects: int = MOST_EFFECTS,
    good_enough: float | Mapping[str, float] | None = None,
    outputs: Sequence[str] | None = None,
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
    time_limit : float, optional
        Seconds after which the best so far is returned; the same happens when the call is
        interrupted (Ctrl-C). The status of the result is ``"stopped"`` then.
    max_effects : int, optional
        Effects that are added at most, offsets and constant forces aside.
    good_enough : float or mapping of str to float, optional
        Held-out error at which nothing more is sought: a share of every output's deviation, or the
        root mean square of outputs by name, in SI units. By default the search ends at the noise,
        or at 0.2 % of the deviation.
    outputs : sequence of str, optional
        Outputs that are used and that the data must hold. By default those that the data hold, and
        ``notes`` names the others.

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
    The model's own numbers are refitted first. Then every effect of the catalogue is screened at
    every place, and linear least squares gives the sizes of single effects and of several together,
    beside offsets and constant forces. The most promising sets are refitted by free runs over
    windows that grow. Sets are compared by one score, in nats: the log likelihood of free runs over
    fitted and held-out blocks, less the cost of their numbers and the deviation of the model's own
    numbers from what was known of them. Among those within five nats of the best the set with the
    fewest numbers is taken; signs have to be physical and sizes determined by the data.

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
    limit = Budget(seconds=math.inf if time_limit is None else time_limit)
    with progress_bar("Diagnosing") if progress is None else nullcontext(progress) as say:
        return _diagnose(model, data, say, limit, max_effects, good_enough, outputs)


def _diagnose(
    model: MechanicalModel,
    data: Any,
    say: Callable[[str], None],
    limit: Budget,
    most: int,
    good_enough: float | Mapping[str, float] | None,
    outputs: Sequence[str] | None,
) -> Diagnosis:
    fewer = reduced_data(model, data, outputs)
    model, prepared = fewer.model, prepare(fewer.model, fewer.record, POLICY)
    say("how inputs act between their samples")
    # what its file says of the inputs is known
    known = fewer.thinned or bool(split_holds(model.effects)[0])
    held = model if known else with_selected_holds(model, prepared)

    begun = False

    def check() -> None:
        """Stop the search when the time is over, once there is something to return."""
        if begun and limit.elapsed > limit.seconds:
            raise _StoppedError

    def tell(text: str) -> None:
        say(text)
        check()

    begin = partial(
        begin_search,
        prepared=prepared,
        say=tell,
        check=check,
        most=most,
        enough=_errors_enough(good_enough, model, prepared.record),
    )
    run = begin(held)
    begun, stopped = True, False
    try:
        if held is not model:
            linear = begin(model)
            # an innovation is what a sample tells beyond those before it, and there a missing jump
            # of a force may look like a late input; over many swings it does not
            run = linear if nats(run.base, linear.base) < STRONG else run
        search(run)
        if not known and run.best.added:
            tell("how inputs act between their samples, beside what was found")
            run = _with_other_holds(run, begin)
        found = conclude(run, model)
    except (_StoppedError, KeyboardInterrupt):
        stopped = True
        run.say = say
        found = conclude(run, model, stopped=True)
    notes = (*fewer.notes, *collect_warnings(model, found.model, prepared))
    return replace(
        found,
        model=fewer.restored(found.model),
        notes=notes,
        status="stopped" if stopped else "complete",
        ledger=_as_compared(found, fewer, data, outputs),
    )


def _as_compared(
    found: Diagnosis, fewer: ReducedRecord, data: Any, outputs: Sequence[str] | None
) -> Ledger:
    """Return the ledger with the errors that :func:`robustpolish.compare` tells of its models.

    Models whose free runs judge nothing are compared in windows, all of them.
    """
    window = comparison_window(found.model, fewer.record, found.reproducible)
    entries = []
    for entry in found.ledger.entries:
        if entry.model is not None:
            model = fewer.restored(entry.model)
            compared: Any = compare(model, data, window=window, outputs=outputs)
            nrmse = {name: error.nrmse for name, error in compared.outputs.items()}
            entries.append(replace(entry, model=model, nrmse=nrmse))
    return replace(found.ledger, entries=tuple(entries))


def _errors_enough(
    good_enough: float | Mapping[str, float] | None, model: MechanicalModel, record: Record
) -> Array | None:
    """Return the errors at which nothing more is sought, in the units of the outputs."""
    if good_enough is None:
        return None
    if isinstance(good_enough, Mapping):
        for name in good_enough:
            one_of("good_enough", name, model.output_names)
        return np.array([good_enough.get(name, np.inf) for name in model.output_names])
    return positive("good_enough", good_enough) * np.std(record.Y, axis=0)


def _with_other_holds(
    run: EffectSearch, begin: Callable[[MechanicalModel], EffectSearch]
) -> EffectSearch:
    """Return the search, or one beside other holds of the inputs that leaves less.

    What is missing from a model may look like a hold that is none, or hide one.
    """
    found = with_reselected_holds(run.best.model, run.reference, run.prepared)
    if found is None:
        return run
    other, fitted = found
    beside = ScoredModel(evaluate_fit(fitted, run.prepared), other)
    if nats(beside, run.best) <= 0:
        return run
    again = begin(other)
    again.fits.done[beside.places] = beside
    again.screening, again.tried = run.screening, run.tried
    again.accept(beside)
    search(again)
    return again
