"""The H2 norm: root mean square response to white noise, or the energy of the impulse response."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import control
import numpy as np
from matplotlib.axes import Axes

from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import invalid, positive, source_of
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic.powers_of_two import bracket
from robustpolish.linear.arithmetic.rational import EXACT_STATES, ExactModel
from robustpolish.linear.arithmetic.realisation import Realisation, realisation, rescaled
from robustpolish.linear.eigen import EPS, eigensystem
from robustpolish.linear.norms.gramian import EnergyBounds, exact_h2_energy, h2_energy
from robustpolish.linear.norms.modal_form import ModalForm, modal_form
from robustpolish.linear.norms.singular_values import singular_values
from robustpolish.linear.scaling import parts
from robustpolish.linear.stability import Stability, stability_of, stable_part
from robustpolish.plots.frequency import plot_gains

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
    n = form.states
    apart = np.empty((n, n), complex)
    apart.real = np.add.outer(rates, rates)
    apart.imag = -np.subtract.outer(form.imag, form.imag)
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
    return H2Norm(
        math.hypot(*(norm.value for norm in found)),
        math.hypot(*(norm.lower for norm in found)),
        math.hypot(*(norm.upper for norm in found)),
        not unsteady,
        reason,
        system,
    )


def _part_norm(model: Realisation, tolerance: float) -> H2Norm:
    spectrum = None
    if model.states:
        model = rescaled(model)
        spectrum = eigensystem(model.A)
        verdict = stability_of(model, spectrum)
        if verdict.verdict == "unstable":
            return H2Norm(math.inf, math.inf, math.inf, False, verdict.reason)
        if verdict.verdict == "marginal":
            return _marginal_norm(model, verdict)
    if not model.discrete and model.D.any():
        return _feedthrough(stable=True)
    if model.states == 0 or model.D.size == 0:
        gain = float(np.linalg.norm(model.D))
        text = "a static gain" if model.D.size else "no input acts on any output"
        return H2Norm(gain, gain, gain, True, text)
    if spectrum is not None and model.states > MODAL_FROM and not model.discrete:
        form = modal_form(model, spectrum, True)
        found = None if form is None else modal_energy(form)
        widest = tolerance if model.states <= EXACT_STATES else max(tolerance, 1e-6)
        if found is not None and found.width <= widest:
            return _in_units(model, found, "sum over pairs of modes, rounding errors enclosed")
    found = h2_energy(model, tolerance)
    text = "trace of the controllability Gramian, its residual checked"
    hopeless = math.isinf(found.width)
    if hopeless or (found.width > tolerance and model.states <= EXACT_STATES):
        found = exact_h2_energy(ExactModel.of(model))
        text = "trace of the controllability Gramian, in ball arithmetic"
    return _in_units(model, found, text)


def _in_units(model: Realisation, found: EnergyBounds, reason: str) -> H2Norm:
    value, lower, upper = bracket(
        *map(math.sqrt, (found.square, found.lower, found.upper)),
        factor=model.gain * math.sqrt(model.time),
    )
    return H2Norm(value, lower, upper, True, reason)


def _feedthrough(stable: bool) -> H2Norm:
    reason = "D is not zero, so white noise passes with infinite power in continuous time"
    return H2Norm(math.inf, math.inf, math.inf, stable, reason)


def _marginal_norm(model: Realisation, verdict: Stability) -> H2Norm:
    seen = stable_part(model, verdict)
    if seen is None:
        return H2Norm(math.inf, math.inf, math.inf, False, verdict.reason)
    if not model.discrete and model.D.any():
        return _feedthrough(stable=False)
    reason = f"{verdict.reason}, but hidden from inputs or outputs: not internally stable"
    return replace(_in_units(model, exact_h2_energy(seen), reason), stable=False)
