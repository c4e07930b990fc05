from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from tests.identification.oscillators import PLACE, oscillator


def fitted(kind, values, **errors):
    """A model with an effect whose numbers have errors."""
    model = oscillator().with_effect(kind, PLACE, values)
    keys = [f"effect[0].{name}" for name in errors]
    P = np.diag(np.array(list(errors.values()), dtype=float) ** 2)
    known = xr.DataArray(P, {"parameter": keys, "other": keys}, ("parameter", "other"))
    return SimpleNamespace(model=model, covariance=known)


def test_cube_of_a_number_with_an_error():
    low, high = rp.uncertain.effect_sector(
        fitted("cubic_stiffness", {"stiffness": 2e6}, stiffness=1e5), "effect[0]", 0.01
    )
    # The slope of the chord is k a^2, with k 1.96 standard errors up.
    assert high == pytest.approx((2e6 + 1.959964e5) * 1e-4, rel=1e-6)
    assert 0 < low < 1e-5 * high


def test_softening_spring_and_both_signs():
    low, high = rp.uncertain.effect_sector(
        fitted("cubic_stiffness", {"stiffness": -2e6}, stiffness=2e6), "effect[0]", 0.01, 0.9
    )
    assert low == pytest.approx((-2e6 - 1.644854 * 2e6) * 1e-4, rel=1e-6)
    assert high == pytest.approx((-2e6 + 1.644854 * 2e6) * 1e-4, rel=1e-6)


def test_force_lies_in_its_sector():
    low, high = rp.uncertain.effect_sector(
        fitted("quadratic_stiffness", {"stiffness": 3e4}).model, "effect[0]", 0.02
    )
    q = np.linspace(-0.02, 0.02, 777)
    force = 3e4 * q * q
    assert (low * q**2 - 1e-12 <= force * q).all()
    assert (force * q <= high * q**2 + 1e-12).all()


@pytest.mark.parametrize(
    ("kind", "values", "says"),
    [
        ("coulomb_friction", {"force": 1.0}, "more than the displacement|of one displacement"),
        ("quadratic_damping", {"coefficient": 1.0}, "displacement"),
        ("bouc_wen_hysteresis", {}, "one displacement"),
    ],
)
def test_forces_of_other_things_are_refused(kind, values, says):
    model = oscillator().with_effect(kind, PLACE, values)
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.uncertain.effect_sector(model, "effect[0]", 0.01)


def test_bad_arguments():
    model = fitted("cubic_stiffness", {"stiffness": 2e6}).model
    for call in (
        lambda: rp.uncertain.effect_sector(model, "effect[1]", 0.01),
        lambda: rp.uncertain.effect_sector(model, "spring[0]", 0.01),
        lambda: rp.uncertain.effect_sector(model, "effect[0]", 0.0),
        lambda: rp.uncertain.effect_sector(model, "effect[0]", 0.01, 95),
        lambda: rp.uncertain.effect_sector(3, "effect[0]", 0.01),
        lambda: rp.uncertain.effect_sector(
            fitted("cubic_stiffness", {"stiffness": 2e6}, stiffness=np.inf), "effect[0]", 0.01
        ),
    ):
        with pytest.raises(rp.InvalidInputError):
            call()
