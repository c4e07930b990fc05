"""Whether a plant can be stabilised and is regular; price and noise, which make it regular."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid
from robustpolish.errors import InfeasibleError
from robustpolish.linear.arithmetic.rational import EXACT_STATES
from robustpolish.linear.controllability import controllability
from robustpolish.linear.zeros import AxisZero, zeros_on_axis
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import NOISE_PREFIX
from robustpolish.synthesis.problem.matrices import PlantMatrices, close_static_loop
from robustpolish.synthesis.problem.scaling import scale_plant

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
    """

    fixed_modes: tuple[FixedMode, ...]
    d12_rank: int
    d21_rank: int
    d12_full: bool
    d21_full: bool
    control_zeros: tuple[AxisZero, ...] | None = None
    measurement_zeros: tuple[AxisZero, ...] | None = None

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
            raise infeasible_modes_error(exact)

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


def _zeros(A: Matrix, B: Matrix, C: Matrix, D: Matrix, dt: Any) -> tuple[AxisZero, ...]:
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
    return SolvabilityCheck(tuple(modes), rank12, rank21, rank12 == plant.nu, rank21 == plant.ny)


def _looks_fixed(A: Matrix, B: Matrix, discrete: bool) -> bool:
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


def infeasible_modes_error(modes: Sequence[FixedMode]) -> InfeasibleError:
    """Return the error that names the modes for which no controller exists."""
    listed = "; ".join(str(mode) for mode in modes)
    remedies = {
        "uncontrollable": "add an actuator that reaches it",
        "unobservable": "add a sensor that sees it",
    }
    remedy = " and ".join(
        text for lack, text in remedies.items() if lack in {mode.lack for mode in modes}
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
