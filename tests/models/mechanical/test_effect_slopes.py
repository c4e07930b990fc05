"""The slopes of effects in a linear model, against derivatives known by hand."""

from dataclasses import replace

import numpy as np
import pytest

from robustpolish.errors import RobustPolishWarning
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Output, Spring
from tests.models.mechanical.two_masses import two_masses


def test_linearisation_takes_the_slope_of_effects():
    ground = ("x", "ground")
    model = two_masses().with_effect("cubic_stiffness", ground, {"stiffness": 4e9})
    np.testing.assert_allclose(model.linearize().A, two_masses().linearize().A)
    stiff = model.linearize(operating_point={"x": 1e-3})
    np.testing.assert_allclose(stiff.A[3, 2], -(3e4 + 3 * 4e9 * 1e-6) / 0.2, rtol=1e-6)


def test_linearisation_finds_the_equilibrium():
    model = MechanicalModel(
        [Dof("x", 2.0)], [Spring(("x", "ground"), 8.0)], outputs=[Output("x", ("x", "ground"))]
    )
    loaded = model.with_effect("constant_force", "x", {"force": 11.0}).with_effect(
        "cubic_stiffness", ("x", "ground"), {"stiffness": 3.0}
    )
    x = np.roots([3.0, 0.0, 8.0, -11.0])
    x = float(x[np.abs(x.imag) < 1e-9].real[0])
    np.testing.assert_allclose(loaded.linearize().A[1, 0], -(8 + 9 * x**2) / 2, rtol=1e-6)


def test_linearisation_keeps_the_states_of_effects():
    resonator = {"mass": 0.02, "stiffness": 500.0, "damping": 0.3}
    plant = two_masses().with_effect("attached_resonator", "x", resonator).linearize()
    three = MechanicalModel(
        [Dof("x_m", 0.6), Dof("x", 0.2), Dof("r", 0.02)],
        [*two_masses().springs, Spring(("x", "r"), 500.0)],
        [*two_masses().dampers, Damper(("x", "r"), 0.3)],
        outputs=two_masses().outputs,
    )
    by_size = lambda A: np.sort_complex(np.linalg.eigvals(A))  # noqa: E731
    np.testing.assert_allclose(by_size(plant.A), by_size(three.linearize().A), rtol=1e-8)


def test_linearisation_leaves_out_what_jumps_and_says_so():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    with pytest.warns(RobustPolishWarning, match="coulomb_friction at x, ground jumps"):
        plant = model.linearize()
    np.testing.assert_allclose(plant.A, two_masses().linearize().A)


def test_linearisation_applies_gains_and_delays():
    plain = two_masses()
    model = (
        plain.with_effect("input_gain", "F", {"gain": 1.5})
        .with_effect("sensor_gain", "x", {"gain": 0.5})
        .with_effect("input_delay", "F", {"delay": 1e-3})
    )
    here, there = model.linearize().system, plain.linearize().system
    w = 300.0
    expected = 0.75 * np.exp(-1j * w * 1e-3) * there(1j * w)[-1, 0]
    np.testing.assert_allclose(here(1j * w)[-1, 0], expected, rtol=1e-4)


def test_linearisation_keeps_lags_and_what_relaxes():
    plain = two_masses()
    values = {"stiffness": 900.0, "time": 2e-3}
    model = plain.with_effect("maxwell_element", ("x", "x_m"), values)
    lagging = model.with_effect("input_lag", "F", {"lag": 4e-3})
    s = 300.0j
    here, there = (each.linearize().system(s)[-1, 0] for each in (lagging, model))
    np.testing.assert_allclose(here, there / (1 + 4e-3 * s), rtol=1e-9)
    # a spring and a damper in a row, beside those that are there
    branch = 900.0 * 2e-3 * s / (1 + 2e-3 * s)
    stiffer = replace(plain, springs=(*plain.springs, Spring(("x", "x_m"), branch.real)))
    both = replace(stiffer, dampers=(*plain.dampers, Damper(("x", "x_m"), branch.imag / s.imag)))
    np.testing.assert_allclose(there, both.linearize().system(s)[-1, 0], rtol=1e-6)
