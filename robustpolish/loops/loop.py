"""Plant and controller as a loop that can be opened anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import control
import numpy as np
import scipy.linalg as sla

from robustpolish.base.arrays import AnyArray, AnyVector, Matrix, Vector
from robustpolish.base.checks import described, invalid
from robustpolish.errors import InvalidInputError
from robustpolish.linear.delay_stability import delay_stability
from robustpolish.linear.delayed_systems import DelayedSystem
from robustpolish.linear.norms.hinf import HinfNorm
from robustpolish.linear.stability import Stability, stability
from robustpolish.loops.response import (
    DelayedLoop,
    DelayedResponse,
    MeasuredResponse,
    SystemResponse,
)
from robustpolish.plants.blocks import (
    GivenController,
    as_state_space,
    controller_system,
    matrices_of,
    named_system,
)
from robustpolish.plants.blocks import closed_loop as plant_loop
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import NOISE_PREFIX
from robustpolish.synthesis.design import Design

Place = Literal["input", "output"]
PLACES: tuple[Place, ...] = ("input", "output")
_Matrices = tuple[Matrix, Matrix, Matrix, Matrix]


class BreakableLoop:
    """What loops of models and of measured plants have in common: signals, and peaks of S and T."""

    plant: GeneralizedPlant
    controller: control.StateSpace

    def names(self, place: Place) -> tuple[str, ...]:
        """Return the signals at which the loop can be broken: controls or measurements.

        Parameters
        ----------
        place : {"input", "output"}

        Returns
        -------
        tuple of str
        """
        own = self.plant
        return own.control_names if place == "input" else own.measurement_names

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the controls and of the measurements, in the order of :meth:`at`."""
        return (*self.plant.control_names, *self.plant.measurement_names)

    def at(self, place: Place, signals: Sequence[int] | None = None) -> list[int]:
        """Return where signals of a place stand in :attr:`closed`.

        Parameters
        ----------
        place : {"input", "output"}
        signals : sequence of int, optional
            All of the place by default.

        Returns
        -------
        list of int
        """
        first = 0 if place == "input" else self.plant.nu
        return [first + i for i in (range(len(self.names(place))) if signals is None else signals)]

    def response_around(
        self, at: Sequence[int], weight: float = 1.0, less: float = 0.0
    ) -> SystemResponse | MeasuredResponse:
        """Return weight * S - less * 1 at some signals over frequency."""
        raise NotImplementedError

    def peak(self, at: Sequence[int], weight: float = 1.0, less: float = 0.0) -> HinfNorm:
        """Return the norm of :meth:`around`, proven if that is affordable, and remember it.

        Parameters
        ----------
        at : sequence of int
        weight, less : float, optional

        Returns
        -------
        HinfNorm
        """
        key = (*at, weight, less)
        if key not in self._peaks:
            self._peaks[key] = self.response_around(at, weight, less).peak()
        return self._peaks[key]

    def balanced_peak(self, at: Sequence[int]) -> HinfNorm:
        """Return the norm of S - T, whose inverse is half the disk margin of one loop.

        Parameters
        ----------
        at : sequence of int

        Returns
        -------
        HinfNorm
        """
        return self.peak(at, 2.0, 1.0)

    @cached_property
    def _peaks(self) -> dict[tuple[float, ...], HinfNorm]:
        return {}


@dataclass(frozen=True, eq=False)
class Loop(BreakableLoop):
    """A plant from u to y and a controller u = K y, with what lies outside the loop left out.

    Delays that a plant keeps beside its state-space system are in :meth:`response`,
    :meth:`peak` and :attr:`stability` as they are. The systems :meth:`opened` and :attr:`closed`
    have Padé approximations of them, as the plant's ``system`` has.

    Attributes
    ----------
    plant : GeneralizedPlant
        As given; its lower block is the plant of the loop.
    controller : control.StateSpace
        K, with positive sign.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace

    @property
    def approximated_delays(self) -> dict[str, float]:
        """Delays in s that the plant keeps beside its system, by signal; Padé's in systems."""
        return dict(self.plant.delays)

    @cached_property
    def delayed(self) -> DelayedLoop | None:
        """The loop with its delays as they are; None without delays and in discrete time."""
        wiring = self.plant.wiring
        if self.is_discrete or not wiring.lines:
            return None
        inner = wiring.chosen([], range(wiring.nu), [], range(wiring.ny))
        return DelayedLoop(inner.with_ports_last(), self.controller_matrices)

    @property
    def dt(self) -> float | bool:
        """Sampling time in s; 0 in continuous time."""
        return self.plant.dt

    @property
    def is_discrete(self) -> bool:
        """Whether it is a loop in discrete time."""
        return self.plant.is_discrete

    def unit(self, name: str) -> str:
        """Return the unit of a signal if the plant knows it; that of a measured state is its own.

        Parameters
        ----------
        name : str

        Returns
        -------
        str
        """
        units = self.plant.units
        bare = name.removeprefix(NOISE_PREFIX)
        return units.get(name) or units.get(bare) or units.get(bare.removeprefix("measured_"), "")

    @cached_property
    def inside(self) -> tuple[int, ...]:
        """The plant's states that lie between u and y; weights and the like do not."""
        own = self.plant
        moved: Any = _reached(own.A != 0, (own.B2 != 0).any(axis=1))
        seen = _reached(own.A.T != 0, (own.C2 != 0).any(axis=0))
        return tuple(int(i) for i in np.flatnonzero(moved & seen))

    @property
    def outside(self) -> tuple[str, ...]:
        """Names of the plant's states that no controller of this loop can change."""
        return tuple(name for i, name in enumerate(self.plant.states) if i not in self.inside)

    @cached_property
    def outside_stability(self) -> Stability:
        """Whether these are stable by themselves."""
        rest = [i for i in range(self.plant.nx) if i not in self.inside]
        A = self.plant.A[np.ix_(rest, rest)]
        names = self.outside
        matrices = (A, np.eye(len(A)), np.eye(len(A)), np.zeros(A.shape))
        return stability(named_system(matrices, self.dt, names, names, names))

    @cached_property
    def plant_matrices(self) -> _Matrices:
        """A, B, C and D from u to y, of the states inside the loop."""
        own, kept = self.plant, list(self.inside)
        return own.A[np.ix_(kept, kept)], own.B2[kept], own.C2[:, kept], own.D22

    @cached_property
    def controller_matrices(self) -> _Matrices:
        """A, B, C and D of K."""
        return matrices_of(self.controller)

    @cached_property
    def closed(self) -> control.StateSpace:
        """From (disturbance at u, noise at y) to (u, y): S and KS above, GS and S below."""
        (A, B, C, D), (Ak, Bk, Ck, Dk) = self.plant_matrices, self.controller_matrices
        nu, ny = D.shape[1], D.shape[0]
        loop = np.eye(nu) - Dk @ D
        u = np.linalg.solve(loop, np.hstack([Dk @ C, Ck, np.eye(nu), Dk]))
        n, k = A.shape[0], Ak.shape[0]
        y = D @ u + np.hstack([C, np.zeros((ny, k + nu)), np.eye(ny)])
        rows = np.vstack([B @ u, Bk @ y])
        rows[:n, :n] += A
        rows[n:, n : n + k] += Ak
        outer = np.vstack([u, y])
        cut = n + k
        matrices = rows[:, :cut], rows[:, cut:], outer[:, :cut], outer[:, cut:]
        return named_system(matrices, self.dt, self.signals, self.signals, self._states())

    @cached_property
    def stability(self) -> Stability:
        """Whether the closed loop is stable, with its delays as they are."""
        found = stability(self.closed)
        if self.delayed is None:
            return found
        inner = self.plant.wiring.chosen([], range(self.plant.nu), [], range(self.plant.ny))
        system = DelayedSystem(plant_loop(inner, self.controller), inner.lines)
        exact = delay_stability(system)
        if exact and found:
            return replace(found, reason=f"{exact.reason}; with Padé models all poles are stable")
        if exact:
            reason = (
                "stable with exact delays, but not with the Padé models that the plant has of "
                "them: give with_delay a higher order="
            )
            return replace(found, reason=reason)
        reason = f"with exact delays {exact.verdict}: {exact.reason}"
        return replace(found, verdict="unstable", reason=reason, pole=exact.rightmost)

    @cached_property
    def rates(self) -> AnyVector:
        """Poles of the closed loop as complex rates in rad/s, those at z = 0 left out."""
        poles = np.asarray(self.stability.poles, dtype=complex)
        if not self.is_discrete:
            return poles
        step = 1.0 if self.dt is True else float(self.dt)
        return np.log(poles[poles != 0]) / step

    @cached_property
    def opposite_stability(self) -> Stability:
        """Whether the loop with the opposite sign, u = -K y, is stable."""
        return stability(Loop(self.plant, -self.controller).closed)

    def between(self, inputs: Sequence[int], outputs: Sequence[int]) -> control.StateSpace:
        """Return :attr:`closed` between some of its inputs and outputs.

        Parameters
        ----------
        inputs, outputs : sequence of int
            Positions in :attr:`closed`.

        Returns
        -------
        control.StateSpace
        """
        return from_to(self.closed, inputs, outputs)

    def around(
        self, at: Sequence[int], weight: float = 1.0, less: float = 0.0
    ) -> control.StateSpace:
        """Return weight * S - less * 1 at some signals, such as S - T = 2 S - 1.

        Parameters
        ----------
        at : sequence of int
            Positions in :attr:`closed`.
        weight, less : float, optional

        Returns
        -------
        control.StateSpace
        """
        closed, at = self.closed, list(at)
        A, B, C, D = (np.asarray(getattr(closed, name)) for name in "ABCD")
        own = weight * D[np.ix_(at, at)] - less * np.eye(len(at))
        names = [closed.input_labels[i] for i in at]
        matrices = A, B[:, at], weight * C[at], own
        return named_system(matrices, self.dt, names, names, closed.state_labels)

    @property
    def side_by_side(self) -> control.StateSpace:
        """Everything opened: from (u, y) to (-K y, -G u)."""
        (A, B, C, D), (Ak, Bk, Ck, Dk) = self.plant_matrices, self.controller_matrices
        nu, ny = D.shape[1], D.shape[0]
        matrices: Any = (
            np.asarray(sla.block_diag(A, Ak)),
            np.asarray(sla.block_diag(B, Bk)),
            np.vstack(
                [np.hstack([np.zeros((nu, len(A))), -Ck]), np.hstack([-C, np.zeros((ny, len(Ak)))])]
            ),
            np.block([[np.zeros((nu, nu)), -Dk], [-D, np.zeros((ny, ny))]]),
        )
        return named_system(matrices, self.dt, self.signals, self.signals, self._states())

    def opened(self, place: Place, signals: Sequence[int] | None = None) -> control.StateSpace:
        """Return the loop transfer function where it is broken, the rest being closed.

        Parameters
        ----------
        place : {"input", "output"}
            Of the plant.
        signals : sequence of int, optional
            Where it is broken; at all signals of the place by default.

        Returns
        -------
        control.StateSpace
            L with S = 1/(1 + L): -K G or -G K if everything is broken.
        """
        names = self.names(place)
        broken = list(range(len(names)) if signals is None else signals)
        first, second = self.plant_matrices, self.controller_matrices
        if place == "output":
            first, second = second, first
        matrices = _opened(first, second, broken)
        labels = [names[i] for i in broken]
        return named_system(matrices, self.dt, labels, labels, self._states(place))

    def response(self, place: Place, signals: Sequence[int] | None = None) -> SystemResponse:
        """Return :meth:`opened` over frequency, delays as they are.

        Parameters
        ----------
        place : {"input", "output"}
        signals : sequence of int, optional

        Returns
        -------
        SystemResponse
        """
        opened, exact = self.opened(place, signals), self.delayed
        if exact is None:
            return SystemResponse(opened, self.rates)
        broken = list(range(len(self.names(place))) if signals is None else signals)
        return DelayedResponse(
            opened,
            self.rates,
            exact=lambda omega: exact.opened(place == "input", broken, omega),
            seconds=exact.seconds,
        )

    def response_around(
        self, at: Sequence[int], weight: float = 1.0, less: float = 0.0
    ) -> SystemResponse:
        """Return :meth:`around` over frequency, delays as they are.

        Parameters
        ----------
        at : sequence of int
        weight, less : float, optional

        Returns
        -------
        SystemResponse
        """
        system, exact = self.around(at, weight, less), self.delayed
        if exact is None:
            return SystemResponse(system)
        one, at = np.eye(len(at)), list(at)

        def values(omega: Vector) -> AnyArray:
            return weight * exact.closed(omega)[:, at][:, :, at] - less * one

        return DelayedResponse(system, self.rates, exact=values, seconds=exact.seconds)

    def _states(self, place: Place = "input") -> list[str]:
        """Name the states of plant and controller, in the order in which they are connected."""
        own = [self.plant.states[i] for i in self.inside]
        others = [
            f"{'controller_' if name in own else ''}{name}" for name in self.controller.state_labels
        ]
        return [*own, *others] if place == "input" else [*others, *own]

    def well_posed(self) -> bool:
        """Tell whether the algebraic part of the loop has a solution."""
        D, Dk = self.plant_matrices[3], self.controller_matrices[3]
        return bool(np.linalg.cond(np.eye(D.shape[1]) - Dk @ D) < 1 / np.finfo(float).eps)


def from_to(
    system: control.StateSpace, inputs: Sequence[int], outputs: Sequence[int]
) -> control.StateSpace:
    """Return a system between some of its inputs and outputs."""
    A, B, C, D = matrices_of(system)
    return named_system(
        (A, B[:, inputs], C[outputs], D[np.ix_(outputs, inputs)]),
        0 if system.dt is None else system.dt,
        [system.input_labels[i] for i in inputs],
        [system.output_labels[i] for i in outputs],
        system.state_labels,
    )


def _reached(edges: Any, start: Any) -> Any:
    """Return which states can be reached; ``edges[i, j]`` leads from j to i."""
    found = start.copy()
    while True:
        further = found | (edges & found).any(axis=1)
        if (further == found).all():
            return found
        found = further


def _opened(first: _Matrices, second: _Matrices, broken: Sequence[int]) -> _Matrices:
    """Return the negative transfer round the loop from `broken` inputs of `first`."""
    (A, B, C, D), (Ak, Bk, Ck, Dk) = first, second
    m, n, k = B.shape[1], A.shape[0], Ak.shape[0]
    shut = np.eye(m)
    shut[broken, broken] = 0.0
    entry = np.eye(m)[:, broken]
    loop = np.eye(m) - Dk @ D @ shut
    back: Any = np.linalg.solve(loop, np.hstack([Dk @ C, Ck, Dk @ D @ entry]))
    u = shut @ back
    u[:, n + k :] += entry
    y = D @ u
    y[:, :n] += C
    rows = np.vstack([B @ u, Bk @ y])
    rows[:n, :n] += A
    rows[n:, n : n + k] += Ak
    outer = -back[broken]
    cut = n + k
    return rows[:, :cut], rows[:, cut:], outer[:, :cut], outer[:, cut:]


# The loop that users give: a design, or a plant and a controller of many kinds, checked.


def loop_of(
    plant: Design | GeneralizedPlant | control.StateSpace | control.TransferFunction,
    controller: Design | GivenController | None,
) -> Loop:
    """Return the loop of a design, or of a plant and a controller.

    Raises
    ------
    InvalidInputError
        If it is no plant, if the controller is missing or does not fit, or if the loop has no
        solution.
    """
    if isinstance(plant, Design):
        if controller is not None:
            shown = described("a design and a controller besides")
            remedy = "Pass design.plant to try another controller on its plant."
            raise invalid(
                "controller", shown, "a design alone, or a plant and a controller", remedy
            )
        plant, controller = plant.plant, plant.controller
    whole = _as_plant(plant)
    controller = controller_of(controller)
    if whole.nu == 0 or whole.ny == 0:
        raise _lacks_signals(whole)
    _complain_about_states(whole, controller)
    K = controller_system(whole, controller)
    if K.nstates and K.dt is not None and K.dt != whole.dt and not _same_step(K.dt, whole.dt):
        shown = described(f"{_timing(K.dt)} for a plant in {_timing(whole.dt)}")
        remedy = "Discretise the plant or the controller first, such as with control.c2d."
        raise invalid("controller", shown, "the same time as the plant", remedy)
    if (K.noutputs, K.ninputs) != (whole.nu, whole.ny):
        shown = described(f"{K.ninputs} inputs and {K.noutputs} outputs")
        expected = f"{whole.ny} inputs (y) and {whole.nu} outputs (u)"
        remedy = "It leads from the measurements y to the controls u."
        raise invalid("controller", shown, expected, remedy)
    loop = Loop(whole, K)
    if not loop.well_posed():
        shown = described("a loop matrix I - Dk D22 that is singular")
        remedy = "Change the controller's feedthrough or the plant's D22."
        raise invalid("controller", shown, "a well-posed loop", remedy)
    return loop


def controller_of(controller: Design | GivenController | None) -> GivenController:
    """Return the controller that was given, out of its design if it is in one."""
    if isinstance(controller, Design):
        return controller.controller
    if controller is None:
        remedy = "Call loop_analysis(plant, controller), with u = K y."
        raise invalid("controller", None, "a controller beside the plant", remedy)
    return controller


def measured_plant(plant: Any) -> GeneralizedPlant | None:
    """Return a plant that is known by its frequency response; None of others."""
    own = plant.system if isinstance(plant, GeneralizedPlant) else plant
    if not isinstance(own, control.FrequencyResponseData):
        return None
    whole = plant
    if not isinstance(plant, GeneralizedPlant):
        whole = GeneralizedPlant(own, own.noutputs or 0, own.ninputs or 0)
    if whole.nu == 0 or whole.ny == 0:
        raise _lacks_signals(whole)
    return whole


def _lacks_signals(whole: GeneralizedPlant) -> InvalidInputError:
    shown = described(f"{whole.nu} controls and {whole.ny} measurements")
    remedy = "Name measurements= and controls= of the plant."
    return invalid("plant", shown, "at least one of each", remedy)


def _as_plant(plant: Any) -> GeneralizedPlant:
    if isinstance(plant, GeneralizedPlant):
        return plant
    if isinstance(plant, control.StateSpace | control.TransferFunction):
        system = as_state_space("plant", plant, 0)
        return GeneralizedPlant(system, system.noutputs or 0, system.ninputs or 0)
    raise invalid(
        "plant",
        described(type(plant).__name__),
        "a Design, a GeneralizedPlant, a control.StateSpace or a control.TransferFunction",
        "Pass what a synthesis returned, or a plant and a controller.",
    )


def _complain_about_states(plant: GeneralizedPlant, controller: GivenController) -> None:
    """Tell a gain of a state feedback, given with a plant that measures something else."""
    given = controller
    if isinstance(given, control.StateSpace) and given.nstates == 0:
        given = given.D
    if isinstance(given, control.InputOutputSystem | control.LTI):
        return
    shape = np.shape(given)
    if shape == (plant.nu, plant.nx) and plant.nx != plant.ny:
        shown = described(f"a gain of shape {shape} for {plant.ny} measurements")
        remedy = "For a state feedback pass plant.with_full_state()."
        raise invalid("controller", shown, f"a gain of shape ({plant.nu}, {plant.ny})", remedy)


def _same_step(one: float | bool, other: float | bool) -> bool:
    """Tell whether two sampling times agree, one of which may be unspecified."""
    if one is True or other is True:
        return bool(one) and bool(other)
    return bool(np.isclose(float(one), float(other), rtol=1e-9, atol=0.0))


def _timing(dt: float | bool | None) -> str:
    if not dt:
        return "continuous time"
    return "discrete time" if dt is True else f"discrete time with a step of {dt:g} s"
