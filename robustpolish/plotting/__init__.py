"""Pictures of labelled data; nothing here knows a result type."""

from robustpolish.plotting.bars import plot_bars as plot_bars
from robustpolish.plotting.before_after import plot_panels as plot_panels
from robustpolish.plotting.before_and_after_fit import (
    plot_before_and_after as plot_before_and_after,
)
from robustpolish.plotting.distribution import plot_distribution as plot_distribution
from robustpolish.plotting.error_bars import plot_error_bars as plot_error_bars
from robustpolish.plotting.force_curve import plot_force_curve as plot_force_curve
from robustpolish.plotting.gain_against_norm import plot_gain_against_norm as plot_gain_against_norm
from robustpolish.plotting.maps.over_plane import plot_over_plane as plot_over_plane
from robustpolish.plotting.maps.path_in_space import plot_path_in_space as plot_path_in_space
from robustpolish.plotting.overlay import plot_overlay as plot_overlay
from robustpolish.plotting.overlay import plot_response as plot_response
from robustpolish.plotting.overlay import plot_spectra as plot_spectra
from robustpolish.plotting.residual_map import plot_residual_map as plot_residual_map
from robustpolish.plotting.residuals import plot_band_shares as plot_band_shares
from robustpolish.plotting.residuals import plot_coherence as plot_coherence
from robustpolish.plotting.residuals import plot_correlation as plot_correlation
from robustpolish.plotting.residuals import plot_residual_analysis as plot_residual_analysis
from robustpolish.plotting.residuals import plot_surface as plot_surface
from robustpolish.plotting.residuals import plot_window_shares as plot_window_shares
from robustpolish.plotting.style import new_axes as new_axes
from robustpolish.plotting.style import si_axis as si_axis
from robustpolish.plotting.systems.bode import plot_bode as plot_bode
from robustpolish.plotting.systems.bode import plot_nyquist as plot_nyquist
from robustpolish.plotting.systems.campbell import plot_campbell as plot_campbell
from robustpolish.plotting.systems.frequency_response import plot_gains as plot_gains
from robustpolish.plotting.systems.frequency_response import (
    plot_over_frequency as plot_over_frequency,
)
from robustpolish.plotting.systems.loop_curves import plot_nichols as plot_nichols
from robustpolish.plotting.systems.loop_curves import plot_nyquist_disks as plot_nyquist_disks
from robustpolish.plotting.systems.poles import plot_poles as plot_poles
from robustpolish.plotting.systems.whirl_shapes import plot_whirl_shapes as plot_whirl_shapes
from robustpolish.plotting.time_series import plot_time_series as plot_time_series
from robustpolish.plotting.told_apart import plot_distances as plot_distances
from robustpolish.plotting.told_apart import plot_two_machines as plot_two_machines
from robustpolish.plotting.waterfall import plot_waterfall as plot_waterfall
