"""Pictures of labelled data; nothing here knows a result type."""

from robustpolish.plotting.bars import plot_bars
from robustpolish.plotting.before_after import plot_panels
from robustpolish.plotting.distribution import plot_distribution
from robustpolish.plotting.frequency_response import plot_gains, plot_over_frequency
from robustpolish.plotting.gain_against_norm import plot_gain_against_norm
from robustpolish.plotting.overlay import plot_overlay, plot_response, plot_spectra
from robustpolish.plotting.poles import plot_poles
from robustpolish.plotting.residual_map import plot_residual_map
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
from robustpolish.plotting.waterfall import plot_waterfall

__all__ = [
    "new_axes",
    "plot_band_shares",
    "plot_bars",
    "plot_coherence",
    "plot_correlation",
    "plot_distribution",
    "plot_gain_against_norm",
    "plot_gains",
    "plot_over_frequency",
    "plot_overlay",
    "plot_panels",
    "plot_poles",
    "plot_residual_analysis",
    "plot_residual_map",
    "plot_response",
    "plot_spectra",
    "plot_surface",
    "plot_time_series",
    "plot_waterfall",
    "plot_window_shares",
    "si_axis",
]
