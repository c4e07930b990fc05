"""The air bearing against the numbers printed in the thesis, each under its stated reading."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


def positive_modes(plant):
    eigenvalues = np.linalg.eigvals(plant.A)
    return eigenvalues[eigenvalues.imag > 0]


def test_modes_of_section_8_5():
    """Reading: bearing of 1.337 kg, holder 1e9 N/m, inertia of the listing."""
    hertz = np.sort(positive_modes(rp.air_bearing(dissipation=0)).imag) / (2 * np.pi)
    expected = [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75]
    np.testing.assert_allclose(hertz, expected, rtol=2e-6)


def test_damping_ratios_of_section_8_5():
    """The fourth is printed as 5.7860e-13; the exponent is a misprint."""
    modes = positive_modes(rp.air_bearing(dissipation=0.001))
    modes = modes[np.argsort(modes.imag)]
    zeta = -modes.real / np.abs(modes)
    expected = [7.93745e-5, 7.93745e-5, 8.17425e-5, 8.17425e-5, 5.78604e-5, 1.99226e-5]
    np.testing.assert_allclose(zeta, expected, rtol=3e-6)


def test_equations_of_motion():
    """Each row of (8.46), written out."""
    p = rp.polishing.AirBearingParameters()
    c = p.damping(0.001)
    plant = rp.air_bearing(p, actuation="force")
    rng = np.random.default_rng(0)
    q = rng.standard_normal(12)
    F_x, F_y, F_z, F_p = w = rng.standard_normal(4)
    u = rng.standard_normal(6)
    x_m, dx_m, x, dx, y_m, dy_m, y, dy, z_m, dz_m, z, dz = q
    expected = [
        dx_m,
        (-p.k_t * x_m + p.k_x * (x - x_m) - c.c_A * dx_m + c.c_D * (dx - dx_m) + u[0]) / p.m_x,
        dx,
        (-p.k_x * (x - x_m) - c.c_D * (dx - dx_m) - F_x + u[1]) / p.m_t,
        dy_m,
        (-p.k_t * y_m + p.k_x * (y - y_m) - c.c_A * dy_m + c.c_D * (dy - dy_m) + u[2]) / p.m_x,
        dy,
        (-p.k_x * (y - y_m) - c.c_D * (dy - dy_m) - F_y + u[3]) / p.m_t,
        dz_m,
        (-p.k_z * (z_m - z) - p.k_A * z_m - c.c_R * (dz_m - dz) - F_p + u[4]) / p.m_z,
        dz,
        (p.k_z * (z_m - z) + c.c_R * (dz_m - dz) - c.c_Z * dz + F_z + u[5]) / p.m_t,
    ]
    np.testing.assert_allclose(plant.A @ q + plant.B1 @ w + plant.B2 @ u, expected, rtol=1e-12)
    np.testing.assert_array_equal(plant.C1 @ q, q[::2])


def test_displacement_actuation_enters_the_displacement_rows():
    plant = rp.air_bearing(actuation="displacement", measured="displacement")
    np.testing.assert_array_equal(plant.B2, plant.C1.T)
    np.testing.assert_array_equal(plant.C2, plant.C1)
    assert plant.units["u_x"] == "m/s"
    assert plant.measurement_names[1] == "measured_x"


def test_printed_load_swaps_x_and_y():
    right, printed = rp.air_bearing().B1, rp.air_bearing(load="printed").B1
    np.testing.assert_array_equal(printed[:, [1, 0, 2, 3]], right)


def test_undamped_model_has_no_damping_at_all():
    np.testing.assert_allclose(
        np.linalg.eigvals(rp.air_bearing(dissipation=0).A).real, 0, atol=1e-7
    )
    assert rp.polishing.AirBearingParameters().damping(0).c_Z == 0


def test_options_are_checked():
    for option in ("actuation", "measured", "load"):
        with pytest.raises(InvalidInputError, match=f"{option}: got 'no'"):
            rp.air_bearing(**{option: "no"})
    with pytest.raises(InvalidInputError, match="parameters: got dict"):
        rp.air_bearing({"m": 1})
    with pytest.raises(InvalidInputError, match="dissipation: got -1"):
        rp.air_bearing(dissipation=-1)
