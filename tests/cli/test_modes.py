"""`robustpolish modes`: the frequencies of the thesis."""

import json

import numpy as np

from tests.cli.command_line import run


def test_modes_are_those_of_the_thesis():
    found = json.loads(run("modes", "--json").stdout)["modes"]
    hertz = sorted(mode["frequency_hz"] for mode in found)
    np.testing.assert_allclose(
        hertz, [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75], rtol=2e-6
    )
    assert "194.0691" in run("modes").stdout
    assert "3361" in run("modes", "--parameters", "corrected").stdout
