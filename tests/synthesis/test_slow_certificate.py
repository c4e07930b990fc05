"""A loop whose peak lies decades beside where a search in doubles ends: in time all the same."""

import numpy as np
import pytest

import robustpolish as rp
from tests.times import computing_time

POSITIONAL = ("A", "B1", "B2", "C1", "C2")


@pytest.mark.shared
@pytest.mark.long
@pytest.mark.parametrize("limit", [1.5, 3.0, 5.0])
def test_the_limit_holds_for_search_and_certificate(limit, shared, monkeypatch):
    with np.load(shared / "data" / "plants" / "slow_certificate.npz") as data:
        matrices = dict(data)
    named = {name: M for name, M in matrices.items() if name not in POSITIONAL}
    plant = rp.GeneralizedPlant.from_matrices(*(matrices[name] for name in POSITIONAL), **named)
    # Seconds of computing, which a busy machine does not change.
    monkeypatch.setattr("time.monotonic", computing_time)
    start = computing_time()
    design = rp.output_feedback(plant, time_limit=limit)
    assert computing_time() - start < limit + 1.0
    assert design.status == "time_limit"
    assert design.certificate.valid
    assert design.certificate.bound <= design.certificate.achieved * (1 + 1e-3)
