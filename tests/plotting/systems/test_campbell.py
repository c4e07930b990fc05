import numpy as np

from robustpolish.plots.poles import plot_campbell

SPEEDS = np.array([0.0, 100.0, 200.0])
HZ = np.array([[10.0, 10.0, 5.0], [9.0, 11.0, 5.0], [8.0, 12.0, 5.0]])
WHIRL = np.array([[0.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])


def test_curves_are_drawn_by_their_way_round():
    ax = plot_campbell(SPEEDS, HZ, WHIRL, critical=[60.0])
    assert [line.get_linestyle() for line in ax.lines[:3]] == ["--", "-", "-."]
    np.testing.assert_allclose(ax.lines[1].get_xdata(), SPEEDS * 30 / np.pi)
    np.testing.assert_allclose(ax.lines[1].get_ydata(), HZ[:, 1])
    spin, marks = ax.lines[3], ax.lines[4]
    np.testing.assert_allclose(spin.get_ydata(), SPEEDS / (2 * np.pi))
    np.testing.assert_allclose(marks.get_ydata(), 60.0 / (2 * np.pi))
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["forward", "backward", "neither", "once per turn", "critical speed"]
    assert ax.get_xlabel() == "speed [rev/min]"
    assert ax.get_ylabel() == "whirl frequency [Hz]"


def test_without_critical_speeds_none_are_named():
    ax = plot_campbell(SPEEDS, HZ[:, :1], WHIRL[:, :1])
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["backward", "once per turn"]
