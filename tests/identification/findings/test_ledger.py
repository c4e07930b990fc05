import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import compare
from robustpolish.identification.diagnosis.findings import Entry, Ledger
from tests.identification.oscillators import oscillator, record

TWO = (
    Ledger(noise_floor={"x": 0.01})
    .add("base", {"x": 0.5, "y": 0.2})
    .add("refit", {"x": 0.3, "y": 0.25})
)


def test_each_entry_falls_from_the_one_before():
    assert TWO.falls("x") == [
        ("base", 0.5, 0.5), ("refit", -0.2, 0.3), ("noise floor", -0.29, 0.01),
    ]  # fmt: skip
    assert TWO.falls("y") == [("base", 0.2, 0.2), ("refit", 0.05, 0.25)]  # of unknown noise


def test_adding_leaves_the_ledger_as_it_was():
    errors = {"x": 0.5}
    ledger = Ledger().add("base", errors)
    errors["x"] = 7.0
    ledger.add("refit", errors)
    assert ledger.entries == (Entry("base", {"x": 0.5}),)
    assert ledger.to_list() == [{"step": "base", "nrmse": {"x": 0.5}}]


def test_comparisons_are_read():
    comparison = compare(oscillator(stiffness=300.0), record(noise=0.1))
    ledger = Ledger().add("unseen", comparison)
    assert ledger.entries == (Entry("unseen", {"x": comparison.outputs["x"].nrmse}),)


def test_it_is_drawn_by_output():
    assert TWO.plot().get_ylabel() == "relative error of x"
    assert TWO.plot(output="y").get_ylabel() == "relative error of y"
    with pytest.raises(InvalidInputError, match="output"):
        TWO.plot(output="z")


def test_a_ledger_without_entries_shows_the_noise():
    assert [line.split() for line in repr(Ledger(noise_floor={"x": 0.01})).splitlines()][1:] == [
        ["step", "x"], ["noise", "floor", "0.01"],
    ]  # fmt: skip
