"""What a design shows: its gain, its card, its plots."""

import dataclasses

import control
import numpy as np
import pytest

import robustpolish as rp
from tests.plotting.legends import names
from tests.reference.examples import servo_design


def mass():
    """One kilogram on a spring of 4 N/m with a damper; u and w are forces."""
    return rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [-4.0, -0.4]],
        [[0.0], [1.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        [[1.0, 0.0]],
        units={"w1": "N", "z1": "m"},
    )


@pytest.fixture(scope="module")
def design():
    return rp.given_controller(mass(), [[-5.0]])


def test_only_a_static_controller_is_a_gain(design):
    assert design.gain == pytest.approx(np.array([[-5.0]]))
    lag = control.StateSpace([[-1.0]], [[1.0]], [[-0.1]], [[0.0]])
    assert rp.given_controller(mass(), lag).gain is None


def test_the_card_tells_what_is_known(design):
    # The spring is now 9 N/m: 1/(2 zeta w^2 sqrt(1 - zeta^2)) with zeta = 0.2/3.
    norm = 1 / (2 * 0.2 / 3 * 9 * np.sqrt(1 - 0.04 / 9))
    text = str(design)
    assert text.startswith("Design (given): suboptimal\n")
    assert f"H-infinity norm     {norm:.6g}, proven to be at most 0.8" in text
    assert "no H-infinity norm below" not in text
    spring = rp.results.PassiveElement("spring", ("x", "ground"), 5.0, "N/m")
    told = dataclasses.replace(
        design, norm="h2", backend="cvxpy", lower_bound=0.5, details={"elements": (spring,)}
    )
    text = str(told)
    assert text.startswith("Design (given, cvxpy): suboptimal\n")
    assert "no H2 norm below" in text
    assert "x and ground" in text


def test_the_plot_shows_both_loops_and_the_norm(design):
    ax = design.plot()
    norm = f"norm {design.certificate.achieved:.4g} m/N"
    assert names(ax) == ["without control", "with control", norm]
    assert ax.yaxis.get_major_formatter()(1.0) == "1 m/N"
    unstable = mass().replace(A=[[0.0, 1.0], [1.0, -0.4]])
    held = rp.given_controller(unstable, [[-5.0]])
    assert names(held.plot())[0] == "without control (unstable)"


def test_the_plot_compares_like_with_like(design):
    """A price acts in the closed loop only; control does not seem worse for it."""
    plant = design.plant
    priced = rp.state_feedback(plant, control_weight=1e-3)
    ax = priced.plot()
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert list(drawn)[:3] == ["without control", "with control", "with control, price"]
    without, loop, whole = list(drawn.values())[:3]
    assert loop[-1] == pytest.approx(without[-1], rel=1e-2)  # far above the bandwidth
    assert (whole >= loop * (1 - 1e-9)).all()
    assert whole.max() == pytest.approx(priced.certificate.achieved, rel=1e-3)


def test_the_regions_that_were_demanded_are_drawn(design):
    slow = rp.HalfPlane(-0.1)
    assert not any("outside" in name for name in names(design.plot_poles()))
    told = dataclasses.replace(design, details={"pole_regions": (slow,)})
    assert f"outside {slow}" in names(told.plot_poles())
    other = rp.Disk(-10.0, 9.95)
    drawn = names(told.plot_poles(regions=other))
    assert f"outside {other}" in drawn
    assert f"outside {slow}" not in drawn


@pytest.mark.parametrize(
    "use",
    [
        lambda K: rp.compare_controllers({"PD": K}, rp.polishing.simulate_brush(duration=0.02)),
        lambda K: rp.simulation.check_robustness(K, None),
        lambda K: rp.polishing.monte_carlo(K, {}),
        lambda K: rp.synthesis.largest_period(K),
    ],
)
def test_a_transfer_function_is_not_a_design_yet(use):
    with pytest.raises(rp.InvalidInputError, match=r"got TransferFunction.*given_controller"):
        use(control.tf([-1.0, -3.0], [0.01, 1.0]))


def test_delays_and_filters_shorten_the_largest_period():
    design = servo_design()
    plain = rp.synthesis.largest_period(design)
    for option in ({"delay_periods": 1.0}, {"delay": 0.1}, {"anti_aliasing": 1.0}):
        assert 0 < rp.synthesis.largest_period(design, **option) < plain
    for method in ("zoh", "foh", "bilinear"):
        assert 0 < rp.synthesis.largest_period(design, method=method) < 1
    for name, value in (
        ("delay", -1.0),
        ("delay_periods", -1.0),
        ("method", "x"),
        ("method", "matched"),
        ("prewarp_hz", 0.0),
    ):
        with pytest.raises(rp.InvalidInputError, match=name):
            rp.synthesis.largest_period(design, **{name: value})
