"""Shapes of a rotor's whirl modes along its shaft."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.plotting.style import LINE_STYLES, legend, new_axes, si_axis


def plot_whirl_shapes(
    nodes: ArrayLike, shapes: Mapping[str, ArrayLike], ax: Axes | None = None
) -> Axes:
    """Draw how far each mode deflects along the shaft, at the moment at which it is largest.

    Parameters
    ----------
    nodes : array_like, shape (nodes,)
        In m.
    shapes : mapping of str to array_like of complex, shape (2, nodes)
        Amplitudes in x and y by the name in the legend. The axis with the larger ones is drawn.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for i, (label, shape) in enumerate(shapes.items(), 1):
        both = np.asarray(shape)
        larger = both[np.abs(both).max(axis=1).argmax()]
        largest = larger[np.abs(larger).argmax()]
        # Turned so that the largest deflection is real, and drawn upwards where the shaft ends.
        drawn = (larger / largest).real
        style = LINE_STYLES[i % len(LINE_STYLES)]
        ax.plot(np.asarray(nodes), drawn * (1 if drawn[-1] >= 0 else -1), label=label, **style)
    ax.axhline(0.0, color="#999999", linewidth=0.5)
    si_axis(ax.xaxis, "along the shaft", "m")
    ax.set_ylabel("deflection over the largest")
    legend(ax, least=1)
    return ax
