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


# Shorter controllers, judged by their certified loops.


def test_a_reduced_design_is_certified_and_says_what_it_cost():
    design = servo_design()
    found = design.reduce(order=3)
    assert found.controller.nstates == 3
    assert found.status == "suboptimal"
    assert found.certificate.valid
    assert found.certificate.achieved < 1.02 * design.certificate.achieved
    assert "from 4 to 3 states" in found.message
    assert found.details["norm_before"] == design.certificate.achieved
    assert found.details["order_after"] == 3
    hankel = found.details["hankel_singular_values"]["closed-loop"]
    assert (np.diff(hankel) <= 0).all()
    again = rp.certify(design.plant, found.controller)
    assert again.achieved == pytest.approx(found.certificate.achieved)


def test_the_smallest_order_within_the_tolerance_is_taken():
    plant = servo_design().plant
    K = servo_design().controller
    # Two states more that do next to nothing: far too fast, and hardly seen.
    fast = control.append(K, control.ss([[-1e4]], [[1e4]], [[1e-6]], 0))
    joined = control.ss(fast.A, fast.B @ [[1.0], [1.0]], [[1.0, 1.0]] @ fast.C, 0)
    design = rp.given_controller(plant, joined)
    found = design.reduce(tolerance=1e-3)
    assert found.controller.nstates == 4
    assert found.certificate.achieved <= design.certificate.achieved * 1.001
    assert design.reduce(tolerance=0.05).controller.nstates == 3
    assert design.reduce().controller.nstates == 3


def test_unstable_controllers_are_shortened_too():
    # An unstable controller for two unstable states, with a fast filter behind it.
    plant = rp.GeneralizedPlant.from_matrices(
        [[1.0, 1.0], [0.0, -2.0]], [[1, 0], [0, 0]], [[0], [1]], [[1, 0], [0, 0]], [[0, 1]],
        D12=[[0], [0.1]], D21=[[0, 0.1]],
    )  # fmt: skip
    with pytest.raises(rp.InfeasibleError):
        rp.output_feedback(plant)
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [1, 0]], [[0, 0], [1, 0]], [[0], [1]], [[1, 0], [0, 0]], [[1, -1.1]],
        D12=[[0], [0.1]], D21=[[0, 0.1]],
    )  # fmt: skip
    design = rp.output_feedback(plant)
    K = design.controller
    assert np.linalg.eigvals(K.A).real.max() > 0
    slow = control.series(K, control.ss([[-3e4]], [[3e4]], [[1.0]], 0))
    whole = rp.given_controller(plant, slow)
    found = whole.reduce(order=K.nstates)
    assert found.controller.nstates <= K.nstates
    assert found.certificate.valid
    assert found.certificate.achieved < 1.02 * whole.certificate.achieved


def test_h2_designs_keep_their_norm():
    design = rp.output_feedback(servo_design().plant, norm="h2")
    found = design.reduce(order=2)
    assert found.norm == "h2"
    assert found.certificate.norm == "h2"
    assert found.certificate.valid


def test_what_cannot_be_reduced_is_refused():
    design = servo_design()
    for order in (4, -1, 1.5, True, "2"):
        with pytest.raises(rp.InvalidInputError, match="order"):
            design.reduce(order=order)
    with pytest.raises(rp.InvalidInputError, match="one of the two"):
        design.reduce(order=3, tolerance=0.1)
    with pytest.raises(rp.InvalidInputError, match="tolerance"):
        design.reduce(tolerance=-0.1)
    with pytest.raises(rp.InfeasibleError, match="Order 3 does"):
        design.reduce(order=1)
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    with pytest.raises(rp.InvalidInputError, match="static gain"):
        rp.given_controller(plant, [[-3.0]]).reduce(order=0)


def test_a_tolerance_that_nothing_keeps_leaves_the_design():
    design = servo_design()
    found = design.reduce(tolerance=1e-6)
    assert found.controller is design.controller
    assert "stays as it is" in found.message
    assert found.status == design.status


def test_margins_that_the_norm_does_not_count_are_told():
    # A levitated ball in volts and millimetres: K S is nearly all of the norm.
    s = control.tf("s")
    magnet = control.tf([-36.27e3], np.poly([66.94, -66.94, -45.69]))
    lead = (s / 45.69 + 1) * (s / 66.94 + 1) / (s / 800 + 1) ** 2 * (s + 3) / s
    shaped = rp.loop_shaping(magnet, W1=20.0 * lead)
    design = rp.given_controller(shaped.plant, shaped.controller)
    short = design.reduce(tolerance=0.1)
    assert short.certificate.achieved < 1.1 * design.certificate.achieved
    before, after = (max(float(rp.loop_analysis(one).output.peaks[name]) for name in "ST")
                     for one in (design, short))  # fmt: skip
    assert after > 1.1 * before
    assert f"sensitivity rises from {before:.3g} to {after:.3g}" in short.message


def test_margins_that_stay_need_no_words():
    assert "sensitivity" not in servo_design().reduce(tolerance=0.05).message


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
