import numpy as np
import pytest

from robustpolish.identification.structure.decays import extrapolation_error, split_decays
from tests.identification.decays.pendulums import AT, decay, pendulum
from tests.identification.discover.searches import prepared_of

NOISE = 1e-3


@pytest.fixture(scope="module")
def prepared():
    """A decay with Coulomb friction and drag."""
    return prepared_of(pendulum(), decay(noise=NOISE))


def ahead(prepared, *effects):
    model = pendulum()
    for kind, parameters in effects:
        model = model.with_effect(kind, AT, parameters)
    return np.exp(
        extrapolation_error(model, prepared, pendulum(), split_decays(model, prepared.record))
    )


def test_the_true_model_predicts_how_the_decay_goes_on(prepared):
    true = ahead(prepared, ("coulomb_friction", {"force": 0.1}),
                 ("quadratic_damping", {"coefficient": 0.1}))  # fmt: skip
    assert true < 1.5 * NOISE


def test_one_that_bends_to_the_loud_part_does_not(prepared):
    """Damping that grows with the angle does there what friction does not."""
    other = ahead(prepared, ("displacement_dependent_damping", {"coefficient": 0.1}))
    assert other > 5 * NOISE
