"""How slowly a design may be sampled: the public function."""

import pytest

import robustpolish as rp
from tests.implementation.designs import servo, servo_design


def test_delays_and_filters_shorten_it():
    design = servo_design()
    plain = rp.synthesis.largest_period(design)
    assert 0 < rp.synthesis.largest_period(design, delay_periods=1.0) < plain
    assert 0 < rp.synthesis.largest_period(design, delay=0.1) < plain
    assert 0 < rp.synthesis.largest_period(design, anti_aliasing=1.0) < plain
    for method in ("zoh", "foh", "bilinear"):
        assert 0 < rp.synthesis.largest_period(design, method=method) < 1


def test_wrong_arguments_are_refused():
    with pytest.raises(rp.InvalidInputError, match="Design"):
        rp.synthesis.largest_period(servo())
    for name, value in (
        ("delay", -1.0),
        ("delay_periods", -1.0),
        ("method", "x"),
        ("method", "matched"),
        ("prewarp_hz", 0.0),
    ):
        with pytest.raises(rp.InvalidInputError, match=name):
            rp.synthesis.largest_period(servo_design(), **{name: value})
