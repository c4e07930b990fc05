"""The plant of robust control: disturbance and control in, performance and measurement out."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.arrays import Matrix
from robustpolish.display import Card, Displayed, quantities
from robustpolish.models.plant.blocks import (
    PlantBlocks,
    closed_loop,
    named_system,
    static_controller,
)
from robustpolish.models.plant.file import plant_arguments, plant_content
from robustpolish.saved_file import read_saved, write_saved
from robustpolish.validation import invalid, matrix, square, state_space


@dataclass(frozen=True, eq=False, init=False, repr=False)
class GeneralizedPlant(PlantBlocks, Displayed):
    r"""A state-space system whose signals are sorted into w, u, z and y.

    ::

                 +-----------------------+
        w  ----->|  x' = A x  + B1 w  + B2 u |-----> z
                 |  z  = C1 x + D11 w + D12 u |
        u  ----->|  y  = C2 x + D21 w + D22 u |-----> y
           |     +-----------------------+     |
           |            +---------+            |
           +------------|    K    |<-----------+
                        +---------+

    The disturbances w come before the controls u among the inputs, the
    performance outputs z before the measurements y among the outputs, as in
    ``control.hinfsyn``. The controller is connected with **positive** sign,
    u = K y; a state feedback is u = F x.

    Parameters
    ----------
    system : control.StateSpace
        The whole plant, continuous or discrete; its signal names are kept.
    measurements : int
        Number of measurements y: the last outputs.
    controls : int
        Number of controls u: the last inputs.
    units : mapping of str to str, optional
        Unit of each named signal or state, such as ``{"x": "m"}``.

    Raises
    ------
    InvalidInputError
        If the system is no ``StateSpace``, has entries that are not finite, or
        if the counts do not fit.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> P = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], 0)
    >>> plant = rp.GeneralizedPlant(P, measurements=1, controls=1)
    >>> plant.B1, plant.B2
    (array([[1.]]), array([[1.]]))
    >>> rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    Generalised plant, continuous time
      disturbances w (1)  w1
      controls u (1)      u1
      performance z (1)   z1
      measurements y (1)  y1
      states x (1)        x1

    What is measured and what is judged can be changed, and loops be closed:

    >>> plant.with_full_state().measurement_names, plant.with_control_outputs().nz
    (('measured_x[0]',), 2)
    >>> loops = plant.closed_loop([[-2.0]]), plant.state_feedback_loop([[-2.0]])
    >>> [float(loop.A[0, 0]) for loop in loops]
    [-3.0, -3.0]
    >>> plant.static_controller([[-2.0]]).input_labels
    ['y[1]']
    """

    system: control.StateSpace
    measurements: int
    controls: int
    units: Mapping[str, str] = field(default_factory=dict)

    def __init__(
        self,
        system: control.StateSpace,
        measurements: int,
        controls: int,
        units: Mapping[str, str] | None = None,
    ) -> None:
        state_space("system", system)
        _count("measurements", measurements, system.noutputs, "outputs")
        _count("controls", controls, system.ninputs, "inputs")
        object.__setattr__(self, "system", system)
        object.__setattr__(self, "measurements", int(measurements))
        object.__setattr__(self, "controls", int(controls))
        object.__setattr__(self, "units", MappingProxyType(dict(units or {})))
        known = _labels(system)
        for name in self.units:
            if name not in known:
                raise invalid("units", name, "names of signals or states", "Check its spelling.")

    @classmethod
    def from_matrices(
        cls,
        A: ArrayLike,
        B1: ArrayLike,
        B2: ArrayLike,
        C1: ArrayLike,
        C2: ArrayLike,
        D11: ArrayLike | None = None,
        D12: ArrayLike | None = None,
        D21: ArrayLike | None = None,
        D22: ArrayLike | None = None,
        *,
        dt: float | bool = 0,
        states: Sequence[str] | None = None,
        disturbances: Sequence[str] | None = None,
        controls: Sequence[str] | None = None,
        performance: Sequence[str] | None = None,
        measurements: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> GeneralizedPlant:
        """Build a plant from its nine matrices; a D that is not given is zero.

        Parameters
        ----------
        A, B1, B2, C1, C2 : array_like
            Shapes (nx, nx), (nx, nw), (nx, nu), (nz, nx), (ny, nx).
        D11, D12, D21, D22 : array_like, optional
            Shapes (nz, nw), (nz, nu), (ny, nw), (ny, nu).
        dt : float or True, optional
            Sampling time in s; 0 is continuous time, True discrete without a unit.
        states, disturbances, controls, performance, measurements : sequence of str, optional
            Names of x, w, u, z and y; w1, w2, ... and so on by default.
        units : mapping of str to str, optional
            Unit of each named signal or state.

        Returns
        -------
        GeneralizedPlant

        Raises
        ------
        InvalidInputError
            If a matrix does not fit the others, or a list of names its matrix.
        """
        A = square("A", A)
        nx = A.shape[0]
        B1, B2 = matrix("B1", B1, (nx, None)), matrix("B2", B2, (nx, None))
        C1, C2 = matrix("C1", C1, (None, nx)), matrix("C2", C2, (None, nx))
        nw, nu, nz, ny = B1.shape[1], B2.shape[1], C1.shape[0], C2.shape[0]

        def feedthrough(name: str, value: ArrayLike | None, rows: int, columns: int) -> Matrix:
            shape = (rows, columns)
            return np.zeros(shape) if value is None else matrix(name, value, shape)

        D = np.block(
            [
                [feedthrough("D11", D11, nz, nw), feedthrough("D12", D12, nz, nu)],
                [feedthrough("D21", D21, ny, nw), feedthrough("D22", D22, ny, nu)],
            ]
        )
        inputs = [
            *_names("disturbances", disturbances, nw, "w"),
            *_names("controls", controls, nu, "u"),
        ]
        outputs = [
            *_names("performance", performance, nz, "z"),
            *_names("measurements", measurements, ny, "y"),
        ]
        B, C, x = np.hstack([B1, B2]), np.vstack([C1, C2]), _names("states", states, nx, "x")
        system = named_system((A, B, C, D), dt, inputs, outputs, x)
        return cls(system, measurements=ny, controls=nu, units=units)

    def replace(
        self, *, units: Mapping[str, str] | None = None, **changes: Any
    ) -> GeneralizedPlant:
        """Return the plant with some matrices, names or units changed; all others are kept.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units of some signals or states. Those of the others stay as long as there is a
            signal or state of the name.
        **changes : array_like, float or sequence of str
            Other arguments of :meth:`from_matrices` by name: A, B1, ..., D22, dt, states,
            disturbances, controls, performance and measurements. A D of zeros that is not given
            takes the new size; names are needed where their number changes.

        Returns
        -------
        GeneralizedPlant

        Raises
        ------
        InvalidInputError
            If a matrix does not fit the others, a list of names its matrix, or if a unit is that
            of an unknown name.
        TypeError
            If :meth:`from_matrices` has no such argument.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.air_bearing()
        >>> pushed = plant.replace(B1=plant.B1[:, :1], disturbances=["F_x"])
        >>> pushed.nw, pushed.nz, pushed.units["F_x"], pushed.units["x_m"]
        (1, 6, 'N', 'm')
        """
        feedthroughs = {name: getattr(self, name) for name in ("D11", "D12", "D21", "D22")}
        own = {
            **{name: getattr(self, name) for name in ("A", "B1", "B2", "C1", "C2")},
            **{name: D for name, D in feedthroughs.items() if D.any()},
            "dt": self.dt,
            "states": self.states,
            "disturbances": self.disturbance_names,
            "controls": self.control_names,
            "performance": self.performance_names,
            "measurements": self.measurement_names,
        }
        plant = GeneralizedPlant.from_matrices(**{**own, **changes})
        return self._with_units_of(plant.system, plant.ny, plant.nu, units)

    def _with_units_of(
        self,
        system: control.StateSpace,
        measurements: int,
        controls: int,
        units: Mapping[str, str] | None = None,
    ) -> GeneralizedPlant:
        """Return another system with this plant's units where a name is the same."""
        known = _labels(system)
        kept = {name: unit for name, unit in self.units.items() if name in known}
        return GeneralizedPlant(system, measurements, controls, {**kept, **(units or {})})

    def part(
        self,
        *,
        states: Sequence[int] | None = None,
        disturbances: Sequence[int] | None = None,
        controls: Sequence[int] | None = None,
        performance: Sequence[int] | None = None,
        measurements: Sequence[int] | None = None,
    ) -> GeneralizedPlant:
        """Return the plant of some of the states and signals, in the given order.

        Parameters
        ----------
        states, disturbances, controls, performance, measurements : sequence of int, optional
            Positions of what stays; all by default.

        Returns
        -------
        GeneralizedPlant

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.air_bearing().part(disturbances=[0], performance=[1, 0]).performance_names
        ('x', 'x_m')
        """
        x = list(range(self.nx) if states is None else states)
        w = list(range(self.nw) if disturbances is None else disturbances)
        u = list(range(self.nu) if controls is None else controls)
        z = list(range(self.nz) if performance is None else performance)
        y = list(range(self.ny) if measurements is None else measurements)
        ins, outs = [*w, *(self.nw + i for i in u)], [*z, *(self.nz + i for i in y)]
        whole = self.system
        A, B, C, D = (self._matrix(name) for name in "ABCD")
        part = named_system(
            (A[np.ix_(x, x)], B[np.ix_(x, ins)], C[np.ix_(outs, x)], D[np.ix_(outs, ins)]),
            self.dt,
            [whole.input_labels[i] for i in ins],
            [whole.output_labels[i] for i in outs],
            [whole.state_labels[i] for i in x],
        )
        return self._with_units_of(part, len(y), len(u))

    @property
    def open_loop(self) -> control.StateSpace:
        """The system from w to z with u = 0."""
        matrices = (self.A, self.B1, self.C1, self.D11)
        names = (self.disturbance_names, self.performance_names, self.states)
        return named_system(matrices, self.dt, *names)

    def closed_loop(self, controller: control.StateSpace | ArrayLike) -> control.StateSpace:
        """Connect u = K y and return the system from w to z.

        Parameters
        ----------
        controller : control.StateSpace or array_like
            K: a system with ny inputs and nu outputs, or a gain of shape (nu, ny).

        Returns
        -------
        control.StateSpace
            The lower linear fractional transformation of plant and controller;
            its states are those of the plant, then those of the controller.

        Raises
        ------
        InvalidInputError
            If shapes or sampling times differ, or if I - D22 Dk is singular, so
            that the loop has no solution.
        """
        return closed_loop(self, controller)

    def state_feedback_loop(self, gain: ArrayLike) -> control.StateSpace:
        """Connect u = F x, whatever is measured, and return the system from w to z.

        Parameters
        ----------
        gain : array_like, shape (nu, nx)
            F; the thesis's D_c of (10.8) with C = I.

        Returns
        -------
        control.StateSpace
        """
        return self.with_full_state().closed_loop(matrix("gain", gain, (self.nu, self.nx)))

    def with_full_state(self) -> GeneralizedPlant:
        """Return the same plant with y = x, for state feedback."""
        return self.replace(
            C2=np.eye(self.nx),
            D21=np.zeros((self.nx, self.nw)),
            D22=np.zeros((self.nx, self.nu)),
            measurements=[f"measured_{name}" for name in self.states],
        )

    def with_control_outputs(self) -> GeneralizedPlant:
        """Return the same plant with u appended to z, so that the loop shows the effort."""
        return self.replace(
            C1=np.vstack([self.C1, np.zeros((self.nu, self.nx))]),
            D11=np.vstack([self.D11, np.zeros((self.nu, self.nw))]),
            D12=np.vstack([self.D12, np.eye(self.nu)]),
            performance=[*self.performance_names, *self.control_names],
        )

    def static_controller(self, gain: ArrayLike) -> control.StateSpace:
        """Return u = K y as a system without states, with the plant's signal names.

        Parameters
        ----------
        gain : array_like, shape (nu, ny)
            K.

        Returns
        -------
        control.StateSpace
        """
        return static_controller(self, gain)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the plant to one JSON file, whole or not at all.

        Parameters
        ----------
        path : path
            Ends in ``.json``; its folder has to exist.
        force : bool, optional
            Replace an existing file.

        Raises
        ------
        InvalidInputError
            If the file exists and `force` is not set, or it cannot be written there.

        Examples
        --------
        >>> import os, tempfile
        >>> import robustpolish as rp
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     rp.air_bearing().save(os.path.join(folder, "plant.json"))
        ...     rp.GeneralizedPlant.load(os.path.join(folder, "plant.json")).nx
        12
        """
        write_saved(path, "plant", plant_content(self), force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> GeneralizedPlant:
        """Read a plant from a file that :meth:`save` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        GeneralizedPlant

        Raises
        ------
        InvalidInputError
            If it is no such file; the message names the key that is wrong.

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.GeneralizedPlant.load("missing.json")
        Traceback (most recent call last):
        ...
        robustpolish.errors.InvalidInputError: path: got missing.json (No such file or directory)...
        """
        return cls(*plant_arguments(read_saved(path, "plant")))

    def _card(self) -> Card:
        time = f"discrete time, step {self.dt}" if self.is_discrete else "continuous time"
        groups = (
            ("disturbances w", self.disturbance_names),
            ("controls u", self.control_names),
            ("performance z", self.performance_names),
            ("measurements y", self.measurement_names),
            ("states x", self.states),
        )
        rows = [(f"{group} ({len(names)})", self._listed(names)) for group, names in groups]
        return Card(f"Generalised plant, {time}", (quantities(*rows),))

    def _listed(self, names: Sequence[str]) -> str:
        """Join names, those of a common unit followed by the unit."""
        by_unit: dict[str, list[str]] = {}
        for name in names:
            by_unit.setdefault(self.units.get(name, ""), []).append(name)
        groups = [
            ", ".join(alike) + (f" [{unit}]" if unit else "") for unit, alike in by_unit.items()
        ]
        return "; ".join(groups)


def _labels(system: control.StateSpace) -> set[str]:
    return {*system.input_labels, *system.output_labels, *system.state_labels}


def _count(argument: str, value: Any, available: int | None, what: str) -> None:
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not 0 <= value <= (available or 0):
        raise invalid(
            argument,
            value,
            f"a whole number from 0 to {available}, the system's number of {what}",
            f"Count the {what} at the end of the list.",
        )


def _names(argument: str, given: Sequence[str] | None, count: int, letter: str) -> list[str]:
    if given is None:
        return [f"{letter}{i + 1}" for i in range(count)]
    if isinstance(given, str) or len(given) != count or len(set(given)) != count:
        raise invalid(argument, given, f"{count} different names", "Name each signal once.")
    return list(given)
