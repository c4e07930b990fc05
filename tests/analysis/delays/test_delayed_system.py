"""Systems whose outputs return after a delay."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.delays.systems import resolvent_response


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


def test_without_lines_it_is_the_system():
    delayed = rp.simulation.DelayedSystem(system(), ())
    np.testing.assert_allclose(delayed.response([2.0])[0], system()(2j))
    np.testing.assert_array_equal(delayed.pade_model().A, system().A)


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


def test_responses_without_states():
    D = np.array([[2.0]])
    none = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), D)
    np.testing.assert_array_equal(resolvent_response(*none, np.array([1j, 2j])), [[[2]], [[2]]])


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
