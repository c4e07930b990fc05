"""The blocks of a system whose signals are sorted into w, u, z and y, and their names."""

from __future__ import annotations

from collections.abc import Mapping

import control
import numpy as np

from robustpolish.arrays import Matrix


class PlantBlocks:
    """Sizes, matrices and names of a plant, read off its system.

    Attributes
    ----------
    system : control.StateSpace
    measurements, controls : int
        Number of last outputs that are y and of last inputs that are u.
    units : mapping of str to str
        Unit of each named signal or state that has one.
    """

    system: control.StateSpace
    measurements: int
    controls: int
    units: Mapping[str, str]

    @property
    def nx(self) -> int:
        """Number of states."""
        return int(self.system.nstates)

    @property
    def nw(self) -> int:
        """Number of disturbances."""
        return int(self.system.ninputs) - self.controls

    @property
    def nu(self) -> int:
        """Number of controls."""
        return self.controls

    @property
    def nz(self) -> int:
        """Number of performance outputs."""
        return int(self.system.noutputs) - self.measurements

    @property
    def ny(self) -> int:
        """Number of measurements."""
        return self.measurements

    @property
    def A(self) -> Matrix:
        """State matrix, shape (nx, nx)."""
        return self._matrix("A")

    @property
    def B1(self) -> Matrix:
        """Disturbance to state, shape (nx, nw)."""
        return self._matrix("B")[:, : self.nw]

    @property
    def B2(self) -> Matrix:
        """Control to state, shape (nx, nu); the thesis's B."""
        return self._matrix("B")[:, self.nw :]

    @property
    def C1(self) -> Matrix:
        """State to performance, shape (nz, nx)."""
        return self._matrix("C")[: self.nz]

    @property
    def C2(self) -> Matrix:
        """State to measurement, shape (ny, nx); the thesis's C."""
        return self._matrix("C")[self.nz :]

    @property
    def D11(self) -> Matrix:
        """Disturbance to performance, shape (nz, nw); the thesis's D1."""
        return self._matrix("D")[: self.nz, : self.nw]

    @property
    def D12(self) -> Matrix:
        """Control to performance, shape (nz, nu)."""
        return self._matrix("D")[: self.nz, self.nw :]

    @property
    def D21(self) -> Matrix:
        """Disturbance to measurement, shape (ny, nw)."""
        return self._matrix("D")[self.nz :, : self.nw]

    @property
    def D22(self) -> Matrix:
        """Control to measurement, shape (ny, nu)."""
        return self._matrix("D")[self.nz :, self.nw :]

    @property
    def dt(self) -> float | bool:
        """Sampling time in s; 0 in continuous time."""
        return 0 if self.system.dt is None else self.system.dt

    @property
    def is_discrete(self) -> bool:
        """Whether the plant is a discrete-time system."""
        return self.dt != 0

    @property
    def states(self) -> tuple[str, ...]:
        """Names of x."""
        return tuple(self.system.state_labels)

    @property
    def disturbance_names(self) -> tuple[str, ...]:
        """Names of w."""
        return tuple(self.system.input_labels[: self.nw])

    @property
    def control_names(self) -> tuple[str, ...]:
        """Names of u."""
        return tuple(self.system.input_labels[self.nw :])

    @property
    def performance_names(self) -> tuple[str, ...]:
        """Names of z."""
        return tuple(self.system.output_labels[: self.nz])

    @property
    def measurement_names(self) -> tuple[str, ...]:
        """Names of y."""
        return tuple(self.system.output_labels[self.nz :])

    def _matrix(self, name: str) -> Matrix:
        """Copy A, B, C or D of the system."""
        return np.array(getattr(self.system, name))
