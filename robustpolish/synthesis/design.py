"""What every synthesis returns: a controller, its loop, and what is known about both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate import Certificate

Status = Literal["optimal", "suboptimal", "infimum_not_attained", "time_limit"]


@dataclass(frozen=True, eq=False)
class Design:
    """A certified controller.

    Attributes
    ----------
    plant : GeneralizedPlant
        The plant that the controller was designed for, in its own units.
    controller : control.StateSpace
        K in u = K y; for a state feedback K is static and y is the state.
    closed_loop : control.StateSpace
        The system from w to z.
    norm : {"hinf", "h2"}
        The norm that was minimised.
    status : str
        "optimal": within the tolerance of the infimum; "suboptimal": certified, but no
        claim of optimality (a constrained, nonconvex or stopped search);
        "infimum_not_attained": the infimum is only approached, by ever larger gains or by a
        limit; "time_limit": the best certified controller when time ran out.
    message : str
        What happened, and what to try next.
    certificate : Certificate
        Computed afresh from the closed loop.
    method : str
        "lmi", "riccati", ...
    backend : str
        The library that solved it: "cvxpy", "picos", "slycot", "scipy", ...
    elapsed : float
        Seconds.
    history : tuple of mapping
        One entry per step of the search (such as per axis, or per gamma).
    details : mapping
        What the method wants to tell besides: diagnosis, observer gain, ...
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    closed_loop: control.StateSpace
    norm: Literal["hinf", "h2"]
    status: Status
    message: str
    certificate: Certificate
    method: str
    backend: str
    elapsed: float
    history: tuple[Mapping[str, Any], ...] = ()
    details: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def gain(self) -> NDArray[np.float64] | None:
        """The matrix K of a static controller, shape (nu, ny); None for a dynamic one."""
        return np.array(self.controller.D) if self.controller.nstates == 0 else None
