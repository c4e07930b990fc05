import control
import pytest

import robustpolish as rp


def test_ways_to_tell_a_range():
    for given in ({"percent": 40}, {"plus_minus": 4}, {"range": (6, 14)}, {"percent": (-40, 40)}):
        element = rp.uncertain.real("k", 10, **given).elements["k"]
        assert (element.low, element.nominal, element.high) == pytest.approx((6, 10, 14))
    assert rp.uncertain.real("k", -10, percent=40).elements["k"].low == -14


def test_shapes_of_dynamics():
    assert rp.uncertain.dynamics("d").shape == (1, 1)
    assert rp.uncertain.dynamics("d", 2).shape == (2, 2)
    assert rp.uncertain.dynamics("d", (2, 3), bound=control.tf(1, [1, 1])).shape == (2, 3)
    one, two = rp.uncertain.dynamics((1, 1)), rp.uncertain.dynamics((1, 1), bound=0.3)
    assert len((one + two).blocks) == 2
    sampled = control.tf(1, [1, -0.5], 0.1)
    assert (rp.uncertain.dynamics("d", bound=sampled) * sampled).dt == 0.1


@pytest.mark.parametrize(
    "call",
    [
        lambda: rp.uncertain.real("k", 10),
        lambda: rp.uncertain.real("k", 10, percent=40, range=(6, 14)),
        lambda: rp.uncertain.real("k", 10, range=(11, 14)),
        lambda: rp.uncertain.real("k", 10, range=(14, 6)),
        lambda: rp.uncertain.real("k", 10, range=3),
        lambda: rp.uncertain.real("k", 0, percent=10),
        lambda: rp.uncertain.real("k", 10, percent=-5),
        lambda: rp.uncertain.real("", 10, percent=5),
        lambda: rp.uncertain.real(3, 10, percent=5),
        lambda: rp.uncertain.real("k", "ten", percent=5),
        lambda: rp.uncertain.real("k", float("nan"), percent=5),
        lambda: rp.uncertain.complex("c", 1j),
        lambda: rp.uncertain.complex("c", 1, radius=0),
        lambda: rp.uncertain.dynamics("d", (0, 1)),
        lambda: rp.uncertain.dynamics("d", (1, 2, 3)),
        lambda: rp.uncertain.dynamics("d", (1, 1), bound=-1),
        lambda: rp.uncertain.dynamics("d", (2, 2), bound=control.tf([1, 0], 1)),
        lambda: rp.uncertain.dynamics("d", (2, 2), bound=[[1, 2, 3]]),
    ],
)
def test_bad_input(call):
    with pytest.raises(rp.InvalidInputError):
        call()
