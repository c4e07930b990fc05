"""The thesis's own discoveries, retold: what its model lacked, found in simulated records.

Data come from the state-space model (8.46), which shares no code with the mechanical model that is
refitted. The brush works on the machine while a shaker adds 3 N of noise to every force: the
brush alone hardly moves the modes above 2 kHz.
"""

import numpy as np
import pytest

import robustpolish as rp

pytestmark = pytest.mark.long

OUTPUTS = ("x_m", "x", "y_m", "y", "z_m", "z")
FORCES = ["F_x", "F_y", "F_z", "F_p"]
K_A, C_Z = "spring[4].stiffness", "damper[4].damping"


def record(plant, seed=0, decibel=40.0):
    """0.25 s at 40 kHz under brush and shaker, with sensor noise."""
    rng = np.random.default_rng(seed)
    forces = rp.simulate_brush(duration=0.25, sample_rate=40e3)[FORCES]
    samples = forces.sizes["time"]
    for name in FORCES:
        shaken = forces[name].values + 3.0 * rng.standard_normal(samples)
        forces[name] = ("time", shaken, {"units": "N"})
    response = rp.simulate(plant, forces)
    for name in OUTPUTS:
        clean = response[name].values
        noise = rng.standard_normal(samples) * clean.std() * 10 ** (-decibel / 20)
        forces[name] = ("time", clean + noise, {"units": "m"})
    return forces


def check_learnt(diagnosis, fall):
    """The verdict is one of parameters, and an error `fall` times the noise falls to the noise."""
    assert diagnosis.verdict == "parameters"
    assert not diagnosis.effects
    base, refit = diagnosis.ledger.entries
    for name in OUTPUTS:
        assert refit.nrmse[name] == pytest.approx(0.01, rel=0.1)
    assert max(base.nrmse.values()) > fall * 0.01


def within(diagnosis, key, truth, share):
    found = diagnosis.parameters[key]
    assert found.value == pytest.approx(truth, rel=share)
    assert abs(found.value - truth) < 5 * found.stderr


def test_the_damped_machine_against_the_undamped_model():
    """Data of (8.46) against (8.45): the coefficients of table 9.1 are found."""
    truth = rp.polishing.air_bearing_model(dissipation=0.001).parameters
    model = rp.polishing.air_bearing_model(dissipation=0.0)
    diagnosis = rp.diagnose(model, record(rp.air_bearing()))
    check_learnt(diagnosis, 5)
    within(diagnosis, "damper[0].damping", truth["damper[0].damping"], 0.1)  # c_A
    within(diagnosis, "damper[1].damping", truth["damper[1].damping"], 0.3)  # c_D
    within(diagnosis, "damper[5].damping", truth["damper[5].damping"], 0.1)  # c_R


def test_the_missing_holder_spring():
    model = rp.polishing.air_bearing_model().with_parameters({K_A: 0.0})
    diagnosis = rp.diagnose(model, record(rp.air_bearing()))
    check_learnt(diagnosis, 20)
    within(diagnosis, K_A, 1e9, 0.02)


def test_the_missing_damping_of_the_work():
    """c_Z, absent from (10.38); of a size that data can show, unlike that of table 9.1."""
    without = rp.polishing.air_bearing_model().with_parameters({C_Z: 0.0})
    working = without.with_parameters({C_Z: 2.0})
    diagnosis = rp.diagnose(without, record(working.linearize()))
    check_learnt(diagnosis, 2)
    within(diagnosis, C_Z, 2.0, 0.05)
    plant = diagnosis.model.linearize(measured="state")
    design = rp.state_feedback(plant, control_weight=1e-7)
    assert design.certificate.valid
    check = rp.simulation.check_robustness(
        design, diagnosis, plant_of=lambda model: model.linearize(measured="state"), samples=50
    )
    assert check.share_stable == 1.0
    assert check.worst < 1.5 * design.certificate.achieved


def test_output_feedback_takes_the_learnt_plant():
    """From the model to a plant with price and noise, and back to Monte Carlo."""
    model = rp.polishing.air_bearing_model()
    design = rp.output_feedback(
        model.linearize(), control_weight=1e-7, measurement_noise=1e-9, time_limit=20.0
    )
    assert design.certificate.valid
    errors = {key: 0.01 * value for key, value in model.parameters.items() if "gain" not in key}
    check = rp.simulation.check_robustness(design, model, standard_errors=errors, samples=30)
    assert check.samples == 30
    assert check.share_stable == 1.0
    assert check.least_share_stable == pytest.approx(0.05 ** (1 / 30))
    assert check.worst < 1.05 * design.certificate.achieved
