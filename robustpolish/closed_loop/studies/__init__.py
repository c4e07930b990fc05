"""Many loops at once: sampled machines and brushes, and what can be said about all of them."""

from robustpolish.closed_loop.studies.monte_carlo import monte_carlo
from robustpolish.closed_loop.studies.sampled_loops import SampledLoops

__all__ = ["SampledLoops", "monte_carlo"]
