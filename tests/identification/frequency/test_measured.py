"""Measured responses that are put to a model."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.identification.frequency.lines import measured_response
from tests.identification.frequency.chains import LINES, measured, two_masses


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
def test_noise_that_nobody_told_is_seen_in_the_scatter(quantity):
    model = two_masses(quantity)
    true = np.abs(model.frequency_response(LINES).values).mean(axis=0)[:, 0] * 0.02
    found = measured_response(model, measured(model))
    assert not found.known
    ratio = np.sqrt(np.median(found.variance, axis=0)) / true
    assert np.all((ratio > 0.7) & (ratio < 1.4))


def test_variance_and_coherence_are_believed():
    model = two_masses()
    data = measured(model, told=True)
    by_variance = measured_response(model, data)
    assert by_variance.known
    shape = data["variance"] / np.abs(data) ** 2 * 20
    coherence = (1 / (1 + shape)).drop_vars("variance")
    by_coherence = data.drop_vars("variance").assign_coords(coherence=coherence)
    unscaled = measured_response(model, by_coherence)
    assert not unscaled.known
    by_coherence.attrs["averages"] = 20.0
    scaled = measured_response(model, by_coherence)
    np.testing.assert_allclose(scaled.variance, by_variance.variance, rtol=1e-6)
    ratio = np.median(unscaled.variance / by_variance.variance)
    assert 0.5 < ratio < 2.0


def test_only_pairs_of_the_model_are_taken_and_static_lines_left():
    model = two_masses()
    lines = np.arange(0.0, 50.0)
    more = measured(model, lines=lines).assign_coords(output=["b", "other"])
    found = measured_response(model, more)
    assert found.names == ("b/F",)
    assert found.frequency[0] == 1.0
    assert found.units == ("m/N",)


def test_a_response_of_control_fits_in_rad_per_second():
    model = two_masses()
    data = control.frd(model.state_space(), 2 * np.pi * LINES)
    found = measured_response(model, data)
    np.testing.assert_allclose(found.of(model), found.values, rtol=1e-9)


def test_what_does_not_belong_together_is_refused():
    model = two_masses()
    with pytest.raises(rp.InvalidInputError, match="pairs of the model: a/F, b/F"):
        measured_response(model, measured(model).assign_coords(input=["G"]))
    with pytest.raises(rp.InvalidInputError, match="the quantity of the model's output"):
        measured_response(model, measured(two_masses("acceleration")))
    with pytest.raises(rp.InvalidInputError, match="a MechanicalModel"):
        measured_response(model.state_space(), measured(model))
