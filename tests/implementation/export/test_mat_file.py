"""The MAT file as scipy reads it, with the cells that MATLAB's ss takes."""

import numpy as np
from scipy.io import loadmat

from tests.implementation.designs import sampled_servo, static_gain


def test_everything_comes_back(tmp_path):
    sampled = sampled_servo()
    content = loadmat(sampled.export_mat(tmp_path, name="servo", limits=3.0))
    for name in "ABCD":
        np.testing.assert_array_equal(content[name], getattr(sampled.controller, name))
    assert content["Ts"].item() == 0.05
    assert content["delay"].item() == 0.02
    assert content["InputName"][0, 0].item() == "x"
    assert content["OutputName"][0, 0].item() == "F"
    assert content["OutputUnit"][0, 0].item() == "N"
    assert content["high"].item() == 3.0
    assert content["L"].shape == (sampled.controller.nstates, 1)


def test_a_gain_has_empty_states(tmp_path):
    content = loadmat(static_gain().export_mat(tmp_path / "gain.mat"))
    assert content["A"].size == 0
    assert content["D"].item() == -3.0
    assert content["high"].item() == np.inf
