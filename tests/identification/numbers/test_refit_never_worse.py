"""Whatever a refit is given, what it returns runs no worse, as `compare` measures it."""

import pytest

import robustpolish as rp
from tests.identification.drawn_machines import drawn, mistaken


def held(seed, most):
    machine = drawn(seed, most)
    given = mistaken(machine, 1000 + seed)
    before, fitted = rp.compare(given, machine.data), rp.refit(given, machine.data)
    after = rp.compare(fitted.model, machine.data)
    if before.reproducible and after.reproducible:
        assert after.nrmse <= before.nrmse * (1 + 1e-9), seed


@pytest.mark.parametrize("seed", range(3))
def test_a_refit_ends_no_worse_than_it_began(seed):
    held(seed, most=1500)


@pytest.mark.long
@pytest.mark.parametrize("seed", [*range(100, 160), *range(1000, 1060)])
def test_a_refit_of_a_longer_record_ends_no_worse(seed):
    held(seed, most=2500)


def test_the_true_numbers_may_stay():
    """With no better ones about, they are returned with their standard errors."""
    machine = drawn(11, most=1500)
    fitted = rp.refit(machine.model, machine.data)
    before = rp.compare(machine.model, machine.data).nrmse
    assert rp.compare(fitted.model, machine.data).nrmse <= before * (1 + 1e-9)
    assert set(fitted.stderr) == set(fitted.units)
