"""What a sampled design shows and passes on."""

import dataclasses

import numpy as np
import pytest

from tests.implementation.designs import sampled_servo, servo_design, static_gain


def test_it_is_frozen_and_complete():
    sampled = sampled_servo()
    with pytest.raises(dataclasses.FrozenInstanceError):
        sampled.period = 1.0
    assert sampled.plant is servo_design().plant
    assert sampled.controller.dt == sampled.period == 0.05
    assert sampled.delay == 0.02
    assert sampled.norm == "hinf"
    assert sampled.continuous_norm == servo_design().certificate.achieved


def test_its_picture_marks_the_norm():
    ax = sampled_servo().plot()
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert any("sampled loop" in label for label in labels)
    assert any("norm" in label for label in labels)


def test_a_realisation_keeps_loop_and_signals():
    sampled = sampled_servo()
    for form in ("balanced", "modal", "sections"):
        found = sampled.realization(form)
        assert found.details["form"] == form
        assert found.controller.input_labels == ["x"]
        assert found.certificate.bound == pytest.approx(sampled.certificate.bound, rel=1e-4)
        np.testing.assert_allclose(
            np.sort(np.abs(found.certificate.poles)),
            np.sort(np.abs(sampled.certificate.poles)),
            rtol=1e-6,
            atol=1e-12,
        )
    gain = static_gain().realization("modal")
    assert gain.controller.nstates == 0
