"""The diagnosis of five machines that others measured, one of them simulated.

Each comes with a model as an engineer writes it first. The limits are those that the project has
set itself.
"""

import numpy as np
import pytest

import robustpolish as rp

pytestmark = [pytest.mark.shared, pytest.mark.long]

MEMORY = {
    "elastic_coulomb_friction", "dahl_friction", "lugre_friction", "bouc_wen_hysteresis",
}  # fmt: skip
DRAGS = {"quadratic_damping", "displacement_dependent_damping"}


@pytest.fixture
def diagnosed(shared):
    """Diagnose a machine; return what was found and the error on the record that nobody fitted."""

    def diagnosed(name, output, **options):
        folder = shared / "data/real" / name
        model = rp.MechanicalModel.from_toml(folder / "model.toml")
        diagnosis = rp.diagnose(model, rp.read_measurement(folder / "train.csv"))
        left = rp.compare(
            diagnosis.model, rp.read_measurement(folder / "test.csv"), **options
        ).residual[output]
        return diagnosis, [e.kind for e in diagnosis.effects], float(np.sqrt(np.mean(left**2)))

    return diagnosed


def test_pendulum(diagnosed):
    """It swings freely from 1.6 rad: its weight, then bearing friction and the drag of the air."""
    _, kinds, error = diagnosed("pendulum_decay", "theta")
    assert kinds[0] == "pendulum_gravity"
    assert set(kinds[1:]) & (MEMORY | DRAGS | {"coulomb_friction", "stribeck_friction"})
    assert error < 0.008


def test_damper(diagnosed):
    _, kinds, error = diagnosed("mr_damper_0v", "F")
    assert set(kinds) & MEMORY
    assert error < 9.5


def test_sloshing(diagnosed):
    _, kinds, error = diagnosed("sloshing", "x")
    assert set(kinds) & {"cubic_stiffness", "pendulum_gravity"}
    assert error < 0.40e-3


def test_bolted_beam(diagnosed):
    """Micro-slip, at a lower amplitude than it was fitted to."""
    _, kinds, error = diagnosed("brb_mode1", "a", window=0.25)
    assert set(kinds) & MEMORY or {"cubic_stiffness", "quadratic_damping"} <= set(kinds)
    assert error < 0.066


def test_hysteresis(diagnosed):
    """The standard benchmark, whose numbers are known."""
    diagnosis, kinds, error = diagnosed("bouc_wen", "y")
    assert kinds == ["bouc_wen_hysteresis"]
    numbers = {name: value.value for name, value in diagnosis.effects[0].parameters.items()}
    # alpha (beta |v| z + gamma v |z|) with an exponent of 1: per unit of the reference force
    bend = numbers["stiffness"] / numbers["force"]
    assert numbers["stiffness"] == pytest.approx(5e4, rel=0.02)
    assert numbers["exponent"] == pytest.approx(1.0, rel=0.02)
    assert bend * numbers["beta"] == pytest.approx(1e3 * 0.8, rel=0.02)
    assert bend * numbers["gamma"] == pytest.approx(-1e3 * 1.1, rel=0.02)
    assert error < 2e-6
