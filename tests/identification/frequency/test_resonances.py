"""Resonances in measured responses, against the poles of models that are known."""

import numpy as np
import pytest

from robustpolish.identification.frequency.lines import (
    likeness,
    match_modes,
    measured_resonances,
    measured_response,
    model_resonances,
)
from tests.identification.frequency.chains import measured, two_masses


def both(model, **options):
    response = measured_response(model, measured(model, **options))
    return model_resonances(model, response), measured_resonances(response)


def test_a_models_modes_are_its_poles():
    model = two_masses()
    modes, _ = both(model)
    poles = np.linalg.eigvals(model.state_space().A)
    poles = sorted(poles[poles.imag > 0], key=abs)
    for mode, pole in zip(modes, poles, strict=True):
        assert mode.frequency == pytest.approx(abs(pole) / (2 * np.pi))
        assert mode.damping == pytest.approx(-pole.real / abs(pole))
    line = 2j * np.pi * 30.0
    series = sum(
        mode.shape / (line - pole) + mode.shape.conj() / (line - pole.conj())
        for mode, pole in zip(modes, poles, strict=True)
    )
    np.testing.assert_allclose(series, model.frequency_response([30.0]).values[0, :, 0], rtol=1e-6)


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_standard_errors_cover_the_truth(quantity):
    deviations = []
    for seed in range(12):
        true, found = both(two_masses(quantity), noise=0.03, seed=seed)
        assert len(found) == 2
        for one, other in zip(true, found, strict=True):
            deviations.append((other.frequency - one.frequency) / other.frequency_error)
            deviations.append((other.damping - one.damping) / other.damping_error)
            assert likeness(one.shape, other.shape) > 0.99
    assert 0.6 < np.sqrt(np.mean(np.square(deviations))) < 1.7


def test_noise_alone_has_no_resonance():
    model = two_masses()
    data = measured(model)
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)
    found = measured_resonances(measured_response(model, data.copy(data=1e-6 * noise)))
    assert found == ()


def test_modes_are_matched_by_shape_when_frequencies_mislead():
    true, found = both(two_masses())
    off, _ = both(two_masses(stiffness=(2e5 * 1.4, 1e5 * 1.4)))
    assert match_modes(off, found) == [(0, 0), (1, 1)]
    assert match_modes(true, found[1:]) == [(1, 0)]
    assert match_modes(true, ()) == []
