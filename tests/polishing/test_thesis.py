"""Chapters 10 and 11 of the thesis: structures of controllers, and tables as printed."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing.thesis.comparison import thesis_comparison, thesis_structures

# Chapter 11 of the thesis, recomputed with the listings as printed.


@pytest.mark.long
@pytest.mark.parametrize("run", [1, 4])
def test_tables_11_1_to_11_8(run):
    """Largest deviations of q_m + q over 5 s, within 12 % but for one value per run.

    The listing is chaotic once its contacts chatter: rounding decides which forces come when, and
    a largest value may rest on a single one of them. Of nine realisations of run 4, eight give
    0.79 to 0.84 times the y printed for C.5, and one, by a spike at 4.135 s, 1.005 times.
    """
    comparison = thesis_comparison(run)
    deviation = comparison.table["deviation"]
    ratios = np.array(
        [
            deviation.sel(row=row, signal=["y", "z"]).to_numpy() / printed[1:]
            for row, printed in rp.polishing.PUBLISHED_DEVIATIONS[run].items()
        ]
    )
    errors = np.sort(np.abs(ratios - 1).ravel())
    assert errors[-2] < 0.12
    assert errors[-1] < 0.30
    x = deviation.sel(signal="x")
    assert 5e-4 < float(x.sel(row="without control")) < 2e-3  # scatters with the solver
    assert (x[1:] == 0).all()  # the gate on w(2): "100 %" in the tables


def test_the_table_says_that_the_loads_differ():
    comparison = thesis_comparison(4, ["second_scaled"], duration=0.02)
    assert "not the same load" in str(comparison)
    assert list(comparison.table["row"].to_numpy()) == ["without control", "second_scaled"]
    with pytest.raises(InvalidInputError, match="run: got 2"):
        thesis_comparison(2)
    with pytest.raises(InvalidInputError, match="controllers: got 'ours'"):
        thesis_comparison(1, ["ours"])


# The thesis's plant with displacements measured: every structure is certified and helps.


def test_three_axes_have_the_norm_of_all_twelve_states():
    plant = rp.air_bearing(actuation="force", measured="displacement")
    # Up to its tolerance a design gives norm away for a smaller gain, so that is made small here.
    whole, parts = (
        rp.output_feedback(
            plant, control_weight=1e-7, measurement_noise=1e-8, tolerance=5e-6, split=split
        )
        for split in (False, True)
    )
    assert len(parts.details["part_norms"]) == 3
    assert len(whole.details["part_norms"]) == 1
    assert whole.certificate.achieved == pytest.approx(parts.certificate.achieved, rel=1e-5)


def test_displacement_actuation_cannot_hold_a_steady_force_along_the_spindle():
    """In doubles c_Z is nothing, so that the spring k_A alone carries a steady force."""
    plant = rp.air_bearing(actuation="displacement", measured="displacement")
    design = rp.output_feedback(plant, time_limit=30)
    stiffness = rp.polishing.AirBearingParameters.as_published().k_A
    assert design.certificate.achieved == pytest.approx(np.sqrt(2) / stiffness, rel=1e-3)
    assert "zeros on the axis, to working accuracy, at 0 rad/s" in design.message


@pytest.mark.long
@pytest.mark.parametrize("actuation", ["force", "displacement"])
def test_every_structure_calms_the_brush(actuation):
    designs = thesis_structures(actuation)
    achieved = {name: design.certificate.achieved for name, design in designs.items()}
    printed, ours, dynamic, static, observer = achieved.values()
    for design in designs.values():
        assert design.certificate.valid
        loop = design.plant.closed_loop(design.controller)
        assert np.asarray(loop.A).shape[0] == design.certificate.poles.size
        assert rp.hinf_norm(loop).value == pytest.approx(design.certificate.achieved, rel=1e-3)
    assert ours <= dynamic <= 1.01 * observer  # more is measured; more is free
    assert dynamic < static
    assert ours < printed
    for run in (1, 4):
        load = rp.polishing.simulate_brush(run=run)
        table = rp.compare_controllers(designs, load, signals=("x", "y", "z")).table
        improved = table["improvement"].sel(signal=["x", "y"]).isel(row=slice(1, None))
        assert (improved > 40).all()
        assert (improved.isel(row=slice(1, None)) > 80).all()
