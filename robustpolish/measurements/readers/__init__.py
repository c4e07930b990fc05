"""One reader per file format, each giving a :class:`RawTable`."""

from robustpolish.measurements.readers.csv_file import csv_headers as csv_headers
from robustpolish.measurements.readers.csv_file import read_csv as read_csv
from robustpolish.measurements.readers.hdf5_file import read_hdf5 as read_hdf5
from robustpolish.measurements.readers.mat_file import read_mat as read_mat
from robustpolish.measurements.readers.npz_file import read_npz as read_npz
from robustpolish.measurements.readers.objects import read_frd as read_frd
from robustpolish.measurements.readers.objects import read_object as read_object
from robustpolish.measurements.readers.tdms_file import read_tdms as read_tdms
from robustpolish.measurements.readers.uff_file import read_uff as read_uff
from robustpolish.measurements.readers.uff_file import read_uff_responses as read_uff_responses
from robustpolish.measurements.readers.uff_file import (
    uff_holds_responses_only as uff_holds_responses_only,
)
from robustpolish.measurements.readers.wav_file import read_wav as read_wav
