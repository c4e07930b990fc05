import numpy as np
import pytest

import robustpolish as rp

AXIS = rp.polishing.PolishingAxis()


def error_of(way, hertz):
    """Force error over mould, N/m, the lag of the mould's waves taken out."""
    s = 2j * np.pi * hertz
    return way.loop(s)[0, 0] * (1 + s / (2 * np.pi * AXIS.surface_bandwidth))


def test_passive_stiffness_is_two_springs_in_series():
    for stiffness in (200.0, 5000.0):
        way = rp.polishing.passive_stiffness(AXIS, stiffness)
        series = 1 / (1 / stiffness + 1 / AXIS.contact_stiffness)
        assert error_of(way, 0.0).real == pytest.approx(series, rel=1e-9)


def test_impedance_control_makes_the_wanted_impedance():
    quick = rp.polishing.PolishingAxis(actuator_bandwidth=1e5, stiffness=800.0)
    way = rp.polishing.impedance_control(quick, mass=1.0, damping=60.0, stiffness=150.0)
    s = 2j * np.pi * 3.0
    wanted = s**2 + 60 * s + 150.0
    contact = quick.contact_stiffness + quick.contact_damping * s
    found = way.loop(s)[0, 0] * (1 + s / (2 * np.pi * quick.surface_bandwidth))
    assert found == pytest.approx(contact * wanted / (contact + wanted), rel=1e-3)


def test_admittance_control_has_no_error_at_rest_and_a_damper_when_moving():
    way = rp.polishing.admittance_control(AXIS, damping=400.0)
    assert abs(error_of(way, 0.0)) < 1e-6
    slow = 0.01
    assert abs(error_of(way, slow)) / (2 * np.pi * slow) == pytest.approx(400.0, rel=0.01)
    held = rp.polishing.admittance_control(AXIS, damping=400.0, stiffness=300.0)
    assert error_of(held, 0.0).real == pytest.approx(1 / (1 / 300 + 1e-4), rel=0.02)


def test_hinf_reaches_what_it_was_asked_for():
    way = rp.polishing.hinf_force_control(AXIS, 5.0, deviation=1e-3, accuracy=0.02)
    assert way.design.certificate.stable
    assert way.design.certificate.achieved < 1
    for hertz in (0.1, 1.0, 3.0):
        fading = abs(1 + 1j * hertz / 5.0) ** 2
        assert abs(way.loop(2j * np.pi * hertz)[0, 0]) * 1e-3 < 0.02 * 10.0 * fading


def test_loops_that_are_not_stable_are_refused():
    with pytest.raises(rp.InvalidInputError, match="a stable loop"):
        rp.polishing.admittance_control(
            rp.polishing.PolishingAxis(contact_damping=0.0), damping=5.0
        )
    with pytest.raises(rp.InvalidInputError, match="axis"):
        rp.polishing.passive_stiffness(7.0)
    with pytest.raises(rp.InfeasibleError):
        rp.polishing.hinf_force_control(AXIS, 50.0, accuracy=1e-5)
