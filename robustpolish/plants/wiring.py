"""The plant as it is wired: what surgery on its signals does to matrices, delay lines included.

Signals are w, u, z and y, as in `PlantBlocks`. The ends of delay lines are further signals: they
stand last among w and last among z, so that closing the loop and closing the delays commute.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import control
import numpy as np

from robustpolish.base.arrays import Matrix
from robustpolish.linear.delayed_systems import DelayedSystem, DelayLine
from robustpolish.plants.blocks import PlantBlocks, chosen_signals, matrices_of, named_system

Side = Literal["input", "output"]


@dataclass(frozen=True, eq=False)
class Wiring(PlantBlocks):
    """A plant whose delays are lines between further signals, not approximated.

    Attributes
    ----------
    system : control.StateSpace
        From (w, ends of lines, u) to (z, beginnings of lines, y).
    measurements, controls : int
        Number of last outputs that are y and of last inputs that are u.
    lines : tuple of DelayLine
        None for a plant without delays.
    units : mapping of str to str
        Not used here: a plant holds them.
    """

    system: control.StateSpace
    measurements: int
    controls: int
    lines: tuple[DelayLine, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def series(self, side: Side, at: int, filter: control.StateSpace, label: str) -> Wiring:
        """Put a filter before inputs, as many as it has outputs, or behind outputs.

        Parameters
        ----------
        side : {"input", "output"}
        at : int
            Where the first signal stands among all.
        filter : control.StateSpace
            With as many inputs as outputs.
        label : str
            What its states are called, with a number behind.

        Returns
        -------
        Wiring
        """
        A, B, C, D = _seen_from(side, self.arrays())
        a, b, c, d = _seen_from(side, matrices_of(filter))
        n, k, own = len(A), len(a), slice(at, at + len(d))
        whole = np.block([[A, B[:, own] @ c], [np.zeros((k, n)), a]])
        C = np.hstack([C, D[:, own] @ c])
        B = np.vstack([B, np.zeros((k, B.shape[1]))])
        B[:n, own], B[n:, own], D[:, own] = B[:n, own] @ d, b, D[:, own] @ d
        states = [*self.states, *_new_names(label, k, self.states)]
        return self._with(_seen_from(side, (whole, B, C, D)), states=states)

    def delayed(self, side: Side, at: int, line: DelayLine) -> Wiring:
        """Lead an input or an output through a delay line.

        Parameters
        ----------
        side : {"input", "output"}
        at : int
            Where the signal stands among all.
        line : DelayLine

        Returns
        -------
        Wiring
        """
        A, B, C, D = _seen_from(side, self.arrays())
        w, z = (self.nw, self.nz) if side == "input" else (self.nz, self.nw)
        # What acted was the input; it is the line's end now, and the input enters the line.
        B, D = np.insert(B, w, B[:, at], axis=1), np.insert(D, w, D[:, at], axis=1)
        at += at >= w
        B[:, at], D[:, at] = 0.0, 0.0
        C, D = np.insert(C, z, 0.0, axis=0), np.insert(D, z, 0.0, axis=0)
        D[z, at] = 1.0
        port = f"delay {len(self.lines) + 1}"
        ins, outs = list(self.system.input_labels), list(self.system.output_labels)
        ins.insert(self.nw, port)
        outs.insert(self.nz, port)
        wired = self._with(_seen_from(side, (A, B, C, D)), ins, outs)
        return replace(wired, lines=(*self.lines, line))

    def with_disturbances(self, onto_measurements: Matrix, names: Sequence[str]) -> Wiring:
        """Append disturbances that act on the measurements.

        Parameters
        ----------
        onto_measurements : ndarray, shape (ny, len(names))
        names : sequence of str

        Returns
        -------
        Wiring
        """
        A, B, C, D = self.arrays()
        at = self.nw - len(self.lines)
        new = np.vstack([np.zeros((self.nz, len(names))), onto_measurements])
        B = np.hstack([B[:, :at], np.zeros((len(B), len(names))), B[:, at:]])
        D = np.hstack([D[:, :at], new, D[:, at:]])
        labels = self.system.input_labels
        return self._with((A, B, C, D), [*labels[:at], *_free(names, labels), *labels[at:]])

    def with_inputs_twice(self, names: Sequence[str]) -> Wiring:
        """Prepend disturbances that act where the controls act."""
        A, B, C, D = self.arrays()
        B, D = np.hstack([B[:, self.nw :], B]), np.hstack([D[:, self.nw :], D])
        return self._with((A, B, C, D), [*names, *self.system.input_labels])

    def with_performance(
        self, of_measurements: Matrix, of_controls: Matrix, names: Sequence[str]
    ) -> Wiring:
        """Append performance outputs made of measurements and controls.

        Parameters
        ----------
        of_measurements : ndarray, shape (len(names), ny)
        of_controls : ndarray, shape (len(names), nu)
        names : sequence of str

        Returns
        -------
        Wiring
        """
        A, B, C, D = self.arrays()
        at = self.nz - len(self.lines)
        rows = of_measurements @ C[self.nz :]
        direct = of_measurements @ D[self.nz :]
        direct[:, self.nw :] += of_controls
        C, D = (np.insert(M, [at] * len(names), new, axis=0) for M, new in ((C, rows), (D, direct)))
        labels = self.system.output_labels
        outs = [*labels[:at], *_free(names, labels), *labels[at:]]
        return self._with((A, B, C, D), None, outs)

    def chosen(
        self, w: Sequence[int], u: Sequence[int], z: Sequence[int], y: Sequence[int]
    ) -> Wiring:
        """Return the wiring of some signals, in the given order, with all delay lines."""
        k = len(self.lines)
        ins = [*w, *range(self.nw - k, self.nw), *(self.nw + i for i in u)]
        outs = [*z, *range(self.nz - k, self.nz), *(self.nz + i for i in y)]
        return Wiring(chosen_signals(self.system, outs, ins), len(y), len(u), self.lines)

    def renamed(
        self, w: Sequence[str], u: Sequence[str], z: Sequence[str], y: Sequence[str],
        states: Sequence[str], lines: Mapping[str, str],
    ) -> Wiring:  # fmt: skip
        """Return the same wiring with other names of its signals, states and lines."""
        ports = [f"delay {i + 1}" for i in range(len(self.lines))]
        wired = self._with(self.arrays(), [*w, *ports, *u], [*z, *ports, *y], states)
        named = [replace(line, name=lines.get(line.name, line.name)) for line in self.lines]
        return replace(wired, lines=tuple(named))

    def pade_model(self) -> control.StateSpace:
        """Return the plant from (w, u) to (z, y) with Pade approximations for its delays."""
        return self.with_ports_last().pade_model() if self.lines else self.system

    def with_ports_last(self) -> DelayedSystem:
        """Return the plant from (w, u) to (z, y) with its delays."""
        k, w, z = len(self.lines), self.nw, self.nz
        ins = [*range(w - k), *range(w, w + self.nu), *range(w - k, w)]
        outs = [*range(z - k), *range(z, z + self.ny), *range(z - k, z)]
        return DelayedSystem(chosen_signals(self.system, outs, ins), self.lines)

    def arrays(self) -> Matrices:
        """Copy A, B, C and D as floats of consistent shapes."""
        return matrices_of(self.system)

    def _with(
        self,
        matrices: Matrices,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        states: Sequence[str] | None = None,
    ) -> Wiring:
        ins = self.system.input_labels if inputs is None else inputs
        outs = self.system.output_labels if outputs is None else outputs
        own = self.states if states is None else states
        return replace(self, system=named_system(matrices, self.dt, ins, outs, own))


Matrices = tuple[Matrix, Matrix, Matrix, Matrix]


def _seen_from(side: Side, matrices: Matrices) -> Matrices:
    """Return A, B, C and D, or those of the dual system, whose inputs are the outputs."""
    A, B, C, D = matrices
    if side == "input":
        return matrices
    A, B, C, D = map(np.ascontiguousarray, (A.T, C.T, B.T, D.T))
    return A, B, C, D


def _free(names: Sequence[str], taken: Sequence[str]) -> list[str]:
    """Return names, those that are taken with a number behind."""
    tries = ((name, *(f"{name}_{i}" for i in range(2, len(taken) + 2))) for name in names)
    return [next(one for one in each if one not in taken) for each in tries]


def _new_names(label: str, count: int, taken: Sequence[str]) -> list[str]:
    """Return names that are not taken: label[0], label[1], ... or label_2[0], ..."""
    stems = (label, *(f"{label}_{number}" for number in range(2, len(taken) + 2)))
    tries = ([f"{stem}[{i}]" for i in range(count)] for stem in stems)
    return next(names for names in tries if not set(names) & set(taken))
