"""The plant of robust control: disturbance and control in, performance and measurement out."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base import checks
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.base.saved import Fields, read_saved, write_saved
from robustpolish.linear.systems import DelayLine
from robustpolish.plants import blocks
from robustpolish.plants.wired import WiredPlant, Wiring

# Plants and systems with names in files: as plain values, every entry of a matrix exact.


def plant_content(plant: WiredPlant) -> dict[str, Any]:
    """Return a plant as plain values; where it has delays, with their lines still open."""
    wiring = plant.wiring
    content = {
        "system": system_content(wiring.system),
        "measurements": plant.measurements,
        "controls": plant.controls,
        "units": dict(plant.units),
    }
    if wiring.lines:
        content["lines"] = [vars(line) for line in wiring.lines]
    facts = {key: dict(getattr(plant, key)) for key in _FACTS}
    return content | {key: known for key, known in facts.items() if known}


_FACTS = ("limits", "rate_limits", "delays")
_MATRICES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
_GROUPS = ("states", "disturbances", "controls", "performance", "measurements")


def plant_from(fields: Fields) -> GeneralizedPlant:
    """Return the plant in a file that has been opened; see :meth:`GeneralizedPlant.load`."""
    units = fields.table("units")
    system, counts, edited = system_from(fields.table("system")), [], "The file was edited."
    for key, available in (("measurements", system.noutputs), ("controls", system.ninputs)):
        count = fields.whole(key)
        counts.append(count)
        if not 0 <= count <= available:
            want = f"a whole number from 0 to {available}"
            raise checks.invalid(f"{fields.where}: {key}", count, want, edited)
    lines = tuple(
        DelayLine(line.text("name"), line.number("seconds"), line.whole("order"))
        for line in (fields.tables("lines") if "lines" in fields else ())
    )
    ports = min(system.noutputs - counts[0], system.ninputs - counts[1])
    if len(lines) > ports:
        shown = checks.described(f"{len(lines)} delay lines and {ports} signals for them")
        raise checks.invalid(f"{fields.where}: lines", shown, "one per pair", edited)
    facts: dict[str, Any] = {key: fields.numbers(key) for key in _FACTS if key in fields}
    ny, nu = counts
    named = {name: units.text(name) for name in units}
    wiring = Wiring(system, ny, nu, lines)
    return GeneralizedPlant(system, ny, nu).rewired(wiring, units=named, **facts)


def system_content(system: control.StateSpace) -> dict[str, Any]:
    """Return a system as plain values, every entry of its matrices exact."""
    return {
        **{name: np.asarray(getattr(system, name)) for name in "ABCD"},
        "dt": 0 if system.dt is None else system.dt,
        "states": list(system.state_labels),
        "inputs": list(system.input_labels),
        "outputs": list(system.output_labels),
    }


def system_from(fields: Fields) -> control.StateSpace:
    """Return the system that :func:`system_content` described."""
    inputs, outputs, states = (list(fields.texts(key)) for key in ("inputs", "outputs", "states"))
    n, m, p = len(states), len(inputs), len(outputs)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = [fields.array(name, *shape) for name, shape in shapes.items()]
    for name, entries in zip(shapes, matrices, strict=True):
        checks.matrix(f"{fields.where}: {name}", entries)
    for key, names in (("inputs", inputs), ("outputs", outputs), ("states", states)):
        dotted = key != "states" and any("." in name for name in names)
        if dotted or len(set(names)) < len(names):
            want, remedy = "different names, of signals without dots", "The file was edited."
            raise checks.invalid(f"{fields.where}: {key}", names, want, remedy)
    dt = True if fields.raw("dt") is True else fields.number("dt")
    if not 0 <= dt < math.inf:
        raise checks.invalid(f"{fields.where}: dt", dt, "0, or a sampling time in s", "Correct it.")
    return blocks.named_system(matrices, dt, inputs, outputs, states)


_SQUARED = 1e150
"""Entries whose squares doubles do not hold."""


def check_size(fields: Fields, *systems: control.StateSpace) -> None:
    """Refuse entries with which no loop can be computed, so that no design had them either.

    Raises
    ------
    InvalidInputError
        With the largest of them.
    """
    largest = max(
        float(np.abs(np.asarray(M)).max(initial=0.0)) for s in systems for M in (s.A, s.B, s.C, s.D)
    )
    if largest > _SQUARED:
        shown, remedy = checks.described(f"an entry of size {largest:g}"), "The file was edited."
        raise checks.invalid(fields.where, shown, "entries whose squares are finite", remedy)


@dataclass(frozen=True, eq=False, init=False, repr=False)
class GeneralizedPlant(WiredPlant, Displayed):
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
    system : control.StateSpace, control.TransferFunction or control.FrequencyResponseData
        The whole plant, continuous or discrete; its signal names are kept. A transfer function
        is realised. A frequency response stays one: ``frequency_response`` shows it, and all
        that needs states refuses it. Where delays were added, ``system`` holds their Pade
        approximations.
    measurements : int, str or sequence of str
        Number of measurements y, the last outputs, or the names of one or several outputs, wherever
        they stand. As an attribute, their number.
    controls : int, str or sequence of str
        The same for the controls u among the inputs.
    units : mapping of str to str, optional
        Unit of each named signal or state, such as ``{"x": "m"}``.
    limits : mapping of str to float, optional
        Largest magnitude of some controls, in their units. A fact for those who judge a loop.
    rate_limits : mapping of str to float, optional
        Largest rate of some controls, in their units per second.

    Attributes
    ----------
    delays : mapping of str to float
        Delay of each signal that ``with_delay`` delayed, in s.

    Raises
    ------
    InvalidInputError
        If the system is of another kind, has entries that are not finite, or
        if the counts or names do not fit.

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

    Signals by name are sorted, and a plain system can be put into its loop:

    >>> G = control.tf([1.0], [1.0, 1.0], inputs="F", outputs="x")
    >>> rp.GeneralizedPlant.from_loop(G, units={"F": "N", "x": "m"})
    Generalised plant, continuous time
      disturbances w (2)  disturbance_x [m]; disturbance_F [N]
      controls u (1)      F [N]
      performance z (2)   output_x [m]; effort_F [N]
      measurements y (1)  x [m]
      states x (1)        x[0]
    """

    system: control.StateSpace
    measurements: int
    controls: int
    units: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    rate_limits: Mapping[str, float] = field(default_factory=dict)
    delays: Mapping[str, float] = field(default_factory=dict)
    _wiring: Wiring | None = None

    def __init__(
        self,
        system: control.StateSpace | control.TransferFunction | control.FrequencyResponseData,
        measurements: blocks.SignalChoice,
        controls: blocks.SignalChoice,
        units: Mapping[str, str] | None = None,
        limits: Mapping[str, float] | None = None,
        rate_limits: Mapping[str, float] | None = None,
    ) -> None:
        whole: Any
        if isinstance(system, control.StateSpace):
            whole = checks.state_space("system", system)
        elif (whole := blocks.as_response("system", system)) is None:
            whole = blocks.as_state_space("system", system)
        whole, ny, nu = blocks.sorted_signals(whole, measurements, controls)
        self._set(whole, ny, nu, units=units, limits=limits, rate_limits=rate_limits)

    def _set(
        self, system: Any, ny: int, nu: int, wiring: Wiring | None = None, **facts: Any
    ) -> None:
        """Set the fields, names in the mappings checked."""
        own: dict[str, Any] = {"system": system, "measurements": ny, "controls": nu}
        own["_wiring"] = wiring
        for key in ("units", *_FACTS):
            given = facts.get(key) or {}
            checks.instance_of(key, given, Mapping, "a mapping of names", "Write {name: value}.")
            own[key] = MappingProxyType(dict(given))
        for name, value in own.items():
            object.__setattr__(self, name, value)
        unknown = [name for name in self.units if name not in _labels(system)]
        if unknown:
            want = "names of signals or states"
            raise checks.invalid("units", unknown[0], want, "Check its spelling.")
        for argument in ("limits", "rate_limits"):
            for name, value in own[argument].items():
                checks.one_of(
                    argument, name, self.control_names, "It has to be the name of a control."
                )
                checks.positive((argument, name), value)

    @classmethod
    def _made(cls, *parts: Any, **more: Any) -> GeneralizedPlant:
        plant = object.__new__(cls)
        plant._set(*parts, **more)
        return plant

    def rewired(
        self,
        wiring: Wiring,
        *,
        units: Mapping[str, str] | None = None,
        limits: Mapping[str, float] | None = None,
        rate_limits: Mapping[str, float] | None = None,
        delays: Mapping[str, float] | None = None,
    ) -> GeneralizedPlant:
        """Return the plant with another wiring, whose signals keep their units.

        Parameters
        ----------
        wiring : Wiring
        units, limits, rate_limits, delays : mapping, optional
            Instead of those that are kept.

        Returns
        -------
        GeneralizedPlant

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.air_bearing()
        >>> plant.rewired(plant.wiring).nx
        12
        """
        kept = wiring if wiring.lines else None
        system, ny, nu = wiring.pade_model(), wiring.measurements, wiring.controls
        given = {"units": units, "limits": limits, "rate_limits": rate_limits, "delays": delays}
        told = {key: value for key, value in given.items() if value is not None}
        return self._made(system, ny, nu, kept, **{**self._facts_in(system, nu), **told})

    def _facts_in(
        self, system: control.StateSpace, controls: int, units: Mapping[str, str] | None = None
    ) -> dict[str, Mapping[str, Any]]:
        """Return units, limits and delays of what has the same name in another system."""
        known = _labels(system)
        names = system.input_labels[system.ninputs - controls :]
        kept = {"units": known, "limits": names, "rate_limits": names, "delays": known}
        facts: dict[str, Mapping[str, Any]] = {
            key: {name: value for name, value in getattr(self, key).items() if name in there}
            for key, there in kept.items()
        }
        return {**facts, "units": {**facts["units"], **(units or {})}}

    def without_delays(self) -> GeneralizedPlant:
        """Return the plant whose Pade approximations are all that is known of its delays.

        Returns
        -------
        GeneralizedPlant
            With the same ``system``, and no ``delays``.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[-1]], [[1]], [[1]], [[1]], [[1]])
        >>> plant.with_delay("u1", 0.1).without_delays().delays
        mappingproxy({})
        """
        facts = {key: getattr(self, key) for key in ("units", "limits", "rate_limits")}
        return self._made(self.system, self.measurements, self.controls, **facts)

    @classmethod
    def from_loop(
        cls,
        system: control.StateSpace | control.TransferFunction | GeneralizedPlant,
        *,
        units: Mapping[str, str] | None = None,
    ) -> GeneralizedPlant:
        """Build the plant of a loop from a plain system with inputs u and outputs y.

        Disturbances act at its output, where they are noise or a reference of the other sign, and
        at its input; z shows y and what the controller asks for. With u = K y the loop from w to z
        is then [I; K] (I - G K)^-1 [I, G], which holds all that a loop is judged by: the
        sensitivity S = (I - G K)^-1, K S, S G and K S G.

        Parameters
        ----------
        system : control.StateSpace, control.TransferFunction or GeneralizedPlant
            G. Of a generalised plant, the part from u to y, with its delays, limits and units.
        units : mapping of str to str, optional
            Unit of each named input, output or state.

        Returns
        -------
        GeneralizedPlant
            With disturbances ``disturbance_``, first those at the outputs, and outputs ``output_``
            and ``effort_`` with the names of the signals behind; controls and measurements keep
            theirs.

        Raises
        ------
        InvalidInputError
            If the system is of another kind or a unit is that of an unknown name.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_loop(control.tf([2.0], [1.0, 1.0]))
        >>> plant.D11, plant.D12.T, plant.D21
        (array([[1., 0.],
               [0., 0.]]), array([[0., 1.]]), array([[1., 0.]]))
        """
        if isinstance(system, GeneralizedPlant):
            inner = system
            if units:
                inner = inner.replace(units=units)
        else:
            G = blocks.as_state_space("system", system)
            inner = cls(G, measurements=G.noutputs, controls=G.ninputs, units=units)
        nu, ny = inner.nu, inner.ny
        names = (inner.control_names, inner.measurement_names)
        plain = inner.wiring.chosen([], range(nu), [], range(ny)).with_inputs_twice(
            [f"disturbance_{name}" for name in names[0]]
        )
        plain = plain.with_disturbances(np.eye(ny), [f"disturbance_{name}" for name in names[1]])
        plain = plain.with_performance(
            np.vstack([np.eye(ny), np.zeros((nu, ny))]),
            np.vstack([np.zeros((ny, nu)), np.eye(nu)]),
            [*(f"output_{name}" for name in names[1]), *(f"effort_{name}" for name in names[0])],
        )
        order = [*range(nu, nu + ny), *range(nu)]
        wiring = plain.chosen(order, range(nu), range(ny + nu), range(ny))
        shown_as = ("", "disturbance_", "effort_", "output_")
        known = {f"{prefix}{n}": unit for n, unit in inner.units.items() for prefix in shown_as}
        there = _labels(wiring.system)
        return inner.rewired(wiring, units={n: unit for n, unit in known.items() if n in there})

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
        A = checks.square("A", A)
        nx = A.shape[0]
        B1, B2 = checks.matrix("B1", B1, (nx, None)), checks.matrix("B2", B2, (nx, None))
        C1, C2 = checks.matrix("C1", C1, (None, nx)), checks.matrix("C2", C2, (None, nx))
        nw, nu, nz, ny = B1.shape[1], B2.shape[1], C1.shape[0], C2.shape[0]

        z, y, w, u = slice(nz), slice(nz, None), slice(nw), slice(nw, None)
        parts = ((D11, z, w), (D12, z, u), (D21, y, w), (D22, y, u))
        D = np.zeros((nz + ny, nw + nu))
        for name, (given, rows, columns) in zip(_MATRICES[5:], parts, strict=True):
            if given is not None:
                D[rows, columns] = checks.matrix(name, given, D[rows, columns].shape)
        ins = [
            *_names("disturbances", disturbances, nw, "w"),
            *_names("controls", controls, nu, "u"),
        ]
        outs = _names("performance", performance, nz, "z")
        outs += _names("measurements", measurements, ny, "y")
        B, C, x = np.hstack([B1, B2]), np.vstack([C1, C2]), _names("states", states, nx, "x")
        system = blocks.named_system((A, B, C, D), dt, ins, outs, x)
        return cls._made(system, ny, nu, units=units)

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
        if self._wiring is not None:
            return self._renamed(units, changes)
        own = {name: getattr(self, name) for name in _MATRICES}
        own = {name: M for name, M in own.items() if name[0] != "D" or M.any()}
        own |= dict(zip(_GROUPS, self._signal_names(), strict=True))
        plant = GeneralizedPlant.from_matrices(**{**own, "dt": self.dt, **changes})
        facts = self._facts_in(plant.system, plant.nu, units)
        return self._made(plant.system, plant.ny, plant.nu, **facts)

    def _renamed(
        self, units: Mapping[str, str] | None, changes: Mapping[str, Any]
    ) -> GeneralizedPlant:
        """Return the plant with other names; its matrices are those of the Pade models."""
        for name in changes:
            if name in (*_MATRICES, "dt"):
                shown = checks.described("a change of a plant with delays")
                remedy = "Change the plant before with_delay(...), or take plant.without_delays()."
                raise checks.invalid(name, shown, "changes of names and units only", remedy)
            if name not in _GROUPS:
                raise TypeError(f"replace() got an unexpected keyword argument {name!r}")
        old = self._signal_names()
        x, w, u, z, y = (
            _names(kind, changes.get(kind, names), len(names), "")
            for kind, names in zip(_GROUPS, old, strict=True)
        )
        before = (*old[1], *old[3], *old[4], *old[2])  # a control's new name counts most
        called = dict(zip(before, (*w, *z, *y, *u), strict=True))
        wiring = self.wiring.renamed(w, u, z, y, x[: self.wiring.nx], called)
        facts: dict[str, Mapping[str, Any]] = {
            key: {called[name]: value for name, value in getattr(self, key).items()}
            for key in _FACTS
        }
        own = {n: unit for n, unit in self.units.items() if n in _labels(wiring.pade_model())}
        return self.rewired(wiring, units={**own, **(units or {})}, **facts)

    def _signal_names(self) -> tuple[tuple[str, ...], ...]:
        """Return the names of x, w, u, z and y."""
        w, u, z = self.disturbance_names, self.control_names, self.performance_names
        return self.states, w, u, z, self.measurement_names

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
            With the delays of the whole; where states are chosen, with their Pade models only.

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.air_bearing().part(disturbances=[0], performance=[1, 0]).performance_names
        ('x', 'x_m')
        """
        w = list(range(self.nw) if disturbances is None else disturbances)
        u = list(range(self.nu) if controls is None else controls)
        z = list(range(self.nz) if performance is None else performance)
        y = list(range(self.ny) if measurements is None else measurements)
        if states is None:
            return self.rewired(self.wiring.chosen(w, u, z, y))
        ins, outs = [*w, *(self.nw + i for i in u)], [*z, *(self.nz + i for i in y)]
        part = blocks.chosen_signals(self._model(), outs, ins, list(states))
        return self._made(part, len(y), len(u), **self.without_delays()._facts_in(part, len(u)))

    @property
    def open_loop(self) -> control.StateSpace:
        """The system from w to z with u = 0."""
        matrices = (self.A, self.B1, self.C1, self.D11)
        names = (self.disturbance_names, self.performance_names, self.states)
        return blocks.named_system(matrices, self.dt, *names)

    def closed_loop(self, controller: blocks.GivenController) -> control.StateSpace:
        """Connect u = K y and return the system from w to z.

        Parameters
        ----------
        controller : control.StateSpace, control.TransferFunction or array_like
            K: a system with ny inputs and nu outputs, or a gain of shape (nu, ny). A transfer
            function is realised.

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
        return blocks.closed_loop(self, blocks.controller_system(self, controller))

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
        return self.with_full_state().closed_loop(checks.matrix("gain", gain, (self.nu, self.nx)))

    def with_full_state(self) -> GeneralizedPlant:
        """Return the same plant with y = x, for state feedback."""
        if self._wiring is not None:
            shown = checks.described("delays, which have infinitely many states")
            remedy = "Use an output feedback, or take plant.without_delays() with its Pade states."
            raise checks.invalid(
                "plant", shown, "a plant without delays for state feedback", remedy
            )
        names = [f"measured_{name}" for name in self.states]
        D21, D22 = np.zeros((self.nx, self.nw)), np.zeros((self.nx, self.nu))
        return self.replace(C2=np.eye(self.nx), D21=D21, D22=D22, measurements=names)

    def with_control_outputs(self) -> GeneralizedPlant:
        """Return the same plant with u appended to z, so that the loop shows the effort."""
        none = np.zeros((self.nu, self.ny))
        shown = self.wiring.with_performance(none, np.eye(self.nu), self.control_names)
        return self.rewired(shown)

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
        return blocks.static_controller(self, gain)

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
    def load(
        cls, path: str | os.PathLike[str], *, max_bytes: float | None = None
    ) -> GeneralizedPlant:
        """Read a plant from a file that :meth:`save` wrote.

        Parameters
        ----------
        path : path
        max_bytes : float, optional
            Largest size of the file in bytes, 2e8 by default.

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
        return plant_from(read_saved(path, "plant", max_bytes))

    def _card(self) -> Card:
        time = f"discrete time, step {self.dt}" if self.is_discrete else "continuous time"
        lines = isinstance(self.system, control.FrequencyResponseData)
        if lines:
            time = "a frequency response"
        groups = {
            "disturbances w": self.disturbance_names,
            "controls u": self.control_names,
            "performance z": self.performance_names,
            "measurements y": self.measurement_names,
            **({} if lines else {"states x": self.states}),
        }
        rows = [(f"{group} ({len(names)})", self._listed(names)) for group, names in groups.items()]
        rows += [
            (what, ", ".join(f"{name} {value:g}{unit}" for name, value in facts.items()))
            for what, facts, unit in (
                ("delays", self.delays, " s"),
                ("limits", self.limits, ""),
                ("limits of rates", self.rate_limits, "/s"),
            )
            if facts
        ]
        return Card(f"Generalised plant, {time}", (quantities(*rows),))

    def _listed(self, names: Sequence[str]) -> str:
        """Join names, those of a common unit followed by the unit."""
        by_unit: dict[str, list[str]] = {}
        for name in names:
            by_unit.setdefault(self.units.get(name, ""), []).append(name)
        shown = {unit: f" [{unit}]" if unit else "" for unit in by_unit}
        return "; ".join(", ".join(alike) + shown[unit] for unit, alike in by_unit.items())


def _labels(system: control.StateSpace) -> set[str]:
    states = system.state_labels if isinstance(system, control.StateSpace) else ()
    return {*system.input_labels, *system.output_labels, *states}


def _names(argument: str, given: Sequence[str] | None, count: int, letter: str) -> list[str]:
    if given is None:
        return [f"{letter}{i + 1}" for i in range(count)]
    if isinstance(given, str) or len(given) != count or len(set(given)) != count:
        raise checks.invalid(argument, given, f"{count} different names", "Name each signal once.")
    return list(given)
