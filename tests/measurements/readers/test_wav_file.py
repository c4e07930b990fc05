"""Sound files."""

import wave

import numpy as np
import scipy.io
import scipy.sparse

from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION


def test_wav(tmp_path):
    path = tmp_path / "data.wav"
    samples = np.column_stack([FORCE / 4e3, MOTION / 4e-3])
    scipy.io.wavfile.write(path, 1000, np.round(samples * 2**15).astype(np.int16))
    data = read_measurement(path, units={"channel_1": "4 kN", "channel_2": "4 mm"})
    data = data.rename(channel_1="F", channel_2="x")
    np.testing.assert_allclose(data["F"], FORCE, atol=4e3 / 2**15)
    np.testing.assert_allclose(data["x"], MOTION, atol=4e-3 / 2**15)
    assert data["x"].attrs["units"] == "m"
    with wave.open(str(path)) as file:
        assert file.getnframes() == data.sizes["time"]
