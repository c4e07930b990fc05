"""The formula behind a curve is found, and none is made up."""

import numpy as np
import pytest

from robustpolish.machines.effects.learned_law import unit_of_power
from tests.effects.learned_curves import law_of, surface_of


def dead(q, gap):
    return np.sign(q) * np.maximum(np.abs(q) - gap, 0)


@pytest.mark.parametrize(
    ("curve", "over", "expression", "numbers"),
    [
        (lambda q: 90 * q, "stiffness", "k*q", {"k": 90}),
        (lambda q: 90 * q**3, "stiffness", "k3*q**3", {"k3": 90}),
        (lambda q: 90 * q**5, "stiffness", "k5*q**5", {"k5": 90}),
        (lambda q: 90 * q * np.abs(q), "stiffness", "ka*q*abs(q)", {"ka": 90}),
        (lambda q: 90 * q**2, "stiffness", "k2*q**2", {"k2": 90}),
        (lambda q: 9 * np.tanh(q / 0.3), "stiffness", "Fs*tanh(q/d)", {"Fs": 9, "d": 0.3}),
        (lambda q: 90 * dead(q, 0.3), "stiffness", "kd*sign(q)*max(abs(q) - d, 0)",
         {"kd": 90, "d": 0.3}),
        (lambda q: 90 * np.maximum(q, 0), "stiffness", "kr*max(q, 0)", {"kr": 90}),
        (lambda q: 90 * np.maximum(q - 0.3, 0), "stiffness", "kr*max(q - d, 0)",
         {"kr": 90, "d": 0.3}),
        (lambda q: 90 * q + 300 * q**3, "stiffness", "k*q + k3*q**3", {"k": 90, "k3": 300}),
        (lambda v: 9 * v, "damping", "c*v", {"c": 9}),
        (lambda v: 9 * np.tanh(v / 0.004), "damping", "F*sign(v)", {"F": 9}),
        (lambda v: 9 * v * np.abs(v), "damping", "ca*v*abs(v)", {"ca": 9}),
        (lambda v: 20 * v**3 - 5 * v, "damping", "c*v + c3*v**3", {"c": -5, "c3": 20}),
    ],
)  # fmt: skip
def test_the_right_formula_is_the_simplest(curve, over, expression, numbers):
    found = law_of(curve, over=over).formula()
    assert found is not None
    assert found.expression == expression
    for name, value in numbers.items():
        assert found.numbers[name] == pytest.approx(value, rel=0.03, abs=0.02 * abs(value))
        error = found.stderr[name]
        assert np.isnan(error) or abs(found.numbers[name] - value) < 4 * error + 0.01 * abs(value)
    assert found.misfit < 0.02
    assert all(name in str(found) for name in numbers)


def test_a_wider_band_takes_a_simpler_formula():
    def bent(q):
        return 90 * q + 5 * q**3

    assert law_of(bent, share=0.002).formula().expression == "k*q + k3*q**3"
    assert law_of(bent, share=0.05).formula().expression == "k*q"


def test_where_none_fits_none_is_named():
    assert law_of(lambda q: 90 * np.sin(8 * q)).formula() is None
    assert law_of(lambda q: 0 * q, share=0.0).formula() is None


def test_surfaces_have_formulas_too():
    assert surface_of(lambda q, v: 8 * q + 3 * v).formula().expression == "k*q + c*v"
    damped = surface_of(lambda q, v: 40 * q**2 * v).formula()
    assert damped.expression == "cq*q**2*v"
    assert damped.units == {"cq": "N s/m^3"}


def test_units_divide_by_powers():
    assert unit_of_power(("N", "m"), 0, 0) == "N"
    assert unit_of_power(("N m", "rad"), 1, 0) == "N m/rad"
    assert unit_of_power(("N", "m"), 0, 2) == "N s^2/m^2"
