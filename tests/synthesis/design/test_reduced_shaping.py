"""Shorter controllers of loop shaping, judged by the gamma of the shaped loop."""

import control
import numpy as np
import pytest

import robustpolish as rp

s = control.tf("s")
MAGNET = control.tf([-36.27e3], np.poly([66.94, -66.94, -45.69]))
LEAD = (s / 45.69 + 1) * (s / 66.94 + 1) / (s / 800 + 1) ** 2 * (s + 3) / s


def gamma_of(design):
    return 1 / rp.uncertain.ncf_margin(
        design.details["shaped_plant"], design.details["shaped_controller"]
    )


def test_gamma_decides_and_not_the_norm_in_units_of_the_plant():
    # In volts and millimetres the norm is nearly all K S, and lets margins go.
    design = rp.loop_shaping(MAGNET, W1=20.0 * LEAD)
    short = design.reduce(tolerance=0.1)
    assert short.controller.nstates < design.controller.nstates
    assert short.details["norm_after"] <= 1.1 * design.details["gamma"]
    assert short.details["gamma"] == pytest.approx(gamma_of(short), rel=1e-6)
    assert short.details["ncf_margin"] == 1 / short.details["gamma"]
    assert "gamma of the shaped loop goes from" in short.message
    assert "sensitivity" not in short.message
    assert short.details["order_after"] == short.controller.nstates
    assert short.certificate.valid
    assert rp.loop_analysis(short).disk_margin.alpha > 0.8 * (
        rp.loop_analysis(design).disk_margin.alpha
    )


def test_the_controller_is_that_of_the_shaped_plant_between_the_weights():
    G = control.ss(control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1]))))
    W1, W2 = (s + 2) / s, 1 / (0.01 * s + 1)
    design = rp.loop_shaping(G, W1=W1, W2=W2)
    short = design.reduce(order=4)
    assert short.controller.nstates == 4
    assert short.details["shaped_controller"].nstates == 2
    inner = control.tf(short.details["shaped_controller"])
    point = 3j
    assert short.controller(point) == pytest.approx(W1(point) * inner(point) * W2(point))
    again = short.reduce(order=3)
    assert again.controller.nstates == 3
    assert "shaped_plant" in again.details


def test_there_is_no_room_below_the_weights():
    design = rp.loop_shaping(1 / s**2, W1=(s + 1) / s)
    with pytest.raises(rp.InfeasibleError, match=r"1 states of the weights.*1 or more"):
        design.reduce(order=0)
    with pytest.raises(rp.InvalidInputError, match="from 0 to 3, below the 4 states"):
        design.reduce(order=4)
    assert design.reduce(order=2).certificate.valid


def test_designs_in_several_signals_and_at_samples():
    G = control.ss([[-1, 0.5], [0, 0.2]], np.eye(2), [[1, 0.5], [0, 1]], 0)
    for plant in (G, control.c2d(G, 0.1)):
        design = rp.loop_shaping(plant, W1=[2.0, 3.0])
        short = design.reduce(order=1)
        assert short.controller.nstates == 1
        assert short.certificate.valid
        assert short.details["gamma"] >= 0.999 * design.details["optimal_gamma"]


def test_what_cannot_be_shortened_stays():
    design = rp.loop_shaping(1 / s**2, W1=(s + 1) / s)
    same = design.reduce(tolerance=1e-3)
    assert same.controller is design.controller
    assert "keeps the gamma of the shaped loop within 0.1 %" in same.message
    assert same.details["shaped_controller"] is design.details["shaped_controller"]


def test_a_saved_design_is_judged_alike(tmp_path):
    design = rp.loop_shaping(MAGNET, W1=20.0 * LEAD)
    path = tmp_path / "design.json"
    design.save(path)
    read = rp.results.Design.load(path).reduce(order=5)
    assert read.details["gamma"] == pytest.approx(design.reduce(order=5).details["gamma"])
