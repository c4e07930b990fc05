from .charts import (
    plot_bars as plot_bars,
)
from .charts import (
    plot_distribution as plot_distribution,
)
from .charts import (
    plot_error_bars as plot_error_bars,
)
from .charts import (
    plot_gain_against_norm as plot_gain_against_norm,
)
from .charts import (
    plot_over_plane as plot_over_plane,
)
from .charts import (
    plot_path_in_space as plot_path_in_space,
)
from .charts import (
    plot_waterfall as plot_waterfall,
)
from .frequency import (
    plot_bode as plot_bode,
)
from .frequency import (
    plot_gains as plot_gains,
)
from .frequency import (
    plot_nichols as plot_nichols,
)
from .frequency import (
    plot_nyquist as plot_nyquist,
)
from .frequency import (
    plot_nyquist_disks as plot_nyquist_disks,
)
from .frequency import (
    plot_over_frequency as plot_over_frequency,
)
from .poles import (
    plot_campbell as plot_campbell,
)
from .poles import (
    plot_poles as plot_poles,
)
from .poles import (
    plot_whirl_shapes as plot_whirl_shapes,
)
from .residuals import (
    plot_band_shares as plot_band_shares,
)
from .residuals import (
    plot_coherence as plot_coherence,
)
from .residuals import (
    plot_correlation as plot_correlation,
)
from .residuals import (
    plot_force_curve as plot_force_curve,
)
from .residuals import (
    plot_residual_analysis as plot_residual_analysis,
)
from .residuals import (
    plot_residual_map as plot_residual_map,
)
from .residuals import (
    plot_surface as plot_surface,
)
from .residuals import (
    plot_window_shares as plot_window_shares,
)
from .style import (
    new_axes as new_axes,
)
from .style import (
    si_axis as si_axis,
)
from .time import (
    plot_before_and_after as plot_before_and_after,
)
from .time import (
    plot_distances as plot_distances,
)
from .time import (
    plot_overlay as plot_overlay,
)
from .time import (
    plot_panels as plot_panels,
)
from .time import (
    plot_response as plot_response,
)
from .time import (
    plot_spectra as plot_spectra,
)
from .time import (
    plot_time_series as plot_time_series,
)
from .time import (
    plot_two_machines as plot_two_machines,
)

__all__ = [
    "new_axes",
    "plot_band_shares",
    "plot_bars",
    "plot_before_and_after",
    "plot_bode",
    "plot_campbell",
    "plot_coherence",
    "plot_correlation",
    "plot_distances",
    "plot_distribution",
    "plot_error_bars",
    "plot_force_curve",
    "plot_gain_against_norm",
    "plot_gains",
    "plot_nichols",
    "plot_nyquist",
    "plot_nyquist_disks",
    "plot_over_frequency",
    "plot_over_plane",
    "plot_overlay",
    "plot_panels",
    "plot_path_in_space",
    "plot_poles",
    "plot_residual_analysis",
    "plot_residual_map",
    "plot_response",
    "plot_spectra",
    "plot_surface",
    "plot_time_series",
    "plot_two_machines",
    "plot_waterfall",
    "plot_whirl_shapes",
    "plot_window_shares",
    "si_axis",
]
