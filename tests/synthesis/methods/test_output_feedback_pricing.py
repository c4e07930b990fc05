"""Price on u and noise on y make the thesis's singular problem regular."""

import pytest

import robustpolish as rp


@pytest.mark.parametrize(("actuation", "price"), [("force", 1e-7), ("displacement", 1e-8)])
def test_thesis_plant_with_displacements_measured(actuation, price):
    """The axes together give the norm of the worst axis, and the gain stays finite."""
    plant = rp.air_bearing(actuation=actuation, measured="displacement")
    design = rp.output_feedback(plant, control_weight=price, measurement_noise=1e-8, time_limit=10)
    assert design.certificate.valid
    assert design.plant.nz == 12
    assert design.plant.nw == 10
    assert len(design.details["parts"]) == 3
    worst = max(design.details["part_norms"])
    assert design.certificate.achieved == pytest.approx(worst, rel=1e-3)
    whole = rp.hinf_norm(design.plant.closed_loop(design.controller)).value
    assert whole == pytest.approx(worst, rel=1e-3)
    plain = rp.hinf_norm(plant.closed_loop(design.controller)).value
    assert plain <= design.certificate.bound
