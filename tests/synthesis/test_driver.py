"""From what engines find to one certified controller: gains preferred, modes removed, lies refused.

An engine that finds what it is told stands for those of the package.
"""

import numpy as np
import pytest
from hard_plants import flexible_structure, heat_rod
from output_tasks import unstable_lag

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis import driver
from robustpolish.synthesis.driver import Candidate, Engine, Settings
from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.problem.preflight import check_solvability
from tests.times import computing_time


def priced_lag(price=1.0, unit=1.0):
    """X' = -x + w + u, z = unit (x, price u), y = x.

    With u = k y the H-infinity norm is sqrt(1 + (price k)^2) / (1 - k), which for a price of 1 is
    least at k = -1, where it is sqrt(1/2); without a price it falls without end.
    """
    plant = unstable_lag(price, noise=0.0, a=-1.0).part(
        states=[0], disturbances=[0], controls=[0], performance=[0, 1], measurements=[0]
    )
    return plant.replace(C1=unit * plant.C1, D12=unit * plant.D12)


def norm_of(k, price=1.0):
    return np.sqrt(1 + (price * k) ** 2) / (1 - k)


def gain(k):
    none = np.zeros
    return Controller(none((0, 0)), none((0, 1)), none((1, 0)), np.array([[float(k)]]))


def chosen(plant, *found, norm="hinf", falling=False, enough=0.0, work=np.inf, tolerance=0.01):
    """Choose among controllers in the plant's units; a pair tells a false norm of the second."""

    class ByHand(Engine):
        method = backend = "by hand"

        def search(self):
            unit = self.problem.scaled
            for each in found:
                claim, K = each if len(each) == 2 else (np.inf, each)
                K = Controller(
                    K.A * unit.time,
                    K.B * unit.time * unit.measurement,
                    K.C / unit.control[:, None],
                    K.D * unit.measurement / unit.control[:, None],
                )
                lie = Candidate(K, claim, claim, "a lie") if np.isfinite(claim) else None
                self.candidates.append(lie or self.checked(K, claim, "by hand"))
            self.falling = falling

    settings = Settings(norm, "by hand", "none", None, tolerance, engines=(ByHand,))
    search = driver.PartSearch(plant, settings, check_solvability(plant), Budget(work))
    return search.choose(enough)


def test_within_the_tolerance_the_smaller_gain_wins_in_the_units_of_the_plant():
    unit = 1e4
    # 0.9 % above the optimum, at it, and 5 % above it.
    assert norm_of(-0.76) < 1.0099 * np.sqrt(0.5) < norm_of(-0.5)
    found = chosen(priced_lag(unit=unit), *map(gain, (-0.76, -1.0, -0.5)))
    assert found.controller.D.item() == pytest.approx(-0.76)
    assert found.status == "optimal"
    assert found.certificate.valid
    assert found.certificate.achieved == pytest.approx(unit * norm_of(-0.76), rel=1e-6)
    assert found.bound.value == pytest.approx(unit * np.sqrt(0.5), rel=1e-3)


def test_the_status_says_what_is_known():
    assert chosen(priced_lag(), gain(-0.5)).status == "suboptimal"
    free = chosen(priced_lag(price=0.0), gain(-3.0), falling=True)
    assert free.status == "infimum_not_attained"


def test_a_falling_search_need_not_go_below_what_is_enough():
    gains = [gain(-k) for k in (9.0, 99.0, 9999.0)]  # norms 1e-1, 1e-2, 1e-4
    best = chosen(priced_lag(price=0.0), *gains, falling=True)
    modest = chosen(priced_lag(price=0.0), *gains, falling=True, enough=0.02)
    assert best.certificate.achieved == pytest.approx(1e-4)
    assert modest.certificate.achieved == pytest.approx(1e-2)


def test_lies_are_found_out_and_the_honest_candidate_is_taken():
    lie = (0.1, gain(2.0))  # which does not stabilise
    found = chosen(priced_lag(), lie, gain(-1.0))
    assert found.controller.D.item() == pytest.approx(-1.0)
    with pytest.raises(rp.SolverError, match=r"No certified controller was found: .*stable"):
        chosen(priced_lag(), lie)


def test_modes_that_do_nothing_are_removed():
    # A fast lag that is cancelled by the feedthrough at rest, and a mode that u does not see.
    B, C = np.array([[1e3], [1.0]]), np.array([[1.0, 0.0]])
    long = Controller(np.diag([-1e6, -3.0]), B, C, -np.eye(1))
    found = chosen(priced_lag(), long)
    assert found.controller.nstates == 0
    assert found.controller.D.item() == pytest.approx(-1.0, rel=2e-3)
    assert chosen(priced_lag(), long, work=1e-9).controller.nstates == 2  # without work none is


def priced_rod(points=80):
    return rp.output_feedback(heat_rod(points), control_weight=1e-3, measurement_noise=1e-3)


def test_a_large_plant_gets_a_short_controller():
    design = priced_rod(105)
    assert design.certificate.valid
    assert design.controller.nstates <= 52
    assert design.closed_loop.nstates == 105 + design.controller.nstates
    assert "of the 105 states" in design.message
    assert "Hankel bound" in design.message
    assert design.lower_bound is None  # that of the shorter plant proves nothing of this one
    assert design.status == "suboptimal"


# No call hangs: every method ends soon after its time, on a plant that is too large for it.


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
    # no certificate in time, no design
    assert found or "time" in refusal or "work allowed was spent" in refusal
    assert computing_time() - start < ALLOWED


def certified(result):
    """Return the designs of a result."""
    if isinstance(result, rp.results.Design):
        return [result]
    return [row.design for row in result if row.design is not None]
