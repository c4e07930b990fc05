"""How well models that are fitted to the beginning of decays predict how these go on.

The end of a decay is smaller than all that came before it: a model whose forces only bend to the
motion that they were fitted to is found out there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.identification.decays.cut import Cut
from robustpolish.identification.fit.homotopy import homotopy, rms_over
from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.fit.prepared import PreparedRecord, with_rest
from robustpolish.identification.observer.run import StartedPiece
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel


def error_ahead(
    model: MechanicalModel, prepared: PreparedRecord, reference: MechanicalModel, cut: Cut
) -> float:
    """Return the mean log of the errors with which a model predicts late parts from early ones.

    Parameters
    ----------
    model : MechanicalModel
        Where the fit to the early parts begins.
    prepared : PreparedRecord
    reference : MechanicalModel
        The model before any fit.
    cut : Cut

    Returns
    -------
    float
        Infinite if no fit ends well.
    """
    fitted = fitted_to(pieces_of(model, cut.early, prepared), model, prepared, reference)
    return np.inf if fitted is None else error_on(fitted.model, cut.late, prepared)


def fitted_to(
    pieces: Sequence[StartedPiece],
    model: MechanicalModel,
    prepared: PreparedRecord,
    reference: MechanicalModel,
) -> Fit | None:
    """Return a fit to pieces of decays, None if none ends well; arguments as above."""
    spans = prepared.spans(pieces, prepared.policy.growth)
    started, settled = with_rest(model, pieces), prepared.policy.settled
    fits = homotopy(model, prepared, started, reference, spans, prepared.steps, settled=settled)
    return fits[-1] if fits else None


def error_on(model: MechanicalModel, parts: Sequence[Record], prepared: PreparedRecord) -> float:
    """Return the mean log of the errors of a model's free runs over parts of a record."""
    errors = rms_over(model, prepared, pieces_of(model, parts, prepared))
    with np.errstate(divide="ignore"):
        return float(np.mean(np.log(errors)))


def pieces_of(
    model: MechanicalModel, parts: Sequence[Record], prepared: PreparedRecord
) -> list[StartedPiece]:
    """Return parts of a record with starts, from the motion that is smoothed before any fit."""
    linear, motion = model.without_effects(), prepared.motion_before
    return [StartedPiece(part, motion.start(linear, part.first)) for part in parts]
