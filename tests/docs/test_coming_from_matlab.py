"""The rows of the page for users of MATLAB are true, those that no other test has tried too."""

import re
from pathlib import Path

import control
import numpy as np
import pytest

import robustpolish as rp

PAGE = (Path(__file__).parents[2] / "docs" / "coming_from_matlab.md").read_text(encoding="utf-8")
s = control.tf("s")
G = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
"""The disturbance process of Skogestad and Postlethwaite."""

L = 1 / (s * (s + 1) * (0.5 * s + 1))
C = control.tf([2.0, 1.0], [1.0, 10.0])
HERTZ = 2 * np.pi


@pytest.fixture(scope="module")
def shaped():
    return rp.loop_shaping(G, W1=(s + 2) / s)


def gain(system, rate):
    return abs(complex(np.squeeze(system(1j * rate))))


def near(found, wanted):
    """Whether two systems of one input and output have the same response."""
    for rate in (0.01, 0.5, 3.0, 40.0):
        one = complex(np.squeeze(found(1j * rate)))
        assert one == pytest.approx(complex(np.squeeze(wanted(1j * rate))), rel=1e-6)


@pytest.mark.parametrize("name", sorted(set(re.findall(r"\brp\.(\w+)", PAGE))))
def test_names_exist(name):
    assert hasattr(rp, name)


ROWS = """hinfsyn augw mixsyn makeweight ncfsyn loopsyn h2syn hinfstruct loopsens allmargin margin
diskmargin balred c2d sigma lft sdhinfnorm codegen damp ureal ucomplex ultidyn uss usubs robstab
robustperf wcgain mussv robgain musyn lpvss hinfgs msfsyn"""


@pytest.mark.parametrize("row", ROWS.split())
def test_rows_are_there(row):
    assert re.search(rf"^\|[^|]*\b{row}\b[^|]*\|", PAGE, re.MULTILINE)


def test_mixsyn_and_augw():
    # Skogestad and Postlethwaite, example 2.17: 1.37
    W1 = (s / 1.5 + 10) / (s + 10 * 1e-4)
    plant = rp.mixed_sensitivity(G, performance=W1, effort=1.0)
    design = rp.output_feedback(plant)
    assert design.certificate.achieved == pytest.approx(1.37, abs=0.005)
    assert [name.partition("_")[0] for name in plant.performance_names] == ["performance", "effort"]
    # u = K y: what mixsyn returns is -K, and its S = 1 / (1 + G K)
    near(rp.loop_analysis(design).output.S, control.feedback(1, G * -control.tf(design.controller)))


def test_ncfsyn(shaped):
    assert shaped.details["optimal_gamma"] == pytest.approx(2.34, abs=0.005)  # example 9.3
    assert shaped.details["gamma"] <= 1.1001 * shaped.details["optimal_gamma"]
    assert rp.uncertain.ncf_margin(
        shaped.details["shaped_plant"], shaped.details["shaped_controller"]
    ) == (pytest.approx(1 / shaped.details["gamma"], rel=1e-3))
    near(shaped.controller, (s + 2) / s * control.tf(shaped.details["shaped_controller"]))


def test_loopsyn_has_the_other_sign(shaped):
    K = -shaped.controller  # for negative feedback
    assert control.feedback(control.ss(G) * K, 1).poles().real.max() < 0


def test_loopsens():
    found = rp.loop_analysis(L, -C)
    near(found.input.S, control.feedback(1, L * C))
    near(found.input.T, control.feedback(L * C, 1))
    near(found.input.L, L * C)
    near(found.output.GS, control.feedback(L, C))
    near(-found.output.KS, control.feedback(C, L))
    unstable = rp.loop_analysis(L, -30)
    assert not unstable.stable
    assert unstable.margins == ()


def test_allmargin_and_margin():
    found = rp.loop_analysis(L, -1).margins[0]
    gm, pm, wpc, wgc = control.margin(L)
    assert found.gain_up == pytest.approx(gm, rel=1e-3)
    assert found.phase_deg == pytest.approx(pm, rel=1e-3)
    assert [c.frequency_hz for c in found.phase_crossovers if c.gain > 1] == (
        pytest.approx([wpc / HERTZ], rel=1e-3)
    )
    assert found.gain_crossovers[0].frequency_hz == pytest.approx(wgc / HERTZ, rel=1e-3)
    assert found.delay_s == pytest.approx(np.radians(pm) / wgc, rel=1e-3)


@pytest.mark.parametrize("method", ["tustin", "zoh", "foh", "matched"])
def test_c2d(shaped, method):
    K = control.ss([[-2.0]], [[1.0]], [[-0.3]], -0.01)
    sampled = rp.given_controller(shaped.plant, K).discretize(0.01, delay=0.002, method=method)
    if method != "foh":
        wanted = control.c2d(K if method != "matched" else control.tf(K), 0.01, method=method)
        for rate in (0.5, 5.0):
            z = np.exp(1j * rate * 0.01)
            assert np.squeeze(sampled.controller(z)) == pytest.approx(
                np.squeeze(wanted(z)), rel=1e-6
            )
    assert sampled.certificate.valid


def test_prewarp_is_in_hertz(shaped):
    K = control.ss([[-2.0]], [[1.0]], [[-0.3]], 0)
    sampled = rp.given_controller(shaped.plant, K).discretize(0.02, prewarp_hz=2.0)
    at = np.exp(1j * 2.0 * HERTZ * 0.02)
    assert np.squeeze(sampled.controller(at)) == pytest.approx(np.squeeze(K(2j * HERTZ * 2.0 / 2)))


def test_synthesis_rows():
    P = control.ss(
        [[-1.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    )
    plant = rp.GeneralizedPlant(P, measurements=1, controls=1)
    named = rp.GeneralizedPlant(P, measurements=["y[2]"], controls=["u[2]"])
    np.testing.assert_array_equal(plant.B2, named.B2)
    for norm, value in (("hinf", rp.hinf_norm), ("h2", rp.h2_norm)):
        design = rp.output_feedback(plant, norm=norm)
        assert design.closed_loop.poles().real.max() < 0
        assert float(value(plant.closed_loop(design.controller))) == (
            pytest.approx(design.certificate.achieved, rel=1e-6)
        )
    fixed = rp.static_output_feedback(plant, structure=[[True]])
    assert fixed.gain.shape == (1, 1)


def test_analysis_rows():
    system = control.ss([[0, 1], [-4, -0.4]], [[0], [1]], [[1, 0]], 0)
    norm = rp.hinf_norm(system)
    peak, rate = control.linfnorm(system)
    assert norm.lower <= peak * (1 + 1e-9)
    assert peak <= norm.upper * (1 + 1e-9)
    assert norm.frequency == pytest.approx(rate, rel=1e-3)  # rad/s
    assert float(rp.h2_norm(system)) == pytest.approx(control.norm(system, 2))
    assert np.isinf(float(rp.h2_norm(control.ss([[-1]], [[1]], [[1]], 1.0))))
    assert rp.modes(system).natural_frequencies_hz[0] == pytest.approx(2 / HERTZ)
    assert rp.linear.prescale(system, (0.1, 10.0)) is not None
    plant = rp.GeneralizedPlant.from_loop(control.tf([1], [2, 0, 0], inputs="F", outputs="x"))
    plant = plant.with_actuator("F", bandwidth_hz=2000).with_sensor("x", noise=1e-9)
    plant = plant.with_delay("F", 1e-3)
    assert dict(plant.delays) == {"F": 1e-3}
    loop = plant.delayed_loop(control.ss([[-20.0]], [[20.0]], [[150.0]], -170.0))
    assert rp.linear.delay_stability(loop)


def test_rows_of_uncertain_systems():
    k, m = rp.uncertain.real("k", 10, percent=(-20, 50)), rp.uncertain.real("m", 2, plus_minus=0.5)
    assert k.elements["k"].low == 8
    plant = rp.uncertain.system(np.array([[0, 1], [-k / m, -0.4 / m]]), [0, 1 / m], [1, 0])
    assert [block.copies for block in plant.blocks] == [1, 1]
    error = rp.uncertain.dynamics("d", (1, 1), bound=rp.weight(0.1, 10, 2))
    loop = control.feedback(plant * (1 + error), 0.1)
    assert sorted(loop.elements) == ["d", "k", "m"]
    assert sorted(control.series(control.tf(1, [1, 1]), plant).elements) == ["k", "m"]
    assert sorted(control.parallel(1, plant).elements) == ["k", "m"]
    assert len(loop.sample(3, seed=0)) == 3
    # robustperf of (1 + 0.5 d) / (s + 1): the gain (1 + m / 2) is 1 / m at m = 0.732
    margin = rp.robust_performance(control.tf(1, [1, 1]) * (1 + rp.uncertain.dynamics("e") * 0.5))
    assert margin.upper == pytest.approx(np.sqrt(3) - 1, rel=1e-3)
    assert rp.structured_singular_value([[2, 2], [-1, -1]], [[1, 1], [-1, 0]]).upper < 3.001
