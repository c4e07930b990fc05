"""Measurements in: files to checked datasets in SI units."""

from robustpolish.measurements.filtering import decimate, lowpass
from robustpolish.measurements.read import read_measurement
from robustpolish.measurements.sampling import check_sampling, sampling_time
from robustpolish.measurements.split import split_blocks
from robustpolish.measurements.units import same_kind, to_si

__all__ = [
    "check_sampling",
    "decimate",
    "lowpass",
    "read_measurement",
    "same_kind",
    "sampling_time",
    "split_blocks",
    "to_si",
]
