"""Sound files, which many analysers write for vibration records."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import scipy.io.wavfile

from robustpolish.files import Wanted, opened
from robustpolish.measurements.raw import RECORD, RawTable, unreadable


def read_wav(path: Path, wanted: Wanted = RECORD) -> RawTable:
    """Read the channels ``channel_1``, ``channel_2``, ...; integers become shares of full scale."""
    with opened(path, wanted) as file, warnings.catch_warnings():
        # SciPy warns of chunks that it skips; they hold remarks, no samples.
        warnings.simplefilter("ignore", scipy.io.wavfile.WavFileWarning)
        try:
            rate, samples = scipy.io.wavfile.read(file)
        except Exception as error:  # struct.error, ValueError and more on damage
            raise unreadable(path, "WAV", error) from None
    table = RawTable(sampling_rate=float(rate))
    samples = np.atleast_2d(samples.T).T
    values = samples.astype(float)
    if samples.dtype == np.uint8:
        values = (values - 128) / 128
    elif samples.dtype.kind == "i":
        values = values / -float(np.iinfo(samples.dtype).min)
    if samples.dtype.kind in "iu":
        table.notes.append("samples are shares of the full scale; pass units= to calibrate")
    for i in range(values.shape[1]):
        table.add(f"channel_{i + 1}", values[:, i])
    return table
