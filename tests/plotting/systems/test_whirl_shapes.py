import numpy as np

from robustpolish.plots.poles import plot_whirl_shapes


def test_the_larger_axis_is_drawn_at_its_largest():
    nodes = np.array([0.0, 0.5, 1.0])
    x, y = np.array([0.0, -1j, -2j]), np.array([0.0, 0.1, 0.1])
    ax = plot_whirl_shapes(nodes, {"in x": np.array([x, y]), "in y": np.array([y, x])})
    for line in ax.lines[:2]:
        np.testing.assert_allclose(line.get_ydata(), [0.0, 0.5, 1.0], atol=1e-15)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["in x", "in y"]
    assert ax.get_xlabel() == "along the shaft [m]"
