"""The axis across the mould along which a tool is pressed on: a mass, an actuator, a contact."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import pi
from typing import Any

import numpy as np

from robustpolish.models import GeneralizedPlant
from robustpolish.validation import positive


def _quantity(value: float, unit: str) -> Any:
    return field(default=value, metadata={"unit": unit})


_MAY_BE_ZERO = frozenset({"contact_damping", "stiffness", "damping"})


@dataclass(frozen=True)
class PolishingAxis:
    r"""A tool that a robot leads along a programmed path and presses on what is really there.

    ::

        m z'' = (F - F_p) - k z - c z' + a,      a' = omega_a (u - a),
        F = F_p + k_c (s - z) + c_c (s' - z').

    z is the height of the tool and s that of the mould, both over where the robot believes the
    mould to be; F, the contact force, pushes the tool up, and so does the actuator's force a. The
    contact is linear, so that a force below zero means that the tool has left the mould.

    Parameters
    ----------
    mass : float
        Moving mass m of tool and spindle [kg]: brush and bearing of table 9.1.
    contact_stiffness, contact_damping : float
        k_c [N/m] and c_c [N s/m]: of the thesis's run 1, and of Hunt-Crossley contact of 50 s/m
        at 10 N.
    polishing_force : float
        F_p [N], which is wanted all the time.
    stiffness, damping : float
        k [N/m] and c [N s/m] of what the tool hangs in at the robot.
    actuator_bandwidth : float
        omega_a / (2 pi) [Hz].
    surface_bandwidth : float
        In Hz. Waves of the mould pass below the tool no quicker than this.

    Raises
    ------
    InvalidInputError
        If a number is negative, zero where it has to be positive, or not finite.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.PolishingAxis().plant()
    >>> plant.disturbance_names, plant.measurement_names
    (('surface', 'force_noise'), ('force', 'height', 'climb'))
    """

    mass: float = _quantity(1.537, "kg")
    contact_stiffness: float = _quantity(1e4, "N/m")
    contact_damping: float = _quantity(500.0, "N s/m")
    polishing_force: float = _quantity(10.0, "N")
    stiffness: float = _quantity(0.0, "N/m")
    damping: float = _quantity(5.0, "N s/m")
    actuator_bandwidth: float = _quantity(100.0, "Hz")
    surface_bandwidth: float = _quantity(100.0, "Hz")

    def __post_init__(self) -> None:
        for item in fields(self):
            number = positive(
                f"PolishingAxis.{item.name}",
                getattr(self, item.name),
                item.metadata["unit"],
                zero=item.name in _MAY_BE_ZERO,
            )
            object.__setattr__(self, item.name, number)

    def plant(self) -> GeneralizedPlant:
        """Return the axis as a plant around its working point.

        Returns
        -------
        GeneralizedPlant
            From `surface` [m] and `force_noise` [N] to `force_error` = F - F_p [N], `tool` = z [m]
            and `gap` = s - z [m]. The control `push` [N] acts upwards; measured are `force`, the
            error with the noise [N], `height`, z [m], and `climb`, z' [m/s].
        """
        m, k, c = self.mass, self.contact_stiffness, self.contact_damping
        slow, quick = 2 * pi * self.surface_bandwidth, 2 * pi * self.actuator_bandwidth
        # States: s, z, z', a. The mould's rate is slow (w - s), with w the disturbance.
        force = np.array([k - c * slow, -k, -c, 0.0])
        A = np.zeros((4, 4))
        A[0, 0], A[1, 2], A[3, 3] = -slow, 1.0, -quick
        A[2] = (force + np.array([0.0, -self.stiffness, -self.damping, 1.0])) / m
        B1 = np.array([[slow, 0.0], [0.0, 0.0], [c * slow / m, 0.0], [0.0, 0.0]])
        B2 = np.array([[0.0], [0.0], [0.0], [quick]])
        tool, climb = np.eye(4)[1], np.eye(4)[2]
        return GeneralizedPlant.from_matrices(
            A,
            B1,
            B2,
            np.array([force, tool, [1.0, -1.0, 0.0, 0.0]]),
            np.array([force, tool, climb]),
            D11=np.array([[c * slow, 0.0], [0.0, 0.0], [0.0, 0.0]]),
            D21=np.array([[c * slow, 1.0], [0.0, 0.0], [0.0, 0.0]]),
            states=["s", "z", "dz", "a"],
            disturbances=["surface", "force_noise"],
            controls=["push"],
            performance=["force_error", "tool", "gap"],
            measurements=["force", "height", "climb"],
            units={
                "s": "m", "z": "m", "dz": "m/s", "a": "N", "surface": "m", "force_noise": "N",
                "push": "N", "force_error": "N", "tool": "m", "gap": "m", "force": "N",
                "height": "m", "climb": "m/s",
            },
        )  # fmt: skip
