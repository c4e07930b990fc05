import math

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish import InvalidInputError
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.simulation.run import simulate_model as simulate

A, W = 0.01, 120.0


@pytest.mark.parametrize(
    ("kind", "values", "closed"),
    [
        ("coulomb_friction", {"force": 3.0}, 4 * 3.0 * A),
        ("quadratic_damping", {"coefficient": 2.0}, 8 / 3 * 2.0 * W**2 * A**3),
        ("structural_damping", {"loss": 5.0}, 2 * 5.0 * A**2),
        ("displacement_dependent_damping", {"coefficient": 7.0}, math.pi / 4 * 7.0 * W * A**4),
        ("cubic_stiffness", {"stiffness": 1e6}, 0.0),
        ("constant_force", {"force": 3.0}, 0.0),
    ],
)
def test_energies_have_their_closed_form(kind, values, closed):
    lost = rp.effects.energy_per_cycle(Effect(kind, "x", values), A, W)
    assert lost == pytest.approx(closed, rel=1e-6, abs=1e-12)


def test_a_spring_in_series_with_friction_loses_what_its_loop_encloses():
    """Elastic friction, fully developed: a parallelogram of 4 F (A - F/k)."""
    effect = Effect("elastic_coulomb_friction", "x", {"force": 3.0, "stiffness": 1e3})
    assert rp.effects.energy_per_cycle(effect, A, W) == pytest.approx(
        4 * 3.0 * (A - 3.0 / 1e3), rel=2e-3
    )


def test_losses_add_up_to_one_damper():
    air = Effect("quadratic_damping", "x", {"coefficient": 2.0})
    c = rp.effects.equivalent_damping([air, 0.25], A, W)
    expected = (8 / 3 * 2.0 * W**2 * A**3 + 0.25) / (math.pi * W * A**2)
    assert c == pytest.approx(expected, rel=1e-6)
    # A damper of this size loses as much: pi c w A^2.
    assert math.pi * c * W * A**2 == pytest.approx(rp.effects.energy_per_cycle(air, A, W) + 0.25)
    assert rp.effects.equivalent_damping(0.0, A, W) == 0.0
    assert rp.effects.equivalent_damping(np.float64(0.25), A, W) == rp.effects.equivalent_damping(
        0.25, A, W
    )


def test_a_share_of_the_energy_is_the_published_damping():
    """(8.23) with table 9.1: c_A, c_D and c_R; (5.7) with any amplitude is the same."""
    p = rp.polishing.AirBearingParameters()
    found, n = p.natural_frequencies(), 0.001
    assert rp.effects.share_damping(n, p.k_t, found["x"][0]) == pytest.approx(1.3159, abs=5e-5)
    assert rp.effects.share_damping(n, p.k_x, found["x"][1]) == pytest.approx(0.0389, abs=5e-5)
    assert rp.effects.share_damping(n, p.k_z, found["z_free"][0]) == pytest.approx(0.5581, abs=5e-5)
    for amplitude in (1e-6, 1e-3):
        energy = n * p.k_x * amplitude**2 / 2
        assert rp.effects.equivalent_damping(energy, amplitude, found["x"][1]) == pytest.approx(
            rp.effects.share_damping(n, p.k_x, found["x"][1])
        )


def test_ratio_and_loss_factor_of_a_share():
    """N = 2 pi eta, and a body on the spring has the ratio n / (4 pi) = eta / 2."""
    k, m, n = 3e5, 0.2, 0.01
    w = math.sqrt(k / m)
    assert rp.effects.share_damping(n, k, w) == pytest.approx(
        rp.effects.loss_damping(n / (2 * math.pi), k, w)
    )
    assert rp.effects.share_damping(n, k, w) / (2 * math.sqrt(k * m)) == pytest.approx(
        n / (4 * math.pi)
    )


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_structural_damping_as_a_force_decays_as_its_loss_factor_says(size):
    """Free decay: a logarithmic decrement of about pi eta, at every amplitude."""
    eta, k = 0.02, 4e2
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)],
        [rp.Spring(("x", "ground"), k)],
        outputs=[rp.Output("x", ("x", "ground"))],
    ).with_effect("structural_damping", ("x", "ground"), {"loss": math.pi / 2 * eta * k})
    period, cycles = 2 * math.pi / math.sqrt(k), 10
    data = xr.Dataset(coords={"time": np.linspace(0, cycles * period, 200 * cycles + 1)})
    x = simulate(model, data, initial_state=[size, 0.0]).outputs[:, 0]
    ends = x[::200][[0, -1]] / size
    # Over half a swing the spring is k + h, then k - h: amplitudes are as (1 - h/k) / (1 + h/k).
    h = math.pi / 2 * eta
    assert ends[1] == pytest.approx(((1 - h) / (1 + h)) ** cycles, rel=0.01)
    assert -math.log(ends[1]) / cycles == pytest.approx(math.pi * eta, rel=0.01)


@pytest.mark.parametrize(
    ("call", "key"),
    [
        (lambda: rp.effects.energy_per_cycle("friction", A, W), "effect"),
        (lambda: rp.effects.energy_per_cycle(Effect("input_gain", "F"), A, W), "effect"),
        (
            lambda: rp.effects.energy_per_cycle(Effect("cross_stiffness", ("x", "y")), A, W),
            "effect",
        ),
        (lambda: rp.effects.energy_per_cycle(Effect("harmonic_force", "x"), A, W), "effect"),
        (lambda: rp.effects.energy_per_cycle(Effect("coulomb_friction", "x"), 0.0, W), "amplitude"),
        (lambda: rp.effects.equivalent_damping(1.0, A, 0.0), "frequency"),
        (lambda: rp.effects.equivalent_damping(-1.0, A, W), "losses"),
        (lambda: rp.effects.equivalent_damping({"a": 1.0}, A, W), "losses"),
        (lambda: rp.effects.share_damping(-0.1, 1.0, W), "share"),
        (lambda: rp.effects.loss_damping(0.1, -1.0, W), "stiffness"),
    ],
)
def test_what_has_no_equivalent_is_refused(call, key):
    with pytest.raises(InvalidInputError) as caught:
        call()
    assert caught.value.key[0] == key
