"""The two machines of a pair that data cannot tell apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.identification.findings.findings import Confusion
from robustpolish.identification.findings.refitted import Refit
from robustpolish.models.mechanical import MechanicalModel


def machines_of(model: MechanicalModel, pair: Confusion) -> tuple[MechanicalModel, MechanicalModel]:
    """Return a model with one effect of a pair, and with the other in its place.

    Parameters
    ----------
    model : MechanicalModel
        What a diagnosis ended with.
    pair : Confusion

    Returns
    -------
    first, second : MechanicalModel
        The effect that the model has already comes first.
    """
    there, other = pair.first, pair.second
    if _place(model, there) is None and _place(model, other) is not None:
        there, other = other, there
    first = model
    if _place(model, there) is None:
        first = replace(model, effects=(*model.effects, there))
    place = _place(first, there)
    rest = [e for i, e in enumerate(first.effects) if i != place]
    bare = replace(first, effects=tuple(rest))
    same = _place(bare, other)
    if same is None:
        return first, replace(bare, effects=(*rest, other))
    # friction of unlike size in both directions: a number more of what is there already
    rest[same] = rest[same].with_values({**rest[same].values, **other.parameters})
    return first, replace(bare, effects=tuple(rest))


def _place(model: MechanicalModel, effect: Effect) -> int | None:
    same = (i for i, e in enumerate(model.effects) if (e.kind, e.at) == (effect.kind, effect.at))
    return next(same, None)


def apart_in_words(first: MechanicalModel, second: MechanicalModel) -> tuple[str, str]:
    """Return what tells two models from each other: effects that only one has, else their names."""
    own = [[str(e) for e in model.effects] for model in (first, second)]
    found = []
    for mine, others, nth, model in (
        (own[0], own[1], "first", first), (own[1], own[0], "second", second),
    ):  # fmt: skip
        only = [text for text in mine if text not in others]
        found.append(" and ".join(only) or f"{model.name or 'the model'} ({nth})")
    return found[0], found[1]


def precision_of(covariance: xr.DataArray) -> Array:
    """Return the inverse of a covariance; zero for what it leaves open.

    Parameters
    ----------
    covariance : xarray.DataArray
        Infinite variances for numbers that were not seen.

    Examples
    --------
    >>> both = xr.DataArray([[4.0, 0.0], [0.0, np.inf]], dims=("parameter", "other"))
    >>> precision_of(both)
    array([[0.25, 0.  ],
           [0.  , 0.  ]])
    """
    values = covariance.values
    seen = np.flatnonzero(np.isfinite(np.diag(values)) & (np.diag(values) > 0)).tolist()
    found = np.zeros_like(values)
    block = values[np.ix_(seen, seen)]
    size = np.sqrt(np.diag(block))
    inverse = np.linalg.pinv(block / np.outer(size, size), rcond=1e-10, hermitian=True)
    found[np.ix_(seen, seen)] = inverse / np.outer(size, size)
    return found


def numbers_of(fitted: Refit) -> tuple[dict[str, float], Array]:
    """Return the standard errors of a refit's numbers, and their precision together."""
    return {key: float(error) for key, error in fitted.stderr.items()}, precision_of(
        fitted.covariance
    )
