"""Mass, damping and stiffness matrices of a mechanical model, and its state space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.models.mechanical.parts import ACCELERATION, DISPLACEMENT, VELOCITY

if TYPE_CHECKING:
    from robustpolish.models.mechanical import MechanicalModel

Matrix = NDArray[np.float64]

NO_INPUT = "no_input"


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
    imposed_signals : tuple of (str, int, str, float)
        Signal name, coordinate, quantity and gain of each column that imposes a motion,
        in the order of the state space's inputs after the forces. A derivative that no
        data column holds is that of the displacement's column, and has its gain.
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
    imposed_signals: tuple[tuple[str, int, str, float], ...]

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the state space's inputs: forces, then imposed motions."""
        return (*self.force_inputs, *(name for name, *_ in self.imposed_signals))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: free displacements, then their velocities."""
        names = [self.coordinates[i] for i in self.free]
        return (*names, *(f"{name}_dot" for name in names))

    def motion_map(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """Return Lq, Lv, and Rq, Rv: the linear motions from states and signals.

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
        return Lq, Lv, Rq, Rv

    def first_order(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """Return A, B, C, D of the first-order form, from `signals` to `outputs`."""
        Lq, Lv, Rq, Rv = self.motion_map()
        n, nf, nw = len(self.coordinates), len(self.free), len(self.signals)
        force = np.hstack([self.B, np.zeros((n, nw - self.B.shape[1]))])
        inverse_mass = 1 / np.diag(self.M)[self.free, None]
        acceleration_s, acceleration_w = np.zeros((n, 2 * nf)), np.zeros((n, nw))
        acceleration_s[self.free] = -inverse_mass * (self.K @ Lq + self.C @ Lv)[self.free]
        acceleration_w[self.free] = inverse_mass * (force - self.K @ Rq - self.C @ Rv)[self.free]
        for column, row, gain in self._imposed_columns(ACCELERATION):
            acceleration_w[row, column] = gain
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
        return control.StateSpace(
            A,
            B,
            C,
            D,
            0,
            inputs=list(signals),
            outputs=list(self.outputs),
            states=list(self.states),
            remove_useless_states=False,
        )

    def _imposed_columns(self, quantity: str) -> list[tuple[int, int, float]]:
        """Column of the signals, coordinate and gain of each imposed motion of one quantity."""
        first = len(self.force_inputs)
        return [
            (first + i, row, gain)
            for i, (_, row, kind, gain) in enumerate(self.imposed_signals)
            if kind == quantity
        ]


def assemble(model: MechanicalModel) -> MechanicalMatrices:
    """Build the matrices of `model` without its effects."""
    index = {name: i for i, name in enumerate(model.dof_names)}
    n = len(index)

    def incidence(pair: Sequence[str]) -> Matrix:
        row = np.zeros(n)
        for name, sign in zip(pair, (1.0, -1.0), strict=True):
            if name in index:
                row[index[name]] += sign
        return row

    M = np.diag([dof.mass for dof in model.dofs])
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for spring in model.springs:
        row = incidence(spring.between)
        K += spring.stiffness * np.outer(row, row)
    for damper in model.dampers:
        row = incidence(damper.between)
        C += damper.damping * np.outer(row, row)
    forces = [item for item in model.inputs if item.imposes is None]
    B = np.array([item.gain * incidence(item.on) for item in forces]).reshape(-1, n).T
    Sq, Sv, Sa = (np.zeros((len(model.outputs), n)) for _ in range(3))
    for i, item in enumerate(model.outputs):
        row = incidence(item.of)
        if item.quantity == DISPLACEMENT:
            Sq[i] = row
        elif item.quantity == VELOCITY:
            Sv[i] = row
        elif item.quantity == ACCELERATION:
            Sa[i] = row
        elif item.drive:
            k = index[item.of[0]]
            Sq[i], Sv[i], Sa[i] = K[k], C[k], M[k]
        else:
            ends = set(item.of)
            Sq[i] = row * sum(s.stiffness for s in model.springs if set(s.between) == ends)
            Sv[i] = row * sum(d.damping for d in model.dampers if set(d.between) == ends)
    imposed = np.array([index[name] for name in model.imposed], dtype=np.intp)
    free = np.array([index[name] for name in model.free], dtype=np.intp)
    return MechanicalMatrices(
        M=M, C=C, K=K, B=B, Sq=Sq, Sv=Sv, Sa=Sa, free=free, imposed=imposed,
        coordinates=model.dof_names,
        force_inputs=tuple(item.name for item in forces),
        outputs=model.output_names,
        imposed_signals=tuple(_imposed_signals(model, index, Sa)),
    )  # fmt: skip


def _imposed_signals(
    model: MechanicalModel, index: dict[str, int], Sa: Matrix
) -> list[tuple[str, int, str, float]]:
    signals = []
    for name in model.imposed:
        given = {item.imposes: item for item in model.inputs if item.imposes and item.on[0] == name}
        base = given[DISPLACEMENT].name
        wanted = [(DISPLACEMENT, base), (VELOCITY, f"{base}_dot")]
        if Sa[:, index[name]].any():
            wanted.append((ACCELERATION, f"{base}_ddot"))
        for quantity, label in wanted:
            item = given.get(quantity, given[DISPLACEMENT])
            label = item.name if quantity in given else label
            while quantity not in given and label in model.input_names:
                label += "_"  # another input has this name already
            signals.append((label, index[name], quantity, item.gain))
    return signals
