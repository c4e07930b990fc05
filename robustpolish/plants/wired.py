"""The plant as it is wired: what surgery on its signals does to matrices, delay lines included.

Signals are w, u, z and y, as in `PlantBlocks`. The ends of delay lines are further signals: they
stand last among w and last among z, so that closing the loop and closing the delays commute.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import control
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import described, instance_of, invalid, misfit, positive, whole_number
from robustpolish.linear import systems
from robustpolish.plants import blocks
from robustpolish.signals.frequency_response import labelled_response, ratio_unit

Side = Literal["input", "output"]


@dataclass(frozen=True, eq=False)
class Wiring(blocks.PlantBlocks):
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
    lines: tuple[systems.DelayLine, ...] = ()
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
        a, b, c, d = _seen_from(side, blocks.matrices_of(filter))
        n, k, own = len(A), len(a), slice(at, at + len(d))
        whole = np.block([[A, B[:, own] @ c], [np.zeros((k, n)), a]])
        C = np.hstack([C, D[:, own] @ c])
        B = np.vstack([B, np.zeros((k, B.shape[1]))])
        B[:n, own], B[n:, own], D[:, own] = B[:n, own] @ d, b, D[:, own] @ d
        states = [*self.states, *_new_names(label, k, self.states)]
        return self._with(_seen_from(side, (whole, B, C, D)), states=states)

    def delayed(self, side: Side, at: int, line: systems.DelayLine) -> Wiring:
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
        return Wiring(blocks.chosen_signals(self.system, outs, ins), len(y), len(u), self.lines)

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

    def with_ports_last(self) -> systems.DelayedSystem:
        """Return the plant from (w, u) to (z, y) with its delays."""
        k, w, z = len(self.lines), self.nw, self.nz
        ins = [*range(w - k), *range(w, w + self.nu), *range(w - k, w)]
        outs = [*range(z - k), *range(z, z + self.ny), *range(z - k, z)]
        return systems.DelayedSystem(blocks.chosen_signals(self.system, outs, ins), self.lines)

    def arrays(self) -> Matrices:
        """Copy A, B, C and D as floats of consistent shapes."""
        return blocks.matrices_of(self.system)

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
        return replace(self, system=blocks.named_system(matrices, self.dt, ins, outs, own))


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


# What stands between a controller and its machine: lags of actuators, sensors and filters.

MOST_ORDER = 8
"""A lag of a higher order is a delay and better given as one."""


def lag(
    bandwidth_hz: float, order: int | None, damping: float | None, dt: float | bool
) -> control.StateSpace:
    """Return a lag whose gain is 1 at rest and has fallen by 3 dB at its bandwidth.

    Parameters
    ----------
    bandwidth_hz : float
        Where the gain is 1 / sqrt(2), in Hz.
    order : int or None
        1 by default, 2 if a damping is given; above 2 that of Butterworth.
    damping : float or None
        Damping ratio of order 2; 1 / sqrt(2), Butterworth's, by default.
    dt : float or True
        Sampling time: 0 is continuous; otherwise the bilinear image, right at the bandwidth.

    Returns
    -------
    control.StateSpace
    """
    hertz = positive("bandwidth_hz", bandwidth_hz, "Hz")
    if damping is not None:
        damping = positive("damping", damping)
        if order not in (None, 2):
            shown = described(f"a damping for order {order}")
            raise invalid("damping", shown, "order=2", "A damping ratio belongs to order 2.")
        order = 2
    order = 1 if order is None else order
    remedy = "Pass another lag as dynamics=, a delay with_delay."
    order = whole_number("order", order, 1, MOST_ORDER, remedy)
    A, B, C, D = systems.in_a_row(_sections(order, damping))
    rate = 2 * math.pi * hertz
    if not dt:
        return blocks.named_system((A * rate, B * rate, C, D), 0, ["u"], ["y"], state_names(len(A)))
    return bilinear(A, B, C, D, dt, rate)


def bilinear(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, dt: float | bool, rate: float
) -> control.StateSpace:
    """Return the discrete image of a system in units of `rate`, with the same response there.

    Parameters
    ----------
    A, B, C, D : ndarray
        In time units of 1 / rate.
    dt : float or True
        Sampling time in s.
    rate : float
        In rad/s; below the Nyquist frequency.
    """
    step = 1.0 if dt is True else float(dt)
    if rate * step >= math.pi:
        shown = described(f"{rate / (2 * math.pi):.6g} Hz")
        want = f"less than the Nyquist frequency {0.5 / step:.6g} Hz"
        raise invalid("frequency", shown, want, "Leave the lag out, or sample faster.")
    half = math.tan(rate * step / 2)  # s = (z - 1) / (z + 1) / half
    one = np.eye(len(A))
    inner = np.linalg.inv(one - half * A)
    matrices = (inner @ (one + half * A), 2 * half * inner @ B, C @ inner, D + half * C @ inner @ B)
    return blocks.named_system(matrices, dt, ["u"], ["y"], state_names(len(A)))


def single_filter(argument: str, value: Any, dt: float | bool) -> control.StateSpace:
    """Return a system of one input and one output that fits the plant's time.

    Parameters
    ----------
    argument : str
        Its name, for messages.
    value : control.StateSpace, control.TransferFunction or float
    dt : float or True
        The plant's sampling time.

    Returns
    -------
    control.StateSpace
    """
    system = blocks.as_state_space(argument, value, dt)
    if (system.ninputs, system.noutputs) != (1, 1):
        shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
        raise invalid(argument, shown, "one of each", "Give each signal a filter of its own.")
    own = dt if system.dt is None or not system.nstates else system.dt
    if own != dt:
        remedy = "Discretise it, for instance with control.sample_system."
        raise misfit(argument, f"sampling time {system.dt}", f"{dt} like the plant", remedy)
    return system


def _sections(order: int, damping: float | None) -> list[systems.Section]:
    """Return lags of first and second order, in units of the bandwidth."""
    one = np.ones((1, 1))
    found: list[systems.Section] = [(-one, one, one, 0.0)] if order % 2 else []
    for k in range(order // 2):
        zeta = math.sin(math.pi * (2 * k + 1) / (2 * order)) if damping is None else damping
        # |G| = 1 / sqrt(2) at 1: w^2 + ... solved for the natural frequency.
        spread = 1 - 2 * zeta**2
        natural = 1.0 if damping is None else 1 / math.sqrt(spread + math.hypot(spread, 1))
        a = np.array([[0.0, natural], [-natural, -2 * zeta * natural]])
        found.append((a, np.array([[0.0], [natural]]), np.array([[1.0, 0.0]]), 0.0))
    return found


def state_names(count: int) -> list[str]:
    """Return names of the states of a filter."""
    return [f"x[{i}]" for i in range(count)]


Given = control.StateSpace | control.TransferFunction | float
NOISE_PREFIX = "noise_"


class WiredPlant(blocks.PlantBlocks):
    """The methods of `GeneralizedPlant` that change its signals one by one.

    Attributes
    ----------
    delays : mapping of str to float
        Delay of each delayed signal, in s.
    limits, rate_limits : mapping of str to float
        Largest magnitude of each limited control, and of its rate per second.
    """

    delays: Mapping[str, float]
    limits: Mapping[str, float]
    rate_limits: Mapping[str, float]
    _wiring: Wiring | None

    @property
    def wiring(self) -> Wiring:
        """The plant with its delays as lines between further signals."""
        return self._wiring or Wiring(self._model(), self.measurements, self.controls)

    rewired: Callable[..., Self]
    without_delays: Callable[[], Self]

    def with_actuator(
        self,
        name: str | Sequence[str],
        bandwidth_hz: float | None = None,
        *,
        order: int | None = None,
        damping: float | None = None,
        dynamics: Given | None = None,
        limit: float | None = None,
        rate_limit: float | None = None,
    ) -> Self:
        """Return the plant with an actuator between the controller and some control.

        Parameters
        ----------
        name : str or sequence of str
            The control, or several that get an actuator of the same kind each.
        bandwidth_hz : float, optional
            Where the actuator's gain has fallen by 3 dB, in Hz.
        order : int, optional
            1 by default, 2 with a damping; above 2 a Butterworth filter.
        damping : float, optional
            Damping ratio of an actuator of second order.
        dynamics : control.StateSpace, control.TransferFunction or float, optional
            From command to what the actuator delivers, instead of a bandwidth.
        limit : float, optional
            Largest magnitude of the command, in the control's unit. A fact that is kept in
            ``limits`` for those who judge a loop; the model stays linear.
        rate_limit : float, optional
            Largest rate, in the control's unit per second.

        Returns
        -------
        GeneralizedPlant
            With the same signals; the control is the command from now on, and outputs that show
            it show what is delivered. States are named for the control.

        Raises
        ------
        InvalidInputError
            If there is no such control, or the description of the actuator is contradictory.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> mass = control.tf([1], [2, 0, 0], inputs="F", outputs="x")
        >>> plant = rp.GeneralizedPlant(mass, measurements="x", controls="F")
        >>> plant = plant.with_actuator("F", bandwidth_hz=2000, limit=50.0)
        >>> plant.nx, plant.control_names, dict(plant.limits)
        (3, ('F',), {'F': 50.0})
        """
        names = blocks.chosen_names("name", name, self.control_names, "controls")
        facts = limit is not None or rate_limit is not None
        model = self._dynamics((bandwidth_hz, order, damping), dynamics, facts)
        wiring = self.wiring
        if model is not None:
            for one in names:
                at = wiring.nw + wiring.control_names.index(one)
                wiring = wiring.series("input", at, model, f"{one}_actuator")
        limits, rates = dict(self.limits), dict(self.rate_limits)
        if limit is not None:
            limits |= dict.fromkeys(names, positive("limit", limit))
        if rate_limit is not None:
            rates |= dict.fromkeys(names, positive("rate_limit", rate_limit))
        return self.rewired(wiring, limits=limits, rate_limits=rates)

    def with_sensor(
        self,
        name: str | Sequence[str],
        bandwidth_hz: float | None = None,
        *,
        order: int | None = None,
        damping: float | None = None,
        dynamics: Given | None = None,
        noise: Given | None = None,
    ) -> Self:
        """Return the plant with a sensor between some measurement and the controller.

        Parameters
        ----------
        name : str or sequence of str
            The measurement, or several that get a sensor of the same kind each.
        bandwidth_hz : float, optional
            Where the sensor's gain has fallen by 3 dB, in Hz.
        order : int, optional
            1 by default, 2 with a damping; above 2 a Butterworth filter.
        damping : float, optional
            Damping ratio of a sensor of second order.
        dynamics : control.StateSpace, control.TransferFunction or float, optional
            From the measured quantity to the reading, instead of a bandwidth.
        noise : control.StateSpace, control.TransferFunction or float, optional
            Density of the noise of the reading, in its unit per square root of Hz, or the filter
            that shapes it. It enters behind the sensor as a further disturbance ``noise_`` and the
            name of the measurement, white and of intensity 1: then the H2 norm is an RMS value.
            (Data sheets give one-sided densities: divide those by the square root of 2.)

        Returns
        -------
        GeneralizedPlant
            With the same signals and one more disturbance per noise.

        Raises
        ------
        InvalidInputError
            If there is no such measurement, or the description of the sensor is contradictory.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> mass = control.tf([1], [2, 0, 0], inputs="F", outputs="x")
        >>> plant = rp.GeneralizedPlant(mass, measurements="x", controls="F")
        >>> plant = plant.with_sensor("x", bandwidth_hz=10e3, noise=1e-9)
        >>> plant.disturbance_names, plant.D21
        (('noise_x',), array([[1.e-09]]))
        """
        names = blocks.chosen_names("name", name, self.measurement_names, "measurements")
        model = self._dynamics((bandwidth_hz, order, damping), dynamics, noise is not None)
        shaped = None if noise is None else single_filter("noise", noise, self.dt)
        wiring = self.wiring
        for one in names:
            y = wiring.measurement_names.index(one)
            if model is not None:
                wiring = wiring.series("output", wiring.nz + y, model, f"{one}_sensor")
            if shaped is not None:
                onto = np.eye(wiring.ny)[:, [y]]
                wiring = wiring.with_disturbances(onto, [NOISE_PREFIX + one])
                at = wiring.nw - len(wiring.lines) - 1
                wiring = wiring.series("input", at, shaped, NOISE_PREFIX + one)
        return self.rewired(wiring)

    def with_filter(self, name: str, system: Given) -> Self:
        """Return the plant with a filter in the way of a signal, such as a notch or a network.

        Parameters
        ----------
        name : str
            A control or a measurement; a disturbance or a performance output if none has the name.
        system : control.StateSpace, control.TransferFunction or float
            Of one input and one output: before an input of the plant, behind an output.

        Returns
        -------
        GeneralizedPlant
            With the same signals and units.

        Raises
        ------
        InvalidInputError
            If there is no such signal, or the filter does not fit.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> mass = control.tf([1], [2, 0, 0], inputs="F", outputs="x")
        >>> plant = rp.GeneralizedPlant(mass, measurements="x", controls="F")
        >>> notch = control.tf([1, 0.1, 100], [1, 10, 100])
        >>> plant.with_filter("x", notch).states[2:]
        ('x_filter[0]', 'x_filter[1]')
        """
        side, at = _place(self.wiring, name, ("u", "y", "w", "z"))
        model = single_filter("system", system, self.dt)
        return self.rewired(self.wiring.series(side, at, model, f"{name}_filter"))

    def weighted(self, weights: Mapping[str, Given]) -> Self:
        """Return the plant with weights on some of its channels, for synthesis.

        Parameters
        ----------
        weights : mapping of str to control.StateSpace, control.TransferFunction or float
            By name of a disturbance or a performance output; see :func:`robustpolish.weight`. A
            control or a measurement is found too, if nothing else has the name; its weight is a
            filter then, of which the controller has to be told.

        Returns
        -------
        GeneralizedPlant
            With the same names and units: weights are taken as ratios.

        Raises
        ------
        InvalidInputError
            If there is no such signal, or a weight does not fit.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.air_bearing()
        >>> slow = rp.weight(10.0, 50.0, 0.1)
        >>> plant.weighted({"x": slow, "F_x": 2.0}).nx - plant.nx
        1
        """
        instance_of("weights", weights, Mapping, "a mapping of names", 'Write {"x": weight}.')
        wiring = self.wiring
        for name, weight in weights.items():
            side, at = _place(self.wiring, name, ("w", "z", "u", "y"))
            model = single_filter(f"weights[{name!r}]", weight, self.dt)
            wiring = wiring.series(side, at, model, f"{name}_weight")
        return self.rewired(wiring)

    def with_delay(self, name: str | Sequence[str], seconds: float, *, order: int = 3) -> Self:
        """Return the plant with a signal delayed.

        In ``system``, which synthesis sees, the delay is a Pade approximation; ``delays`` keep it,
        and :meth:`frequency_response`, :meth:`delayed_loop` and certificates take it as it is.

        Parameters
        ----------
        name : str or sequence of str
            A control or a measurement; a disturbance or a performance output if none has the name.
            Several are delayed by as much each.
        seconds : float
            The delay in s; 0 changes nothing. In discrete time a whole number of samples, for
            which the plant gets as many states.
        order : int, optional
            Order of the Pade approximation: right up to a phase of `order` rad of the delay.

        Returns
        -------
        GeneralizedPlant
            With the same signals and units.

        Raises
        ------
        InvalidInputError
            If there is no such signal, or the delay is negative or no whole number of samples.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> mass = control.tf([1], [2, 0, 0], inputs="F", outputs="x")
        >>> plant = rp.GeneralizedPlant(mass, measurements="x", controls="F")
        >>> plant = plant.with_delay("x", 1e-3)
        >>> dict(plant.delays), plant.nx
        ({'x': 0.001}, 5)
        """
        seconds = positive("seconds", seconds, "s", zero=True)
        line = systems.DelayLine("signal", seconds or 1.0, order)  # which checks the order
        names = [name] if isinstance(name, str) or not isinstance(name, Sequence) else list(name)
        wiring, delays = self.wiring, dict(self.delays)
        for one in names:
            side, at = _place(wiring, one, ("u", "y", "w", "z"))
            if not seconds:
                continue
            if self.is_discrete:
                wiring = wiring.series(side, at, self._shift(seconds), f"{one}_delay")
            else:
                wiring = wiring.delayed(side, at, replace(line, name=one))
            delays[one] = delays.get(one, 0.0) + seconds
        return self.rewired(wiring, delays=delays)

    def delayed_loop(self, controller: blocks.GivenController) -> systems.DelayedSystem:
        """Connect u = K y and return the loop with its delays as they are.

        Parameters
        ----------
        controller : control.StateSpace, control.TransferFunction or array_like
            K, as for :meth:`closed_loop`.

        Returns
        -------
        DelayedSystem
            From w to z; ask :func:`robustpolish.linear.delay_stability` whether it is stable.

        Raises
        ------
        InvalidInputError
            If plant and controller do not fit, or time is discrete: there :meth:`closed_loop`
            is exact, delays included.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> lag = control.tf([1], [1, 1], inputs="u", outputs="y")
        >>> plant = rp.GeneralizedPlant(lag, measurements="y", controls="u").with_delay("u", 0.5)
        >>> [bool(rp.linear.delay_stability(plant.delayed_loop([[k]]))) for k in (-3.0, -5.0)]
        [True, False]
        """
        whole = self.wiring
        return systems.DelayedSystem(
            blocks.closed_loop(whole, blocks.controller_system(whole, controller)), whole.lines
        )

    def frequency_response(self, frequency: ArrayLike) -> xr.DataArray:
        """Return the response from (w, u) to (z, y), delays as they are.

        Parameters
        ----------
        frequency : array_like, shape (k,)
            In Hz.

        Returns
        -------
        xarray.DataArray
            Complex, over ``frequency``, ``output`` and ``input``, with the units of each pair. Of
            a plant that is a measured response, drawn straight between its lines.

        Raises
        ------
        InvalidInputError
            If a frequency is not finite, or lies beyond the lines of a measured response.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> lag = control.tf([1], [1, 1], inputs="u", outputs="y")
        >>> plant = rp.GeneralizedPlant(lag, measurements="y", controls="u").with_delay("u", 0.5)
        >>> response = plant.frequency_response([0.0, 1.0])
        >>> print(response.sel(output="y", input="u").round(3).values)
        [ 1.   +0.j    -0.025+0.155j]
        """
        hertz = systems.frequencies("frequency", frequency)
        omega = 2 * np.pi * hertz
        if isinstance(self.system, control.FrequencyResponseData):
            values = blocks.interpolate_response(self.system, omega)
        elif self.is_discrete:
            step = 1.0 if self.dt is True else float(self.dt)
            values = systems.resolvent_response(*self.wiring.arrays(), np.exp(1j * omega * step))
        else:
            values = self.wiring.with_ports_last().response(omega)
        ins, outs = list(self.system.input_labels), list(self.system.output_labels)
        units = [
            [ratio_unit(self.units.get(o, ""), self.units.get(i, "")) for i in ins] for o in outs
        ]
        return labelled_response(hertz, values, outs, ins, units)

    def _dynamics(
        self, of_lag: tuple[float | None, int | None, float | None], dynamics: Any, facts: bool
    ) -> control.StateSpace | None:
        """Return what an actuator or a sensor does to its signal; None if nothing was said."""
        told = any(value is not None for value in of_lag)
        if dynamics is not None:
            if told:
                shown = described("a bandwidth, order or damping besides")
                raise invalid("dynamics", shown, "one of both", "Describe it in one way.")
            return single_filter("dynamics", dynamics, self.dt)
        if facts and not told:
            return None
        bandwidth_hz, order, damping = of_lag
        if bandwidth_hz is None:
            want = "a bandwidth in Hz, or dynamics="
            raise invalid("bandwidth_hz", None, want, "Say how fast it is.")
        return lag(bandwidth_hz, order, damping, self.dt)

    def _shift(self, seconds: float) -> control.StateSpace:
        """Return a chain of states that delays by a whole number of samples."""
        step = 1.0 if self.dt is True else float(self.dt)
        count = round(seconds / step)
        if count < 1 or abs(seconds / step - count) > 1e-6 * count:
            want = f"a whole number of samples of {step:g} s"
            raise invalid("seconds", seconds, want, "Round it, or delay the continuous plant.")
        A, B, C = np.eye(count, k=-1), np.eye(count)[:, :1], np.eye(count)[-1:]
        return blocks.named_system((A, B, C, [[0.0]]), self.dt, ["u"], ["y"], state_names(count))


def _place(wiring: Wiring, name: str, order: Sequence[str]) -> tuple[Side, int]:
    """Return on which side a signal stands and where, the first of the kinds that has it."""
    groups: dict[str, tuple[Side, int, Sequence[str]]] = {
        "w": ("input", 0, wiring.disturbance_names[: wiring.nw - len(wiring.lines)]),
        "u": ("input", wiring.nw, wiring.control_names),
        "z": ("output", 0, wiring.performance_names[: wiring.nz - len(wiring.lines)]),
        "y": ("output", wiring.nz, wiring.measurement_names),
    }
    for kinds in (order[:2], order[2:]):
        found = [groups[kind] for kind in kinds if name in groups[kind][2]]
        if len(found) > 1:
            both = "a control and a measurement" if "u" in kinds else "a disturbance and an output"
            shown = described(f"{name!r}, the name of {both}")
            raise invalid("name", shown, "the name of one signal", "Rename one by replace(...).")
        if found:
            side, start, names = found[0]
            return side, start + names.index(name)
    known = dict.fromkeys(signal for kind in order for signal in groups[kind][2])
    raise invalid("name", name, f"one of the signals {', '.join(known)}", "Check its spelling.")
