"""The peak of the gain with a bracket, exact or estimated."""

from dataclasses import replace

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms import peak as module
from robustpolish.linear.norms.peak import Peak, certified_peak

ZETA = 0.01
OSCILLATOR = realisation("s", control.ss([[0, 1], [-1, -2 * ZETA]], [[0], [1]], [[1, 0]], 0))
PEAK = 1 / (2 * ZETA * np.sqrt(1 - ZETA**2))


@pytest.mark.parametrize("exact", [True, False])
def test_the_bracket_holds_the_peak(exact):
    found = certified_peak(OSCILLATOR, 1e-9, exact)
    assert found.lower <= PEAK <= found.upper
    assert found.gain == pytest.approx(PEAK, rel=1e-9)
    assert found.upper <= found.lower * (1 + 1e-6)
    assert ("exact arithmetic" in found.proof) is exact


def test_larger_systems_are_proven_exactly_where_doubles_say_nothing(monkeypatch):
    monkeypatch.setattr(module, "EXACT_ALWAYS", 1)
    assert "double precision" in certified_peak(OSCILLATOR, 1e-9, True).proof
    monkeypatch.setattr(module, "bounds_gain", lambda *_: False)
    assert "exact arithmetic" in certified_peak(OSCILLATOR, 1e-9, True).proof
    monkeypatch.setattr(module, "EXACT_AT_MOST", 1)
    unproven = certified_peak(OSCILLATOR, 1e-9, True)
    assert unproven.upper == np.inf
    assert unproven.lower == pytest.approx(PEAK, rel=1e-9)


def test_what_cancels_has_no_gain():
    nothing = realisation("s", control.ss(-np.eye(2), [[1], [1]], [[1, -1]], 0))
    found = certified_peak(nothing, 1e-9, True)
    assert (found.gain, found.upper, found.proof) == (0.0, 0.0, "the transfer function is zero")


def test_units_are_undone():
    scaled = Peak(2.0, 3.0, 2.5, 3.5, "p").in_units(replace(OSCILLATOR, time=10.0, gain=4.0))
    assert scaled == Peak(20.0, 12.0, 10.0, 14.0, "p")


def test_crossings_decades_apart_take_few_passes(monkeypatch):
    gammas = []
    exact_crossings = module.crossings

    def counted(model, square):
        gammas.append(square)
        return exact_crossings(model, square)

    monkeypatch.setattr(module, "gain_crossings", counted)
    # A wide band-pass: 1 at the frequency 1, from a search that went astray by six decades.
    monkeypatch.setattr(module, "peak", lambda *_: (1.1e6, 0.0))
    band = realisation("s", control.ss([[0, 1], [-1, -3]], [[0], [1]], [[0, 3]], [[1e-9]]))
    found = certified_peak(band, 1e-9, True)
    assert found.gain == pytest.approx(1.0, rel=1e-8)
    assert found.lower <= found.gain <= found.upper <= found.lower * (1 + 2e-9)
    assert len(gammas) <= 7  # 24 by halving alone
