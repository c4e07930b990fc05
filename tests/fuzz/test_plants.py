"""Random plants end in results or in errors of the package, on every public function."""

import numpy as np

from . import plants
from .drawn_plants import ABSURD_EVERY, drawn_plant
from .plant_calls import CHEAP, DEAR, ELSEWHERE, public, taking_plants


def test_no_public_function_that_takes_a_plant_is_forgotten():
    called = {*CHEAP, *DEAR}
    assert taking_plants() - called == set(ELSEWHERE)
    assert all(callable(public(name)) for name in called)
    assert not set(CHEAP) & set(DEAR)


def test_plants_are_the_same_every_time_and_every_fifth_is_absurd():
    for number in range(10):
        one, same = (str(drawn_plant(4, number)) for _ in range(2))
        assert one == same
        drawn = drawn_plant(4, number)
        assert drawn.absurd == (number % ABSURD_EVERY == ABSURD_EVERY - 1)
        for name, M in drawn.matrices.items():
            assert np.array_equal(drawn_plant(4, number).matrices[name], M)


def test_forty_plants_end_in_results_or_our_errors():
    words, crashes = plants.run(40, seed=2)
    assert not crashes, "\n".join(map(str, crashes))
    ended = {word for _, word in words}
    assert {"result", "proven", "InvalidInputError"} <= ended


def test_a_foreign_error_and_a_late_answer_count_as_crashes(monkeypatch):
    def broken(given):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setitem(CHEAP, "modes", broken)
    outcomes, (crash,) = plants.try_plant(2, 0, ["modes"])
    assert outcomes == [("modes", "crash")]
    assert "ZeroDivisionError: by nothing" in str(crash)
    monkeypatch.setitem(CHEAP, "modes", lambda given: None)
    monkeypatch.setattr(plants, "LATE", -plants.UNLIMITED - 1.0)
    _, (late,) = plants.try_plant(2, 0, ["modes"])
    assert late.where == "late"
