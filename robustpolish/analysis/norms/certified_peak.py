"""The peak of the gain with a bracket, proven in exact arithmetic or estimated in double."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from flint import arb, fmpq
from scipy.optimize import minimize_scalar

from robustpolish.analysis.norms.crossings import crossings
from robustpolish.analysis.norms.modal.modal_form import modal_form
from robustpolish.analysis.norms.peak_search import bounds_gain, cayley, peak
from robustpolish.analysis.poles.eigen import EPS, Eigensystem, eigensystem
from robustpolish.deadline import look_at_the_clock
from robustpolish.exact.exponents import bracket
from robustpolish.exact.rational import ExactModel, fraction, transfer
from robustpolish.exact.realisation import Realisation, rescaled

EXACT_FIRST = 6
"""Up to so many coupled states the proof is exact from the start: nothing is as quick."""
EXACT_ALWAYS = 40
"""Up to so many the bracket is as narrow as is asked for, which exact arithmetic grants."""
EXACT_AT_MOST = 80
"""Up to so many exact arithmetic is used where nothing else proves a bound."""
# Widths of brackets that are accepted from modal coordinates: beyond EXACT_ALWAYS, beyond
# EXACT_AT_MOST where nothing else would prove any, and of estimates, which the Hamiltonian test
# could narrow.
_WIDE, _WIDEST, _ESTIMATED = 1e-6, 1e-2, 1e-6
# Gains of so many signals per state are quicker by the Hamiltonian matrix.
_SIGNALS = 4

# Crossings whose frequencies differ by more than this factor are far apart.
_FAR = 4
_MOST_BETWEEN = 12
_MOST_CLIMBING = 24


@dataclass(frozen=True)
class Peak:
    """The peak of a stable system's gain, in the units of its rescaled matrices.

    Attributes
    ----------
    frequency : float
        In the variable x of :class:`ExactModel`.
    gain, lower, upper : float
        The gain there, and bounds of the true peak.
    proof : str
        How the upper bound was found.
    """

    frequency: float
    gain: float
    lower: float
    upper: float
    proof: str

    def in_units(self, model: Realisation) -> Peak:
        """Come back from the scaled units of `model`."""
        known = bracket(self.gain, self.lower, self.upper, model.gain)
        return Peak(self.frequency * model.time, *known, self.proof)


def certified_peak(
    model: Realisation,
    tolerance: float,
    exact: bool,
    exact_model: ExactModel | None = None,
    spectrum: Eigensystem | None = None,
) -> Peak:
    """Find and bracket the peak of a stable, rescaled system.

    The `spectrum` of its A is taken if it is at hand. An `exact_model` takes its place where the
    doubles are rounded.
    """
    spectrum = spectrum or eigensystem(model.A)
    if exact_model is None and model.states > (EXACT_FIRST if exact else 1):
        found = _modal(model, spectrum, tolerance, exact)
        if found is not None:
            return found
    search = replace(model, time=1.0, gain=1.0)
    poles = spectrum.values
    if model.discrete:
        search = rescaled(cayley(search))
        poles = np.linalg.eigvals(search.A).astype(complex)
    frequency, gain = peak(search, poles, tolerance)
    if not exact or model.states > EXACT_ALWAYS:
        found = _estimated(search, frequency, gain, tolerance)
        found = found.in_units(search)
        if not exact or found.upper <= (1 + max(tolerance, 1e-6)) * found.lower:
            return found
        if model.states > EXACT_AT_MOST:
            return _sharper_below(model, found)
    return _proven(exact_model or ExactModel.of(model), frequency * search.time, tolerance)


def _modal(model: Realisation, spectrum: Eigensystem, tolerance: float, exact: bool) -> Peak | None:
    """Bracket the peak in modal coordinates; None where these are too ill conditioned."""
    if model.D.size > _SIGNALS * model.states:
        return None
    form = modal_form(model, spectrum, exact)
    if form is None or not form.stable:
        return None
    # Imports Numba, which takes as long as all the rest together.
    from robustpolish.analysis.norms.modal.modal_peak import modal_peak

    widest = _WIDE if model.states <= EXACT_AT_MOST else _WIDEST
    if not exact:
        widest = _ESTIMATED
    elif model.states <= EXACT_ALWAYS:
        widest = tolerance
    found = modal_peak(form, tolerance, max(tolerance, widest))
    if found is None:
        return None
    text = "every frequency covered, rounding errors enclosed"
    if not exact:
        text = "every frequency covered, within the rounding errors of double precision"
    return Peak(found.frequency, found.gain, found.lower, found.upper, text)


def _proven(model: ExactModel, start: float, tolerance: float) -> Peak:
    """Raise the gain by exact crossings until the upper bound has none."""
    at = fraction(start) if math.isfinite(start) else None
    gain = _gain(model, at)
    if gain == 0 and model.is_zero():
        return Peak(0.0, 0.0, 0.0, 0.0, "the transfer function is zero")
    trial: list[fmpq | None] = [fmpq(0), None]
    touching: list[fmpq] = []
    far = False
    trial += [fmpq(k, k + 2) for k in range(1, 2 * model.states + 3)] if gain == 0 else []
    for _ in range(100):  # every pass raises the gain by more than the tolerance; few are needed
        look_at_the_clock()
        values = [_gain(model, x) for x in trial]
        best = int(np.argmax(values))
        if values[best] > gain:
            gain, at = values[best], trial[best]
        elif touching:  # the gain only touches the last bound, at a crossing
            values = [_gain(model, x) for x in touching]
            gain, at = max(values), touching[int(np.argmax(values))]
        upper = gain * (1 + tolerance)
        found = crossings(model, fraction(upper) ** 2)
        if not found:
            for a, b in pairwise(touching):
                if far and at is not None and a <= at <= b:
                    at, gain = _higher(model, at, gain, _climbed(model, a, b))
            return _bracketed(model, at, gain, upper)
        spans = list(pairwise(found))
        far = far or any(_far_apart(a, b) for a, b in spans)
        trial = [fmpq(0), None, *(x for a, b in spans for x in _between(a, b))]
        if model.states > EXACT_FIRST and len(spans) == 1:
            trial.append(_climbed(model, *spans[0]))
        touching = found
    return replace(_bracketed(model, at, gain, math.inf), proof="the search did not settle")


def _far_apart(low: fmpq, high: fmpq) -> bool:
    return low > 0 and high > _FAR * low


def _higher(model: ExactModel, at: fmpq, gain: float, other: fmpq) -> tuple[fmpq, float]:
    """Return the frequency of the larger gain with it.

    A search that began far away ends as soon as its bracket is narrow, not at the top of the peak.
    """
    there = _gain(model, other)
    return (other, there) if there > gain else (at, gain)


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
    return middle + [
        fraction(bottom * 2.0 ** (octaves * k / (count + 1))) for k in range(1, count + 1)
    ]


def _climbed(model: ExactModel, low: fmpq, high: fmpq) -> fmpq:
    """Climb between two crossings, for gains take far less time than determinants."""
    ends = [math.log(max(float(arb(end)), 1e-300)) for end in (low, high)]
    found: Any = minimize_scalar(
        lambda x: -_gain(model, fraction(math.exp(x))),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-7 * (ends[1] - ends[0]), "maxiter": _MOST_CLIMBING},
    )
    return fraction(math.exp(found.x))


def _bracketed(model: ExactModel, at: fmpq | None, gain: float, upper: float) -> Peak:
    rounding = 4 * EPS * (model.B.ncols() + model.C.nrows())
    frequency = math.inf if at is None else float(arb(at))
    return Peak(frequency, gain, gain * (1 - rounding), upper, "no crossing, in exact arithmetic")


def _sharper_below(model: Realisation, found: Peak) -> Peak:
    """Evaluate the gain in ball arithmetic where doubles leave it uncertain."""
    at = fraction(found.frequency) if math.isfinite(found.frequency) else None
    gain = _gain(ExactModel.of(model), at)
    upper = found.upper if found.upper > gain else math.inf
    return replace(found, gain=gain, lower=gain * (1 - 1e-14), upper=upper)


def _gain(model: ExactModel, x: fmpq | None) -> float:
    G, scale = transfer(model, x)
    return float(np.linalg.norm(G, 2)) * scale


def _estimated(model: Realisation, frequency: float, gain: float, tolerance: float) -> Peak:
    """Widen the bracket until the Hamiltonian test in double precision is beyond doubt."""
    error = _evaluation_error(model, frequency)
    lower = gain * max(0.0, 1 - error)
    widths = [w for w in (tolerance, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.1) if w >= tolerance]
    for width in widths:
        upper = gain * (1 + width + error)
        if gain > 0 and bounds_gain(model, upper):
            text = "no crossing within the rounding errors of double precision"
            return Peak(frequency, gain, lower, upper, text)
    return Peak(frequency, gain, lower, math.inf, "double precision proves no upper bound")


def _evaluation_error(model: Realisation, frequency: float) -> float:
    """Estimate the relative error of the gain from the spread of the resolvent."""
    if not math.isfinite(frequency) or model.states == 0:
        return 10 * EPS
    singular = np.linalg.svd(
        1j * frequency * np.eye(model.states) - model.A, compute_uv=False, hermitian=False
    )
    if singular[-1] == 0:
        return 1.0
    return 10 * EPS * math.sqrt(model.states) * float(singular[0] / singular[-1])
