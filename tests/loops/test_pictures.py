"""Systems of a loop as pictures: their frequencies, curves and steps."""

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

from robustpolish.loops.pictures import (
    grid_of,
    plot_loop_bode,
    plot_loop_nichols,
    plot_loop_nyquist,
    plot_sigma,
    plot_steps,
    responses,
)
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK


def test_frequencies_follow_the_loop_and_not_rounding():
    rates = np.array([-1.0 + 0j, -100.0])
    omega = grid_of({"L": control.ss(control.tf([1], [1, 0, 0, 0]))}, rates)
    assert (omega.min(), omega.max()) == (pytest.approx(0.1), pytest.approx(1000))
    sampled = grid_of({"L": control.ss(control.tf([1], [1, -0.5], 0.1))}, rates)
    assert sampled.max() <= np.pi / 0.1 * (1 + 1e-12)


def test_responses_are_labelled():
    found = responses({"L": control.ss(TEXTBOOK)})
    assert found["L"].dims == ("frequency",)
    omega = found["L"]["frequency"].values * 2 * np.pi
    np.testing.assert_allclose(found["L"].values, TEXTBOOK(1j * omega), rtol=1e-9)
    assert list(responses({"L": SATELLITE})) == [
        f"L u[{j}] to y[{i}]" for i in range(2) for j in range(2)
    ]


def test_every_kind_is_drawn():
    loop = {"u": control.ss(TEXTBOOK)}
    for ax in (
        plot_loop_bode(loop),
        plot_loop_nyquist(loop, {"u": 0.5}),
        plot_loop_nichols(loop, {"u": 0.5}),
        plot_sigma(loop),
        plot_sigma({"G": SATELLITE}),
    ):
        assert ax.lines
        plt.close(ax.figure)


def test_steps_reach_their_end():
    ax = plot_steps({"T": control.ss(control.tf([2], [1, 1]))}, 10.0)
    assert ax.lines[0].get_ydata()[-1] == pytest.approx(2.0, rel=1e-3)
    assert ax.get_xlabel() == "time [s]"
    plt.close(ax.figure)
    ax = plot_steps({"T": control.ss(control.tf([0.5], [1, -0.5], 0.1))}, 2.0)
    np.testing.assert_allclose(ax.lines[0].get_ydata()[:3], [0, 0.5, 0.75])
    plt.close(ax.figure)
