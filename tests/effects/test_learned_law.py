import numpy as np
import pytest

import robustpolish as rp
from robustpolish.machines.effects.effect import Effect
from tests.effects.learned_curves import law_of, surface_of


def test_the_curve_comes_with_its_band():
    law = law_of(lambda q: 100 * q**3, count=12, share=0.01)
    shown = law.curve()
    true = 100 * shown["displacement"].values ** 3
    off = np.abs(shown["force"].values - true) / shown["stderr"].values
    assert np.mean(off < 2) > 0.9
    assert shown["force"].attrs["units"] == "N"
    assert shown["displacement"].attrs["units"] == "m"
    assert law.seen == {"displacement": (-1.1, 1.0)}
    assert law.over == "displacement"


def test_what_is_not_known_has_no_band():
    known = law_of(lambda q: q, count=8)
    bare = rp.results.LearnedLaw(known.effect)
    assert np.isnan(bare.curve()["stderr"].values).all()
    assert len(bare.plot().collections) == 0
    # one coefficient that no data has seen spoils the band where it counts, and there only
    covariance = np.array(known.covariance)
    covariance[0, 0] = np.inf
    stderr = rp.results.LearnedLaw(known.effect, covariance).curve()["stderr"].values
    assert np.isinf(stderr[0])
    assert np.isfinite(stderr[-1])


def test_a_torque_over_an_angle_has_its_units():
    law = rp.results.LearnedLaw(law_of(lambda q: 5 * q).effect, rotational=True)
    assert law.curve()["force"].attrs["units"] == "N m"
    assert law.plot().get_xlabel().startswith("displacement [")
    assert "rad" in law.plot().get_xlabel()
    assert "N m/rad" in str(law.formula())


def test_curves_and_surfaces_are_drawn():
    ax = law_of(lambda v: 5 * v, over="damping").plot()
    assert ax.get_xlabel() == "velocity [m/s]"
    assert ax.get_ylabel() == "force [N]"
    assert len(ax.collections) == 1
    surface = surface_of(lambda q, v: 3 * q + 2 * v)
    assert surface.plot().get_ylabel() == "velocity [m/s]"
    shown = surface.curve(5)
    assert shown["force"].shape == (5, 5)
    wanted = 3 * shown["displacement"] + 2 * shown["velocity"]
    np.testing.assert_allclose(shown["force"], wanted, atol=0.1)


@pytest.mark.parametrize(
    ("over", "quantity", "unit"),
    [
        ("varying_stiffness", "stiffness", "N/m"),
        ("varying_damping", "damping", "N s/m"),
    ],
)
def test_what_varies_is_a_curve_over_time(over, quantity, unit):
    law = law_of(lambda t: 40 * t - 90, low=2.0, high=8.0, over=over)
    assert (law.over, law.quantity, law.unit) == ("time", quantity, unit)
    assert law.seen == {"time": (2.0, 8.0)}
    shown = law.curve(3)
    assert set(shown.data_vars) == {quantity, "stderr"}
    np.testing.assert_allclose(shown[quantity], [-10, 110, 230], atol=2)
    assert shown["time"].attrs["units"] == "s"
    ax = law.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", f"{quantity} [{unit}]")
    formula = law.formula()
    assert formula.expression == "a0 + a1*t"
    assert formula.units == {"a0": unit, "a1": f"{unit}/s"}
    assert formula.numbers["a1"] == pytest.approx(40, rel=0.02)
    turning = rp.results.LearnedLaw(law.effect, rotational=True)
    assert turning.unit == unit.replace("N", "N m").replace("/m", "/rad")


def test_it_shows_itself():
    text = str(law_of(lambda q: 100 * q**3))
    assert "Force over displacement at x, ground" in text
    assert "displacement seen" in text
    assert "It hardens" in text


def test_named_effects_are_refused():
    with pytest.raises(rp.InvalidInputError, match="a learned law"):
        rp.results.LearnedLaw(Effect("cubic_stiffness", "x", {"stiffness": 1.0}))
