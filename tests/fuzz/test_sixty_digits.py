"""The check of certificates refutes what is false, and finds textbook norms."""

from dataclasses import replace

import control
import pytest

import robustpolish as rp

from .plant_calls import Given
from .sixty_digits import ExactSystem, FalsehoodError, certificate, checked, design

RESONANCE = control.ss([[0, 1], [-4, -0.1]], [[0], [1]], [[1, 0]], 0)


def given(system):
    return Given(None, system, None)


def test_norms_of_a_resonance():
    # |G| peaks at w^2 = 4 - 0.1^2 / 2 with 1 / (0.1 sqrt(4 - 0.1^2 / 4)); H2^2 = 1 / (2 * 0.1 * 4).
    exact = ExactSystem.of(RESONANCE)
    peak = 1 / (0.1 * (4 - 0.0025) ** 0.5)
    assert exact.verdict == "stable"
    assert float(exact.gain((4 - 0.005) ** 0.5)) == pytest.approx(peak, rel=1e-14)
    assert exact.exceeds(peak * (1 - 1e-12))
    assert not exact.exceeds(peak * (1 + 1e-12))
    assert float(exact.h2()) == pytest.approx(1.25**0.5, rel=1e-14)


@pytest.mark.parametrize(
    ("A", "verdict"), [([[0, 1], [-1, 0]], "marginal"), ([[0, 1], [0, 0]], "marginal"),
                       ([[0, 1], [1, 0]], "unstable"), ([[-1, 5], [0, -1]], "stable"),
                       ([[-1e-160, 1], [-1, 0]], "stable"), ([[1e-160, 1], [-1, 0]], "unstable")]
)  # fmt: skip
def test_poles(A, verdict):
    assert ExactSystem.of(control.ss(A, [[0], [1]], [[1, 0]], 0)).verdict == verdict


def test_false_norms_are_refuted():
    norm = rp.hinf_norm(RESONANCE)
    assert checked("hinf_norm", norm, given(RESONANCE)) == "proven"
    for wrong in (
        {"upper": norm.value * (1 - 1e-9), "value": norm.lower * (1 - 1e-8), "lower": 0.0},
        {"lower": norm.upper * 1.01, "value": norm.upper * 1.01, "upper": norm.upper * 1.02},
        {"stable": False},
        {"value": float("nan")},
    ):
        with pytest.raises(FalsehoodError):
            checked("hinf_norm", replace(norm, **wrong), given(RESONANCE))
    h2 = rp.h2_norm(RESONANCE)
    assert checked("h2_norm", h2, given(RESONANCE)) == "proven"
    with pytest.raises(FalsehoodError, match="outside"):
        wrong = replace(h2, lower=1.2, value=1.21, upper=1.22)
        checked("h2_norm", wrong, given(RESONANCE))


def test_false_certificates_are_refuted():
    plant = rp.GeneralizedPlant.from_matrices(
        [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D22=[[0.3]]
    )
    found = rp.given_controller(plant, [[-3.0]])
    assert design(found) == "proven"
    low = replace(found.certificate, bound=found.certificate.bound * 0.999)
    with pytest.raises(FalsehoodError, match="exceeds"):
        certificate(low, plant, found.controller)
    with pytest.raises(FalsehoodError, match="stable"):
        certificate(found.certificate, plant, plant.static_controller([[0.5]]))
    with pytest.raises(FalsehoodError, match="lower bound"):
        design(replace(found, lower_bound=2 * found.certificate.bound))
