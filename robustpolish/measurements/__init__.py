"""Measurements in: files to checked datasets in SI units."""

from robustpolish.measurements.filtering import decimate, lowpass
from robustpolish.measurements.forces import measured_forces
from robustpolish.measurements.frequency.estimate import estimate_frequency_response
from robustpolish.measurements.frequency.read import (
    holds_frequency_response,
    read_frequency_response,
)
from robustpolish.measurements.frequency.response import labelled_response, ratio_unit
from robustpolish.measurements.read import read_measurement
from robustpolish.measurements.sampling import check_sampling, sampling_time
from robustpolish.measurements.split import split_blocks
from robustpolish.measurements.units import same_kind, to_si

__all__ = [
    "check_sampling",
    "decimate",
    "estimate_frequency_response",
    "holds_frequency_response",
    "labelled_response",
    "lowpass",
    "measured_forces",
    "ratio_unit",
    "read_frequency_response",
    "read_measurement",
    "same_kind",
    "sampling_time",
    "split_blocks",
    "to_si",
]
