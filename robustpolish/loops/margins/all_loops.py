"""The margins of several loops at once: every signal of a place changed in any combination."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import control
import numpy as np

from robustpolish.analysis.norms.peak_search import cayley
from robustpolish.arrays import AnyMatrix, Vector
from robustpolish.exact.realisation import Realisation, realisation, rescaled
from robustpolish.loops.loop import Loop, Place
from robustpolish.loops.margins.delayed_intervals import DelayedIntervals
from robustpolish.loops.margins.disk import DiskMargin, disk_of
from robustpolish.loops.margins.scaled_peak import (
    MOST_INTERVALS,
    best_scales,
    interval,
    scaled_peak,
)
from robustpolish.loops.response import Response, roots

Where = Literal["inputs", "outputs", "inputs and outputs"]
_MOST_STEPS = 300
# With delays an interval is as wide as a slope allows, where states alone have eigenvalues for it.
_MOST_DELAYED = 1000
_SHARES_OF_SCALES = (1.0, 0.6, 0.2)
# What the bound of delays may lose: intervals of constant scales get long enough.
_SLACK = 1e-2
# A loop that is not small this far above its poles counts as large for ever.
_FARTHEST = 1e15


@dataclass(frozen=True)
class MarginsAtOnce:
    """What several loops bear together, each changed by a factor or delay of its own.

    Attributes
    ----------
    where : {"inputs", "outputs", "inputs and outputs"}
        Of the plant.
    signals : tuple of str
        The signals that change.
    disk : DiskMargin
        A factor from the disk at every signal, in any combination.
    common_delay_s : float
        Smallest delay in s that makes the loop unstable if all signals of the place have it; nan
        for inputs and outputs together.
    any_delay_s : float
        Delays up to this, in s, in any combination leave the loop stable: a lower bound, which
        takes the worst complex change in place of a delay.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> A, C = [[0, 10], [-10, 0]], [[1, 10], [-10, 1]]
    >>> satellite = control.ss(A, [[1, 0], [0, 1]], C, 0)
    >>> at_once = rp.loop_analysis(satellite, [[-1, 0], [0, -1]]).at_once["inputs"]
    >>> round(at_once.disk.alpha, 3), at_once.disk.proven
    (0.1, True)
    """

    where: Where
    signals: tuple[str, ...]
    disk: DiskMargin
    common_delay_s: float
    any_delay_s: float


def margins_at_once(loop: Loop, where: Where) -> MarginsAtOnce:
    """Return what a stable loop bears at all inputs, all outputs, or all of both."""
    place: Place | None = {"inputs": "input", "outputs": "output"}.get(where)  # type: ignore
    if place is None:
        at, opened = [*loop.at("input"), *loop.at("output")], loop.side_by_side
        common = math.nan
    else:
        at, opened = loop.at(place), loop.opened(place)
        common = common_delay(loop.response(place))
    names = tuple(loop.closed.input_labels[i] for i in at)
    balanced = _axis(loop.around(at, 2.0, 1.0), _closed_delays(loop, at))
    if len(at) == 1:  # no scales to choose
        disk = disk_of(loop.balanced_peak(at))
    else:
        peak = scaled_peak(
            balanced.size, balanced.response, balanced.seeds(), balanced.around, balanced.most
        )
        alpha = 2 / peak.upper if peak.upper else math.inf
        hertz = float(balanced.omega(peak.frequency) / (2 * math.pi))
        disk = DiskMargin(alpha, hertz, peak.covered)
    delay = any_delay(balanced, _axis(opened, _opened_delays(loop, place)), disk.alpha)
    return MarginsAtOnce(where, names, disk, common, delay)


@dataclass(frozen=True, eq=False)
class _Axis:
    """A system over the continuous frequency x, of which rad/s is a function."""

    model: Realisation
    discrete: bool
    step: float
    most = MOST_INTERVALS

    @classmethod
    def of(cls, system: control.StateSpace) -> _Axis:
        model = realisation("system", system)
        model = rescaled(model) if model.states else model
        discrete, step = model.discrete, model.step
        image = cayley(model)
        gain = model.gain
        image = Realisation(
            image.A, image.B * gain, image.C, image.D * gain, False, 1.0, model.time, 1.0
        )
        return cls(image, discrete, step)

    def omega(self, x: float) -> float:
        """Return the frequency in rad/s."""
        return 2 * math.atan(x) / self.step if self.discrete else x * self.model.time

    def x(self, omega: float) -> float:
        """Return the frequency of the model."""
        if not self.discrete:
            return omega / self.model.time
        angle = omega * self.step / 2
        return math.tan(angle) if angle < math.pi / 2 * (1 - 1e-15) else math.inf

    def response(self, x: float) -> AnyMatrix:
        model = self.model
        D = model.D.astype(complex)
        if not model.states or not math.isfinite(x):
            return D
        try:
            inner = np.linalg.solve(1j * x * np.eye(model.states) - model.A, model.B + 0j)
        except np.linalg.LinAlgError:
            return np.full_like(D, np.inf)
        return D + model.C @ inner

    @property
    def size(self) -> float:
        """A frequency near the fastest of the model."""
        return float(np.linalg.norm(self.model.A)) or 1.0

    def around(self, x: float, scales: Vector, level: float) -> tuple[float, float]:
        """Return the frequencies around one at which the scaled response is below a level."""
        return interval(self.model, x, scales, level)

    def seeds(self) -> Vector:
        """Return the frequencies of the poles."""
        poles: Any = np.linalg.eigvals(self.model.A) if self.model.states else np.zeros(0)
        return np.unique(np.round(np.abs(poles), 12))


@dataclass(frozen=True, eq=False)
class _DelayedAxis(_Axis):
    """The same with exact delays; the model shows where to look."""

    exact: DelayedIntervals
    most = _MOST_DELAYED

    def response(self, x: float) -> AnyMatrix:
        if not math.isfinite(x):
            return super().response(x)
        return self.exact.response(self.omega(x))

    def around(self, x: float, scales: Vector, level: float) -> tuple[float, float]:
        # Scales that are best by a hair may be far apart, and the slope then large: less will do.
        found = [
            self.exact.around(self.omega(x), scales**share, level)
            for share in _SHARES_OF_SCALES[: 1 if len(scales) == 1 else None]
        ]
        return self.x(min(one[0] for one in found)), self.x(max(one[1] for one in found))


def _axis(system: control.StateSpace, exact: DelayedIntervals | None) -> _Axis:
    own = _Axis.of(system)
    return own if exact is None else _DelayedAxis(own.model, own.discrete, own.step, exact)


def _closed_delays(loop: Loop, at: list[int]) -> DelayedIntervals | None:
    """Return S - T = 2 S - 1 at some signals with exact delays; None without."""
    if loop.delayed is None:
        return None
    every = np.eye(loop.plant.nu + loop.plant.ny)
    # z = 2 q - w: q holds w already, and o = q - w.
    some = every[at]
    return DelayedIntervals.wired(loop.delayed, every, some.T, (some, some))


def _opened_delays(loop: Loop, place: Place | None) -> DelayedIntervals | None:
    """Return what :attr:`Loop.side_by_side`, or the loop opened at a place, is with delays."""
    if loop.delayed is None:
        return None
    every = np.eye(loop.plant.nu + loop.plant.ny)
    broken = list(range(len(every))) if place is None else loop.at(place)
    back = every.copy()
    back[broken] = 0.0
    return DelayedIntervals.wired(
        loop.delayed, back, every[:, broken], (-every[broken], np.zeros((len(broken), len(every))))
    )


def common_delay(response: Response) -> float:
    """Return the smallest delay in s at all signals of a loop that makes it unstable.

    A pole is on the boundary if an eigenvalue of L, turned by the delay, is -1: the frequencies
    at which one has size 1 are found by bracketing among points that are dense at resonances.
    """
    points = [response.grid, response.level_hints(1.0)]

    def eigenvalues(omega: Vector | float) -> Any:
        values = response.at(omega)
        values[~np.isfinite(values).all(axis=(1, 2))] = 1e300
        found = np.linalg.eigvals(values)
        return np.take_along_axis(found, np.argsort(-np.abs(found), axis=1), axis=1)

    def excess(omega: Vector | float, rank: int) -> Vector:
        with np.errstate(divide="ignore"):
            return np.log(np.abs(eigenvalues(omega)[:, rank]))

    if not response.model.discrete and np.abs(eigenvalues(math.inf)).max() >= 1 - 1e-12:
        return 0.0
    least = math.inf
    for rank in range(response.system.ninputs or 0):
        for omega in roots(partial(excess, rank=rank), points, response.highest):
            found = eigenvalues(omega)[0]
            crossing = found[np.abs(np.abs(found) - 1) < 1e-6]
            lags = (np.angle(crossing) + math.pi) % (2 * math.pi)
            least = min(least, float(lags.min(initial=math.inf)) / omega)
    return least


def any_delay(balanced: _Axis, opened: _Axis, alpha: float) -> float:
    """Return a delay in s up to which delays in any combination leave the loop stable.

    A delay turns the phase by omega tau, and the balanced disk of size alpha holds all turns up
    to 2 atan(alpha / 2). Above the frequency from which on L is small, any turn will do.
    """
    top = _last_large(opened)
    if top in (0.0, math.inf):
        return math.inf if top == 0.0 else 0.0
    least, end = math.inf, top
    for _ in range(_MOST_STEPS):
        if 2 * math.atan(alpha / 2) / end >= least:
            return least
        x = balanced.x(end)
        value, scales = best_scales(balanced.response(x))
        level = value * (1 + _SLACK)
        least = min(least, 2 * math.atan(1 / level) / end)
        first = balanced.omega(balanced.around(x, scales, level)[0])
        end = min(first, end * (1 - 1e-6))
        if end <= 0:
            return least
    return min(least, 2 * math.atan(alpha / 2) / top)


def _last_large(opened: _Axis) -> float:
    """Return the frequency in rad/s above which no change of phases matters, L being small."""
    model = opened.model
    fastest = float(np.abs(np.linalg.eigvals(model.A)).max()) if model.states else 0.0
    end = fastest or 1.0
    while True:  # out to where the loop is small and stays so
        value, scales = best_scales(opened.response(end))
        if value < 1 and opened.around(end, scales, 1.0)[1] == math.inf:
            break
        if end > _FARTHEST * (fastest or 1.0):
            return opened.omega(math.inf)
        end *= 10
    for _ in range(_MOST_STEPS):
        value, scales = best_scales(opened.response(end * (1 - 1e-4)))
        if value >= 1:
            return opened.omega(end)
        end = min(end * (1 - 1e-4), opened.around(end * (1 - 1e-4), scales, 1.0)[0])
        if end == 0:
            return 0.0
    return opened.omega(end)
