"""Dynamic output feedback on 24 plants of COMPleib, as they are and in other units."""

import time

import numpy as np
import pytest
from published_plants import compleib

import robustpolish as rp

# Infimum of the full-order H-infinity norm; 0 is approached, never attained.
INFIMUM = {
    "AC1": 0.0, "AC3": 2.96740, "AC4": 0.557292, "AC6": 3.4273, "AC8": 1.61648, "AC12": 0.0,
    "AC15": 14.8628, "HE1": 0.0736154, "HE2": 2.41813, "HE4": 22.8382, "REA1": 0.861721,
    "DIS5": 666.271, "TG1": 3.46524, "BDT1": 0.266212, "EB1": 3.10408, "UWV": 0.0,
    "PSM": 0.920243, "NN2": 1.76438, "NN7": 33.0389, "HF2D11": 76443.3, "HF2D18": 93.1532,
    "ROC6": 21.5279, "FS": 77918.8,
}  # fmt: skip
# What the inequalities alone leave open: a limit of high gain beyond a plateau.
LMI_MAY_FAIL = {"AC12"}


def plant_of(shared, name, units=None):
    """Load a plant; with `units` (a random generator), change every unit by 1e-3 to 1e3."""
    plant = compleib(shared, name)
    if units is None:
        return plant, 1.0
    A, B1, B2, C1, C2 = plant.A, plant.B1, plant.B2, plant.C1, plant.C2

    def scale(n):
        return 10.0 ** units.uniform(-3, 3, n)

    x, u, y = scale(len(A)), scale(B2.shape[1]), scale(len(C2))
    w, z, time = scale(3)
    plant = rp.GeneralizedPlant.from_matrices(
        time * A * x / x[:, None],
        time * w * B1 / x[:, None],
        time * B2 * u / x[:, None],
        z * C1 * x,
        C2 * x / y[:, None],
        z * w * plant.D11,
        z * plant.D12 * u,
        plant.D21 * w / y[:, None],
    )
    return plant, z * w


def check(design, plant, infimum, unit):
    """Judge the loop alone, connected again from plant and controller."""
    achieved = rp.hinf_norm(plant.closed_loop(design.controller)).value
    assert achieved <= 1.001 * design.certificate.achieved
    assert design.certificate.achieved <= 1.001 * design.certificate.bound
    if infimum:
        assert achieved <= 1.01 * infimum * unit
    else:
        assert achieved <= 1e-3 * unit
        assert design.status == "infimum_not_attained"


def designed(plant):
    """Design with at most 5 s of computing, whatever else the machine does meanwhile."""
    start = time.process_time()
    design = rp.output_feedback(plant, time_limit=30)
    assert time.process_time() - start < 5
    return design


@pytest.mark.shared
@pytest.mark.parametrize("name", INFIMUM)
def test_within_one_percent_of_the_infimum(shared, name):
    plant, unit = plant_of(shared, name)
    check(designed(plant), plant, INFIMUM[name], unit)


@pytest.mark.shared
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long) if i % 3 else name
        for i, name in enumerate(INFIMUM)
    ],
)
def test_the_same_in_other_units(shared, name):
    plant, unit = plant_of(shared, name, np.random.default_rng(list(name.encode())))
    check(designed(plant), plant, INFIMUM[name], unit)


@pytest.mark.shared
def test_a_plant_that_nobody_can_stabilise(shared):
    plant, _ = plant_of(shared, "REA4")
    with pytest.raises(rp.InfeasibleError, match=r"0\.6065.*x8") as caught:
        rp.output_feedback(plant)
    assert caught.value.modes[0] == pytest.approx(0.6065, abs=5e-5)


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.parametrize("name", [name for name in INFIMUM if name not in LMI_MAY_FAIL])
def test_inequalities_alone(shared, name):
    plant, unit = plant_of(shared, name)
    design = rp.output_feedback(plant, method="lmi", time_limit=30)
    check(design, plant, INFIMUM[name], unit)
