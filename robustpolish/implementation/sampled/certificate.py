"""The certificate of a sampled loop, computed from plant, controller, period and delay alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix, Matrix
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import invalid, misfit, positive, state_space, whole_number
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.implementation.sampled import lifting
from robustpolish.implementation.sampled.induced_norm import (
    GainTest,
    bracket,
    check_gain,
    peak_frequency,
)
from robustpolish.implementation.sampled.proof import average_power, prove_above, prove_below
from robustpolish.plants.blocks import as_state_space, is_system, matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import lag
from robustpolish.plots.poles import plot_poles

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
