"""The beam in a magnetic field."""

import numpy as np
import pytest

import robustpolish as rp


def test_the_decay_has_the_published_frequencies():
    beam = rp.datasets.magnetic_beam()
    strain, time = beam["strain_beam"].values, beam["time"].values
    rising = np.flatnonzero((strain[:-1] < 0) & (strain[1:] >= 0))
    crossings = time[rising] - strain[rising] * 1e-3 / (strain[rising + 1] - strain[rising])
    first = 5 / (crossings[5] - crossings[0])
    assert first == pytest.approx(41.0, abs=0.3)
    assert 5 / (crossings[-1] - crossings[-6]) < 38
