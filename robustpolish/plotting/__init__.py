"""Pictures of labelled data; nothing here knows a result type."""

from robustpolish.plotting.before_after import plot_panels
from robustpolish.plotting.overlay import plot_overlay, plot_spectra
from robustpolish.plotting.residuals import (
    plot_band_shares,
    plot_coherence,
    plot_correlation,
    plot_residual_analysis,
    plot_surface,
    plot_window_shares,
)
from robustpolish.plotting.style import new_axes, si_axis
from robustpolish.plotting.time_series import plot_time_series

__all__ = [
    "new_axes",
    "plot_band_shares",
    "plot_coherence",
    "plot_correlation",
    "plot_overlay",
    "plot_panels",
    "plot_residual_analysis",
    "plot_spectra",
    "plot_surface",
    "plot_time_series",
    "plot_window_shares",
    "si_axis",
]
