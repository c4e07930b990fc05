"""The FMU as FMPy loads, checks and runs it."""

import shutil

import numpy as np
import pytest

from robustpolish.implementation.realization import controller_outputs
from tests.implementation.designs import sampled_servo, static_gain, two_by_two
from tests.reference.examples import servo_design

fmpy = pytest.importorskip("fmpy")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


def simulated(path, sampled, y, steps_per_period=1):
    """Run an FMU; y is held over each period."""
    from fmpy.fmi2 import FMU2Slave

    card = fmpy.read_model_description(path)
    folder = fmpy.extract(path)
    try:
        unit = FMU2Slave(
            guid=card.guid,
            unzipDirectory=folder,
            modelIdentifier=card.coSimulation.modelIdentifier,
            instanceName="one",
        )
        unit.instantiate()
        unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        by_cause = {"input": [], "output": []}
        for variable in card.modelVariables:
            by_cause[variable.causality].append(variable.valueReference)
        step, found = sampled.period / steps_per_period, []
        for k in range(len(y) * steps_per_period):
            unit.setReal(by_cause["input"], list(y[k // steps_per_period]))
            unit.doStep(k * step, step)
            found.append(unit.getReal(by_cause["output"]))
        unit.terminate()
        unit.freeInstance()
        return np.array(found)
    finally:
        shutil.rmtree(folder)


@pytest.mark.parametrize("make", [two_by_two, static_gain])
def test_it_agrees_with_python(make, tmp_path):
    from fmpy.validation import validate_fmu

    sampled = make()
    path = sampled.export_fmu(tmp_path, name="loop")
    assert validate_fmu(str(path)) == []
    y = np.random.default_rng(0).uniform(-1, 1, (300, sampled.controller.ninputs))
    expected = controller_outputs(sampled.controller, y)
    np.testing.assert_allclose(simulated(path, sampled, y), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("periods", [0.0, 0.4, 1.0, 2.5])
def test_its_outputs_are_late_by_the_delay(periods, tmp_path):
    sampled = servo_design().discretize(0.05, delay=periods * 0.05)
    path = sampled.export_fmu(tmp_path / "late.fmu", name="late")
    y = np.random.default_rng(1).uniform(-1, 1, (40, 1))
    u = controller_outputs(sampled.controller, y)
    found = simulated(path, sampled, y, steps_per_period=10)
    for j in range(400):
        acting = int(np.ceil((j + 1) / 10 - periods - 1e-6)) - 1
        expected = u[acting] if acting >= 0 else 0.0
        np.testing.assert_allclose(found[j], expected, rtol=1e-10, atol=1e-12)


def test_units_names_and_limits_are_in_it(tmp_path):
    sampled = sampled_servo()
    path = sampled.export_fmu(tmp_path, name="servo", limits={"F": 0.1})
    card = fmpy.read_model_description(path)
    assert [(v.name, v.causality, v.unit) for v in card.modelVariables] == [
        ("x", "input", "m"),
        ("F", "output", "N"),
    ]
    assert float(card.defaultExperiment.stepSize) == sampled.period
    y = np.random.default_rng(2).uniform(-1, 1, (100, 1))
    assert np.abs(simulated(path, sampled, y)).max() == 0.1


def test_the_same_controller_gives_the_same_bytes(tmp_path):
    first = static_gain().export_fmu(tmp_path / "a.fmu").read_bytes()
    second = static_gain().export_fmu(tmp_path / "b.fmu").read_bytes()
    assert first == second
