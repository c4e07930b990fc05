"""Searches at their beginning, and refits that no fit made."""

import numpy as np

from robustpolish.identification.fit.least_squares import EvaluatedFit, Fit
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.identification.refit import fit_own_parameters
from robustpolish.identification.structure.screening import ScreenedEffect
from robustpolish.identification.structure.state import RefittedEffect, Search
from robustpolish.machines.effects.effect import Effect
from tests.identification.oscillators import PLACE, rig

MODEL = rig()
STRIBECK = {"force": 3.0, "static_force": 4.0, "velocity": 1.0, "width": 0.1}
"""Numbers of a friction that are not absurd; with a sliding force near 0 they are."""


def prepared_of(model, data, policy=POLICY):
    return prepare(model, record_of(model, data), policy)


def search_of(model, data, policy=POLICY):
    """A search whose model has been refitted, with nothing added."""
    prepared = prepared_of(model, data, policy)
    own, short_window_model = fit_own_parameters(model, prepared)
    steps = [("base", model), ("refit", own.model)]
    return Search(
        prepared,
        model,
        str,
        linear=own,
        stage=own,
        short_window_model=short_window_model,
        steps=steps,
    )


def judged(model, free, short=None, reproducible=True, share=0.01):
    """A fit with given held-out errors, all of whose numbers have one relative standard error."""
    numbers = tuple(free_parameters(model, 10.0, POLICY))
    white = np.random.default_rng(0).standard_normal((20_000, len(model.outputs)))
    sizes = np.array([model.parameters[p.key] / p.scale for p in numbers])
    information = np.diag(1 / (share * sizes) ** 2)
    made = Fit(model, (), 1.0, white, np.ones(white.shape[1]), information, numbers)
    errors = np.atleast_1d(np.array(free, dtype=float))
    over = errors if short is None else np.atleast_1d(np.array(short, dtype=float))
    return EvaluatedFit(made, errors, lambda: over, reproducible, lambda: made.rmse)


def refitted(model, kind, at, values, free, score=100.0, **options):
    """A refitted effect that takes the held-out error to `free`."""
    effect = Effect(kind, at, values)
    fitted = judged(model.with_effect(kind, at, values), free, **options)
    return RefittedEffect(ScreenedEffect(effect, score, 0.5), fitted)


def cubic(free, **options):
    """A cubic spring at the rig."""
    return refitted(MODEL, "cubic_stiffness", PLACE, {"stiffness": 3.0}, free, **options)


def drag(free, **options):
    """A drag at the rig."""
    return refitted(MODEL, "quadratic_damping", PLACE, {"coefficient": 3.0}, free, **options)
