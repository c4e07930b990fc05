"""Pictures of labelled data; nothing here knows a result type."""

from robustpolish.plotting.before_after import plot_panels
from robustpolish.plotting.style import new_axes, si_axis
from robustpolish.plotting.time_series import plot_time_series

__all__ = ["new_axes", "plot_panels", "plot_time_series", "si_axis"]
