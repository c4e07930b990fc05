"""One function at many points: on all cores or a cluster, resumed after a kill."""

from robustpolish.sweeps.sweep import sweep as sweep

__all__ = ["sweep"]
