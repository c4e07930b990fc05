"""Diagnoses and rows that nobody computed, for the tests of those that judge them."""

from concurrent.futures import Future
from types import SimpleNamespace

from robustpolish.identification.diagnosis.findings import FoundEffect, IndistinguishablePair, Value
from robustpolish.machines.effects.effect import Effect
from tests.hidden_effects.cases import model_of
from tests.hidden_effects.rows import empty_row


def found(kind, at, **numbers):
    """An effect with numbers and standard errors of a hundredth of them."""
    parameters = {name: Value(x, abs(x) / 100, "") for name, x in numbers.items()}
    return FoundEffect(kind, at, parameters)


def diagnosis_of(case, effects=(), verdict="missing_effect", alike=(), **more):
    """A diagnosis of a case that says what it is told to say."""
    return SimpleNamespace(
        verdict=verdict,
        effects=tuple(effects),
        indistinguishable=tuple(
            IndistinguishablePair(Effect(*first), Effect(*second), "") for first, second in alike
        ),
        **{"model": model_of(case), "parameters": {}, "noise_floor": {}, "laws": (), **more},
    )


def row_of(case, right, **more):
    """A row about a case."""
    return {**empty_row(case), "verdict": case.verdict, "right": right, "ratio": 1.0, **more}


class NoPool:
    """Runs at once, in this process, what a pool would run in others."""

    def __init__(self, workers):
        self.workers = workers

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return None

    def map(self, call, *items):
        return map(call, *items)

    def submit(self, call, item):
        future = Future()
        future.set_result(call(item))
        return future
