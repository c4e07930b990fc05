import pytest

from robustpolish.identification.diagnosis.findings import indistinguishable_pair
from robustpolish.machines.effects.effect import Effect, lookup

PLACE = ("x", "ground")


@pytest.mark.parametrize(
    ("first", "second", "experiment"),
    [
        (Effect("coulomb_friction", PLACE), Effect("constant_force", "x"), "rest"),
        (Effect("constant_force", "x"), Effect("coulomb_friction", PLACE), "rest"),
        (Effect("input_gain", "F"), Effect("sensor_gain", "x"), "known weight"),
        (Effect("cubic_stiffness", PLACE), Effect("cubic_stiffness", ("x", "y")), "ground and y"),
        (Effect("quadratic_damping", PLACE), Effect("bouc_wen_hysteresis", PLACE), "memory"),
        (Effect("quadratic_damping", PLACE), Effect("cubic_stiffness", PLACE), "amplitude"),
    ],
)
def test_a_pair_comes_with_the_experiment_that_would_separate_it(first, second, experiment):
    found = indistinguishable_pair(first, second)
    assert (found.first, found.second) == (first, second)
    assert experiment in found.experiment


def test_only_memory_makes_the_path_matter():
    both = [lookup(name).has_memory for name in ("bouc_wen_hysteresis", "lugre_friction")]
    assert all(both)
    pair = (Effect("bouc_wen_hysteresis", PLACE), Effect("lugre_friction", PLACE))
    assert "memory" not in indistinguishable_pair(*pair).experiment
