"""Singular values over frequency, and the H-infinity norm with its peak and proven bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import isqrt
from typing import Any

import control
import numpy as np
import scipy.linalg as sla
import xarray as xr
from flint import arb, fmpq, fmpq_mat, fmpq_poly, fmpz_poly
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from robustpolish.base.arrays import AGREE, EPS, Vector
from robustpolish.base.budget import check_deadline, single_threaded_blas
from robustpolish.base.checks import described, invalid, positive, source_of
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic import exact as rational
from robustpolish.linear.arithmetic.balls import block
from robustpolish.linear.arithmetic.exact import bracket, rescaled
from robustpolish.linear.norms.modal_peak import Peak, modal_form
from robustpolish.linear.scaling import equilibrating_scales, in_units, parts
from robustpolish.linear.stability import (
    Eigensystem,
    eigensystem,
    positive_roots,
    stability_of,
    stable_part,
)
from robustpolish.linear.systems import Realisation, hamiltonian, realisation, resolvent_response
from robustpolish.plots.frequency import plot_gains

# Frequencies that show what a system does: an even background, and points at every resonance.

_BACKGROUND = 400
# Rates this far below the fastest are poles at 0 that rounding moved (a double one by the root
# of the precision).
_AT_REST = 1e-8


def frequency_grid(poles: Any, highest: float = math.inf) -> Vector:
    """Return frequencies from a tenth of the slowest pole to ten times the fastest.

    Parameters
    ----------
    poles : ndarray of complex
        Poles, and zeros if these count too, in rad/s; infinities and what is at 0 are ignored.
    highest : float, optional
        No frequency lies above it, such as pi over the sampling time.

    Returns
    -------
    ndarray of float
        Rising, in rad/s, above 0; dense around each resonance however narrow it is.

    Examples
    --------
    >>> import numpy as np
    >>> from robustpolish.linear.norms.hinf import frequency_grid
    >>> grid = frequency_grid(np.array([-1e-9 + 3j, -1e-9 - 3j]))
    >>> int(np.sum(abs(grid - 3) < 1e-8)) > 10
    True
    """
    rates = np.abs(poles)
    rates = rates[(rates > 0) & np.isfinite(rates)]
    rates = rates[rates > _AT_REST * rates.max(initial=0.0)]
    low, high = (rates.min(), rates.max()) if rates.size else (1.0, 1.0)
    background = np.geomspace(low / 10, min(high * 10, highest), _BACKGROUND)
    points = np.unique(np.concatenate([background, *around_resonances(poles)]))
    return points[(points > 0) & (points <= highest)]


def around_resonances(poles: Any) -> Iterator[Vector]:
    """Yield frequencies in rad/s around each complex pole, dense however narrow its resonance."""
    for pole in poles[(np.abs(poles.imag) > 0) & np.isfinite(poles)]:
        away = np.geomspace(max(abs(pole.real / pole.imag), 1e-12) / 10, 0.3, 40)
        yield abs(pole.imag) * np.concatenate([1 - away[::-1], [1.0], 1 + away])


def singular_values(
    system: control.StateSpace, frequencies_hz: ArrayLike | None = None
) -> xr.DataArray:
    """Compute the singular values of a system's frequency response.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete; an unspecified sampling time means continuous.
    frequencies_hz : array_like, optional
        Frequencies in Hz, not negative (cycles per sample if ``dt`` is True). By default from a
        tenth of the slowest pole to ten times the fastest, dense around every resonance however
        narrow it is.

    Returns
    -------
    xarray.DataArray
        Over ``frequency`` in Hz and ``singular_value`` (0 is the largest), in output units per
        input unit. Infinite at a pole on the boundary of stability, and where it is beyond doubles.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, has entries that are not finite, or a frequency is negative.

    See Also
    --------
    hinf_norm : the largest of all, proven.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0)
    >>> gains = rp.linear.singular_values(lag, [0.0, 1 / 3.141592653589793])
    >>> [round(float(gain), 6) for gain in gains.isel(singular_value=0)]
    [1.0, 0.707107]
    """
    model = realisation("system", system)
    scaled = rescaled(model) if model.states else model
    if frequencies_hz is None:
        hertz = _grid(scaled)
    else:
        hertz = np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
        if hertz.ndim != 1 or not (hertz >= 0).all():
            shown = described(repr(frequencies_hz))
            raise invalid("frequencies_hz", shown, "a list of numbers from 0 on", "Give Hz.")
    angles = 2 * math.pi * hertz * (scaled.step if scaled.discrete else 1 / scaled.time)
    values = scaled.gain * np.array([_at(scaled, angle) for angle in angles])
    coords = {"frequency": ("frequency", hertz, {"units": "Hz"})}
    dims = ("frequency", "singular_value")
    return xr.DataArray(values.reshape(hertz.size, -1), coords, dims, "gain")


def _grid(model: Realisation) -> Vector:
    """Return frequencies in Hz: an even background, and points around each resonance."""
    poles: Any = np.linalg.eigvals(model.A) if model.states else np.zeros(0, complex)
    highest = math.inf
    if model.discrete:
        with np.errstate(divide="ignore"):
            poles = np.log(poles.astype(complex)) / model.step
        highest = math.pi / model.step
    return frequency_grid(poles, highest) * model.time / (2 * math.pi)


def _at(model: Realisation, angle: float) -> Vector:
    """Return the singular values at one frequency, scaled, in rad (per sample)."""
    point = np.exp(1j * angle) if model.discrete else 1j * angle
    if 0 in model.D.shape:
        return np.zeros(0)
    response = model.D
    if math.isfinite(angle):
        points = np.array([point])
        response = resolvent_response(model.A, model.B, model.C, model.D, points)[0]
    if not np.isfinite(response).all():  # a pole, or one that it all but hits
        return np.full(min(model.D.shape), np.inf)
    return np.asarray(np.linalg.svd(response, compute_uv=False), dtype=float)


# The peak of the gain with a bracket, proven in exact arithmetic or estimated in double.


# The frequencies at which a singular value equals a given gain, in exact arithmetic.


def gain_crossings(model: rational.ExactModel, square: fmpq) -> list[fmpq]:
    """Return the frequencies x >= 0 at which a singular value of G is the root of `square`.

    The Hamiltonian matrix (continuous time) or the symplectic pencil (discrete
    time) has an eigenvalue on the stability boundary at just these
    frequencies. Its characteristic polynomial is even; as a polynomial in x^2
    it is computed without rounding, so an empty list is a proof.

    Parameters
    ----------
    model : ExactModel
        No pole of it may lie on the stability boundary.
    square : fmpq
        Square of the gain, above that of D.

    Returns
    -------
    list of fmpq
        Ascending, each to about 128 bits.
    """
    A, B, C, D = model.A, model.B, model.C, model.D
    n, price = model.states, D.transpose() * D - rational.identity(D.ncols()) * square
    if model.discrete:
        nodes = range(n + 1)
        values = [_pencil_determinant(model, price, k) for k in nodes]
        table = fmpq_mat([[(-k * k) ** j for j in nodes] for k in nodes])  # x^2 = -s^2
        polynomial = fmpq_poly(table.solve(fmpq_mat(n + 1, 1, values)).entries())
    else:
        Ct = C.transpose()
        terms = balls.riccati_terms(A, B, Ct * C, Ct * D, price)
        coefficients = balls.hamiltonian(*terms).charpoly().coeffs()[::2]
        polynomial = fmpq_poly([(-1) ** k * c for k, c in enumerate(coefficients)])
    roots = positive_roots(fmpz_poly(polynomial.numer().coeffs()))
    return sorted(_square_root(root.real.mid().fmpq()) for root, _ in roots)


def _square_root(value: fmpq) -> fmpq:
    """Return the root to 100 bits or more."""
    shift = 200
    while value != 0 and (int(value.p) << shift) // int(value.q) < 1 << 220:
        shift += 200
    return fmpq(isqrt((int(value.p) << shift) // int(value.q)), 1 << (shift // 2))


def _pencil_determinant(model: rational.ExactModel, price: fmpq_mat, s: int) -> fmpq:
    """Return the determinant of the symplectic pencil at s = (z - 1)/(z + 1).

    The unknowns are state, co-state and input; the rows of the states are multiplied by 1 - s.
    """
    check_deadline()
    A, B, C, D = model.A, model.B, model.C, model.D
    n, one, Ct = model.states, rational.identity(model.states), model.C.transpose()
    At, none = A.transpose(), fmpq_mat(n, n)
    up, down = 1 - s, 1 + s
    rows = [
        [A * up - one * down, none, B * up],
        [Ct * C * -down, one * up - At * down, Ct * D * -down],
        [D.transpose() * C, B.transpose(), price],
    ]
    return block(rows).det()


# The peak of the gain in double precision: quick, good for a start, with an honest error bar.


def cayley(model: Realisation) -> Realisation:
    """Map a discrete system by z = (1 + s)/(1 - s), which keeps its gains; others stay."""
    if not model.discrete or model.states == 0:
        return model
    one = np.eye(model.states)
    factors = sla.lu_factor(model.A + one, check_finite=False)
    B = sla.lu_solve(factors, model.B, check_finite=False)
    A = sla.lu_solve(factors, model.A - one, check_finite=False)
    C = sla.lu_solve(factors, model.C.T, trans=1, check_finite=False).T
    return Realisation(A, math.sqrt(2) * B, math.sqrt(2) * C, model.D - model.C @ B, False)


def largest_response(model: Realisation, frequencies: Vector | None = None) -> tuple[float, float]:
    """Return the frequency x, s = i x, of the largest gain of some, and this gain.

    By default they are those of the poles, where the gain is a rough size of the norm.
    """
    if 0 in model.D.shape:
        return 0.0, 0.0
    if frequencies is None:
        frequencies = _seeds(np.linalg.eigvals(model.A).astype(complex))
    gains = np.full(len(frequencies), np.linalg.norm(model.D, 2))
    finite = np.flatnonzero(np.isfinite(frequencies)) if model.states else np.zeros(0, int)
    for start in range(0, finite.size, 64):  # bounds the memory for large systems
        where = finite[start : start + 64]
        points = 1j * frequencies[where]
        G = resolvent_response(model.A, model.B, model.C, model.D, points)
        G[~np.isfinite(G).all(axis=(1, 2))] = 0.0  # a pole on the axis to rounding
        gains[where] = np.linalg.svd(G, compute_uv=False)[:, 0]
    best = int(gains.argmax())
    return float(frequencies[best]), float(gains[best])


def peak(
    model: Realisation, poles: NDArray[np.complex128], tolerance: float
) -> tuple[float, float]:
    """Climb to the largest gain by the two-step iteration of Bruinsma and Steinbuch.

    Returns
    -------
    frequency, gain : float
        Not certified: crossings that rounding hides are missed.
    """
    frequency, gain = largest_response(model, _seeds(poles))
    for _ in range(30):
        level = gain * (1 + tolerance)
        crossings = _crossings(model, level) if gain else np.empty(0)
        if crossings.size == 0:
            break
        middles = 0.5 * (crossings[1:] + crossings[:-1])
        there, reached = largest_response(model, np.concatenate([crossings, middles]))
        if reached > gain:
            frequency, gain = there, reached
        if reached <= level:
            break
    return frequency, gain


def _seeds(poles: NDArray[np.complex128]) -> Vector:
    radius = np.abs(poles)
    damping = np.divide(poles.real, radius, out=np.ones_like(radius), where=radius > 0)
    resonance = radius * np.sqrt(np.clip(1 - 2 * damping**2, 0, None))
    return np.unique(np.concatenate([[0.0, np.inf], radius, np.abs(poles.imag), resonance]))


@np.errstate(over="ignore", invalid="ignore")  # what has no size has no near eigenvalues
def _crossings(model: Realisation, gamma: float) -> Vector:
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return np.empty(0)
    eigenvalues = np.linalg.eigvals(H)
    near = np.abs(eigenvalues.real) <= 1e-7 * np.abs(eigenvalues) + 100 * EPS * np.linalg.norm(H)
    return np.unique(np.abs(eigenvalues.imag[near]))


def bounds_gain(model: Realisation, gamma: float) -> bool:
    """Say whether the Hamiltonian has no imaginary eigenvalue, rounding errors considered."""
    H = hamiltonian(model, gamma)
    if H is None or not np.isfinite(H).all():
        return False
    spectrum = eigensystem(H)
    return bool((np.abs(spectrum.values.real) > spectrum.errors).all())


EXACT_FIRST = 6
"""Up to so many coupled states the proof is exact from the start: nothing is as quick."""
EXACT_ALWAYS = 40
"""Up to so many the bracket is as narrow as is asked for, which exact arithmetic grants."""
EXACT_AT_MOST = 80
"""Up to so many exact arithmetic is used where nothing else proves a bound."""
# Widths of brackets that are accepted from modal coordinates: beyond EXACT_ALWAYS, beyond
# EXACT_AT_MOST where nothing else would prove any, and of estimates, which the Hamiltonian test
# could narrow.
_WIDEST = 1e-2
# Gains of so many signals per state are quicker by the Hamiltonian matrix.
_SIGNALS = 4

# Crossings whose frequencies differ by more than this factor are far apart.
_FAR = 4
_MOST_BETWEEN = 12
_MOST_CLIMBING = 24


def peak_in_units(found: Peak, model: Realisation) -> Peak:
    """Bring a peak back from the scaled units of a model."""
    known = bracket(found.gain, found.lower, found.upper, model.gain)
    return Peak(found.frequency * model.time, *known, found.proof)


def certified_peak(
    model: Realisation,
    tolerance: float,
    exact: bool,
    exact_model: rational.ExactModel | None = None,
    spectrum: Eigensystem | None = None,
) -> Peak:
    """Find and bracket the peak of a stable, rescaled system.

    The `spectrum` of its A is taken if it is at hand. An `exact_model` takes its place where the
    doubles are rounded.
    """
    spectrum = spectrum or eigensystem(model.A)
    if exact_model is None and model.states > (EXACT_FIRST if exact else 1):
        # Where the quick modes are too rough, enclosed ones are far quicker than what follows.
        for enclosed in sorted({exact, True}):
            found = _modal(model, spectrum, tolerance, enclosed)
            if found is not None:
                return found
    search = replace(model, time=1.0, gain=1.0)
    poles = spectrum.values
    if model.discrete:
        search = rescaled(cayley(search))
        poles = np.linalg.eigvals(search.A).astype(complex)
    frequency, gain = peak(search, poles, tolerance)
    if not exact or model.states > EXACT_ALWAYS:
        found = peak_in_units(_estimated(search, frequency, gain, tolerance), search)
        if not exact or found.upper <= (1 + max(tolerance, 1e-6)) * found.lower:
            return found
        if model.states > EXACT_AT_MOST:  # in ball arithmetic, where doubles leave it uncertain
            at = rational.fraction(found.frequency) if math.isfinite(found.frequency) else None
            gain = _gain(rational.ExactModel.of(model), at)
            upper = found.upper if found.upper > gain else math.inf
            return found._replace(gain=gain, lower=gain * (1 - 1e-14), upper=upper)
    return _proven(exact_model or rational.ExactModel.of(model), frequency * search.time, tolerance)


def _modal(model: Realisation, spectrum: Eigensystem, tolerance: float, exact: bool) -> Peak | None:
    """Bracket the peak in modal coordinates; None where these are too ill conditioned."""
    if model.D.size > _SIGNALS * model.states:
        return None
    form = modal_form(model, spectrum, exact)
    if form is None or not form.stable:
        return None
    # Imports Numba, which takes as long as all the rest together.
    from robustpolish.linear.norms.modal_peak import modal_peak

    widest = AGREE if model.states <= EXACT_AT_MOST else _WIDEST
    if not exact:
        widest = AGREE
    elif model.states <= EXACT_ALWAYS:
        widest = tolerance
    found = modal_peak(form, tolerance, max(tolerance, widest))
    errors = (
        "rounding errors enclosed" if exact else "within the rounding errors of double precision"
    )
    return found and found._replace(proof=f"every frequency covered, {errors}")


def _proven(model: rational.ExactModel, start: float, tolerance: float) -> Peak:
    """Raise the gain by exact crossings until the upper bound has none."""

    def highest(places: Iterable[fmpq | None]) -> tuple[float, fmpq | None]:
        return max(((_gain(model, x), x) for x in places), key=lambda pair: pair[0])

    gain, at = highest([rational.fraction(start) if math.isfinite(start) else None])
    if gain == 0 and model.is_zero():
        return Peak(0.0, 0.0, 0.0, 0.0, "the transfer function is zero")
    trial: list[fmpq | None] = [fmpq(0), None]
    trial += [fmpq(k, k + 2) for k in range(1, 2 * model.states + 3)] if gain == 0 else []
    touching: list[fmpq] = []
    far, upper, proof = False, math.inf, "the search did not settle"
    for _ in range(100):  # every pass raises the gain by more than the tolerance; few are needed
        check_deadline()
        reached = highest(trial)
        if reached[0] > gain:
            gain, at = reached
        elif touching:  # the gain only touches the last bound, at a crossing
            gain, at = highest(touching)
        bound = gain * (1 + tolerance)
        found = gain_crossings(model, rational.fraction(bound) ** 2)
        if not found:
            for a, b in pairwise(touching):
                # A search from far away ends when its bracket is narrow, not at the top.
                if far and at is not None and a <= at <= b:
                    gain, at = highest([at, _climbed(model, a, b)])
            upper, proof = bound, "no crossing, in exact arithmetic"
            break
        spans = list(pairwise(found))
        far = far or any(_far_apart(a, b) for a, b in spans)
        trial = [fmpq(0), None, *(x for a, b in spans for x in _between(a, b))]
        if model.states > EXACT_FIRST and len(spans) == 1:
            trial.append(_climbed(model, *spans[0]))
        touching = found
    rounding = 4 * EPS * (model.B.ncols() + model.C.nrows())
    frequency = math.inf if at is None else float(arb(at))
    return Peak(frequency, gain, gain * (1 - rounding), upper, proof)


def _far_apart(low: fmpq, high: fmpq) -> bool:
    return low > 0 and high > _FAR * low


def _between(low: fmpq, high: fmpq) -> list[fmpq]:
    """Return the middle of two crossings, and if they are far apart one frequency per octave.

    The gain peaks somewhere between them. Halving an interval that spans decades comes near zero
    by an octave per pass, and a pass costs a determinant per state.
    """
    middle = [(low + high) / 2]
    if not _far_apart(low, high):
        return middle
    bottom, octaves = float(arb(low)), math.log2(float(arb(high)) / float(arb(low)))
    count = min(math.ceil(octaves), _MOST_BETWEEN)
    steps = octaves * np.arange(1, count + 1) / (count + 1)
    return middle + [rational.fraction(bottom * 2.0**step) for step in steps]


def _climbed(model: rational.ExactModel, low: fmpq, high: fmpq) -> fmpq:
    """Climb between two crossings, for gains take far less time than determinants."""
    ends = [math.log(max(float(arb(end)), 1e-300)) for end in (low, high)]
    found: Any = minimize_scalar(
        lambda x: -_gain(model, rational.fraction(math.exp(x))),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-7 * (ends[1] - ends[0]), "maxiter": _MOST_CLIMBING},
    )
    return rational.fraction(math.exp(found.x))


def _gain(model: rational.ExactModel, x: fmpq | None) -> float:
    G, scale = rational.transfer(model, x)
    return float(np.linalg.norm(G, 2)) * scale


def _estimated(model: Realisation, frequency: float, gain: float, tolerance: float) -> Peak:
    """Widen the bracket until the Hamiltonian test in double precision is beyond doubt."""
    error = 10 * EPS  # of the gain, relative, from the spread of the resolvent
    if math.isfinite(frequency) and model.states:
        resolvent = 1j * frequency * np.eye(model.states) - model.A
        sizes = np.linalg.svd(resolvent, compute_uv=False)
        error *= math.sqrt(model.states) * float(sizes[0] / sizes[-1]) if sizes[-1] else 0.1 / EPS
    lower = gain * max(0.0, 1 - error)
    widths = [w for w in (tolerance, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.1) if w >= tolerance]
    for width in widths:
        upper = gain * (1 + width + error)
        if gain > 0 and bounds_gain(model, upper):
            text = "no crossing within the rounding errors of double precision"
            return Peak(frequency, gain, lower, upper, text)
    return Peak(frequency, gain, lower, math.inf, "double precision proves no upper bound")


@dataclass(frozen=True, repr=False)
class HinfNorm(Displayed):
    """Largest gain of a system over all frequencies; ``float(norm)`` is its value.

    Attributes
    ----------
    value : float
        The norm, in output units per input unit; infinite if a pole is on or
        beyond the stability boundary (see :func:`hinf_norm` for hidden ones).
    frequency : float
        Where the gain peaks, in rad/s (rad per sample if ``dt`` is True); infinite if
        only the limit reaches it, nan if there is no peak.
    lower, upper : float
        The true norm lies between the two.
    stable : bool
        Whether all poles are strictly stable, hidden ones included.
    reason : str
        How the bracket was proven, or why the norm is infinite.
    system : control.StateSpace or None
        What it is the norm of.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rp.hinf_norm(control.ss([[-2.0]], [[2.0]], [[1.0]], 0))
    H-infinity norm
      value         1
      peak at [Hz]  0
      at least      1
      at most       1
      stable        yes
      proof: no crossing, in exact arithmetic
    """

    value: float
    frequency: float
    lower: float
    upper: float
    stable: bool
    reason: str
    system: control.StateSpace | None = field(default=None, compare=False)

    def __float__(self) -> float:
        return self.value

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the largest singular value over frequency with the norm marked.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0)
        >>> rp.hinf_norm(lag).plot().get_xlabel()
        'frequency'
        """
        gain = singular_values(source_of(self.system)).isel(singular_value=0)
        mark = {f"norm {self.value:.4g}": (self.frequency / (2 * np.pi), self.value)}
        return plot_gains({"largest singular value": gain}, mark, ax)

    def _card(self) -> Card:
        rows = (
            ("value", self.value),
            ("peak at [Hz]", self.frequency / (2 * np.pi)),
            ("at least", self.lower),
            ("at most", self.upper),
            ("stable", self.stable),
        )
        return Card("H-infinity norm", (quantities(*rows),), (self.reason,))


_ONE_THREAD_ANYWAY = 24
"""Linear algebra of so many states is never shared among threads."""


def hinf_norm(
    system: control.StateSpace, *, tolerance: float = 1e-9, exact: bool = True
) -> HinfNorm:
    r"""Compute the H-infinity norm, the largest singular value over all frequencies.

    States, time and gain are scaled by powers of two first. The frequency axis is cut into
    pieces, on each of which the response in modal coordinates is a power series with an enclosed
    error; branch and bound over them finds the peak and proves that no gain lies above the upper
    bound. Extended precision encloses what the computed modes leave out of the system.

    One or two states, and systems whose poles nearly coincide or are damped too lightly for that,
    are searched by the two-step Hamiltonian iteration [1]_, [2]_ and proven in exact arithmetic:
    the characteristic polynomial of the Hamiltonian matrix (the symplectic pencil in discrete
    time) at the upper bound, formed from the stored numbers without rounding, has no root on the
    stability boundary. Where a root is left, the search goes on from it. So the answer is right for
    any damping and any units, and does not miss peaks.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete; an unspecified sampling time means continuous.
    tolerance : float, optional
        Relative width of the bracket, at least 1e-12.
    exact : bool, optional
        False proves nothing: the bracket then rests on estimates of rounding errors, is wider for
        light damping and may have no upper end. Up to three times as quick where modal
        coordinates serve; meant for searches whose result is checked afterwards. With True, a
        proven bracket may be 1e-6 wide beyond 40 coupled states and 1e-2 beyond 80. Where modal
        coordinates prove none, a block of more than 40 states takes the estimate if it is at most
        1e-6 wide, and one of more than 80 in any case.

    Returns
    -------
    HinfNorm
        Infinite if the state matrix has an eigenvalue beyond the stability boundary,
        even if it is hidden from inputs or outputs. An eigenvalue exactly on the
        boundary counts only if it is reachable and observable; a
        hidden one leaves the norm finite and `stable` False, and `reason` says so.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, has entries that are not finite, or if the
        tolerance is out of range.

    Notes
    -----
    Measured on one thread by ``make bench``: dense systems of 12 states take 2.4 times as long as
    SLICOT's AB13DD, which proves nothing, 24 states 1.5 times, 60 states 1.9 times, 120 states 1.7
    times (16 ms) and 400 states 0.4 times (0.21 s); with ``exact=False`` 1.4, 0.8, 0.9, 0.9 and 0.2
    times. Where modal coordinates fail, 60 states take up to 2 s. Decoupled parts are treated one
    by one. The search is compiled at its first use, which takes some 20 s once.

    References
    ----------
    .. [1] S. Boyd, V. Balakrishnan, P. Kabamba, "A bisection method for computing the
       H-infinity norm of a transfer matrix and related problems", Mathematics of
       Control, Signals and Systems 2 (1989) 207-219.
    .. [2] N. A. Bruinsma, M. Steinbuch, "A fast algorithm to compute the H-infinity norm
       of a transfer function matrix", Systems & Control Letters 14 (1990) 287-293.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> w, zeta = 1e9, 0.05
    >>> norm = rp.hinf_norm(control.ss([[0, 1], [-w**2, -2*zeta*w]], [[0], [w**2]], [[1, 0]], 0))
    >>> round(norm.value, 6), norm.lower <= norm.value <= norm.upper
    (10.012523, True)
    """
    tolerance = positive("tolerance", tolerance)
    if not 1e-12 <= tolerance <= 0.5:
        raise invalid("tolerance", tolerance, "1e-12 to 0.5", "The default is 1e-9.")
    model = realisation("system", system)
    norm = _norm if model.states <= _ONE_THREAD_ANYWAY else single_threaded_blas(_norm)
    found = norm(model, tolerance, exact)
    # by its fields: `replace` would take a fiftieth of the time of a small system
    return HinfNorm(**{**vars(found), "system": model.source})


def _norm(model: Realisation, tolerance: float, exact: bool) -> HinfNorm:
    found = [_part_norm(part, tolerance, exact) for part in parts(model)]
    if not found:
        return HinfNorm(0.0, 0.0, 0.0, 0.0, True, "there are no states, inputs or outputs")
    if len(found) == 1:
        return found[0]
    largest = max(found, key=lambda norm: (norm.value, norm.upper))
    unsteady = next((norm.reason for norm in found if not norm.stable), largest.reason)
    lower, upper = (max(getattr(norm, end) for norm in found) for end in ("lower", "upper"))
    reason = unsteady if math.isfinite(largest.value) else largest.reason
    stable = all(norm.stable for norm in found)
    return replace(largest, lower=lower, upper=upper, stable=stable, reason=reason)


def _part_norm(model: Realisation, tolerance: float, exact: bool) -> HinfNorm:
    if model.states == 0:
        gain = float(np.linalg.norm(model.D, 2)) if model.D.size else 0.0
        return HinfNorm(gain, 0.0, gain, gain, True, "a static gain")
    model = rescaled(model)
    spectrum = eigensystem(model.A)
    verdict = stability_of(model, spectrum)
    if verdict.verdict == "unstable":
        return HinfNorm(math.inf, math.nan, math.inf, math.inf, False, verdict.reason)
    if model.D.size == 0:
        reason = "no input acts on any output" if verdict else verdict.reason
        return HinfNorm(0.0, 0.0, 0.0, 0.0, bool(verdict), reason)
    if verdict:
        return _in_units(model, certified_peak(model, tolerance, exact, spectrum=spectrum))
    # Do the poles on the boundary reach from an input to an output? That is decided exactly.
    seen = stable_part(model, verdict)
    if seen is None:
        return HinfNorm(math.inf, math.nan, math.inf, math.inf, False, verdict.reason)
    A, B, C, D = map(rational.to_float, (seen.A, seen.B, seen.C, seen.D))
    found = certified_peak(Realisation(A, B, C, D, model.discrete), tolerance, True, seen)
    reason = f"{verdict.reason}, but hidden from the inputs or outputs: not internally stable"
    return replace(_in_units(model, found), stable=False, reason=reason)


def _in_units(model: Realisation, found: Peak) -> HinfNorm:
    if model.discrete:
        found = found._replace(frequency=2 * math.atan(found.frequency) / model.step)
    frequency, gain, lower, upper, proof = peak_in_units(found, model)
    return HinfNorm(gain, frequency, lower, upper, True, f"proof: {proof}")


@dataclass(frozen=True)
class AxisZero:
    """An invariant zero on or near the stability boundary.

    Attributes
    ----------
    frequency : float
        In rad/s, at least 0 (in discrete time the angle over the sampling time).
    distance : float
        Size of a relative change of the scaled matrices that puts a zero exactly
        on the boundary there: the smallest singular value that the normal rank leaves.
    """

    frequency: float
    distance: float


def zeros_on_axis(system: control.StateSpace, *, tolerance: float = 1e-9) -> tuple[AxisZero, ...]:
    r"""Find where on the stability boundary the system matrix loses rank.

    The matrix (A - lambda I, B; C, D) has its normal rank except at the invariant zeros. Those
    of (A, B2, C1, D12) and of (A, B1, C2, D21) on the imaginary axis (unit circle) break
    the assumptions of Riccati-based synthesis. Candidates are the generalised eigenvalues of the
    matrix, squared by two random compressions; each is then moved along the boundary to the least
    smallest singular value. It counts if that is within the tolerance and far below its
    surroundings. Zeros at infinity (a rank-deficient D)
    are not listed.

    Parameters
    ----------
    system : control.StateSpace
        The channel in question, continuous or discrete.
    tolerance : float, optional
        Largest relative distance that counts, in scaled units.

    Returns
    -------
    tuple of AxisZero
        By frequency; a pair counts once.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, not finite, or the tolerance is not positive.

    Examples
    --------
    >>> import control
    >>> from robustpolish.linear import zeros_on_axis
    >>> notch = control.ss([[0, 1], [-1, -1]], [[0], [1]], [[3, -1]], 1)  # (s^2 + 4)/(s^2 + s + 1)
    >>> [round(zero.frequency, 6) for zero in zeros_on_axis(notch)]
    [2.0]
    """
    tolerance = positive("tolerance", tolerance)
    model = realisation("system", system)
    if 0 in model.D.shape:
        return ()
    m, p = model.B.shape[1], model.C.shape[0]
    each = [np.array([i]) for i in range(m)], [np.array([i]) for i in range(p)]
    scaled = in_units(model, equilibrating_scales(model, *each))
    M = np.block([[scaled.A, scaled.B], [scaled.C, scaled.D]])
    N = np.zeros(M.shape)
    N[: scaled.states, : scaled.states] = np.eye(scaled.states)
    rng, size = np.random.default_rng(0), float(np.linalg.norm(M, 2))
    points = rng.standard_normal(3) + 1j * rng.standard_normal(3)
    ranks = [np.linalg.matrix_rank(M - s * N, tol=100 * EPS * max(size, 1)) for s in points]
    rank = int(max(ranks))

    def smallest(angle: float) -> float:
        """Return the last singular value of the normal rank, relative to the matrices."""
        point = complex(np.exp(1j * angle)) if scaled.discrete else 1j * angle
        singular = np.linalg.svd(M - point * N, compute_uv=False)
        return float(singular[rank - 1]) / max(size, 1e-300)

    rng, starts = np.random.default_rng(1), [0.0]
    for _ in range(2):
        left, right = (rng.standard_normal(shape) for shape in ((rank, len(M)), (len(M.T), rank)))
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.asarray(sla.eigvals(left @ M @ right, left @ N @ right))
        values = values[np.isfinite(values) & (np.abs(values) < 1e3 * max(size, 1))]
        starts += list(np.abs(np.angle(values) if scaled.discrete else np.imag(values)))
    found: list[AxisZero] = []
    for start in starts:
        angle, distance = _descended(smallest, start)
        frequency = angle * scaled.time / scaled.step
        # Beside a zero the rank is full, unlike in the decay towards a zero at infinity.
        width = 0.03 * angle if angle else 0.03
        beside = min(smallest(abs(angle - width)), smallest(angle + width))
        known = any(math.isclose(frequency, zero.frequency, rel_tol=1e-6) for zero in found)
        if distance <= min(tolerance, 1e-3 * beside) and not known:
            found.append(AxisZero(float(frequency), distance))
    return tuple(sorted(found, key=lambda zero: zero.frequency))


def _descended(smallest: Callable[[float], float], start: float) -> tuple[float, float]:
    """Minimise along the boundary by shrinking steps around the start."""
    angle, value = start, smallest(start)
    step = 0.1 * start if start else 0.01
    for _ in range(120):
        reached, trial = min((smallest(x), x) for x in (abs(angle - step), angle + step))
        if reached < value:
            angle, value = trial, reached
        else:
            step *= 0.5
        if step <= EPS * max(angle, 1e-3):
            break
    # What rounding alone tells from zero is zero.
    at_rest = smallest(0.0)
    return (0.0, at_rest) if at_rest <= max(2 * value, 10 * EPS) else (angle, value)
