from .forces import (
    decimate as decimate,
)
from .forces import (
    lowpass as lowpass,
)
from .forces import (
    measured_forces as measured_forces,
)
from .forces import (
    split_blocks as split_blocks,
)
from .frequency_response import (
    estimate_frequency_response as estimate_frequency_response,
)
from .frequency_response import (
    holds_frequency_response as holds_frequency_response,
)
from .frequency_response import (
    labelled_response as labelled_response,
)
from .frequency_response import (
    ratio_unit as ratio_unit,
)
from .frequency_response import (
    read_frequency_response as read_frequency_response,
)
from .raw import (
    check_sampling as check_sampling,
)
from .raw import (
    same_kind as same_kind,
)
from .raw import (
    sampling_time as sampling_time,
)
from .raw import (
    to_si as to_si,
)
from .read import (
    read_measurement as read_measurement,
)

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
