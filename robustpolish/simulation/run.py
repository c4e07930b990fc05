"""Run a mechanical model with its physical effects over samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from robustpolish.arrays import Array
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.parts import DISPLACEMENT
from robustpolish.simulation.between import Lines, lines_through
from robustpolish.simulation.kernel import run_pieces, run_steps
from robustpolish.simulation.signals import lines, measured, raw_outputs, signals
from robustpolish.simulation.step import Ahead
from robustpolish.simulation.system import NonlinearSystem, build_system, needed_substeps
from robustpolish.validation import matrix


class NonlinearResponse(NamedTuple):
    """Outputs (samples, ny), states (samples, n) and internal states of effects (samples, nz)."""

    outputs: Array
    states: Array
    internal: Array


class Course(NamedTuple):
    """Pieces of record that follow each other in the arrays, and what acts on a machine there.

    Attributes
    ----------
    begin, end : ndarray, shape (samples, signals)
        Signals at the ends of the line over the step after each sample.
    beside : ndarray, shape (samples, signals), or None
        What signals are at the samples, more than at the beginning of those lines; None if nowhere.
    time : ndarray, shape (samples,)
        In s.
    marks : ndarray of int, shape (pieces + 1,)
        Where pieces begin and end.
    """

    begin: Array
    end: Array
    beside: Array | None
    time: Array
    marks: NDArray[np.int64]

    @classmethod
    def of(
        cls, inputs: Array, lines: Lines | None, time: Array, marks: NDArray[np.int64]
    ) -> Course:
        """Return a course of signals at the samples, linear between them unless lines are given."""
        begin, end = lines_through(inputs) if lines is None else lines
        beside = None if lines is None else inputs - begin
        begin, end, time = (np.ascontiguousarray(part) for part in (begin, end, time))
        return cls(begin, end, beside, time, marks)


@dataclass(frozen=True, eq=False)
class Stepper:
    """Steps a model over samples, freely or led by data, as often as wanted.

    Parameters
    ----------
    model : MechanicalData
        Its effects on outputs are applied to what comes out.
    system : NonlinearSystem
        Of the model, built for ``step / substeps``; it may have more states.
    step : float
        Time between samples in s.
    substeps : int
        Steps of the integration per sample.
    """

    model: MechanicalData
    system: NonlinearSystem
    step: float
    substeps: int

    @cached_property
    def matrices(self) -> Ahead:
        """Matrices of a substep."""
        return self.system.steps(self.step / self.substeps)

    def over(
        self,
        inputs: Array,
        state: Array,
        internal: Array,
        time: Array,
        led_by: Array | None = None,
        gain: Array | None = None,
        keep: bool = True,
        lines: Lines | None = None,
    ) -> NonlinearResponse:
        """Return outputs as the sensors show them, states and internal states.

        Parameters
        ----------
        inputs : ndarray, shape (samples, signals)
            See :func:`robustpolish.simulation.signals.signals`.
        state, internal : ndarray, shapes (n,) and (nz,)
            At the first sample.
        time : ndarray, shape (samples,)
            In s.
        led_by, gain : ndarray, shapes (samples, ny) and (n, ny), optional
            Measured outputs, and what of the prediction error is added to the states after every
            sample; a free run by default.
        keep : bool, optional
            Whether states are kept; otherwise they have no samples.
        lines : Lines, optional
            What the inputs do between the samples, see
            :func:`robustpolish.simulation.signals.lines`; linear by default.

        Returns
        -------
        NonlinearResponse
        """
        system = self.system
        ny = len(system.C)
        course = Course.of(inputs, lines, time, np.array([0, time.size]))
        seen = self._beside(course)
        Y = np.zeros((1, ny)) if led_by is None else raw_outputs(self.model, led_by, time) - seen
        K = np.zeros((system.states, ny)) if gain is None else gain
        outputs, states, inner = run_steps(
            self.matrices, (system.C, system.D, system.H), system.addresses,
            system.layout, system.values, course.begin, course.end, Y, K,
            np.ascontiguousarray(state), np.ascontiguousarray(internal), time[0], self.step,
            self.substeps, keep,
        )  # fmt: skip
        return NonlinearResponse(measured(self.model, outputs + seen, time), states, inner)

    def over_pieces(
        self, course: Course, starts: Array, internal: Array, keep: bool = False
    ) -> NonlinearResponse:
        """Return what :meth:`over` does freely, of pieces that follow each other in the arrays.

        Parameters
        ----------
        course : Course
        starts, internal : ndarray, shapes (pieces, n) and (pieces, nz)
            At the first sample of each piece.
        keep : bool, optional
            Whether states are kept; otherwise they have no samples.

        Returns
        -------
        NonlinearResponse
        """
        system, time, marks = self.system, course.time, course.marks
        outputs, states, inner = run_pieces(
            self.matrices, (system.C, system.D, system.H), system.addresses,
            system.layout, system.values, course.begin, course.end,
            np.ascontiguousarray(starts), np.ascontiguousarray(internal),
            time[marks[:-1]], marks, self.step, self.substeps, keep,
        )  # fmt: skip
        seen = self._beside(course)
        return NonlinearResponse(measured(self.model, outputs + seen, time), states, inner)

    def _beside(self, course: Course) -> Array | float:
        """Return what outputs see of a sample that is no end of a line.

        An accelerometer sees a held force as it is.
        """
        return 0.0 if course.beside is None else course.beside @ self.system.D.T


def simulate(
    model: MechanicalData,
    data: xr.Dataset,
    initial_state: ArrayLike | None = None,
    internal_state: ArrayLike | None = None,
    substeps: int | None = None,
) -> NonlinearResponse:
    """Run a model freely on measured inputs.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        Uniform ``time`` in s and the model's inputs by name, in SI units. Outputs are used
        only for their amplitude, which decides on substeps.
    initial_state : array_like, shape (n,), optional
        Free displacements, then their velocities; zero by default.
    internal_state : array_like, shape (nz,), optional
        Internal states of the effects; zero by default.
    substeps : int, optional
        Steps per sample; chosen from the effects' stiffness at the amplitude by default, that of
        a first run if no displacement is measured.

    Returns
    -------
    NonlinearResponse

    Raises
    ------
    InvalidInputError
        If an input is missing or a state has the wrong size.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 4.0)],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> data = xr.Dataset(coords={"time": np.arange(101) * 0.01})
    >>> response = simulate(model, data, initial_state=[1.0, 0.0])
    >>> bool(np.allclose(response.outputs[:, 0], np.cos(2 * data.time)))
    True
    """
    time = np.asarray(data["time"].values, dtype=float)
    dt = (time[-1] - time[0]) / max(time.size - 1, 1)

    def stepped(n: int) -> NonlinearResponse:
        stepper = Stepper(model, build_system(model, dt / n), dt, n)
        s0 = _state("initial_state", initial_state, stepper.system.states)
        z0 = _state("internal_state", internal_state, stepper.system.internal)
        W, between = signals(model, data), lines(model, data)
        return stepper.over(W, s0, z0, time, lines=between)

    amplitude = _output_amplitudes(model, data)
    n = substeps or needed_substeps(model, dt, amplitude)
    found = stepped(n)
    if substeps is None and amplitude == 0:
        needed = needed_substeps(model, dt, _state_amplitude(model, found))
        found = found if needed == n else stepped(needed)
    return found


def _state(argument: str, value: ArrayLike | None, size: int) -> Array:
    if value is None:
        return np.zeros(size)
    return matrix(argument, np.reshape(np.asarray(value, dtype=float), (1, -1)), (1, size))[0]


def _output_amplitudes(model: MechanicalData, data: xr.Dataset) -> float:
    """Return the largest displacement amplitude in the data, 0 if none is measured."""
    shown = [
        float(np.percentile(np.abs(data[o.name].values), 99))
        for o in model.outputs
        if o.name in data and o.quantity == DISPLACEMENT
    ]
    return max(shown, default=0.0)


def _state_amplitude(model: MechanicalData, run: NonlinearResponse) -> float:
    """Return the largest displacement amplitude of a run, 0 if it diverges."""
    moved = np.abs(run.states[:, : len(model.free)])
    finite = moved.size > 0 and bool(np.isfinite(moved).all())
    return float(np.max(np.percentile(moved, 99, axis=0))) if finite else 0.0
