"""The noise beside a fitted model."""

import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.discover.floor_beside import floor_beside
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import oscillator, record

COLOURED = lfilter([1.0], [1.0, -0.9], np.random.default_rng(1).standard_normal(4000))
SHARE = 0.03


@pytest.fixture(scope="module")
def found():
    data = record()
    size = SHARE * float(np.std(data["x"]))
    noisy = data["x"] + size * COLOURED / np.std(COLOURED)
    return prepared_of(oscillator(), data.assign(x=noisy.assign_attrs(data["x"].attrs))), size


@pytest.mark.parametrize("calm", [True, False])
def test_a_right_model_shows_the_whole_of_coloured_noise(found, calm):
    prepared, size = found
    assert prepared.scales.noise[0] < 0.7 * size  # what the quietest band shows
    assert floor_beside(oscillator(), prepared, calm)[0] == pytest.approx(size, rel=0.3)


def test_a_wrong_model_does_not_make_its_error_a_noise(found):
    prepared, size = found
    assert floor_beside(oscillator(stiffness=300.0), prepared, True)[0] < 1.5 * size
