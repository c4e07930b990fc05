"""Mass, damping and stiffness matrices of a mechanical model, and its state space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import Matrix
from robustpolish.models.mechanical.parts import (
    ACCELERATION,
    DISPLACEMENT,
    VELOCITY,
    CoupledInertia,
    Damper,
    Dof,
    Input,
    Output,
    Spring,
    imposed_by,
    mass_matrix,
)
from robustpolish.models.plant.blocks import named_system

NO_INPUT = "no_input"


_Four = tuple[Matrix, Matrix, Matrix, Matrix]


class ImposedSignal(NamedTuple):
    """A signal that imposes displacement, velocity or acceleration of a coordinate.

    Attributes
    ----------
    name : str
        Of the signal; a data column, or what the derivative of one is called.
    coordinate : int
        Position of the coordinate that is moved.
    quantity : str
    gain : float
    source : str
        Name of the input that the signal is, or that it is a derivative of.
    """

    name: str
    coordinate: int
    quantity: str
    gain: float
    source: str


@dataclass(frozen=True, eq=False)
class MechanicalMatrices:
    """The linear part of a mechanical model over its n coordinates.

    ::

        M q'' + C q' + K q = B u
        y = Sq q + Sv q' + Sa q''

    The rows of a force output are in Sq and Sv (and Sa for a driving force). Rows and
    columns of imposed coordinates are kept: `free` and `imposed` hold the positions.

    Attributes
    ----------
    M, C, K : ndarray, shape (n, n)
        Mass, damping and stiffness matrix.
    B : ndarray, shape (n, nu)
        Signals of the force inputs to forces on the coordinates, gains included.
    Sq, Sv, Sa : ndarray, shape (ny, n)
        Displacements, velocities and accelerations to outputs.
    free, imposed : ndarray of int
        Positions of the free and of the imposed coordinates.
    coordinates, force_inputs, outputs : tuple of str
        Names of the rows and columns.
    imposed_signals : tuple of ImposedSignal
        The columns that impose a motion, in the order of the state space's inputs after the
        forces. A derivative that no input gives is that of the displacement's column, and has
        its gain.
    """

    M: Matrix
    C: Matrix
    K: Matrix
    B: Matrix
    Sq: Matrix
    Sv: Matrix
    Sa: Matrix
    free: NDArray[np.intp]
    imposed: NDArray[np.intp]
    coordinates: tuple[str, ...]
    force_inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    imposed_signals: tuple[ImposedSignal, ...]

    @cached_property
    def inverse_mass(self) -> Matrix:
        """Accelerations of the free coordinates from forces on them, ``inv(M[free, free])``.

        Fits ask for it again and again; it is read-only.
        """
        block = self.M[self.free][:, self.free]
        masses = np.diag(block)
        if np.count_nonzero(block) == masses.size:
            found = np.diag(1 / masses)  # as exact as the masses
        else:
            size = np.sqrt(masses)
            found = np.linalg.inv(block / np.outer(size, size)) / np.outer(size, size)
        found.flags.writeable = False
        return found

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the state space's inputs: forces, then imposed motions."""
        return (*self.force_inputs, *(signal.name for signal in self.imposed_signals))

    @property
    def sources(self) -> tuple[str, ...]:
        """Name of the input behind each signal: a derivative belongs to its displacement."""
        return (*self.force_inputs, *(signal.source for signal in self.imposed_signals))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: free displacements, then their velocities."""
        names = [self.coordinates[i] for i in self.free]
        return (*names, *(f"{name}_dot" for name in names))

    @cached_property
    def motion_map(self) -> _Four:
        """Lq, Lv, and Rq, Rv: the linear motions from states and signals, read-only.

        ``q = Lq s + Rq w`` and ``q' = Lv s + Rv w`` with the states s and the signals w.
        """
        n, nf, nw = len(self.coordinates), len(self.free), len(self.signals)
        Lq, Lv = np.zeros((n, 2 * nf)), np.zeros((n, 2 * nf))
        Lq[self.free, np.arange(nf)] = 1
        Lv[self.free, nf + np.arange(nf)] = 1
        Rq, Rv = np.zeros((n, nw)), np.zeros((n, nw))
        for column, row, gain in self._imposed_columns(DISPLACEMENT):
            Rq[row, column] = gain
        for column, row, gain in self._imposed_columns(VELOCITY):
            Rv[row, column] = gain
        for part in (Lq, Lv, Rq, Rv):
            part.flags.writeable = False
        return Lq, Lv, Rq, Rv

    def first_order(self) -> _Four:
        """Return A, B, C, D of the first-order form, from `signals` to `outputs`."""
        A, B, C, D = self._first_order
        return A.copy(), B.copy(), C.copy(), D.copy()

    @cached_property
    def _first_order(self) -> _Four:
        Lq, Lv, Rq, Rv = self.motion_map
        n, nf, nw = len(self.coordinates), len(self.free), len(self.signals)
        force = np.hstack([self.B, np.zeros((n, nw - self.B.shape[1]))])
        inverse_mass = self.inverse_mass
        acceleration_s, acceleration_w = np.zeros((n, 2 * nf)), np.zeros((n, nw))
        for column, row, gain in self._imposed_columns(ACCELERATION):
            acceleration_w[row, column] = gain
        imposed = self.M[self.free][:, self.imposed] @ acceleration_w[self.imposed]
        pushed = (force - self.K @ Rq - self.C @ Rv)[self.free] - imposed
        acceleration_s[self.free] = -inverse_mass @ (self.K @ Lq + self.C @ Lv)[self.free]
        acceleration_w[self.free] = inverse_mass @ pushed
        return (
            np.vstack([Lv[self.free], acceleration_s[self.free]]),
            np.vstack([np.zeros((nf, nw)), acceleration_w[self.free]]),
            self.Sq @ Lq + self.Sv @ Lv + self.Sa @ acceleration_s,
            self.Sq @ Rq + self.Sv @ Rv + self.Sa @ acceleration_w,
        )

    def state_space(self) -> control.StateSpace:
        """Return the system from the signals to the outputs.

        python-control knows no system with states and outputs but without inputs; a model that
        decays freely gets an input ``"no_input"`` that does nothing.
        """
        A, B, C, D = self.first_order()
        signals = self.signals
        if not signals:
            B, D, signals = np.zeros((len(A), 1)), np.zeros((len(C), 1)), (NO_INPUT,)
        return named_system((A, B, C, D), 0, signals, self.outputs, self.states)

    def _imposed_columns(self, quantity: str) -> list[tuple[int, int, float]]:
        """Column of the signals, coordinate and gain of each imposed motion of one quantity."""
        first = len(self.force_inputs)
        return [
            (first + i, signal.coordinate, signal.gain)
            for i, signal in enumerate(self.imposed_signals)
            if signal.quantity == quantity
        ]


def incidence(names: Sequence[str], pair: Sequence[str]) -> Matrix:
    """Return the row that gives the relative displacement of a pair from all coordinates."""
    row = np.zeros(len(names))
    for name, sign in zip(pair, (1.0, -1.0), strict=False):
        if name in names:
            row[names.index(name)] += sign
    return row


def assemble(
    dofs: Sequence[Dof],
    springs: Sequence[Spring],
    dampers: Sequence[Damper],
    inputs: Sequence[Input],
    outputs: Sequence[Output],
    coupled_inertias: Sequence[CoupledInertia] = (),
) -> MechanicalMatrices:
    """Build the matrices of checked parts, without effects."""
    names = tuple(dof.name for dof in dofs)
    n = len(names)
    M = mass_matrix(dofs, coupled_inertias)
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for spring in springs:
        row = incidence(names, spring.between)
        K += spring.stiffness * np.outer(row, row)
    for damper in dampers:
        row = incidence(names, damper.between)
        C += damper.damping * np.outer(row, row)
    forces = [item for item in inputs if item.imposes is None]
    B = np.array([item.gain * incidence(names, item.on) for item in forces]).reshape(-1, n).T
    Sq, Sv, Sa = (np.zeros((len(outputs), n)) for _ in range(3))
    for i, item in enumerate(outputs):
        row = incidence(names, item.of) if item.weights is None else np.zeros(n)
        for name, weight in zip(item.of, item.weights or (), strict=False):
            row[names.index(name)] = weight
        if item.quantity == DISPLACEMENT:
            Sq[i] = row
        elif item.quantity == VELOCITY:
            Sv[i] = row
        elif item.quantity == ACCELERATION:
            Sa[i] = row
        elif item.drive:
            k = names.index(item.of[0])
            Sq[i], Sv[i], Sa[i] = K[k], C[k], M[k]
        else:
            ends = set(item.of)
            Sq[i] = row * sum(s.stiffness for s in springs if set(s.between) == ends)
            Sv[i] = row * sum(d.damping for d in dampers if set(d.between) == ends)
    moved = imposed_by(inputs)
    imposed = np.array([i for i, name in enumerate(names) if name in moved], dtype=np.intp)
    free = np.array([i for i, name in enumerate(names) if name not in moved], dtype=np.intp)
    return MechanicalMatrices(
        M=M, C=C, K=K, B=B, Sq=Sq, Sv=Sv, Sa=Sa, free=free, imposed=imposed,
        coordinates=names,
        force_inputs=tuple(item.name for item in forces),
        outputs=tuple(item.name for item in outputs),
        imposed_signals=tuple(
            _imposed_signals(inputs, names, imposed.tolist(), np.vstack([Sa, M[free]]))
        ),
    )  # fmt: skip


def _imposed_signals(
    inputs: Sequence[Input], names: Sequence[str], imposed: Sequence[int], used: Matrix
) -> list[ImposedSignal]:
    taken = {item.name for item in inputs}
    signals = []
    for i in imposed:
        given = {item.imposes: item for item in inputs if item.imposes and item.on[0] == names[i]}
        base = given[DISPLACEMENT]
        wanted = [(DISPLACEMENT, base.name), (VELOCITY, f"{base.name}_dot")]
        if used[:, i].any():  # by an output, or by what an inertia couples to it
            wanted.append((ACCELERATION, f"{base.name}_ddot"))
        for quantity, label in wanted:
            item = given.get(quantity, base)
            label = item.name if quantity in given else label
            while quantity not in given and label in taken:
                label += "_"  # another input has this name already
            signals.append(ImposedSignal(label, i, quantity, item.gain, item.name))
    return signals
