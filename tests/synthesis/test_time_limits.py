"""No call hangs: every method ends soon after its time, on a plant that is too large for it."""

import pytest
from hard_plants import flexible_structure

import robustpolish as rp
from tests.times import computing_time

LIMIT = 1.0
# Seconds of computing, which a busy machine does not change: the limit with a second for what
# cannot be cut, and 1 s to start and end a process with a solver. Without limits: minutes.
ALLOWED = LIMIT + 2.0

PLANT = flexible_structure(20)
CALLS = {
    "state, lmi": lambda: rp.state_feedback(PLANT, method="lmi", time_limit=LIMIT),
    "state, riccati": lambda: rp.state_feedback(PLANT, method="riccati", time_limit=LIMIT),
    "state, picos": lambda: rp.state_feedback(PLANT, backend="picos", time_limit=LIMIT),
    "state, gain": lambda: rp.state_feedback(PLANT, gain_bound=100.0, time_limit=LIMIT),
    "state, region": lambda: rp.state_feedback(
        PLANT, pole_region=rp.HalfPlane(-0.001), time_limit=LIMIT
    ),
    "output, lmi": lambda: rp.output_feedback(PLANT, method="lmi", time_limit=LIMIT),
    "output, riccati": lambda: rp.output_feedback(PLANT, method="riccati", time_limit=LIMIT),
    "output, slycot": lambda: rp.output_feedback(PLANT, method="slycot", time_limit=LIMIT),
    "output, picos": lambda: rp.output_feedback(
        PLANT, method="lmi", backend="picos", time_limit=LIMIT
    ),
    "output, h2": lambda: rp.output_feedback(PLANT, "h2", time_limit=LIMIT),
    "output, h2, lmi": lambda: rp.output_feedback(PLANT, "h2", "lmi", time_limit=LIMIT),
    "output, h2, slycot": lambda: rp.output_feedback(PLANT, "h2", "slycot", time_limit=LIMIT),
    "static": lambda: rp.static_output_feedback(PLANT, time_limit=LIMIT),
    "order 2": lambda: rp.static_output_feedback(PLANT, order=2, time_limit=LIMIT),
    "observer": lambda: rp.observer_feedback(PLANT, time_limit=LIMIT),
    "mixed": lambda: rp.mixed_output_feedback(
        PLANT, pole_region=rp.HalfPlane(-0.001), time_limit=LIMIT
    ),
    "comparison": lambda: rp.compare_methods(PLANT, methods=("auto",), time_limit=LIMIT),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_method_ends_in_time(name):
    start = computing_time()
    found, refusal = [], ""
    try:
        result = CALLS[name]()
        found, refusal = certified(result), f"{result!r}"
    except rp.SolverError as error:
        refusal = str(error)
    assert all(each.certificate.valid for each in found)
    assert found or "time" in refusal  # no certificate in time, no design
    assert computing_time() - start < ALLOWED


def certified(result):
    """Return the designs of a result."""
    if isinstance(result, rp.results.Design):
        return [result]
    return [row.design for row in result if row.design is not None]
