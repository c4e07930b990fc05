from dataclasses import replace

import numpy as np
import pytest

from tests.identification.discover.searches import MODEL, judged, search_of
from tests.identification.oscillators import of_rig


@pytest.fixture(scope="module")
def begun():
    """A search at the rig, whose noise is 1 N and whose error stands at 10 N."""
    search = search_of(MODEL, of_rig(noise=1.0))
    scales = replace(search.prepared.scales, noise=np.ones(1))
    return replace(
        search, stage=judged(MODEL, 10.0), prepared=replace(search.prepared, scales=scales)
    )


@pytest.fixture
def search(begun):
    return replace(begun, reasons=[], indistinguishable_pairs=[], beside={})
