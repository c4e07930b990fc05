"""Finite numbers of any size as arguments: a result, or an error of the package."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robustpolish as rp

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
# What people write, and the ends of what doubles hold.
EDGES = st.sampled_from([0.0, -1.0, 1.0, 0.5, 5e-324, 1e-160, 1e160, 1.7e308, -1.7e308])
ANY = st.one_of(EDGES, NUMBERS)
LAG = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
SCALARS = {
    "disk": lambda a, b, c: rp.Disk(a, b),
    "delay line": lambda a, b, c: rp.simulation.DelayLine("x", a),
    "half plane": lambda a, b, c: rp.HalfPlane(a),
    "sector": lambda a, b, c: rp.Sector(a),
    "certify": lambda a, b, c: rp.certify(LAG, [[a]], claimed=b, tolerance=c),
    "lead_lag": lambda a, b, c: rp.tunable.lead_lag("y1", gain=a, zero_hz=b, pole_hz=c),
    "loss_damping": rp.effects.loss_damping,
    "low_pass": lambda a, b, c: rp.tunable.low_pass("y1", frequency_hz=a, damping=b),
    "notch": lambda a, b, c: rp.tunable.notch("y1", frequency_hz=a, depth=b, width=c),
    "pid": lambda a, b, c: rp.tunable.pid("y1", Kp=a, Ki=b, Kd=c),
    "plant_at_samples": lambda a, b, c: rp.implementation.plant_at_samples(LAG, a, b),
    "resultant_forces": lambda a, b, c: rp.polishing.resultant_forces(ahead=a, behind=b, side=c),
    "share_damping": rp.effects.share_damping,
    "static_gain": lambda a, b, c: rp.tunable.static_gain(gain=[[a]]),
    "tunable": lambda a, b, c: rp.tunable.tunable("k", a, b, c),
    "uncertain_complex": lambda a, b, c: rp.uncertain.complex("k", a, radius=b),
    "uncertain_dynamics": lambda a, b, c: rp.uncertain.dynamics("k", bound=a),
    "uncertain_real": lambda a, b, c: rp.uncertain.real("k", a, range=(b, c)),
    "uncertain_real in percent": lambda a, b, c: rp.uncertain.real("k", a, percent=b),
    "weight": rp.weight,
}
pytestmark = pytest.mark.usefixtures("overflows_are_expected")


@pytest.mark.parametrize("name", SCALARS)
def test_scalars(name):
    @settings(max_examples=25, deadline=None, derandomize=True, database=None)
    @given(ANY, ANY, ANY)
    def ends_well(a, b, c):
        try:
            found = SCALARS[name](a, b, c)
        except rp.RobustPolishError:
            return
        if isinstance(found, float):
            assert not np.isnan(found)
        if isinstance(found, control.StateSpace):
            assert all(np.isfinite(getattr(found, each)).all() for each in "ABCD")

    ends_well()


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(st.lists(ANY, min_size=9, max_size=9))
def test_systems_of_two_states(n):
    system = control.StateSpace(
        [[n[0], n[1]], [n[2], n[3]]], [[n[4]], [n[5]]], [[n[6], n[7]]], [[n[8]]], 0,
        remove_useless_states=False,
    )  # fmt: skip
    linear = (rp.linear.stability, rp.linear.controllability)
    for function in (rp.hinf_norm, rp.h2_norm, rp.modes, *linear):
        try:
            found = function(system)
        except rp.RobustPolishError:
            continue
        if isinstance(found, rp.results.HinfNorm | rp.results.H2Norm):
            assert found.lower <= found.value <= found.upper


@settings(max_examples=40, deadline=None, derandomize=True, database=None)
@given(NUMBERS.filter(lambda x: 1e-290 < abs(x) < 1e290))
def test_the_gain_of_a_lag_follows_its_numbers(c):
    norm = rp.hinf_norm(control.StateSpace([[-2.0]], [[2.0]], [[c]], 0))
    assert norm.lower <= abs(c) <= norm.upper
    assert norm.upper <= abs(c) * (1 + 1e-8)
