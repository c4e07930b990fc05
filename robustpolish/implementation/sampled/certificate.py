"""The certificate of a sampled loop, computed from plant, controller, period and delay alone."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import control
import flint
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix, Matrix, Vector
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import invalid, misfit, positive, state_space, whole_number
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.implementation.sampled import lifting
from robustpolish.implementation.sampled.induced_norm import (
    SMALL_STEP,
    GainTest,
    bracket,
    check_gain,
    halvings,
    peak_frequency,
)
from robustpolish.implementation.sampled.induced_norm import hamiltonian as double_hamiltonian
from robustpolish.implementation.sampled.lifting import DOUBLINGS, Phase, ScaledMap
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import Ball, BallSystem, hamiltonian, is_definite
from robustpolish.linear.systems import as_state_space, is_system
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import lag
from robustpolish.plots.poles import plot_poles

# Proofs, in ball arithmetic, of a bound on a sampled loop's norm and of a gain that it reaches.


# Stretches of a sampled loop in ball arithmetic: what doubles found, computed again with proof.

_SPARE_BITS = 140
"""Bits beyond those that doublings use up; loops of stiff machines lose 60 in inversions."""


class BallSection(NamedTuple):
    """A, G and Q of a stretch, enclosed; see `induced_norm.EnergySection`."""

    A: Ball
    G: Ball
    Q: Ball


def bits_needed(loop: ScaledMap, gamma: float) -> int:
    """Return the precision for a period: each doubling of a short step costs a bit or two."""
    tested = ((double_hamiltonian(phase, gamma), phase.length) for phase in loop.phases)
    counts = [halvings(H, length) for H, length in tested if H is not None]
    return _SPARE_BITS + 3 * max(counts, default=0)


def joined_balls(first: BallSection, second: BallSection) -> BallSection:
    """Join two stretches; whether their gain stays below one has to be proven beside it.

    Raises
    ------
    ZeroDivisionError
        If the join is singular as far as the balls can tell.
    """
    n = first.G.nrows()
    W = (balls.identity(n) - first.G * second.Q).inv()
    through = W * first.A
    return BallSection(
        second.A * through,
        balls.symmetric(second.G + second.A * W * first.G * second.A.transpose()),
        balls.symmetric(first.Q + first.A.transpose() * second.Q * through),
    )


def prove_joined_gain(first: BallSection, second: BallSection) -> bool:
    """Prove that two stretches in a row keep the gain below one.

    With S = G1 + e I for a small e > 0, S - S Q2 S > 0 says that all eigenvalues of S Q2,
    and so those of G1 Q2, lie below one.
    """
    n = first.G.nrows()
    size = float(np.linalg.norm(balls.magnitude(first.G)))
    heavy = float(np.linalg.norm(balls.magnitude(second.Q)))
    if size * heavy * (1 + 1e-12) < 1:
        return True
    S = first.G + balls.identity(n) * flint.arb(size * 2.0**-40)
    return is_definite(S) and is_definite(balls.symmetric(S - S * second.Q * S))


def phase_balls(phase: Phase, flow: Vector, gamma: float, doublings: int | None = None) -> Any:
    """Enclose a phase at gamma in the coordinates that `flow` scales.

    Parameters
    ----------
    phase : Phase
        In its own coordinates.
    flow : ndarray
        Powers of two.
    gamma : float
    doublings : int, optional
        Stop after so many, for a witness in the midst of the phase.

    Returns
    -------
    (BallSection, bool)
        The section, and whether every join in it is proven to be sound.
    """
    n = phase.A.shape[0]
    root = flint.arb(gamma).sqrt()
    own = BallSystem.of(phase).transformed(*_diagonal(1 / flow, flow))
    own = BallSystem(own.A, own.B / root, own.C / root, own.D / flint.arb(gamma))
    if not is_definite(balls.identity(own.D.ncols()) - own.D.transpose() * own.D):
        raise ZeroDivisionError
    H = hamiltonian(*own.riccati_terms())
    length = flint.arb(phase.length)
    size = float(balls.magnitude(H * length).sum(axis=0).max())
    times = max(0, math.ceil(math.log2(size / SMALL_STEP))) if size > SMALL_STEP else 0
    Phi = (H * (length * flint.arb(2) ** -times)).exp()
    upper, lower = range(n), range(n, 2 * n)
    F12, F21, F22 = (
        balls.part(Phi, *block) for block in ((upper, lower), (lower, upper), (lower, lower))
    )
    inverse = F22.inv()
    found = BallSection(
        inverse.transpose(),
        balls.symmetric(F12 * inverse),
        balls.symmetric(inverse * F21 * flint.arb(-1)),
    )
    sound = True
    for _ in range(times if doublings is None else doublings):
        sound = sound and prove_joined_gain(found, found)
        found = joined_balls(found, found)
    return found, sound


def _diagonal(*scales: Vector) -> tuple[Ball, ...]:
    return tuple(balls.ball(np.diag(scale)) for scale in scales)


def period_balls(loop: ScaledMap, gamma: float) -> tuple[BallSection, bool]:
    """Enclose a whole period, in the loop's scaled states at the samples."""
    found: Any = None
    sound = True
    for phase in loop.map.phases:
        own, safe = phase_balls(phase, loop.flow, gamma)
        sound = sound and safe and (found is None or prove_joined_gain(found, own))
        found = own if found is None else joined_balls(found, own)
    return at_samples(loop, *found), sound


def at_samples(loop: ScaledMap, A: Ball, reached: Ball, seen: Ball) -> BallSection:
    """Return what the flow of a period means for the states at its samples."""
    L, N = loop.map.connected(balls.ball, lambda a, b: a * b)
    into, back, out, flow = _diagonal(1 / loop.sample, loop.sample, 1 / loop.flow, loop.flow)
    L, M = out * L * back, into * balls.ball(loop.map.M) * flow
    return BallSection(
        into * N * back + M * A * L,
        balls.symmetric(M * reached * M.transpose()),
        balls.symmetric(L.transpose() * seen * L),
    )


# The H2 norm of a sampled loop: the root of the average power of z under white noise w.
#
# Noise of unit density enters at all times, not only at the samples; the power of z is
# averaged over a period. Stretches are joined as for the induced norm, here with energies only.

_TERMS = 40
_SMALL = 0.25
_POWER_SPARE_BITS = 160
_POWER_MARGINS = (1e-12, 1e-10, 1e-8, 1e-6, 1e-4)


class PowerSection(NamedTuple):
    """State map A, covariance W from noise within, energy Q of the state, energy J of the noise."""

    A: Ball
    W: Ball
    Q: Ball
    J: Any


def average_power(loop: ScaledMap) -> tuple[float, float] | None:
    """Enclose the H2 norm of a stable loop whose D11 is zero, with proof.

    Parameters
    ----------
    loop : ScaledMap

    Returns
    -------
    (lower, upper) or None
        None if stability or the upper bound could not be proven.

    Notes
    -----
    The norm of B. Bamieh and J. B. Pearson, "The H2 problem for sampled-data systems", Systems &
    Control Letters 19 (1992) 1-12: impulses at all instants of a period are averaged over.
    """
    h = loop.map.period
    times = [_halvings(loop, phase) for phase in loop.map.phases]
    with balls.precision(_POWER_SPARE_BITS + 3 * max(times)):
        parts = (_phase(loop, *each) for each in zip(loop.map.phases, times, strict=True))
        flow = functools.reduce(_joined, parts)
        A, W, Q = at_samples(loop, flow.A, flow.W, flow.Q)
        upper = _covariance_above(A, W)
        if upper is None:
            return None
        high = ((flow.J + (Q * upper).trace()) / flint.arb(h)).sqrt().upper()
        S = W
        for _ in range(DOUBLINGS):
            grown = balls.symmetric(S + A * S * A.transpose())
            done = (Q * (grown - S)).trace() < 1e-14 * (Q * grown).trace()
            S, A = grown, A * A
            if done:
                break
        low = ((flow.J + (Q * S).trace()) / flint.arb(h)).sqrt().lower()
    return max(0.0, float(low) * (1 - 1e-15)), float(high) * (1 + 1e-15)


def _halvings(loop: ScaledMap, phase: Phase) -> int:
    A = phase.A * loop.flow / loop.flow[:, None]
    size = 2 * max(np.linalg.norm(A, 1), np.linalg.norm(A, np.inf)) * phase.length / _SMALL
    return max(0, math.ceil(math.log2(size))) if size > 1 else 0


def _phase(loop: ScaledMap, phase: Phase, times: int) -> PowerSection:
    A, B, C, _ = BallSystem.of(phase).transformed(*_diagonal(1 / loop.flow, loop.flow))
    step = flint.arb(phase.length) * flint.arb(2) ** -times
    weight, source = C.transpose() * C, B * B.transpose()
    W, Q = source * step, weight * step
    J = (source * weight).trace() * step * step / 2
    term_w, term_q, factor = source, weight, step
    for k in range(1, _TERMS):
        term_w = balls.symmetric(A * term_w) * flint.arb(2)
        term_q = balls.symmetric(A.transpose() * term_q) * flint.arb(2)
        factor = factor * step / (k + 1)
        W, Q = W + term_w * factor, Q + term_q * factor
        J = J + (source * term_q).trace() * factor * step / (k + 2)
    # What the series leaves out: each term is at most a quarter of the one before it.
    rest = flint.arb(_SMALL) ** _TERMS * step
    size_w, size_q = _norm(source), _norm(weight)
    n = A.nrows()
    found = PowerSection(
        (A * step).exp(),
        W + _unknown(n, rest * size_w),
        Q + _unknown(n, rest * size_q),
        J + flint.arb(0, (rest * step * size_w * size_q * n).upper()),
    )
    for _ in range(times):
        found = _joined(found, found)
    return found


def _joined(first: PowerSection, second: PowerSection) -> PowerSection:
    return PowerSection(
        second.A * first.A,
        balls.symmetric(second.W + second.A * first.W * second.A.transpose()),
        balls.symmetric(first.Q + first.A.transpose() * second.Q * first.A),
        first.J + second.J + (second.Q * first.W).trace(),
    )


def _covariance_above(A: Ball, W: Ball) -> Ball | None:
    """Return an S with S > A S A' + W, which proves stability and bounds the covariance."""
    step, source = balls.midpoint(A), balls.midpoint(W)
    if np.abs(np.linalg.eigvals(step)).max(initial=0.0) >= 1:
        return None
    size = max(float(np.linalg.norm(source, 2)), 1e-300)
    for margin in _POWER_MARGINS:
        S: Any = linalg.solve_discrete_lyapunov(step, source + margin * size * np.eye(len(step)))
        if not np.isfinite(S).all():
            return None
        ball = balls.symmetric(balls.ball(S))
        if is_definite(balls.symmetric(ball - A * ball * A.transpose() - W)) and is_definite(ball):
            return ball
    return None


def _norm(matrix: Ball) -> Any:
    """Return an upper bound of the Frobenius norm."""
    return sum((entry * entry for entry in matrix.entries()), flint.arb(0)).sqrt()


def _unknown(n: int, radius: Any) -> Ball:
    return flint.arb_mat(n, n, [flint.arb(0, radius.upper())] * (n * n))


SLACKS = (2e-6, 1e-5, 1e-4, 1e-3)
"""How far above the norm a bound may be claimed: the first that can be proven is."""

_MARGINS = (1e-13, 1e-11, 1e-9, 1e-7)
"""Energy of the states, beside that of z in a period, by which the inequality is kept strict."""

_REFINEMENTS = 5
_BITS_PER_STAGE = (24, 120)
"""Bits that a doubling over periods may cost where the gain comes near to gamma; tried in turn.

NN7 of COMPleib, nine states of the controller, needs the second.
"""


def prove_below(loop: ScaledMap, gamma: float) -> tuple[float, Matrix] | None:
    """Prove that a loop is stable and its norm at most a little above gamma.

    Parameters
    ----------
    loop : ScaledMap
    gamma : float
        The norm as doubles found it, positive.

    Returns
    -------
    (bound, storage) or None
        With x'Px, which falls by more in every period than z gained over bound^2 w.
    """
    for slack in SLACKS:
        bound = gamma * (1 + slack)
        try:
            with balls.precision(bits_needed(loop, bound)):
                section, sound = period_balls(loop, bound)
                for margin in _MARGINS if sound else ():
                    storage = check_gain(loop, bound, margin).storage
                    proven = None if storage is None else _dissipating(section, storage, margin)
                    if proven is not None:
                        return bound, proven
        except ZeroDivisionError:
            continue
    return None


def _dissipating(section: BallSection, storage: Matrix, margin: float) -> Matrix | None:
    """Return a storage function that is proven, refined from one that doubles found."""
    if not np.isfinite(storage).all():
        return None
    n = len(storage)
    P = balls.symmetric(balls.ball(storage))
    level = margin * float(np.linalg.norm(balls.midpoint(section.Q), 2))
    extra = balls.identity(n) * flint.arb(level)
    for _ in range(_REFINEMENTS):
        through = (balls.identity(n) - section.G * P).inv() * section.A
        after = balls.symmetric(section.A.transpose() * P * through)
        if _dissipates(section, P, after):
            return balls.midpoint(P)
        rest = balls.midpoint(section.Q + extra + after - P)
        step = _lyapunov_sum(balls.midpoint(through), rest)
        if step is None:
            return None
        P = balls.symmetric((P + balls.ball(step)).mid())
    return None


def _lyapunov_sum(through: Matrix, rest: Matrix) -> Matrix | None:
    """Return the sum of T'^k R T^k: Newton's step on the Riccati equation."""
    total, power = rest, through
    for _ in range(DOUBLINGS):
        added = power.T @ total @ power
        total, power = total + added, power @ power
        if not np.isfinite(total).all():
            return None
        if np.linalg.norm(added) <= 1e-16 * np.linalg.norm(total):
            return (total + total.T) / 2
    return None


def _dissipates(section: BallSection, P: Ball, after: Ball) -> bool:
    """Prove P > 0, P^-1 > G and P > Q + A'(P^-1 - G)^-1 A."""
    return (
        is_definite(balls.symmetric(P - section.Q - after))
        and is_definite(P)
        and is_definite(balls.symmetric(P - P * section.G * P))
    )


def prove_above(loop: ScaledMap, test: GainTest) -> bool:
    """Prove that the gain which a failed test saw is really reached, by an input that ends.

    The costate l names an input that costs l'G1 l and brings the energy l'G1 Q2 G1 l afterwards.

    Parameters
    ----------
    loop : ScaledMap
    test : GainTest
        One that failed.

    Returns
    -------
    bool
        False where the balls leave it open.
    """
    if test.stage < 0 and test.phase >= 0:
        # D alone reaches gamma in each phase, for inputs that change quickly enough.
        gains = [np.linalg.norm(p.D, 2) if p.D.size else 0.0 for p in loop.phases]
        return all(gain * (1 - 1e-13) >= test.gamma for gain in gains)
    if test.costate is None or not test.costate.any():
        return False
    return any(_witnessed(loop, test, test.costate, bits) for bits in _BITS_PER_STAGE)


def _witnessed(loop: ScaledMap, test: GainTest, costate: Matrix, bits_per_stage: int) -> bool:
    """Compare cost and energy of the input that a costate names."""
    bits = bits_needed(loop, test.gamma) + bits_per_stage * max(0, test.stage)
    try:
        with balls.precision(bits):
            first, second = _pair(loop, test)
            direction = first.G * balls.ball(costate[:, None])
            cost = (balls.ball(costate[None, :]) * direction)[0, 0]
            gain = (direction.transpose() * second.Q * direction)[0, 0]
            return bool(cost > 0 and gain >= cost)
    except ZeroDivisionError:
        return False


def _pair(loop: ScaledMap, test: GainTest) -> tuple[BallSection, BallSection]:
    """Return the two stretches between which the gain is reached."""
    phases = loop.map.phases
    if test.phase < len(phases):
        found, _ = phase_balls(phases[test.phase], loop.flow, test.gamma, test.stage)
        return found, found
    parts = [phase_balls(phase, loop.flow, test.gamma)[0] for phase in phases]
    if test.phase == len(phases):
        return parts[0], parts[1]
    section = at_samples(loop, *functools.reduce(joined_balls, parts))
    for _ in range(test.stage):
        section = joined_balls(section, section)
    return section, section


# Analogue filters before the samplers, which stay continuous in every check.

AntiAliasing = (
    float | int | tuple[int, float] | control.StateSpace | control.TransferFunction | None
)
"""None, a corner in Hz (Butterworth, second order), (order, corner in Hz), or a filter."""

_REMEDY = "Pass a corner in Hz, (order, corner in Hz), or a stable continuous system."


def filter_system(anti_aliasing: AntiAliasing, measurements: int) -> control.StateSpace | None:
    """Return the filter of all measurements as one system.

    Parameters
    ----------
    anti_aliasing : number, (int, number), control system or None
        A corner in Hz: a Butterworth filter of second order, or of the order given, for each
        measurement. A system with one input and output filters each measurement alike.
    measurements : int
        Number of signals to filter.

    Returns
    -------
    control.StateSpace or None

    Raises
    ------
    InvalidInputError
        If it is no such filter, or not stable.
    """
    if anti_aliasing is None:
        return None
    found: Any = anti_aliasing
    if is_system(found):
        found = as_state_space("anti_aliasing", found)
    if isinstance(found, control.StateSpace):
        _check(found, measurements)
    else:
        if isinstance(found, tuple | list) and len(found) != 2:
            raise invalid("anti_aliasing", found, "(order, corner in Hz)", _REMEDY)
        order, corner = found if isinstance(found, tuple | list) else (2, found)
        if isinstance(corner, bool | str) or isinstance(order, bool):
            raise invalid("anti_aliasing", found, "a filter or its corner in Hz", _REMEDY)
        order = whole_number("anti_aliasing, its order", order, 1, 8, _REMEDY)
        found = lag(positive("anti_aliasing", corner, "Hz"), order, None, 0)
    if found.ninputs == measurements:
        return found
    each = [np.kron(np.eye(measurements), M) for M in matrices_of(found)]
    return control.StateSpace(*each, 0, remove_useless_states=False)


def with_filter(plant: GeneralizedPlant, found: control.StateSpace | None) -> GeneralizedPlant:
    """Return the plant whose measurements have passed the filter; w that acts on y does so too.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    found : control.StateSpace or None

    Returns
    -------
    GeneralizedPlant
        With the delays of the plant, which stand before the filter.
    """
    if found is None:
        return plant
    wiring = plant.wiring
    return plant.rewired(wiring.series("output", wiring.nz, found, "filter"))


def _check(found: control.StateSpace, measurements: int) -> None:
    state_space("anti_aliasing", found)
    sizes = found.ninputs, found.noutputs
    if found.dt not in (0, None):
        shown, want = f"a discrete system, dt = {found.dt}", "a continuous filter"
    elif sizes not in ((1, 1), (measurements, measurements)):
        shown, want = f"{sizes[0]} inputs and {sizes[1]} outputs", f"1 or {measurements} of each"
    elif found.nstates and np.linalg.eigvals(found.A).real.max() >= 0:
        shown, want = "an unstable filter", "a stable one"
    else:
        return
    raise misfit("anti_aliasing", shown, want, _REMEDY)


Norm = Literal["hinf", "h2"]

_TIGHT = 1.002
"""A bound further above the reached gain than this is told as loose."""

_BELOW = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)


@dataclass(frozen=True, eq=False, repr=False)
class SampledCertificate(Displayed):
    """What is proven about a continuous plant with a controller that acts at samples.

    Attributes
    ----------
    norm : {"hinf", "h2"}
        "hinf": the gain from w to z in energy, with everything between the samples; "h2": the
        root of the average power of z under white noise w of unit density.
    valid : bool
        True only if stability and `bound` are proven.
    reasons : tuple of str
        Why it is not valid; empty if it is.
    stable : bool
        Whether the poles, as doubles see them, are stable.
    achieved : float
        The norm; infinite if unstable.
    lower, bound : float
        The norm lies between them, both proven in ball arithmetic; 0 and infinity where not.
    peak_frequency : float or None
        Where a disturbance has this gain, rad/s, up to half the sample rate; it may also hold
        parts at this frequency plus multiples of the sample rate. None for "h2".
    poles : ndarray of complex
        Of the loop from sample to sample.
    period, delay : float
        In s.
    notes : tuple of str
        What was assumed.
    storage : ndarray or None
        The matrix behind the bound of "hinf": s'P s falls in each period by more than the energy
        of z less bound^2 times that of w, in the scaled states of the proof, rounded to doubles.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.implementation.certify_sampled(plant, [[-3.0]], period=0.3, delay=0.12)
    Certificate of the sampled loop: valid
      induced L2 norm achieved  0.797087
      proven to be at least     0.797086
      proven to be at most      0.797088
      peak at [Hz]               0.48673
      period [s]                     0.3
      delay [s]                     0.12
      largest pole              0.676701
    """

    norm: Norm
    valid: bool
    reasons: tuple[str, ...]
    stable: bool
    achieved: float
    lower: float
    bound: float
    peak_frequency: float | None
    poles: NDArray[np.complex128]
    period: float
    delay: float
    notes: tuple[str, ...] = ()
    storage: Matrix | None = field(default=None, repr=False)

    @property
    def upper(self) -> float:
        """The same as `bound`."""
        return self.bound

    @property
    def spectral_radius(self) -> float:
        """Size of the largest pole; below 1 for a stable loop."""
        return float(np.abs(self.poles).max(initial=0.0))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the poles of the loop from sample to sample.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.implementation.certify_sampled(plant, [[-3.0]], period=0.1).plot().get_xlabel()
        'real part'
        """
        return plot_poles({"poles of the sampled loop": self.poles}, None, ax, discrete=True)

    def _card(self) -> Card:
        name = "induced L2 norm" if self.norm == "hinf" else "H2 norm"
        peak = None if self.peak_frequency is None else self.peak_frequency / (2 * np.pi)
        rows = (
            (f"{name} achieved", self.achieved),
            ("proven to be at least", self.lower),
            ("proven to be at most", self.bound),
            *([("peak at [Hz]", peak)] if self.norm == "hinf" else []),
            ("period [s]", self.period),
            ("delay [s]", self.delay),
            ("largest pole", self.spectral_radius),
        )
        title = f"Certificate of the sampled loop: {'valid' if self.valid else 'NOT valid'}"
        return Card(title, (quantities(*rows),), (*self.reasons, *self.notes))


@single_threaded_blas
def certificate_of(
    plant: GeneralizedPlant, controller: control.StateSpace, delay: float, norm: Norm
) -> SampledCertificate:
    """Certify a loop whose arguments have been checked; see `certify_sampled`."""
    period = float(controller.dt)
    given = plant
    plant, own = lifting.without_loop_delay(plant)
    found = lifting.period_map(plant, controller, period, delay + own)
    loop = lifting.scaled(found)
    with np.errstate(over="ignore", invalid="ignore"):
        transition = loop.transition()
    if not np.isfinite(transition).all():
        raise lifting.beyond_a_period(period)
    poles: Any = np.linalg.eigvals(transition).astype(complex)
    poles = poles[np.argsort(-np.abs(poles), kind="stable")]
    notes = [*_delay_notes(given, plant, own), *_noise_notes(plant, found.noisy)]
    size = float(np.abs(poles).max(initial=0.0))
    reason = "stability and norm could not be proven in ball arithmetic"
    lower, achieved, bound, storage, peak = 0.0, np.inf, np.inf, None, None
    if not size < 1:
        worst = poles[0] if poles.size else size
        reason = f"the sampled loop is unstable: a pole of size {abs(worst):.6g} at {worst:.6g}"
    elif norm == "h2":
        if power := average_power(loop):
            lower, bound = power
            achieved = bound
    elif tests := bracket(loop, _first_guess(loop)):
        failed, passed = tests
        achieved = passed.gamma
        if failed.gamma > 0:
            peak, lower = peak_frequency(loop, achieved), _proven_gain(loop, failed)
        bound, storage = prove_below(loop, achieved) or (np.inf, None)
    else:
        reason = "no finite gain was found"
    if np.isfinite(bound) and lower > 0 and bound > _TIGHT * lower:
        notes.append(f"between {lower:.6g} and {bound:.6g} nothing was decided")
    return SampledCertificate(
        norm=norm,
        valid=bool(np.isfinite(bound)),
        reasons=() if np.isfinite(bound) else (reason,),
        stable=bool(size < 1),
        achieved=float(achieved),
        lower=float(lower),
        bound=float(bound),
        peak_frequency=peak,
        poles=poles,
        period=period,
        delay=delay,
        notes=tuple(notes),
        storage=storage,
    )


def _first_guess(loop: lifting.ScaledMap) -> float:
    """Return a gain of the right order, from the energies of a single period."""
    guess = max(
        float(np.linalg.norm(p.C) * np.linalg.norm(p.B)) * p.length + float(np.linalg.norm(p.D))
        for p in loop.phases
    )
    return guess if guess > 0 and np.isfinite(guess) else 1.0


def _proven_gain(loop: lifting.ScaledMap, failed: GainTest) -> float:
    """Return the largest gain near that of a failed test which is proven to be reached."""
    for part in _BELOW:
        test = failed if part == 0 else check_gain(loop, failed.gamma * (1 - part))
        if test.gamma > 0 and not test.below and prove_above(loop, test):
            return test.gamma
    return 0.0


def _delay_notes(given: GeneralizedPlant, plant: GeneralizedPlant, own: float) -> list[str]:
    """Say which delays of the plant, other than that of the computation, are models."""
    notes = []
    if own:
        exact = f"the plant's own delays ({', '.join(given.delays)}) are exact: {own:.6g} s round"
        notes.append(f"{exact} the loop{', the rest is not' if plant.delays else ''}")
    if plant.delays:
        left = ", ".join(f"{seconds:.6g} s at {name}" for name, seconds in plant.delays.items())
        notes.append(f"proven for Pade models of the plant's own delays ({left})")
    return notes


def _noise_notes(plant: GeneralizedPlant, noisy: tuple[int, ...]) -> list[str]:
    names = ", ".join(plant.measurement_names[i] for i in noisy)
    note = (
        f"What w adds directly to {names} enters as its average over the period before each "
        "sample (a discrete noise of the same density): sampled as it is, without a filter, its "
        "gain would be infinite."
    )
    return [note] * bool(noisy)


# The gain of a sampled loop for disturbances of one frequency at a time.

_POINTS = 120
_DECADES = 4.0


def sinusoid_gains(
    plant: GeneralizedPlant, controller: control.StateSpace, delay: float
) -> xr.DataArray:
    """Return the largest RMS of z for a sinusoidal w of RMS one, over frequency.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter; the sampled loop is stable.
    controller : control.StateSpace
        Discrete.
    delay : float
        In s.

    Returns
    -------
    xarray.DataArray
        Over `frequency` in Hz, up to half the sample rate. z holds other frequencies besides,
        which count too.
    """
    period = float(controller.dt)
    plant, own = lifting.without_loop_delay(plant)
    loop = lifting.scaled(lifting.period_map(plant, controller, period, delay + own))
    poles = np.abs(np.angle(np.linalg.eigvals(loop.transition()))) / (2 * np.pi * period)
    grid = 0.5 / period * np.logspace(-_DECADES, 0, _POINTS)
    hertz = np.unique(np.concatenate([grid, poles[poles > grid[0]]]))
    coords = {"frequency": ("frequency", hertz, {"units": "Hz"})}
    return xr.DataArray([_gain(loop, 2 * np.pi * f) for f in hertz], coords, "frequency")


def _gain(loop: lifting.ScaledMap, omega: float) -> float:
    n, m = loop.phases[0].B.shape
    through: AnyMatrix = np.eye(n + m, dtype=complex)
    energy: AnyMatrix = np.zeros((n + m, n + m), dtype=complex)
    for phase in loop.phases:
        E = np.zeros((n + m, n + m), dtype=complex)
        E[:n, :n], E[:n, n:], E[n:, n:] = phase.A, phase.B, 1j * omega * np.eye(m)
        step, own = _flow(E, np.hstack([phase.C, phase.D]), phase.length)
        energy = energy + through.conj().T @ own @ through
        through = step @ through
    back = np.exp(1j * omega * loop.map.period) * np.eye(len(loop.N)) - loop.N
    back = back - loop.M @ through[:n, :n] @ loop.L
    start = np.vstack([loop.L @ np.linalg.solve(back, loop.M @ through[:n, n:]), np.eye(m)])
    power: Any = np.linalg.eigvalsh(start.conj().T @ energy @ start) / loop.map.period
    return float(np.sqrt(max(power[-1], 0.0)))


def _flow(E: AnyMatrix, out: AnyMatrix, length: float) -> tuple[AnyMatrix, AnyMatrix]:
    """Return the exponential and the energy of the output, in steps too short to overflow."""
    n = len(E)
    times = max(0, int(np.ceil(np.log2(max(np.linalg.norm(E, 1) * length, 1e-300)))))
    weight = out.conj().T @ out
    block = np.block([[-E.conj().T, weight], [np.zeros((n, n)), E]]) * (length / 2**times)
    found = np.asarray(linalg.expm(block))
    step = found[n:, n:]
    energy = step.conj().T @ found[:n, n:]
    for _ in range(times):
        # Exponential and energy over twice the time.
        step, energy = step @ step, energy + step.conj().T @ energy @ step
    return step, energy
