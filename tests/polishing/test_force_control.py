"""Control of the polishing force: axis, controllers, comparison."""

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp


def test_the_plant_is_the_equation_of_motion():
    axis = rp.polishing.PolishingAxis(stiffness=300.0)
    plant, omega = axis.plant(), 2 * np.pi * 7.0
    s = 1j * omega
    lag = 1 / (1 + s / (2 * np.pi * axis.surface_bandwidth))
    push = 1 / (1 + s / (2 * np.pi * axis.actuator_bandwidth))
    contact = axis.contact_stiffness + axis.contact_damping * s
    hung = axis.mass * s**2 + axis.damping * s + axis.stiffness
    tool = {"surface": contact * lag / (hung + contact), "push": push / (hung + contact)}
    system = control.ss(plant.A, np.hstack([plant.B1, plant.B2]), plant.C1,
                        np.hstack([plant.D11, plant.D12]))  # fmt: skip
    found = system(s)
    assert found[1, 0] == pytest.approx(tool["surface"])
    assert found[1, 2] == pytest.approx(tool["push"])
    assert found[0, 0] == pytest.approx(contact * (lag - tool["surface"]))
    assert found[0, 2] == pytest.approx(-contact * tool["push"])


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


def test_impedance_and_admittance_control_make_what_is_wanted():
    quick = rp.polishing.PolishingAxis(actuator_bandwidth=1e5, stiffness=800.0)
    way = rp.polishing.impedance_control(quick, mass=1.0, damping=60.0, stiffness=150.0)
    s = 2j * np.pi * 3.0
    wanted = s**2 + 60 * s + 150.0
    contact = quick.contact_stiffness + quick.contact_damping * s
    found = way.loop(s)[0, 0] * (1 + s / (2 * np.pi * quick.surface_bandwidth))
    assert found == pytest.approx(contact * wanted / (contact + wanted), rel=1e-3)
    way = rp.polishing.admittance_control(AXIS, damping=400.0)
    assert abs(error_of(way, 0.0)) < 1e-6
    slow = 0.01
    assert abs(error_of(way, slow)) / (2 * np.pi * slow) == pytest.approx(400.0, rel=0.01)
    held = rp.polishing.admittance_control(AXIS, damping=400.0, stiffness=300.0)
    assert error_of(held, 0.0).real == pytest.approx(1 / (1 / 300 + 1e-4), rel=0.02)


def test_hinf_reaches_what_it_was_asked_for_and_unstable_loops_are_refused():
    way = rp.polishing.hinf_force_control(AXIS, 5.0, deviation=1e-3, accuracy=0.02)
    assert way.design.certificate.stable
    assert way.design.certificate.achieved < 1
    for hertz in (0.1, 1.0, 3.0):
        fading = abs(1 + 1j * hertz / 5.0) ** 2
        assert abs(way.loop(2j * np.pi * hertz)[0, 0]) * 1e-3 < 0.02 * 10.0 * fading
    with pytest.raises(rp.InvalidInputError, match="a stable loop"):
        rp.polishing.admittance_control(
            rp.polishing.PolishingAxis(contact_damping=0.0), damping=5.0
        )
    with pytest.raises(rp.InvalidInputError, match="axis"):
        rp.polishing.passive_stiffness(7.0)
    with pytest.raises(rp.InfeasibleError):
        rp.polishing.hinf_force_control(AXIS, 50.0, accuracy=1e-5)


PATH = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
TIME = np.linspace(0.0, 3.0, 3001)


def compared(ways, deviation, **options):
    return rp.polishing.compare_force_control(ways, PATH, deviation, TIME, **options)


def test_force_of_a_slow_rise_and_removal_without_one():
    ways = [
        rp.polishing.passive_stiffness(AXIS, 500.0),
        rp.polishing.admittance_control(AXIS, damping=400.0),
    ]
    found = compared(ways, 2e-3 * TIME)
    last = found.signals["force"].isel(time=-1).values
    # 6 mm on 500 and 1e4 N/m in series; 2 mm/s on a damper of 400 N s/m.
    assert last[0] == pytest.approx(10 + 6e-3 / (1 / 500 + 1e-4), rel=5e-3)
    assert last[1] == pytest.approx(10 + 0.8, rel=1e-3)
    assert found.table["touching"].values.tolist() == [1.0, 1.0]
    found = compared([rp.polishing.passive_stiffness(AXIS)], 0 * TIME)
    assert float(found.table["removal_error"][0]) < 1e-12
    name = found.signals["control"].values[0]
    np.testing.assert_allclose(found.removal[name], found.removal["wanted"])


def test_table_words_and_pictures():
    ways = [
        rp.polishing.passive_stiffness(AXIS),
        rp.polishing.impedance_control(AXIS),
        rp.polishing.hinf_force_control(AXIS),
    ]
    deviation = 1e-3 * np.sin(2 * np.pi * TIME)
    noise = np.random.default_rng(0).normal(0, 0.01, TIME.size)
    found = compared(ways, deviation, force_noise=noise)
    errors = found.table["removal_error"].values
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert len(found.explain().splitlines()) == 4
    assert len(found.plot().lines) >= 3
    assert found.plot_removal("H-infinity", error=True).get_xlabel() == "x [mm]"
    plt.close("all")
    with pytest.raises(rp.InvalidInputError, match="control"):
        found.plot_removal("nobody")


def test_deviations_are_those_of_the_surfaces_and_controls_suit_each_other():
    mould = rp.polishing.Mould.from_formula("0.02*x", x=(-0.02, 0.02), y=(-0.02, 0.02))
    x, _ = PATH.position(TIME)
    expected = 0.02 * (x - x[0])
    found = rp.polishing.height_deviation(mould, None, PATH, TIME)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.all(rp.polishing.height_deviation(mould, mould, PATH, TIME) == 0)
    small = rp.polishing.Mould.from_formula("0*x", x=(-0.01, 0.01), y=(-0.01, 0.01))
    with pytest.raises(rp.InvalidInputError, match="leaves one of the surfaces"):
        rp.polishing.height_deviation(small, None, PATH, TIME)
    other = rp.polishing.PolishingAxis(polishing_force=5.0)
    passive = rp.polishing.passive_stiffness(AXIS)
    for ways in ([], [passive, passive], [passive, rp.polishing.admittance_control(other)]):
        with pytest.raises(rp.InvalidInputError, match="controls"):
            compared(ways, 0 * TIME)
    with pytest.raises(rp.InvalidInputError, match="deviation"):
        compared([passive], [0.0, 1.0])
