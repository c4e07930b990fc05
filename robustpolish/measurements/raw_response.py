"""What a reader gets out of a file of frequency responses, before any check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True, eq=False)
class RawResponse:
    """One curve over frequency, as written.

    Attributes
    ----------
    output, input : str
        What was measured, and what drove the machine.
    frequency : ndarray, shape (lines,)
        In `frequency_unit`.
    values : ndarray, shape (lines,)
        Complex for a response, real for its coherence or variance.
    unit : str
        Of the response; empty if the file gives none.
    kind : {"response", "coherence", "variance"}
    frequency_unit : str
    """

    output: str
    input: str
    frequency: np.ndarray
    values: np.ndarray
    unit: str = ""
    kind: Literal["response", "coherence", "variance"] = "response"
    frequency_unit: str = "Hz"
