import numpy as np
import pytest

from robustpolish.identification.experiments.candidates import EXPERIMENTS
from robustpolish.identification.policy import POLICY


def test_two_machines_are_apart_where_the_wrong_one_errs_visibly_more():
    noise_and_difference = np.sqrt(1 + EXPERIMENTS.clear**2)
    assert 1 - 1 / noise_and_difference == pytest.approx(POLICY.visible_fall)
    assert EXPERIMENTS.sure > EXPERIMENTS.clear


def test_the_amplitudes_are_those_that_the_guide_names():
    assert EXPERIMENTS.times == (0.3, 1.0, 3.0, 10.0)
