"""Delays: Pade models, exact responses, stability against closed forms."""

import control
import numpy as np
import pytest
from scipy.special import lambertw

import robustpolish as rp
from robustpolish.linear.delay_stability import count_unstable
from robustpolish.linear.systems import MOST_ORDER, pade

# Stability against what is known in closed form.


def loop(L, seconds):
    """Return the loop u(t) = -y(t - seconds) around a system L from u to y."""
    L = control.ss(L)
    ports = control.ss(L.A, -L.B, L.C, -L.D)
    return rp.simulation.DelayedSystem(ports, (rp.simulation.DelayLine("y", seconds),))


def delay_margins(L):
    """Return every delay at which a root crosses, by python-control's crossings."""
    margins = control.stability_margins(L, returnall=True)
    return np.radians(margins[1] % 360) / margins[4]


@pytest.mark.parametrize("T", [0.3, 1.57, 1.5709, 10.0, 30.0])
def test_an_integrator_has_the_roots_of_lambert(T):
    # s = -exp(-s T), so s T = W(-T)
    found = rp.linear.delay_stability(loop(control.tf([1], [1, 0]), T))
    branches = lambertw(-T, np.arange(-30, 31)) / T
    assert found.unstable_roots == (branches.real > 0).sum()
    assert bool(found) == (np.pi / 2 > T)
    rightmost = branches[np.argmax(branches.real)]
    assert found.rightmost.real == pytest.approx(rightmost.real, abs=1e-9)
    assert abs(found.rightmost.imag) == pytest.approx(abs(rightmost.imag), rel=1e-9)


@pytest.mark.parametrize("kind", range(20))
def test_random_loops_lose_stability_at_the_delay_margin(kind):
    np.random.seed(kind)  # noqa: NPY002, which is what control.rss draws from
    rng = np.random.default_rng(kind)
    scale = 10.0 ** rng.uniform(-3, 6)
    while True:
        L = control.rss(int(rng.integers(1, 7)), 1, 1, strictly_proper=True)
        L = rng.choice([-1, 1]) * rng.uniform(0.5, 20) * L
        stable = (np.linalg.eigvals(L.A - L.B @ L.C).real < 0).all()
        if stable and len(control.stability_margins(L, returnall=True)[4]):
            break
    margin = delay_margins(L).min()
    fast = control.ss(L.A * scale, L.B * scale, L.C, 0)
    assert rp.linear.delay_stability(loop(fast, 0.999 * margin / scale))
    late = rp.linear.delay_stability(loop(fast, 1.001 * margin / scale))
    assert (late.verdict, late.unstable_roots) in (("unstable", 2), ("unstable", 1))
    assert late.rightmost.real > 0


def test_a_light_resonance_is_counted_again_and_again():
    # w^2 / (s^2 + w^2 + 2 d w s) around with gain 0.5 and many turns of delay: known crossings.
    L = control.tf([50.0], [1, 0.2, 100])
    for T in np.linspace(0.05, 3.0, 25):
        crossings = control.stability_margins(L, returnall=True)
        omega, phases = crossings[4], np.radians(crossings[1] % 360)
        count = 0
        for w, phase in zip(omega, phases, strict=True):
            times = np.arange(phase / w, T, 2 * np.pi / w)
            # the gain falls through 1 at the upper crossing: roots go right there, left below
            count += (2 if w == omega.max() else -2) * times.size
        assert rp.linear.delay_stability(loop(L, T)).unstable_roots == count


def test_a_system_without_delays_is_that_of_its_poles():
    system = control.ss([[-1.0]], [[1.0]], [[1.0]], 0)
    found = rp.linear.delay_stability(rp.simulation.DelayedSystem(system, ()))
    assert (found.verdict, found.rightmost) == ("stable", -1)
    unstable = rp.simulation.DelayedSystem(control.ss([[2.0]], [[1.0]], [[1.0]], 0), ())
    assert rp.linear.delay_stability(unstable).unstable_roots == 1


def test_delays_that_feed_each_other():
    # A lag of unit gain under negative feedback k, delayed, with feedthrough d: neutral.
    def ring(d):
        return rp.linear.delay_stability(loop(control.ss([[-1.0]], [[1.0]], [[0.1]], [[d]]), 0.2))

    assert ring(0.5).verdict == "stable"
    assert ring(-0.8).verdict == "stable"
    assert ring(1.2).verdict == "unstable"
    many = control.ss([[-1.0]], [[1.0, 0.0]], [[0.1], [0.0]], [[0.9, 0.9], [0.9, -0.9]])
    lines = (rp.simulation.DelayLine("a", 0.1), rp.simulation.DelayLine("b", 0.23))
    assert (
        rp.linear.delay_stability(rp.simulation.DelayedSystem(many, lines)).verdict == "undecided"
    )


def test_two_delays_in_different_places_and_units():
    # Mass under PD control: position and velocity delayed each, positions in nanometres.
    lag = control.tf([1], [1, 0, 0], inputs="F", outputs="x")
    plant = rp.GeneralizedPlant(lag, "x", "F").weighted({"x": 1e9}).with_delay("F", 0.05)
    K = control.tf([-2e-9, -1e-9], [0.01, 1])

    def stable(T):
        return bool(rp.linear.delay_stability(plant.with_delay("x", T).delayed_loop(control.ss(K))))

    margin = delay_margins(control.tf([1], [1, 0, 0]) * K * -1e9).min()
    assert stable(0.999 * margin - 0.05)
    assert not stable(1.001 * margin - 0.05)


def test_only_delayed_systems_are_taken():
    with pytest.raises(rp.InvalidInputError, match="system: got StateSpace"):
        rp.linear.delay_stability(control.ss([[-1.0]], [[1.0]], [[1.0]], 0))


# The count of unstable roots, where the Pade model misleads too.


def loop_winding(order=1, T=1.0, gain=1.0):
    ports = control.ss([[0.0]], [[-gain]], [[1.0]], 0)
    return rp.simulation.DelayedSystem(ports, (rp.simulation.DelayLine("y", T, order),))


@pytest.mark.parametrize("order", [1, 2, 5])
@pytest.mark.parametrize("T", [1.5, 1.6, 1.9, 2.1, 9.0])
def test_the_count_does_not_depend_on_the_pade_model(T, order):
    # Of order 1 it is stable up to T = 2; the truth is pi / 2.
    expected = 2 * int(np.ceil((T - np.pi / 2) / (2 * np.pi))) if np.pi / 2 < T else 0
    assert count_unstable(loop_winding(order, T))[0] == expected


def test_a_root_on_the_axis_is_not_counted():
    unstable, _, highest = count_unstable(loop_winding(3, np.pi / 2))
    assert unstable is None
    assert highest == pytest.approx(1 / 0.8, rel=0.1)


# Systems whose outputs return after a delay.


def system(lines=2):
    rng = np.random.default_rng(3)
    shapes = ((4, 4), (4, 1 + lines), (2 + lines, 4), (2 + lines, 1 + lines))
    matrices = [rng.standard_normal(shape) / 3 for shape in shapes]
    matrices[0] -= 2 * np.eye(4)
    return control.ss(*matrices)


LINES = (rp.simulation.DelayLine("a", 0.4, 2), rp.simulation.DelayLine("b", 0.1, 3))


def test_the_response_solves_the_equations_of_the_lines():
    delayed = rp.simulation.DelayedSystem(system(), LINES)
    w = 1.7
    H, E = system()(1j * w), np.diag(np.exp(-1j * w * np.array([0.4, 0.1])))
    d = np.linalg.solve(np.eye(2) - E @ H[2:, 1:], E @ H[2:, :1])
    np.testing.assert_allclose(delayed.response([w])[0], H[:2, :1] + H[:2, 1:] @ d)


def test_the_pade_model_tends_to_it():
    fine = tuple(rp.simulation.DelayLine(line.name, line.seconds, 12) for line in LINES)
    delayed = rp.simulation.DelayedSystem(system(), fine)
    model = delayed.pade_model()
    for w in (0.0, 0.9, 5.0):
        np.testing.assert_allclose(model(1j * w), delayed.response(w)[0], atol=1e-10)
    assert model.nstates == 4 + 24
    assert model.state_labels[4] == "a_delay[0]"


def test_a_pole_on_the_axis_is_infinite():
    integrator = control.ss([[0.0]], [[1.0, 1.0]], [[1.0], [0.0]], 0)
    delayed = rp.simulation.DelayedSystem(integrator, (rp.simulation.DelayLine("u", 1.0),))
    values = delayed.response([0.0, 1.0])
    assert not np.isfinite(values[0, 0, 0])
    np.testing.assert_allclose(values[1, 0, 0], 1 / 1j)


def test_a_pole_of_the_open_lines_is_none_of_the_whole():
    # x' = w - x(t - 1): at rest x = w
    ports = control.ss([[0.0]], [[1.0, -1.0]], [[1.0], [1.0]], 0)
    values = rp.simulation.DelayedSystem(ports, (rp.simulation.DelayLine("x", 1.0),)).response(
        [0.0]
    )
    np.testing.assert_allclose(values[0, 0, 0], 1)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((control.tf([1], [1, 1]), ()), "system: got TransferFunction"),
        ((system(), ("a",)), "lines: got str"),
        ((system(0), LINES), "lines: got 2 delay lines and 1 signals"),
        ((control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.1), LINES[:1]), "system: got a discrete-time"),
    ],
)
def test_bad_systems_are_named(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.simulation.DelayedSystem(*given)


def test_a_pade_model_without_a_solution_is_refused():
    # d = v(t - T), v = w + d: the loop through the odd Pade at infinity is v = w - v, the even
    # one's v = w + v has no solution.
    ring = control.ss([], [], [], [[1.0, 1.0], [1.0, 1.0]])
    with pytest.raises(rp.InvalidInputError, match="a loop without solution at infinite"):
        rp.simulation.DelayedSystem(ring, (rp.simulation.DelayLine("u", 1.0, 2),)).pade_model()


# The Pade approximation of a delay.


def response(seconds, order, omega):
    A, B, C, D = pade(seconds, order)
    return np.array([(C @ np.linalg.solve(1j * w * np.eye(order) - A, B) + D)[0, 0] for w in omega])


@pytest.mark.parametrize("order", [1, 2, 3, 6, 11, MOST_ORDER])
def test_it_is_the_rational_function_of_python_control(order):
    omega = np.geomspace(1, 1e5, 40)
    num, den = control.pade(1e-3, order)
    expected = np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega)
    np.testing.assert_allclose(response(1e-3, order, omega), expected, rtol=1e-10)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((0.0, 2), "seconds: got 0.0"),
        ((1.0, 0), "order: got 0"),
        ((1.0, 21), "order: got 21"),
        ((1.0, "3"), "order: got '3'"),
    ],
)
def test_bad_delays_are_named(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        pade(*given)
