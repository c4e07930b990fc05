import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.diagnosis.findings import IndistinguishablePair
from robustpolish.identification.experiments.candidates import (
    describe_difference,
    machine_pair,
    precision_of,
)
from robustpolish.machines.effects.effect import Effect
from tests.identification.oscillators import PLACE, oscillator

COULOMB = Effect("coulomb_friction", PLACE, {"force": 3.0})
STRIBECK = Effect("stribeck_friction", PLACE, {"force": 2.9, "static_force": 3.5, "velocity": 0.01})
PUSH = Effect("constant_force", ("x",), {"force": 0.4})


def with_effects(*effects):
    return oscillator(effects=effects)


@pytest.mark.parametrize("turned", [False, True])
def test_one_effect_stands_in_the_place_of_the_other(turned):
    pair = (STRIBECK, COULOMB) if turned else (COULOMB, STRIBECK)
    first, second = machine_pair(with_effects(COULOMB, PUSH), IndistinguishablePair(*pair, ""))
    assert first == with_effects(COULOMB, PUSH)
    assert second.effects == (PUSH, STRIBECK)
    assert describe_difference(first, second) == (str(COULOMB), str(STRIBECK))


def test_friction_of_unlike_size_is_a_number_more_of_what_is_there():
    lopsided = Effect("coulomb_friction", PLACE, {"asymmetry": -0.4})
    first, second = machine_pair(
        with_effects(COULOMB, PUSH), IndistinguishablePair(PUSH, lopsided, "")
    )
    assert first.effects == (COULOMB, PUSH)
    (only,) = second.effects
    assert only.values["force"] == 3.0
    assert only.values["asymmetry"] == -0.4


def test_a_pair_that_the_model_has_not_is_added():
    first, second = machine_pair(oscillator(), IndistinguishablePair(COULOMB, STRIBECK, ""))
    assert first.effects == (COULOMB,)
    assert second.effects == (STRIBECK,)


def test_models_with_the_same_effects_go_by_their_names():
    one, other = oscillator(name="new"), oscillator(stiffness=300.0)
    assert describe_difference(one, other) == ("new (first)", "the model (second)")


def test_the_precision_is_the_inverse_where_something_is_known():
    full = np.array([[4.0, 1e4], [1e4, 1e8]])
    covariance = np.full((3, 3), 0.0)
    covariance[:2, :2] = full
    covariance[2, 2] = np.inf
    found = precision_of(xr.DataArray(covariance, dims=("parameter", "other")))
    np.testing.assert_allclose(found[:2, :2], np.linalg.inv(full), rtol=1e-9)
    assert not found[2].any()
