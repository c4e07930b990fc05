"""The JSON file."""

import json

import numpy as np

from tests.implementation.designs import sampled_servo


def test_every_number_comes_back_exactly(tmp_path):
    sampled = sampled_servo()
    content = json.loads(sampled.export_json(tmp_path, limits=(-1, 2)).read_text())
    for name in "ABCD":
        np.testing.assert_array_equal(content[name], getattr(sampled.controller, name))
    assert content["robustpolish"] == "controller"
    assert content["measurements"] == ["x"]
    assert content["units"] == {"x": "m", "F": "N"}
    assert content["limits"] == [[-1.0], [2.0]]
    assert content["period"] == 0.05
