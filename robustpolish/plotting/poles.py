"""Poles in the complex plane, and the region that they were to lie in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from robustpolish.plotting.style import MARKER_STYLES, new_axes, si_axis

_GRID = 301


def plot_poles(
    poles: Mapping[str, ArrayLike],
    regions: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    ax: Axes | None = None,
    *,
    discrete: bool = False,
) -> Axes:
    """Draw poles, the boundary of stability, and the regions that they were to lie in.

    Parameters
    ----------
    poles : mapping of str to array_like of complex
        By the name in the legend: in rad/s, or in discrete time without unit.
    regions : mapping of str to (L, M), optional
        Regions {s : L + s M + conj(s) M' < 0} by name; what lies outside is hatched.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    discrete : bool, optional
        Whether the unit circle bounds the stable poles.

    Returns
    -------
    matplotlib.axes.Axes
        In continuous time the real part is drawn in 1/s (a rate of growth), the imaginary part
        over 2 pi in Hz.
    """
    ax = new_axes(ax)
    scale = 1.0 if discrete else 2 * np.pi
    drawn: dict[str, Any] = {
        label: np.ravel(np.asarray(values, dtype=complex)) for label, values in poles.items()
    }
    for i, (label, values) in enumerate(drawn.items()):
        style = MARKER_STYLES[i % len(MARKER_STYLES)]
        height = values.imag / scale
        ax.plot(values.real, height, linestyle="", fillstyle="none", label=label, **style)
    if discrete:
        circle: Any = np.exp(1j * np.linspace(0, 2 * np.pi, 400))
        ax.plot(circle.real, circle.imag, color="black", linewidth=0.8)
        ax.set_aspect("equal")
    else:
        ax.axvline(0.0, color="black", linewidth=0.8)
    ax.axhline(0.0, color="#999999", linewidth=0.5)
    ax.margins(0.08)
    handles = list(ax.get_legend_handles_labels()[0])
    for name, (L, M) in (regions or {}).items():
        _hatch_outside(ax, np.asarray(L, dtype=float), np.asarray(M, dtype=float), scale)
        handles.append(Patch(facecolor="none", edgecolor="#999999", hatch="//", label=name))
    si_axis(ax.xaxis, "real part", "" if discrete else "1/s")
    si_axis(ax.yaxis, "imaginary part" if discrete else "frequency", "" if discrete else "Hz")
    if handles:
        handles.append(Line2D([], [], color="black", linewidth=0.8, label="boundary of stability"))
        ax.legend(handles=handles, loc="best")
    return ax


def _hatch_outside(ax: Axes, L: NDArray, M: NDArray, scale: float) -> None:
    """Hatch what lies outside a region, within the axes' limits."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    x, y = np.linspace(left, right, _GRID), np.linspace(low, high, _GRID)
    s = x[None, :] + 1j * scale * y[:, None]
    matrices = L + s[..., None, None] * M + np.conj(s)[..., None, None] * M.T
    excess = np.linalg.eigvalsh(matrices)[..., -1]
    if (excess >= 0).any():
        top = max(float(excess.max()), 1e-300)
        ax.contourf(x, y, excess, levels=[0.0, 1.01 * top], colors="none", hatches=["//"])
    if (excess >= 0).any() and (excess < 0).any():
        ax.contour(x, y, excess, levels=[0.0], colors="#666666", linewidths=0.8)
    ax.set_xlim(left, right)
    ax.set_ylim(low, high)
