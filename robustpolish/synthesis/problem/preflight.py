"""A plant before synthesis: its parts, its units, what can be stabilised; price and noise."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from robustpolish.base.arrays import EPS, AnyMatrix, Array, Matrix
from robustpolish.base.checks import described, invalid
from robustpolish.errors import InfeasibleError
from robustpolish.implementation.reduction import balancing_projection, own_gramians
from robustpolish.linear.arithmetic import exact
from robustpolish.linear.arithmetic.exact import EXACT_STATES, ExactModel, to_float
from robustpolish.linear.norms.hinf import AxisZero, zeros_on_axis
from robustpolish.linear.scaling import decoupled_blocks
from robustpolish.linear.stability import controllability
from robustpolish.linear.systems import named_system, realisation
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import NOISE_PREFIX
from robustpolish.synthesis.problem.matrices import (
    NAMES,
    Controller,
    PlantMatrices,
    absorb_d22,
    balanced,
    close_static_loop,
    to_continuous,
    to_discrete,
    with_measured_states,
)

# Units in which a plant is solved, all of order one, and the way from there back.


# Split a plant into parts that share no signal, and put their controllers together.


@dataclass(frozen=True, eq=False)
class PlantPart:
    """One decoupled part of a plant.

    Attributes
    ----------
    plant : GeneralizedPlant
        The part, with the names of the whole.
    states, disturbances, controls, performance, measurements : tuple of int
        Where its signals are in the whole.
    """

    plant: GeneralizedPlant
    states: tuple[int, ...]
    disturbances: tuple[int, ...]
    controls: tuple[int, ...]
    performance: tuple[int, ...]
    measurements: tuple[int, ...]


def decoupled_parts(
    plant: GeneralizedPlant, structure: NDArray[np.bool_] | None = None
) -> tuple[PlantPart, ...]:
    """Return the parts of a plant that are connected neither by it nor by its controller.

    Parameters
    ----------
    plant : GeneralizedPlant
    structure : ndarray of bool, shape (nu, ny), optional
        Entries of the controller that join a control to a measurement; none by
        default, because a full-order controller gains nothing from joining parts.

    Returns
    -------
    tuple of PlantPart
    """
    D = np.array(plant.system.D)
    if structure is not None:
        # A feedthrough as a mark only: it joins y to u in the graph.
        D = (D != 0).astype(float)
        D[plant.nz :, plant.nw :] += np.asarray(structure, float).T
    nw, nz = plant.nw, plant.nz
    parts = []
    for block in decoupled_blocks(plant.A, plant.system.B, plant.system.C, D):
        kept = {
            "states": block.states,
            "disturbances": [i for i in block.inputs if i < nw],
            "controls": [i - nw for i in block.inputs if i >= nw],
            "performance": [i for i in block.outputs if i < nz],
            "measurements": [i - nz for i in block.outputs if i >= nz],
        }
        # python-control holds no outputs without inputs; without inputs they do not matter either.
        shown = kept if block.inputs else kept | {"performance": [], "measurements": []}
        places = {name: tuple(indices) for name, indices in kept.items()}
        parts.append(PlantPart(plant.part(**shown), **places))
    return tuple(parts)


def whole_plant(plant: GeneralizedPlant) -> PlantPart:
    """Return the whole plant as its only part."""
    counts = (plant.nx, plant.nw, plant.nu, plant.nz, plant.ny)
    return PlantPart(plant, *(tuple(range(count)) for count in counts))


def with_dummy_signals(part: GeneralizedPlant) -> GeneralizedPlant:
    """Add a w or a z without effect to a part that has none and only has to be stabilised."""
    if part.nw and part.nz:
        return part
    return part.replace(
        B1=part.B1 if part.nw else np.zeros((part.nx, 1)),
        C1=part.C1 if part.nz else np.zeros((1, part.nx)),
        disturbances=part.disturbance_names or None,
        performance=part.performance_names or None,
    )


def joined_controller(
    plant: GeneralizedPlant,
    parts: Sequence[PlantPart],
    controllers: Sequence[control.StateSpace | None],
) -> control.StateSpace:
    """Put the controllers of the parts together, with the plant's signal names.

    Parameters
    ----------
    plant : GeneralizedPlant
    parts : sequence of PlantPart
    controllers : sequence of control.StateSpace or None
        One for each part; None leaves the part's controls at zero.

    Returns
    -------
    control.StateSpace
        From the plant's measurements to its controls.
    """
    known = [(part, K) for part, K in zip(parts, controllers, strict=True) if K is not None]
    order = sum(K.nstates for _, K in known)
    A, B = np.zeros((order, order)), np.zeros((order, plant.ny))
    C, D = np.zeros((plant.nu, order)), np.zeros((plant.nu, plant.ny))
    start = 0
    for part, K in known:
        own = list(range(start, start + K.nstates))
        start += K.nstates
        A[np.ix_(own, own)] = K.A
        B[np.ix_(own, part.measurements)] = K.B
        C[np.ix_(part.controls, own)] = K.C
        D[np.ix_(part.controls, part.measurements)] = K.D
    return named_controller(plant, A, B, C, D)


def named_controller(
    plant: GeneralizedPlant, A: AnyMatrix, B: AnyMatrix, C: AnyMatrix, D: AnyMatrix
) -> control.StateSpace:
    """Return a controller whose signals have the names of the plant's y and u."""
    states = [f"xk{i + 1}" for i in range(len(A))]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((A, B, C, D), plant.dt, *names)


_SWEEPS = 20


@dataclass(frozen=True, eq=False)
class ScaledPlant:
    """A plant in its own units, the same plant in units that suit a solver, and the way back.

    A quantity in the plant's units is its unit times the scaled quantity. All factors are
    powers of two, so that scaling adds no rounding error.

    Attributes
    ----------
    original, plant : GeneralizedPlant
        Before and after scaling; the signals keep their names.
    time : float
        Unit of time in the plant's unit of time, usually s; 1 in discrete time.
    state, control, measurement : ndarray
        Unit of every x, u and y.
    disturbance, performance : float
        One unit for all w and one for all z, because single ones would change the norm.
    """

    original: GeneralizedPlant
    plant: GeneralizedPlant
    time: float
    state: Matrix
    control: Matrix
    measurement: Matrix
    disturbance: float
    performance: float

    def norm(self, scaled: float, kind: str = "hinf") -> float:
        """Return a norm from w to z, "hinf" or "h2", in the plant's units."""
        value = scaled * self.performance / self.disturbance
        return value / math.sqrt(self.time) if kind == "h2" else value

    def scaled_norm(self, value: float, kind: str = "hinf") -> float:
        """Return a norm given in the plant's units for the scaled plant."""
        return value / self.norm(1.0, kind)

    def state_gain(self, scaled: ArrayLike) -> Matrix:
        """Return F of u = F x in the plant's units, equation (10.60)."""
        return self.control[:, None] * np.asarray(scaled, dtype=float) / self.state

    def output_gain(self, scaled: ArrayLike) -> Matrix:
        """Return F of u = F y in the plant's units."""
        return self.control[:, None] * np.asarray(scaled, dtype=float) / self.measurement

    def in_units(self, p: PlantMatrices) -> PlantMatrices:
        """Return another plant of these signals in the same units, which round nothing.

        Its first states are those of this plant; more of them keep their own units.
        """
        x = np.concatenate([self.state, np.ones(p.nx - len(self.state))])
        u, y, w, z = self.control, self.measurement, self.disturbance, self.performance
        return p.replace(
            A=self.time * p.A * x / x[:, None],
            B1=self.time * p.B1 * w / x[:, None],
            B2=self.time * p.B2 * u / x[:, None],
            C1=p.C1 * x / z,
            D11=p.D11 * w / z,
            D12=p.D12 * u / z,
            C2=p.C2 * x / y[:, None],
            D21=p.D21 * w / y[:, None],
            D22=p.D22 * u / y[:, None],
        )

    def controller(self, K: Controller) -> Controller:
        """Return a dynamic controller u = K y of the scaled plant in the plant's units."""
        rate, u, y = self.time, self.control[:, None], self.measurement
        return Controller(K.A / rate, K.B / rate / y, u * K.C, u * K.D / y)

    def scaled_controller(self, K: control.StateSpace) -> Controller:
        """Return a controller in the plant's units for the scaled plant."""
        rate, u, y = self.time, self.control[:, None], self.measurement
        A, B, C, D = matrices_of(K)
        return Controller(A * rate, B * rate * y, C / u, D * y / u)


def scale_plant(plant: GeneralizedPlant) -> ScaledPlant:
    """Choose units in which the entries of a plant's matrices are of order one.

    The unit of time is the geometric mean of the time constants; states are balanced as
    for eigenvalues, but with inputs and outputs taken into account; each control and
    measurement gets the unit that makes its column or row of order one; the
    disturbances share one unit and so do the performance outputs.

    Parameters
    ----------
    plant : GeneralizedPlant
        In any units, continuous or discrete.

    Returns
    -------
    ScaledPlant

    Examples
    --------
    A stiff spring with a small mass, pushed by a force of some N, seen in micrometres:

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [-1e8, -1.0]], [[0.0], [2.0]], [[0.0], [2.0]], [[1.0, 0.0]], [[1.0, 0.0]]
    ... )
    >>> from robustpolish.synthesis.problem.preflight import scale_plant
    >>> bool(abs(scale_plant(plant).plant.A).max() < 10)
    True
    """
    nx, nw, nu, nz, ny = plant.nx, plant.nw, plant.nu, plant.nz, plant.ny
    given = {name: getattr(plant, name) for name in NAMES}
    with exact.range_errors_as_input_errors("plant", given):
        time = 1.0 if plant.is_discrete else _unit_of_time(plant.A)
        S = np.block(
            [
                [exact.scaled(M, time) for M in (plant.A, plant.B1, plant.B2)],
                [plant.C1, plant.D11, plant.D12],
                [plant.C2, plant.D21, plant.D22],
            ]
        )
        left, right = _balance(S, nx, nw, nz)
        S = exact.scaled(S, left[:, None], right)
        exact.refuse_out_of_range(S)
    matrices = (S[:nx, :nx], S[:nx, nx:], S[nx:, :nx], S[nx:, nx:])
    whole = plant.system
    names = (whole.input_labels, whole.output_labels, whole.state_labels)
    system = named_system(matrices, plant.dt, *names)
    return ScaledPlant(
        original=plant,
        plant=GeneralizedPlant(system, ny, nu),
        time=time,
        state=right[:nx],
        control=right[nx + nw :],
        measurement=1 / left[nx + nz :],
        disturbance=float(right[nx]) if nw else 1.0,
        performance=float(1 / left[nx]) if nz else 1.0,
    )


@dataclass(frozen=True, eq=False)
class SolverPlant:
    """A plant prepared for an engine.

    Attributes
    ----------
    original : GeneralizedPlant
        In its own units, continuous or discrete.
    scaled : ScaledPlant
        The same, or its continuous-time image, before and after scaling.
    matrices : PlantMatrices
        The scaled matrices without D22.
    feedback : ndarray, shape (nu, ny)
        A static controller that was closed around a discrete-time plant before it was mapped.
    """

    original: GeneralizedPlant
    scaled: ScaledPlant
    matrices: PlantMatrices
    feedback: Matrix

    @classmethod
    def of(cls, plant: GeneralizedPlant, mapped: bool, full_state: bool = False) -> SolverPlant:
        """Prepare a plant.

        Parameters
        ----------
        plant : GeneralizedPlant
        mapped : bool
            Whether to map a discrete-time plant to continuous time, which keeps the H-infinity
            norm but not the H2 norm.
        full_state : bool
            Whether y is x, which is then measured in the units of the states.
        """
        feedback = np.zeros((plant.nu, plant.ny))
        scaled = scale_plant(plant)
        if full_state:
            scaled = replace(scaled, measurement=scaled.state)
            return cls(
                plant, scaled, with_measured_states(PlantMatrices.of(scaled.plant)), feedback
            )
        if plant.is_discrete and mapped:
            gain = scaled.output_gain(np.ones_like(feedback))
            image, feedback = to_continuous(plant, scaled.state, gain)
            scaled = scale_plant(image)
        return cls(plant, scaled, PlantMatrices.of(scaled.plant).without_d22(), feedback)

    def norm(self, value: float, kind: str = "hinf") -> float:
        """Return a norm of the scaled loop in the plant's units."""
        return self.scaled.norm(value, kind)

    def controller(self, K: Controller) -> control.StateSpace | None:
        """Return a controller in the plant's units; None if its loop is not well posed."""
        shifted = absorb_d22(K, self.scaled.plant.D22)
        if shifted is None:
            return None
        final: Controller | None = self.scaled.controller(shifted)
        if self.original.is_discrete and not self.scaled.original.is_discrete:
            final = to_discrete(final, self.feedback, self.original.D22)
        if final is None or not all(np.isfinite(M).all() for M in final):
            return None
        return named_controller(self.original, *balanced(final))


def _balance(S: Matrix, nx: int, nw: int, nz: int) -> tuple[Matrix, Matrix]:
    """Return factors of the rows and columns of [[A, B1, B2], [C1, D11, D12], [C2, D21, D22]]."""
    left, right = np.ones(S.shape[0]), np.ones(S.shape[1])
    for _ in range(_SWEEPS):
        before = right.copy()
        size = np.abs(S) * left[:, None] * right
        column = _reach(size[:nx, nx:], size[nx:, nx:])
        row = _reach(size[nx:, :nx].T, size[nx:, nx:].T)
        right[nx + nw :] /= _power_of_two(column[nw:])
        right[nx : nx + nw] /= _power_of_two(column[:nw].max(initial=0.0))
        left[nx + nz :] /= _power_of_two(row[nz:])
        left[nx : nx + nz] /= _power_of_two(row[:nz].max(initial=0.0))
        for i in range(nx):
            into = np.linalg.norm(np.delete(np.abs(S[i]) * left[i] * right, i))
            out = np.linalg.norm(np.delete(np.abs(S[:, i]) * left * right[i], i))
            if into > 0 and out > 0:
                factor = float(_power_of_two(math.sqrt(into / out)))
                left[i] /= factor
                right[i] *= factor
        if (right == before).all():
            break
    return left, right


def _reach(on_states: Matrix, direct: Matrix) -> Matrix:
    """Return the size of inputs by what they do to states; directly, where they reach none."""
    reach = np.linalg.norm(on_states, axis=0)
    return np.where(reach > 0, reach, np.linalg.norm(direct, axis=0))


def _unit_of_time(A: Matrix) -> float:
    """Return the power of two next to the geometric mean of the time constants."""
    size = np.abs(np.linalg.eigvals(A)) if A.size else np.zeros(0)
    # Modes at zero, up to rounding, say nothing about the time scale.
    size = size[size > size.max(initial=0.0) * math.sqrt(EPS)]
    if not size.size:
        largest = float(np.abs(A).max(initial=0.0))
        return 1 / float(_power_of_two(largest)) if largest > 0 else 1.0
    return float(np.exp2(np.clip(np.round(-np.log2(size).mean()), -1000, 1000)))


def _power_of_two(size: ArrayLike) -> Matrix:
    """Return the next power of two of every number; 1 for zeros."""
    array = np.asarray(size, dtype=float)
    safe = np.where(array > 0, array, 1.0)
    return np.exp2(np.clip(np.round(np.log2(safe)), -1000, 1000))


# Leave out the states of a large plant that nothing sees or reaches, before a search.


def truncated(plant: PlantMatrices) -> tuple[PlantMatrices, float] | None:
    """Truncate the stable part of a plant in balanced states.

    Parameters
    ----------
    plant : PlantMatrices
        Continuous, scaled, with states.

    Returns
    -------
    plant, error : PlantMatrices, float, or None
        None where most states count, or doubles cannot tell. The error is twice the sum of the
        Hankel singular values that are left out, which bounds the H-infinity norm of the
        difference of the responses from w, u to z, y.

    Notes
    -----
    K. Glover, "All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity error bounds", Int. J. Control 39 (1984) 1115-1193.
    """
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of equations that are nearly singular
            into, back, stable = _split(plant.A)
            P = plant.in_states(into, back)
            A, B, C, D = P.system
            part = A[:stable, :stable], B[:stable], C[:, :stable], D
            (way,) = own_gramians("balanced", part, plant.discrete)
            T, Ti, values = balancing_projection(way)
    except (linalg.LinAlgError, ValueError):
        return None
    left_out = 2 * np.cumsum(values[::-1])[::-1]
    rest = plant.nx - stable
    # The Hankel bound that is allowed, over the largest singular value. Gains multiply it: with
    # 1e-6 and gains of 3e3 a chain of 150 masses has a norm of 110, where 96 was seen.
    kept = int(np.count_nonzero(~(left_out <= 1e-8 * values.max(initial=0.0))))
    # Half of the states take an eighth of the time, so that little is lost where the whole plant
    # has to be searched after all.
    if kept + rest > 0.5 * plant.nx or not 0 < kept < stable:
        return None
    others: Any = np.eye(rest)
    into, back = linalg.block_diag(Ti[:kept], others), linalg.block_diag(T[:, :kept], others)
    return P.in_states(np.asarray(into), np.asarray(back)), float(left_out[kept])


def _split(A: AnyMatrix) -> tuple[AnyMatrix, AnyMatrix, int]:
    """Return coordinates, and back, in which the stable states stand first, alone."""
    # What decays less is kept as what is unstable: rounding makes poles of this size of double
    # ones at zero, on both sides of the axis.
    least = 1e-6 * float(np.abs(A).max())
    T, Z, count = linalg.schur(A, output="real", sort=lambda re, im: re < -least)  # type: ignore[misc]
    n, turn = len(A), np.eye(len(A))
    if 0 < count < n:
        turn[:count, count:] = linalg.solve_sylvester(
            T[:count, :count], -T[count:, count:], -T[:count, count:]
        )
    back = Z @ turn
    turn[:count, count:] *= -1
    return turn @ Z.T, back, count


Status = Literal["optimal", "suboptimal", "infimum_not_attained", "time_limit"]

# The word that says least comes first. After "time_limit" another machine may find something else;
# "suboptimal" leaves open how much is to be gained, and by what; "infimum_not_attained" says both:
# as much as wanted, by larger gains; "optimal" says that nothing is.
_WORST_FIRST: tuple[Status, ...] = ("time_limit", "suboptimal", "infimum_not_attained", "optimal")


def worst_status(statuses: Iterable[str]) -> Status:
    """Return the status of a whole: that of the part about which least is known.

    Examples
    --------
    >>> worst_status(["optimal", "infimum_not_attained", "suboptimal"])
    'suboptimal'
    >>> worst_status([])
    'optimal'
    """
    found = {"optimal", *statuses}
    return next(status for status in _WORST_FIRST if status in found)


_SUSPECT = 1e-7
# A price or a noise below this, in scaled units, counts as none.
_WEAKEST = 1e-6
_FAINT = f", or one that is too small to count (below {_WEAKEST:.0e} in scaled units)"


@dataclass(frozen=True)
class FixedMode:
    """An unstable mode that the controls do not move, the measurements do not see or no gain moves.

    Attributes
    ----------
    eigenvalue : complex
        In rad/s, or of the discrete-time state matrix.
    state : str
        The state with the largest part in the mode.
    lack : {"uncontrollable", "unobservable", "immovable"}
    distance : float
        Relative change of the scaled matrices that would make the mode fixed exactly.
    exact : bool
        Whether it is fixed to rounding; otherwise only nearly so.
    """

    eigenvalue: complex
    state: str
    lack: str
    distance: float
    exact: bool

    def __str__(self) -> str:
        nearly = "" if self.exact else "nearly "
        return f"{nearly}{self.lack} mode {self.value_text} (state {self.state})"

    @property
    def value_text(self) -> str:
        """The eigenvalue, or the pair of them, as text."""
        value = self.eigenvalue
        text = f"{value.real:+.6g}"
        if abs(value.imag) > 1e-9 * abs(value):
            text += f" +- {abs(value.imag):.6g}j"
        return text


@dataclass(frozen=True)
class SolvabilityCheck:
    """Findings about a plant.

    Attributes
    ----------
    fixed_modes : tuple of FixedMode
        Unstable modes that are uncontrollable or unobservable; in large plants, which no exact
        test clears, also those that are nearly so.
    d12_rank, d21_rank : int
        Numerical ranks in scaled units; nu and ny make the problem regular.
    d12_full, d21_full : bool
        Whether they have full column and row rank.
    control_zeros, measurement_zeros : tuple of AxisZero or None
        Zeros of (A, B2, C1, D12) and (A, B1, C2, D21) on the stability boundary; None where
        they were not looked for.
    needed : int
        States that the response needs, if a plant of these alone has no fixed modes; or 0.
    """

    fixed_modes: tuple[FixedMode, ...]
    d12_rank: int
    d21_rank: int
    d12_full: bool
    d21_full: bool
    control_zeros: tuple[AxisZero, ...] | None = None
    measurement_zeros: tuple[AxisZero, ...] | None = None
    needed: int = 0

    @property
    def regular_feedthrough(self) -> bool:
        """Whether D12 and D21 have full rank."""
        return self.d12_full and self.d21_full

    @property
    def regular(self) -> bool | None:
        """Whether the Riccati equations need no regularisation; None if the zeros are unknown."""
        if not self.regular_feedthrough:
            return False
        if self.control_zeros is None or self.measurement_zeros is None:
            return None
        return not (self.control_zeros or self.measurement_zeros)

    def require_stabilisable(self) -> None:
        """Raise an InfeasibleError if some mode is surely fixed."""
        exact = [mode for mode in self.fixed_modes if mode.exact]
        if exact:
            raise infeasible_modes_error(exact, self.needed)

    def with_zeros(self, plant: GeneralizedPlant) -> SolvabilityCheck:
        """Return the diagnosis of the plant with its zeros on the axis, which take longer."""
        P = plant
        return replace(
            self,
            control_zeros=_zeros(P.A, P.B2, P.C1, P.D12, P.dt),
            measurement_zeros=_zeros(P.A, P.B1, P.C2, P.D21, P.dt),
        )

    @property
    def findings(self) -> tuple[str, ...]:
        """The findings as sentences; empty for a regular plant without fixed modes."""
        found = [f"It has the {mode}." for mode in self.fixed_modes]
        if not self.d12_full:
            found.append(f"D12 has rank {self.d12_rank} only: some control has no price{_FAINT}.")
        if not self.d21_full:
            lacking = f"some measurement has no noise{_FAINT}"
            found.append(f"D21 has rank {self.d21_rank} only: {lacking}.")
        channels = (("u to z", self.control_zeros), ("w to y", self.measurement_zeros))
        for name, zeros in channels:
            if zeros:
                where = ", ".join(f"{zero.frequency:.6g}" for zero in zeros)
                found.append(
                    f"The channel from {name} has zeros on the axis, to working accuracy, at "
                    f"{where} rad/s."
                )
        return tuple(found)


def _zeros(A: AnyMatrix, B: AnyMatrix, C: AnyMatrix, D: AnyMatrix, dt: Any) -> tuple[AxisZero, ...]:
    """Return the zeros on the axis of a channel; none where it has no signals."""
    if not B.shape[1] or not C.shape[0]:
        return ()
    return zeros_on_axis(control.StateSpace(A, B, C, D, dt))


def check_solvability(plant: GeneralizedPlant) -> SolvabilityCheck:
    """Look for what makes an output feedback impossible or singular."""
    scaled = scale_plant(plant)
    P = scaled.plant
    # Ranks in scaled units, in which directions that are too weak count as absent.
    rank12, rank21 = (
        int((np.linalg.svd(D, compute_uv=False) > _WEAKEST).sum()) if D.size else 0
        for D in (P.D12, P.D21)
    )
    modes = []
    for A, B, lack in ((P.A, P.B2, "uncontrollable"), (P.A.T, P.C2.T, "unobservable")):
        if _looks_fixed(A, B, plant.is_discrete):
            test = controllability(A, B, states=plant.states, dt=plant.dt)
            modes += [
                FixedMode(m.eigenvalue / scaled.time, m.state, lack, m.distance, m.deficient)
                for m in test.modes
                if not m.stable
                and (m.deficient or (plant.nx > EXACT_STATES and m.distance < _SUSPECT))
            ]
    full = rank12 == plant.nu, rank21 == plant.ny
    needed = _needed_states(plant) if any(mode.exact for mode in modes) else 0
    return SolvabilityCheck(tuple(modes), rank12, rank21, *full, needed=needed)


def _needed_states(plant: GeneralizedPlant) -> int:
    """Return the order of a plant's response, if a plant of that order has no fixed modes."""
    seen = ExactModel.of(realisation("plant", plant.system)).minimal()
    if seen.states in (0, plant.nx):
        return 0
    few = control.StateSpace(*map(to_float, (seen.A, seen.B, seen.C, seen.D)), plant.dt)
    fixed = check_solvability(GeneralizedPlant(few, plant.ny, plant.nu)).fixed_modes
    return 0 if fixed else seen.states


def _looks_fixed(A: AnyMatrix, B: AnyMatrix, discrete: bool) -> bool:
    """Apply the Popov-Belevitch-Hautus test to the modes that are not clearly stable.

    It is a first look only: an integrator behind a fast lag is suspected as well, because sizes are
    relative to the fastest rate, though that keeps no controller from moving it.
    """
    values: Any = np.linalg.eigvals(A)
    # Without any dynamics and control every mode is fixed.
    size = (np.linalg.norm(A, 2) + np.linalg.norm(B, 2) if A.size else 0.0) or 1.0
    margin = 1 - np.abs(values) if discrete else -values.real
    return any(
        np.linalg.svd(np.hstack([A - value * np.eye(len(A)), B]), compute_uv=False)[-1]
        < _SUSPECT * size
        for value in values[(margin <= 1e-7 * size) & (values.imag >= 0)]
    )


def infeasible_modes_error(modes: Sequence[FixedMode], needed: int = 0) -> InfeasibleError:
    """Return the error that names the modes for which no controller exists."""
    listed = "; ".join(str(mode) for mode in modes)
    remedies = {
        "uncontrollable": "add an actuator that reaches it",
        "unobservable": "add a sensor that sees it",
    }
    remedy = " and ".join(
        text for lack, text in remedies.items() if lack in {mode.lack for mode in modes}
    )
    if needed:
        remedy = (
            f"leave out copies and what never shows: the plant's response needs {needed} states, "
            "with which nothing is fixed. Build each part once, or pass control.minreal(system)"
        )
    return InfeasibleError(
        f"No controller stabilises the plant because of the {listed}. To go on, {remedy}.",
        [mode.eigenvalue for mode in modes],
    )


def with_control_penalty(plant: GeneralizedPlant, weight: ArrayLike | None) -> GeneralizedPlant:
    """Append weighted controls to the performance outputs.

    Parameters
    ----------
    plant : GeneralizedPlant
    weight : float or array_like, shape (nu,), or None
        Units of z per unit of u; controls with weight 0 add no output.

    Returns
    -------
    GeneralizedPlant
        The plant itself if all weights are zero; otherwise z = (z, weight u), with
        outputs named ``price_`` and the name of the control.

    Raises
    ------
    InvalidInputError
        If the shape does not fit or a weight is negative or not finite.
    """
    weights = _weights("control_weight", weight, plant.nu, "units of z per unit of u")
    paid = np.flatnonzero(weights)
    if not paid.size:
        return plant
    names = [f"price_{plant.control_names[i]}" for i in paid]
    none = np.zeros((paid.size, plant.ny))
    return plant.rewired(plant.wiring.with_performance(none, np.diag(weights)[paid], names))


def with_measurement_noise(plant: GeneralizedPlant, noise: ArrayLike | None) -> GeneralizedPlant:
    """Append noise on the measurements to the disturbances.

    Without it a controller may amplify a small y without limit, so a price on u alone does
    not keep the gain finite.

    Parameters
    ----------
    plant : GeneralizedPlant
    noise : float or array_like, shape (ny,), or None
        Units of y per unit of w; measurements with noise 0 get no disturbance.

    Returns
    -------
    GeneralizedPlant
        The plant itself if all are zero; otherwise w = (w, noise), with disturbances named
        ``noise_`` and the name of the measurement.

    Raises
    ------
    InvalidInputError
        If the shape does not fit or a size is negative or not finite.
    """
    sizes = _weights("measurement_noise", noise, plant.ny, "units of y per unit of w")
    heard = np.flatnonzero(sizes)
    if not heard.size:
        return plant
    names = [NOISE_PREFIX + plant.measurement_names[i] for i in heard]
    return plant.rewired(plant.wiring.with_disturbances(np.diag(sizes)[:, heard], names))


def _weights(argument: str, weight: ArrayLike | None, count: int, unit: str) -> Array:
    if weight is None:
        return np.zeros(count)
    expected = f"a number of at least 0, or {count} of them, in {unit}"
    try:
        weights = np.array(np.broadcast_to(np.asarray(weight, dtype=float), (count,)))
    except (TypeError, ValueError):
        shown = described(f"shape {np.shape(weight)}")
        raise invalid(argument, shown, expected, "Pass one number per signal.") from None
    if not np.isfinite(weights).all() or (weights < 0).any():
        raise invalid(argument, weight, expected, "Check its sign.")
    return weights


# Modes that no controller of a given structure can move.

# A mode that random gains move by less than this share of the state matrix is fixed.
_MOVED = 1e-7
_GAINS = 5


def unstable_fixed_modes(
    loop: PlantMatrices, mask: NDArray[np.bool_], states: Sequence[str], unit_of_time: float = 1.0
) -> tuple[FixedMode, ...]:
    """Find unstable eigenvalues of A + B2 K C2 common to all K with the given pattern.

    With all entries free these are the modes that are uncontrollable or unobservable;
    with a pattern they are the fixed modes of Wang and Davison (1973), found as they propose:
    by gains drawn at random.

    Parameters
    ----------
    loop : PlantMatrices
        Scaled, so that entries of K of order one matter.
    mask : ndarray of bool, shape (nu, ny)
        True where K is free.
    states : sequence of str
        Names of x.
    unit_of_time : float
        Unit of the loop's time in s.

    Returns
    -------
    tuple of FixedMode
        One of each complex pair; what it lacks is a gain of the structure that moves it.
    """
    found = np.linalg.eig(loop.A)
    values: Any = np.asarray(found[0], complex)
    vectors = np.asarray(found[1])
    size = float(np.linalg.norm(loop.A, 2)) if loop.A.size else 0.0
    margin = np.abs(values) - 1 if loop.discrete else np.real(values)
    suspects = np.flatnonzero((margin >= -_MOVED * size) & (values.imag >= 0)).tolist()
    rng = np.random.default_rng(0)
    for scale in np.logspace(-1, 1, _GAINS) if suspects else ():
        closed = close_static_loop(loop, np.where(mask, scale * rng.normal(size=mask.shape), 0.0))
        if closed is not None:
            suspects = [
                i for i in suspects if np.abs(closed.poles - values[i]).min() <= _MOVED * size
            ]
    leaders = np.abs(vectors).argmax(axis=0) if suspects else ()
    return tuple(
        FixedMode(
            complex(values[i] / unit_of_time), states[int(leaders[i])], "immovable", 0.0, True
        )
        for i in suspects
    )


def refuse_fixed_modes(
    loop: PlantMatrices,
    mask: NDArray[np.bool_],
    states: Sequence[str],
    unit_of_time: float,
    what: str = "static gain",
) -> None:
    """Raise an InfeasibleError if an unstable mode is fixed.

    Parameters
    ----------
    loop, mask, states, unit_of_time
        As in :func:`unstable_fixed_modes`.
    what : str
        What is designed, for the message.
    """
    found = unstable_fixed_modes(loop, mask, states, unit_of_time)
    if not found:
        return
    unit = "" if loop.discrete else " rad/s"
    named = ", ".join(f"{mode.value_text}{unit} (state {mode.state})" for mode in found)
    kind = "of this structure " if not mask.all() else ""
    raise InfeasibleError(
        f"No {what} {kind}stabilises the plant: no gain moves the mode {named}. "
        "Add an actuator or a sensor that reaches it"
        + (", or free more entries of the structure." if kind else "."),
        [mode.eigenvalue for mode in found],
    )


def refuse_unstable(plant: GeneralizedPlant) -> None:
    """Raise an InfeasibleError unless a part without control is stable by itself."""
    if not plant.nx:
        return
    found = np.linalg.eig(plant.A)
    poles, vectors = np.asarray(found[0], complex), np.asarray(found[1])
    margin = np.abs(poles) - 1 if plant.is_discrete else np.real(poles)
    worst = int(np.argmax(margin))
    if margin[worst] >= 0:
        state = plant.states[int(np.argmax(np.abs(vectors[:, worst])))]
        raise InfeasibleError(
            f"No controller stabilises the plant: nothing joins the mode {poles[worst]:.6g} "
            f"(state {state}) to a control and a measurement. Add an actuator and a sensor there.",
            [complex(poles[worst])],
        )
