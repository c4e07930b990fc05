"""The H2 norm: root mean square response to white noise, or the energy of the impulse response."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np
from flint import arb, arb_mat
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.base.arrays import EPS, Matrix
from robustpolish.base.budget import check_deadline, single_threaded_blas
from robustpolish.base.checks import invalid, positive, source_of
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic import exact
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.linear.norms.hinf import singular_values
from robustpolish.linear.norms.modal_peak import ModalForm, modal_form
from robustpolish.linear.scaling import parts
from robustpolish.linear.stability import eigensystem, lyapunov_solution, stability_of, stable_part
from robustpolish.linear.systems import Realisation, realisation
from robustpolish.plots.frequency import plot_gains

# The square of the H2 norm with bounds, in double precision or in ball arithmetic.


@dataclass(frozen=True)
class EnergyBounds:
    """Square of an H2 norm with bounds; the upper one is infinite where nothing is known."""

    square: float
    lower: float
    upper: float

    @property
    def width(self) -> float:
        """Half the width of the bounds, relative to the upper one."""
        if math.isinf(self.upper):
            return math.inf
        return (self.upper - self.lower) / (2 * self.upper) if self.upper > 0 else 0.0


ExtendedArray = NDArray[Any]
_WIDE: Any = np.finfo(np.longdouble).eps


def h2_energy(model: Realisation, tolerance: float) -> EnergyBounds:
    r"""Bound trace(C X C') + trace(D D') for a stable system, X its controllability Gramian.

    The residual R, formed in extended precision where the machine has it, refines X until
    the bounds are close or refining helps no more. It bounds the error too: the solution
    operator of a stable Lyapunov equation is positive, so -E <= R <= E, with E the diagonal
    matrix of the row sums of \|R\|, gives -W <= error <= W, with W the Gramian of E.
    """
    X = np.zeros(model.A.shape, dtype=np.longdouble)
    B = model.B.astype(np.longdouble)
    residual = B @ B.T
    best = EnergyBounds(0.0, 0.0, math.inf)
    for step in range(6):
        X = X + lyapunov_solution(model.A, residual.astype(float), model.discrete)
        residual, rounding = _residual(model, X)
        found = _bounds(model, X, np.abs(residual) + rounding)
        if step and not found.width < 0.5 * best.width:
            break
        best = found
        if best.width <= tolerance:
            break
    return best


def _bounds(model: Realisation, X: ExtendedArray, residual: ExtendedArray) -> EnergyBounds:
    """Bound the energy that X shows; `residual` bounds the entries of its residual."""
    C = model.C.astype(np.longdouble)
    rows = np.sum(residual, axis=1).astype(float)
    W = lyapunov_solution(model.A, np.diag(rows), model.discrete)
    error = 2 * float(np.sum((model.C @ W) * model.C))  # twice, for the rounding of W itself
    error += float(4 * _WIDE * X.shape[0] * np.sum((np.abs(C) @ np.abs(X)) * np.abs(C)))
    square = float(np.sum((C @ X) * C))
    if model.discrete:
        square += float(np.sum(model.D**2))
    if not (math.isfinite(square) and error >= 0 and np.all(np.diag(W) >= 0)):
        return EnergyBounds(0.0, 0.0, math.inf)
    error += 4 * EPS * abs(square)
    return EnergyBounds(square, max(square - error, 0.0), square + error)


def _residual(model: Realisation, X: ExtendedArray) -> tuple[ExtendedArray, Matrix]:
    """Return the residual of the Lyapunov equation at a symmetric X, and a bound of its rounding.

    Products in extended precision take most of the time of a large system, so that there is one
    and its transpose; the bound, for which doubles do, has room for their own rounding.
    """
    A, B = model.A.astype(np.longdouble), model.B.astype(np.longdouble)
    a, b, x = np.abs(model.A), np.abs(model.B), np.abs(X).astype(float)
    source, grain = B @ B.T, b @ b.T
    if model.discrete:
        residual = A @ X @ A.T - X + source
        grain = grain + a @ x @ a.T + x
    else:
        moved, size = A @ X, a @ x
        residual = moved + moved.T + source
        grain = grain + size + size.T
    return residual, grain * float(2 * (2 * A.shape[0] + B.shape[1]) * _WIDE)


def exact_h2_energy(model: exact.ExactModel) -> EnergyBounds:
    """Enclose the same number to double precision, whatever the damping."""
    bits = 192 if model.states <= 40 else 448
    while True:
        with precision(bits):
            try:
                ball = _energy_ball(model)
            except ZeroDivisionError:  # too few bits to invert
                ball = arb(0, math.inf)
            if ball.is_finite() and ball > 0 and ball.rel_accuracy_bits() >= 60:
                with precision(53):
                    middle = float(ball)
                return EnergyBounds(middle, middle * (1 - 2 * EPS), middle * (1 + 2 * EPS))
        if bits >= 768 and model.is_zero():
            return EnergyBounds(0.0, 0.0, 0.0)
        bits *= 2


def _energy_ball(model: exact.ExactModel) -> arb:
    """Sum the series of the Gramian X = M X M' + B B' by doubling: X <- X + M X M', M <- M M."""
    M, B, C, direct = *map(arb_mat, (model.A, model.B, model.C)), arb(0)
    X = B * B.transpose()
    if model.discrete:
        direct = _square_size(arb_mat(model.D))
    else:  # by s = (z + 1)/(z - 1), where the Gramian stays the same
        one = exact.identity(model.states)
        M, B = (arb_mat(model.A - one).solve(side) for side in (arb_mat(model.A + one), B))
        X = B * B.transpose() * 2
    seen = (C * X * C.transpose()).trace() + direct
    for _ in range(20_000):
        check_deadline()
        gain = _square_size(M)
        if gain < 0.5:
            rest = _square_size(C) * gain * X.trace() / (1 - gain)
            if rest < seen * arb(2) ** -70 or (not seen > 0 and gain < arb(2) ** -4000):
                return seen + arb(rest.mid() / 2, rest.mid() / 2 + rest.rad())
        elif not gain.is_finite() or gain.rel_accuracy_bits() < 16:
            break  # more bits are needed
        X = X + M * X * M.transpose()
        M = M * M
        seen = (C * X * C.transpose()).trace() + direct
    return arb(0, math.inf)


def _square_size(M: arb_mat) -> arb:
    return sum((entry * entry for entry in M.entries()), arb(0))


# The square of the H2 norm in modal coordinates.
#
# .. math:: \|G\|_2^2 = -\sum_{j,k} \frac{\langle R_j, R_k \rangle}{\lambda_j + \bar\lambda_k}
#
# with the residues R of a continuous system without D.


def modal_energy(form: ModalForm) -> EnergyBounds | None:
    """Enclose it; None where the modal form does not prove that the system is stable.

    With E the diagonal matrix of the inverse decay rates, the L2 norms w of the states' impulse
    responses are at most those of the modes alone plus E F w, and what F changes in the response
    is at most |c| E F w.
    """
    if form.discrete or not form.stable:
        return None
    rates = -form.real
    products = form.residues @ form.residues.conj().T
    n, imag = rates.size, form.high + form.low.astype(np.longdouble)
    apart = np.empty((n, n), complex)
    apart.real, apart.imag = np.add.outer(rates, rates), -np.subtract.outer(imag, imag)
    square = float(np.sum((products / apart).real))
    sizes = np.outer(form.sizes, form.sizes) / np.abs(apart)
    rounding = EPS * (8 * n + 64) * float(sizes.sum())
    small = form.rows / rates
    if not small.max() < 0.5:
        return None
    alone = form.moved / np.sqrt(2 * rates)
    w = alone + small * alone.max() / (1 - small.max())
    moved = float((form.shown / rates) @ form.coupling @ w)
    moved += float(np.sum(form.signal_errors / np.sqrt(2 * rates)))
    moved *= 1 + 1e-9
    if not (math.isfinite(rounding + moved) and square > rounding):
        return None
    low, high = math.sqrt(square - rounding), math.sqrt(square + rounding)
    lower = max(0.0, low - moved) ** 2 * (1 - 8 * EPS)
    return EnergyBounds(square, lower, (high + moved) ** 2 * (1 + 8 * EPS))


_FEEDTHROUGH = "D is not zero, so white noise passes with infinite power in continuous time"
MODAL_FROM = 12
"""Beyond so many coupled states modes are summed, which is quicker there."""


@dataclass(frozen=True, repr=False)
class H2Norm(Displayed):
    """Size of a system's response to white noise; ``float(norm)`` is its value.

    Attributes
    ----------
    value : float
        The norm; infinite if a pole is on or beyond the stability boundary (see
        :func:`h2_norm` for hidden ones) or, in continuous time, if D is not zero.
    lower, upper : float
        The true norm lies between the two.
    stable : bool
        Whether all poles are strictly stable, hidden ones included.
    reason : str
        How the value was found, or why it is infinite.
    system : control.StateSpace or None
        What it is the norm of.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rp.h2_norm(control.ss([[-2.0]], [[2.0]], [[1.0]], 0))
    H2 norm
      value     1
      at least  1
      at most   1
      stable    yes
      trace of the controllability Gramian, its residual checked
    """

    value: float
    lower: float
    upper: float
    stable: bool
    reason: str
    system: control.StateSpace | None = field(default=None, compare=False)

    def __float__(self) -> float:
        return self.value

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw how the norm grows with the bandwidth of the white noise.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            The root of the gain's square, integrated from zero up to each frequency; at its end
            stands the norm.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> rp.h2_norm(control.ss([[-2.0]], [[2.0]], [[1.0]], 0)).plot().get_xlabel()
        'frequency'
        """
        system = source_of(self.system)
        gains = singular_values(system)
        density = (gains**2).sum("singular_value").values
        # In discrete time the mean over all frequencies counts, not the integral in Hz.
        step = 1.0 if not system.dt or system.dt is True else float(system.dt)
        hertz = np.concatenate([[0.0], gains["frequency"].values])
        slabs = 0.5 * np.diff(hertz) * (np.concatenate([density[:1], density[:-1]]) + density)
        running = np.sqrt(2 * step * np.cumsum(slabs))
        curve = gains.isel(singular_value=0).copy(data=running)
        mark = {f"norm {self.value:.4g}": (math.nan, self.value)}
        return plot_gains({"up to the frequency": curve}, mark, ax, name="H2 norm")

    def _card(self) -> Card:
        rows = (
            ("value", self.value),
            ("at least", self.lower),
            ("at most", self.upper),
            ("stable", self.stable),
        )
        return Card("H2 norm", (quantities(*rows),), (self.reason,))


@single_threaded_blas
def h2_norm(system: control.StateSpace, *, tolerance: float = 1e-9) -> H2Norm:
    r"""Compute the H2 norm, the root of trace(C X C'), with X the controllability Gramian.

    Up to 12 coupled states, and in discrete time, the Lyapunov equation is solved in double
    precision for scaled states and time; its residual gives an error bound. Beyond, the energies
    of all pairs of modes are summed, every error enclosed. Where the bound exceeds the tolerance,
    as for very light damping or poles that nearly coincide, the other way is taken, and then the
    Gramian's series is summed in ball arithmetic, which encloses the norm.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete; an unspecified sampling time means continuous.
        In discrete time the norm is that of the pulse response (no factor of the
        sampling time), D included.
    tolerance : float, optional
        Largest relative error that is accepted from double precision; beyond 60 coupled
        states it is used whatever its error, which the bounds tell, unless it has none, and
        bounds 1e-6 wide from modes are accepted.

    Returns
    -------
    H2Norm
        Infinite if the state matrix has an eigenvalue beyond the stability boundary, or
        a reachable and observable one on it. One on the boundary that is exactly
        hidden leaves the norm finite and `stable` False.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, has entries that are not finite, or if the
        tolerance is not positive.

    Notes
    -----
    Thesis section 10.2.3. A pair of input and output units scales it as any gain, a unit of
    time by the root of the factor.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> round(float(rp.h2_norm(control.ss([[-2.0]], [[1.0]], [[1.0]], 0))), 6)
    0.5
    >>> rp.h2_norm(control.ss([[-2.0]], [[1.0]], [[1.0]], 3.0)).reason
    'D is not zero, so white noise passes with infinite power in continuous time'
    """
    tolerance = positive("tolerance", tolerance)
    if tolerance < 1e-15:
        raise invalid("tolerance", tolerance, "at least 1e-15", "The default is 1e-9.")
    model = realisation("system", system)
    found = [_part_norm(part, tolerance) for part in parts(model)]
    unsteady = [norm for norm in found if not norm.stable]
    infinite = [norm for norm in found if math.isinf(norm.value)]
    by_hand = [norm for norm in found if "ball" in norm.reason]
    telling = [*(norm for norm in infinite if not norm.stable), *infinite, *unsteady, *by_hand]
    reason = (telling or found)[0].reason if found else "there are no states, inputs or outputs"
    value, lower, upper = (
        math.hypot(*(getattr(norm, name) for norm in found)) for name in ("value", "lower", "upper")
    )
    return H2Norm(value, lower, upper, not unsteady, reason, model.source)


def _part_norm(model: Realisation, tolerance: float) -> H2Norm:
    spectrum, stable = None, True
    if model.states:
        model = exact.rescaled(model)
        spectrum = eigensystem(model.A)
        verdict = stability_of(model, spectrum)
        if verdict.verdict == "unstable":
            return _infinite(verdict.reason)
        seen = stable_part(model, verdict) if verdict.verdict == "marginal" else None
        if verdict.verdict == "marginal" and seen is None:
            return _infinite(verdict.reason)
        if seen is not None and (model.discrete or not model.D.any()):
            reason = f"{verdict.reason}, but hidden from inputs or outputs: not internally stable"
            return replace(_in_units(model, exact_h2_energy(seen), reason), stable=False)
        stable = seen is None
    if not model.discrete and model.D.any():
        return _infinite(_FEEDTHROUGH, stable)
    if model.states == 0 or model.D.size == 0:
        gain = float(np.linalg.norm(model.D))
        text = "a static gain" if model.D.size else "no input acts on any output"
        return H2Norm(gain, gain, gain, True, text)
    if spectrum is not None and model.states > MODAL_FROM and not model.discrete:
        form = modal_form(model, spectrum, True)
        found = None if form is None else modal_energy(form)
        widest = tolerance if model.states <= exact.EXACT_STATES else max(tolerance, 1e-6)
        if found is not None and found.width <= widest:
            return _in_units(model, found, "sum over pairs of modes, rounding errors enclosed")
    found = h2_energy(model, tolerance)
    text = "trace of the controllability Gramian, its residual checked"
    hopeless = math.isinf(found.width)
    if hopeless or (found.width > tolerance and model.states <= exact.EXACT_STATES):
        found = exact_h2_energy(exact.ExactModel.of(model))
        text = "trace of the controllability Gramian, in ball arithmetic"
    return _in_units(model, found, text)


def _in_units(model: Realisation, found: EnergyBounds, reason: str) -> H2Norm:
    value, lower, upper = map(math.sqrt, (found.square, found.lower, found.upper))
    known = exact.bracket(value, lower, upper, model.gain * math.sqrt(model.time))
    return H2Norm(*known, True, reason)


def _infinite(reason: str, stable: bool = False) -> H2Norm:
    return H2Norm(math.inf, math.inf, math.inf, stable, reason)
