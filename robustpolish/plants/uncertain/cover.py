"""Cover of a family of plants by a nominal one with unmodeled dynamics below a weight."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, get_args

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.polynomial import chebyshev
from scipy.optimize import linprog

from robustpolish.base.arrays import SAME, AnyArray, AnyVector, Matrix, Vector
from robustpolish.base.checks import described, invalid, one_of, whole_number
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic.exact import refuse_extreme
from robustpolish.linear.norms.hinf import frequency_grid
from robustpolish.linear.systems import as_state_space, of_roots
from robustpolish.plants.blocks import as_response
from robustpolish.plants.uncertain.build import uncertain_dynamics
from robustpolish.plants.uncertain.system import UncertainSystem, as_uncertain
from robustpolish.plots.frequency import plot_gains

# A stable weight with a stable inverse whose gain lies above given gains, as little as possible.
#
# The square of a weight's gain is a ratio b / a of polynomials in the square of the frequency, both
# positive, and every such ratio is one: it only has to be factorised. For a given ratio between the
# weight and the gains, b and a obey linear inequalities, so that the smallest ratio is found by
# bisection over linear programs [1]_.
#
# References
# ----------
# .. [1] S. Boyd, L. Vandenberghe, "Convex Optimization", Cambridge University Press (2004), section
#    4.3.2; S.-P. Wu, S. Boyd, L. Vandenberghe, "FIR filter design via spectral factorization and
#    convex optimization", in Applied and Computational Control, Signals and Circuits (1999).

# Gains below this share of the largest are taken as it.
_FLOOR = 1e-4
# Dips narrower than this factor of frequency are filled: no weight of a few states follows them.
_DIP = 4.0
# Beyond the first and the last frequency the weight keeps this share of the last gain.
_BEYOND = 0.5
# Width of the bisection, in the logarithm of the ratio of squares, at which it ends.
_SETTLED = 1e-3
_STEPS = 60
# Smallest size of a, relative to what it was before, that keeps roots off the axis.
_OFF_AXIS = 1e-5
# A further state has to lower the largest ratio by this share.
_WORTH = 2e-3
# Real part of a pole or zero over its size below which it is no longer off the axis.
_DAMPED = 1e-6
# By how much more a weight is raised than its response asks for, which is rounded itself.
_ROUNDING = 1e-8


def bounding_weight(omega: Vector, gains: Vector, order: int) -> control.StateSpace:
    """Return a weight W with ``|W(j omega)| >= gains``, nearest to them in decibels.

    Parameters
    ----------
    omega : ndarray, shape (n,)
        Frequencies in rad/s, rising and above 0.
    gains : ndarray, shape (n,)
        Above or equal to 0, some above.
    order : int
        Largest number of states; fewer where more are of no use.

    Returns
    -------
    control.StateSpace
        Continuous. Between the frequencies it is above the line through neighbours on logarithmic
        axes, and beyond them at least half of the gain at the end.
    """
    wanted = envelope(omega, gains)
    centre = float(np.sqrt(omega[0] * omega[-1]))
    x = (omega / centre) ** 2
    squares = wanted**2
    points = np.concatenate([x, np.sqrt(x[1:] * x[:-1]), [0.0, np.inf]])
    asked = np.concatenate(
        [squares, np.sqrt(squares[1:] * squares[:-1]), _BEYOND**2 * squares[[0, -1]]]
    )
    found: list[tuple[float, control.StateSpace]] = []
    b, a = np.array([asked.max()]), np.ones(1)
    for degree in range(order + 1):
        b, a = _nearest(points, asked, x.size, degree, b, a)
        system = _sections(_factor(b) * centre, _factor(a) * centre)
        if system is None:
            continue
        # What programs and roots have lost is given back; nothing is believed.
        ratio = np.abs(system(1j * omega).ravel()) / wanted
        factor = 1 / float(ratio.min())
        found.append((float(ratio.max() * factor), amplified(system, factor)))
    best = min(ratio for ratio, _ in found)
    return next(system for ratio, system in found if ratio <= (1 + _WORTH) * best)


def amplified(system: control.StateSpace, factor: float) -> control.StateSpace:
    """Return a system of a larger gain, with something for the rounding of its response."""
    larger = factor * (1 + _ROUNDING)
    C, D = (larger * np.asarray(getattr(system, name)) for name in "CD")
    return control.StateSpace(system.A, system.B, C, D, system.dt)


def envelope(omega: Vector, gains: Vector) -> Vector:
    """Return gains with narrow dips filled: what a weight is fitted to.

    Parameters
    ----------
    omega, gains : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    floored = np.maximum(gains, _FLOOR * gains.max())
    half = np.sqrt(_DIP)
    first = np.searchsorted(omega, omega / half * (1 - 1e-12))
    last = np.searchsorted(omega, omega * half * (1 + 1e-12), side="right")
    spread = np.array([floored[i:j].max() for i, j in zip(first, last, strict=True)])
    return np.array([spread[i:j].min() for i, j in zip(first, last, strict=True)])


def _nearest(
    x: Vector, wanted: Vector, count: int, degree: int, b: Vector, a: Vector
) -> tuple[Vector, Vector]:
    """Return b and a of the smallest largest ratio, from those of a lower degree.

    Polynomials in x of a degree, over (1 + x) to that power, are polynomials in
    u = (x - 1) / (x + 1), which lies between -1 and 1: there they are sums of Chebyshev's. What is
    asked for at the first `count` points bounds the ratio from above, too.
    """
    n = degree + 1
    with np.errstate(invalid="ignore"):
        u: Vector = np.where(np.isinf(x), 1.0, (x - 1) / (x + 1))
    basis: Matrix = np.asarray(chebyshev.chebvander(u, n - 1), dtype=float)
    size = float(np.exp(np.mean(np.log(wanted[:count]))))

    def reached(b: Vector, a: Vector) -> float:
        """Return the logarithm of the largest ratio, if b / a is raised above all that is asked."""
        ratio = (basis @ b) / (basis @ a) / wanted
        return float(np.log(ratio[:count].max() / ratio.min())) if (ratio > 0).all() else np.inf

    def feasible(ratio: float, weights: Vector) -> tuple[Vector, Vector] | None:
        """Return b and a with ``wanted <= b / a <= ratio wanted``, None if there are none."""
        T = basis / weights[:, None]
        asked = T * (size / wanted)[:, None]  # b over what it should be
        slack, none = np.full((len(T), 1), ratio), np.zeros((len(T), 1))
        above = np.hstack([asked, -ratio * T, slack])[:count]
        rows = [np.hstack([-asked, T, none]), np.hstack([0 * T, -T, none]), above]
        limits = [np.zeros(len(T)), np.full(len(T), -_OFF_AXIS), np.zeros(count)]
        total = np.concatenate([np.zeros(n), T.mean(axis=0), [0.0]])
        found = linprog(
            np.concatenate([np.zeros(2 * n), [-1.0]]),
            np.vstack(rows), np.concatenate(limits), total[None], [1.0],
            bounds=[(None, None)] * (2 * n) + [(None, 1.0)], method="highs",
        )  # fmt: skip
        if found.x is None or found.x[-1] < 0:
            return None
        return found.x[:n] * size, found.x[n : 2 * n]

    best = np.pad(b, (0, n - b.size)), np.pad(a, (0, n - a.size))
    low, high = 0.0, reached(*best)
    for _ in range(_STEPS):
        if high - low <= _SETTLED:
            break
        middle = (low + high) / 2
        # Inequalities count relative to the a that was good enough last.
        found = feasible(float(np.exp(middle)), np.abs(basis @ best[1]))
        if found is not None and (level := reached(*found)) < high:
            best, high = found, max(level, low)
        else:
            low = middle
    return best


def _factor(values: Vector) -> AnyVector:
    """Return the roots s in the left half plane of a polynomial in -s^2 that is positive."""
    u = chebyshev.chebroots(chebyshev.chebtrim(values, 0)).astype(complex)
    x = (1 + u) / (1 - u)
    s = np.sqrt(-x)
    return np.where(np.real(s) > 0, -s, s)


def _sections(zeros: AnyVector, poles: AnyVector) -> control.StateSpace | None:
    """Return the system of zeros and poles; None if one of them is not off the axis."""
    roots = np.concatenate([zeros, poles])
    if zeros.size != poles.size or not (np.real(roots) < -_DAMPED * np.abs(roots)).all():
        return None
    return of_roots(zeros, poles, 1.0)


# A family of plants, as responses at common frequencies, and their errors from one of them.

Kind = Literal["output", "input", "additive"]

_EXPECTED = "models, or responses measured at the same frequencies"
# Points of an even background, on which models are looked at beside their resonances.
_BACKGROUND = 300
# Into how many parts the steps between frequencies are cut for the last look at a weight.
_FINER = 5
# Decades beyond the slowest and the fastest pole or zero.
_BEYOND_FAMILY = 2.0
# Relative distance from a pole at which a response stands for the one there.
_BESIDE = 1e-8
# Real part over size below which a pole counts as one on the axis, on neither side.
_AXIS = 1e-8


class PlantFamily(NamedTuple):
    """Plants at common frequencies.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Rising, in rad/s, above 0.
    responses : ndarray of complex, shape (plants, n, outputs, inputs)
    models : tuple of control.StateSpace
        The plants themselves; empty if they were measured.
    nominal : control.StateSpace or None
    dt : float or True
        Sampling time; 0 in continuous time.
    """

    omega: Vector
    responses: AnyArray
    models: tuple[control.StateSpace, ...]
    nominal: control.StateSpace | None
    dt: float | bool


def read_family(plants: Any, nominal: Any) -> PlantFamily:
    """Return what a user gave as a family."""
    if isinstance(plants, Mapping):
        plants = list(plants.values())
    several = isinstance(plants, Iterable)
    single = isinstance(plants, str | xr.DataArray | control.LTI)
    given = list(plants) if several and not single else []
    if not given:
        raise invalid("plants", plants, _EXPECTED, "Pass a list of them.")
    centre = None if nominal is None else as_state_space("nominal", nominal)
    measured = [as_response(f"plants[{i}]", item) for i, item in enumerate(given)]
    if any(item is not None for item in measured):
        return _of_responses([item for item in measured if item], len(given), centre)
    models = tuple(as_state_space(f"plants[{i}]", item) for i, item in enumerate(given))
    for i, model in enumerate(models):
        refuse_extreme(f"plants[{i}]", {name: np.asarray(getattr(model, name)) for name in "ABCD"})
    return _of_models(models, centre)


def response(system: control.StateSpace, omega: Vector) -> AnyArray:
    """Return the response of a system, shape (frequencies, outputs, inputs).

    At a pole on the axis it is the one beside it: what the errors of plants that share the pole
    tend to is finite.
    """

    def at(omega: Vector) -> AnyArray:
        points = 1j * omega
        if system.dt:
            points = np.exp(points * (1.0 if system.dt is True else system.dt))
        values = np.asarray(system(points, squeeze=False, warn_infinite=False))
        return np.moveaxis(values, -1, 0)

    values = at(omega)
    at_pole = ~np.isfinite(values).all(axis=(1, 2))
    if at_pole.any():
        values[at_pole] = at(omega[at_pole] * (1 + _BESIDE))
    return values


def errors(family: PlantFamily, nominal: AnyArray, kind: Kind, refuse: bool = True) -> AnyArray:
    """Return the largest gain of each plant's error over frequency, shape (plants, frequencies).

    Parameters
    ----------
    family : PlantFamily
    nominal : ndarray of complex
        Its response.
    kind : {"output", "input", "additive"}
    refuse : bool, optional
        Whether to refuse a form that cannot make the plants; infinite errors otherwise.
    """
    difference = family.responses - nominal
    if kind == "additive":
        error, left = difference, 0 * difference
    elif kind == "output":  # E P0 = P - P0
        error = difference @ np.linalg.pinv(nominal, rcond=1e-12)
        left = error @ nominal - difference
    else:
        error = np.linalg.pinv(nominal, rcond=1e-12) @ difference
        left = nominal @ error - difference
    gains = np.linalg.norm(error, 2, axis=(-2, -1))
    size = np.linalg.norm(family.responses, 2, axis=(-2, -1))
    # What is left of a difference that a relative error cannot make, relative to the plant.
    gains[np.linalg.norm(left, 2, axis=(-2, -1)) > SAME * size] = np.inf
    if refuse and not np.isfinite(gains).all():
        where = family.omega[np.argwhere(~np.isfinite(gains))[0][1]]
        other = "input" if kind == "output" else "output"
        shown = described(f"a relative error at the {kind} that is infinite at {where:.6g} rad/s")
        remedy = f'Take kind="additive" or "{other}", or another nominal plant.'
        raise invalid("kind", shown, "a form that can make every plant", remedy)
    return gains


def _of_responses(
    measured: Sequence[control.FrequencyResponseData], count: int, centre: Any
) -> PlantFamily:
    if len(measured) != count:
        shown = described("models among measured responses")
        raise invalid("plants", shown, _EXPECTED, "Cover them one kind at a time.")
    if centre is None:
        shown = described("none, with measured responses")
        raise invalid("nominal", shown, "a model in their middle", "Fit one, for example.")
    order = np.argsort(measured[0].omega)
    omega = np.asarray(measured[0].omega, dtype=float)[order]
    values = []
    for i, item in enumerate(measured):
        # Relative difference of frequencies that are the same.
        same = len(item.omega) == omega.size and np.allclose(
            np.sort(item.omega), omega, rtol=SAME, atol=0
        )
        if not same:
            shown = described("another list of frequencies than that of the first")
            remedy = "Interpolate them, or leave lines out."
            raise invalid(("plants", i), shown, _EXPECTED, remedy)
        values.append(np.moveaxis(np.asarray(item.frdata), -1, 0)[np.argsort(item.omega)])
    use = omega > 0
    if np.count_nonzero(use) < 2:
        raise invalid("plants", described("fewer than two lines"), _EXPECTED, "Measure more.")
    _same_shape([v.shape[1:] for v in values], centre)
    return PlantFamily(omega[use], np.array(values)[:, use], (), centre, centre.dt or 0)


def _of_models(models: tuple[control.StateSpace, ...], centre: Any) -> PlantFamily:
    every = (*models, *(() if centre is None else (centre,)))
    times = {float(m.dt) if m.dt is not None else 0.0 for m in every if m.nstates}
    if len(times) > 1:
        shown = described(f"sampling times {', '.join(f'{t:g}' for t in sorted(times))}")
        raise invalid("plants", shown, "one sampling time", "Resample the others.")
    _same_shape([(m.noutputs, m.ninputs) for m in models], every[-1])
    poles = [np.asarray(m.poles()) for m in every]
    dt = next((m.dt for m in every if m.dt), 0)
    beyond = [np.abs(p) - 1 if dt else np.real(p) for p in poles]
    unstable = [
        int(np.count_nonzero(b > _AXIS * np.abs(p))) for b, p in zip(beyond, poles, strict=True)
    ]
    if len(set(unstable)) > 1:
        shown = described(f"{min(unstable)} to {max(unstable)} unstable poles")
        remedy = "No stable error makes one of another: cover them apart."
        raise invalid("plants", shown, "plants with as many unstable poles", remedy)
    zeros = [np.asarray(m.zeros()) for m in every if m.nstates and m.ninputs == m.noutputs]
    omega = _frequencies(np.concatenate([*poles, *zeros]), dt)
    return PlantFamily(omega, np.array([response(m, omega) for m in models]), models, centre, dt)


def _same_shape(shapes: Sequence[tuple[int, ...]], centre: control.StateSpace) -> None:
    own = (centre.noutputs, centre.ninputs)
    if 0 in own:
        shown = described(f"{own[0]} outputs and {own[1]} inputs")
        raise invalid("plants", shown, "at least one of each", "Select signals.")
    for i, shape in enumerate(shapes):
        if tuple(shape) != own:
            shown = described(f"{shape[0]} x {shape[1]}")
            raise invalid(("plants", i), shown, f"{own[0]} x {own[1]}", "Select the same signals.")


def _frequencies(roots: AnyArray, dt: float | bool) -> Vector:
    """Return frequencies that show what models do: an even background, and every resonance."""
    step = 1.0 if dt is True else float(dt)
    highest = np.pi / step if dt else np.inf
    if dt:
        with np.errstate(divide="ignore"):
            roots = np.log(roots[roots != 0].astype(complex)) / step
    rates = np.abs(roots)
    rates = rates[(rates > 0) & np.isfinite(rates)]
    low, high = (rates.min(), rates.max()) if rates.size else (1.0, 1.0)
    ends = low / 10**_BEYOND_FAMILY, min(high * 10**_BEYOND_FAMILY, 0.999 * highest)
    grid = [np.geomspace(*ends, _BACKGROUND)]
    for root in roots[np.isfinite(roots) & (np.imag(roots) > 0)]:
        near = frequency_grid(np.array([root]), highest)
        apart = np.abs(near / abs(root.imag) - 1)
        grid += [near[apart < 0.3][::4], [root.imag]]
    points = np.unique(np.concatenate(grid))
    return points[(points >= ends[0]) & (points <= ends[1])]


_MOST_ORDER = 12


@dataclass(frozen=True, eq=False, repr=False)
class Cover(Displayed):
    """A nominal plant and a weight that together stand for a family of plants.

    Attributes
    ----------
    nominal : control.StateSpace
        The plant in the middle.
    weight : control.StateSpace
        Stable, with a stable inverse; its gain is at least the error of every plant of the family
        at every one of `frequency`.
    kind : {"output", "input", "additive"}
        What the error is relative to.
    system : UncertainSystem
        The nominal plant with dynamics below the weight, for :func:`robust_stability` and others.
    frequency : ndarray, shape (n,)
        In rad/s.
    errors : ndarray, shape (plants, n)
        Largest gain of each plant's error.

    Examples
    --------
    >>> import numpy as np
    >>> import control
    >>> import robustpolish as rp
    >>> found = rp.uncertain.cover(
    ...     [control.tf([k], [t, 1]) for k in (0.9, 1.1) for t in (0.2, 0.3)], order=2
    ... )
    >>> bool(found.covered), bool(found.tightness < 1.1)
    (True, True)
    >>> found.plot().get_ylabel()
    'relative error at the output'
    """

    nominal: control.StateSpace
    weight: control.StateSpace
    kind: Literal["output", "input", "additive"]
    system: UncertainSystem
    frequency: Vector
    errors: AnyArray

    @property
    def gains(self) -> Vector:
        """Gain of the weight at the frequencies."""
        return np.abs(response(self.weight, self.frequency)[:, 0, 0])

    @property
    def covered(self) -> bool:
        """Whether the weight lies above all errors at all frequencies."""
        return bool((self.gains >= self.errors.max(axis=0)).all())

    @property
    def tightness(self) -> float:
        """Largest ratio of the weight over the largest error whose narrow dips are filled."""
        return float(np.max(self.gains / envelope(self.frequency, self.errors.max(axis=0))))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the errors and the weight over frequency.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        hertz = {"frequency": self.frequency / (2 * np.pi)}
        curves = {f"plant {i}": row for i, row in enumerate(self.errors, 1)}
        if len(curves) > 6:  # more than a legend holds
            curves = {"largest error": self.errors.max(axis=0)}
        curves["weight"] = self.gains
        labelled = {name: xr.DataArray(gain, hertz, "frequency") for name, gain in curves.items()}
        side = "error" if self.kind == "additive" else f"relative error at the {self.kind}"
        return plot_gains(labelled, ax=ax, name=side)

    def _card(self) -> Card:
        largest = self.errors.max(axis=0)
        rows = (
            ("plants", len(self.errors)),
            ("states of the weight", self.weight.nstates),
            ("smallest error covered", float(largest.min())),
            ("largest error covered", float(largest.max())),
            ("weight over error, at most", self.tightness),
        )
        low, high = self.frequency[[0, -1]] / (2 * np.pi)
        note = (
            f"Checked at {len(self.frequency)} frequencies from {low:.4g} to {high:.4g} Hz; "
            "nothing is known of the plants between and beyond them."
        )
        side = "an error" if self.kind == "additive" else f"a relative error at the {self.kind}"
        return Card(f"Cover by {side}", (quantities(*rows),), (note,))


def cover(
    plants: Any,
    nominal: Any = None,
    *,
    kind: Literal["output", "input", "additive"] = "output",
    order: int = 2,
    name: str = "cover",
) -> Cover:
    """Cover a family of plants by a nominal one with dynamics below a weight.

    Parameters
    ----------
    plants : sequence of control.LTI, control.FrequencyResponseData or xarray.DataArray
        Models, or responses measured at the same frequencies: as many of them as the machine shows
        faces. An array is what :func:`read_frequency_response` returns, of one measurement each.
    nominal : control.LTI, optional
        The plant in the middle. Of models by default the one whose largest error is smallest;
        measured responses need one.
    kind : {"output", "input", "additive"}, optional
        The form P = (I + W D) P0, P0 (I + W D) or P0 + W D with D any stable dynamics of gain at
        most 1. For several signals D is a full matrix, W the same for all of them: scale them.
    order : int, optional
        Largest number of states of the weight.
    name : str, optional
        Of the dynamics in the uncertain system.

    Returns
    -------
    Cover

    Raises
    ------
    InvalidInputError
        If the plants do not go together, or the form cannot make one of another: no relative error
        covers an output that the nominal plant cannot move, nor another number of unstable poles.

    Notes
    -----
    The weight is the one nearest to the largest error in decibels: the ratio is bounded by linear
    inequalities in the square of its gain, which is then factorised. Errors below 1e-4 of the
    largest and dips narrower than two octaves are not followed. Stability of a loop with the
    uncertain system is that of all plants whose error is below the weight and which have as many
    unstable poles as the nominal one [1]_; of measured ones that cannot be seen.

    References
    ----------
    .. [1] J. Doyle, G. Stein, "Multivariable feedback design: concepts for a classical/modern
       synthesis", IEEE Transactions on Automatic Control 26 (1981) 4-16.

    Examples
    --------
    A motor whose belt resonates somewhere between 20 and 30 rad/s:

    >>> import control
    >>> import robustpolish as rp
    >>> plants = [control.tf([w**2], [1, 0.2 * w, w**2, 0]) for w in (20, 22, 25, 28, 30)]
    >>> found = rp.uncertain.cover(plants, plants[2], order=3)
    >>> found.covered, found.weight.nstates
    (True, 3)
    >>> margin = rp.robust_stability((found.system * 0.5).feedback())
    >>> bool(margin.robust)
    True
    """
    one_of("kind", kind, get_args(Kind))
    whole_number("order", order, 0, _MOST_ORDER, "Try 2.")
    family = read_family(plants, nominal)
    centre, found = _chosen(family, kind)
    largest = found.max(axis=0)
    if not largest.any():
        shown = described("plants that are all the same as the nominal one")
        raise invalid("plants", shown, "plants that differ", "There is nothing to cover.")
    weight = _weight(family, largest, int(order))
    if family.models:  # they are known between the frequencies of the fit, too
        ratio = (family.omega[1:] / family.omega[:-1])[:, None]
        between = (family.omega[:-1, None] * ratio ** (np.arange(_FINER) / _FINER)).ravel()
        omega = np.append(between, family.omega[-1])
        responses = np.array([response(model, omega) for model in family.models])
        family = family._replace(omega=omega, responses=responses)
        found = errors(family, response(centre, family.omega), kind)
        weight = _above(weight, family.omega, found.max(axis=0))
    return Cover(centre, weight, kind, _system(centre, weight, kind, name), family.omega, found)


def _chosen(family: PlantFamily, kind: Kind) -> tuple[control.StateSpace, AnyArray]:
    """Return the nominal plant and the errors of all plants from it."""
    if family.nominal is not None:
        return family.nominal, errors(family, response(family.nominal, family.omega), kind)
    tried = [errors(family, own, kind, refuse=False) for own in family.responses]
    best = int(np.argmin([found.max() for found in tried]))
    if not np.isfinite(tried[best]).all():
        shown = described("plants none of which can be made of another")
        raise invalid("kind", shown, "a form that covers them", 'Try kind="additive".')
    return family.models[best], tried[best]


def _weight(family: PlantFamily, largest: Vector, order: int) -> control.StateSpace:
    """Return the weight, of sampled plants the bilinear image of a continuous one."""
    if not family.dt:
        return bounding_weight(family.omega, largest, order)
    step = 1.0 if family.dt is True else float(family.dt)
    found = bounding_weight(2 / step * np.tan(family.omega * step / 2), largest, order)
    image = control.sample_system(found, step, "bilinear")
    # The image has the same gains but for rounding, which is given back.
    return _above(image, family.omega, largest)


def _above(weight: control.StateSpace, omega: Vector, gains: Vector) -> control.StateSpace:
    """Return a weight raised to where it lies above gains at all frequencies."""
    short = float((gains / np.abs(response(weight, omega)[:, 0, 0])).max())
    return amplified(weight, short) if short > 1 else weight


def _system(
    nominal: control.StateSpace, weight: control.StateSpace, kind: Kind, name: str
) -> UncertainSystem:
    """Return the nominal plant with dynamics below the weight."""
    ny, nu = nominal.noutputs, nominal.ninputs
    sizes = {"output": (ny, ny), "input": (nu, nu), "additive": (ny, nu)}
    delta = uncertain_dynamics(name, sizes[kind]).matrices
    error = as_uncertain("weight", weight) * UncertainSystem(replace(delta, dt=nominal.dt or 0))
    centre = as_uncertain("nominal", nominal)
    if kind == "additive":
        system = centre + error
    else:
        system = centre * (np.eye(nu) + error) if kind == "input" else (np.eye(ny) + error) * centre
    return UncertainSystem(system.matrices.names(nominal.input_labels, nominal.output_labels))
