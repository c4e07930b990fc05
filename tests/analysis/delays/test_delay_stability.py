"""Stability with delays against what is known in closed form."""

import control
import numpy as np
import pytest
from scipy.special import lambertw

import robustpolish as rp


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
