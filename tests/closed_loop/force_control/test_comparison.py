import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp

AXIS = rp.polishing.PolishingAxis()
PATH = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
TIME = np.linspace(0.0, 3.0, 3001)


def test_a_slow_rise_gives_the_force_of_the_springs():
    ways = [
        rp.polishing.passive_stiffness(AXIS, 500.0),
        rp.polishing.admittance_control(AXIS, damping=400.0),
    ]
    found = rp.polishing.compare_force_control(ways, PATH, 2e-3 * TIME, TIME)
    last = found.signals["force"].isel(time=-1).values
    # 6 mm on 500 and 1e4 N/m in series; 2 mm/s on a damper of 400 N s/m.
    assert last[0] == pytest.approx(10 + 6e-3 / (1 / 500 + 1e-4), rel=5e-3)
    assert last[1] == pytest.approx(10 + 0.8, rel=1e-3)
    assert found.table["touching"].values.tolist() == [1.0, 1.0]


def test_what_is_wanted_is_taken_off_where_nothing_deviates():
    found = rp.polishing.compare_force_control(
        [rp.polishing.passive_stiffness(AXIS)], PATH, 0 * TIME, TIME
    )
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
    found = rp.polishing.compare_force_control(ways, PATH, deviation, TIME, force_noise=noise)
    errors = found.table["removal_error"].values
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert len(found.explain().splitlines()) == 4
    assert len(found.plot().lines) >= 3
    assert found.plot_removal("H-infinity", error=True).get_xlabel() == "x [mm]"
    plt.close("all")
    with pytest.raises(rp.InvalidInputError, match="control"):
        found.plot_removal("nobody")


def test_deviations_are_those_of_the_surfaces():
    mould = rp.polishing.Mould.from_formula("0.02*x", x=(-0.02, 0.02), y=(-0.02, 0.02))
    x, _ = PATH.position(TIME)
    expected = 0.02 * (x - x[0])
    found = rp.polishing.height_deviation(mould, None, PATH, TIME)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.all(rp.polishing.height_deviation(mould, mould, PATH, TIME) == 0)
    small = rp.polishing.Mould.from_formula("0*x", x=(-0.01, 0.01), y=(-0.01, 0.01))
    with pytest.raises(rp.InvalidInputError, match="leaves one of the surfaces"):
        rp.polishing.height_deviation(small, None, PATH, TIME)


def test_controls_have_to_suit_each_other():
    other = rp.polishing.PolishingAxis(polishing_force=5.0)
    passive = rp.polishing.passive_stiffness(AXIS)
    for ways in ([], [passive, passive], [passive, rp.polishing.admittance_control(other)]):
        with pytest.raises(rp.InvalidInputError, match="controls"):
            rp.polishing.compare_force_control(ways, PATH, 0 * TIME, TIME)
    with pytest.raises(rp.InvalidInputError, match="deviation"):
        rp.polishing.compare_force_control([passive], PATH, [0.0, 1.0], TIME)
