"""Margins and bandwidths of a measured loop, from its lines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robustpolish.arrays import AnyArray, Vector
from robustpolish.loops.bandwidth import LoopBandwidth
from robustpolish.loops.loop import PLACES, Place
from robustpolish.loops.margins.all_loops import MarginsAtOnce, Where
from robustpolish.loops.margins.disk import DiskMargin
from robustpolish.loops.margins.one_loop import Crossing, LoopMargins
from robustpolish.loops.margins.scaled_peak import best_scales
from robustpolish.loops.measured.loop import MeasuredLoop

_HALF_POWER = 1 / math.sqrt(2)
_NEAR_AXIS = math.radians(10)
"""At the first and last line a phase this near to -180 degrees counts as a crossing: to be safe."""
_FAR = 1e3
"""Unless that lies 60 dB from any margin."""


def measured_margins(loop: MeasuredLoop, place: Place, signal: int) -> LoopMargins:
    """Return the margins at one signal; crossings lie between lines, drawn straight."""
    values = loop.opened(place, [signal])
    L = values[:, 0, 0]
    at_gain, at_phase = _gain_crossings(loop.omega, L), _phase_crossings(loop.omega, L)
    at = loop.at(place, [signal])
    name = loop.names(place)[signal]
    return LoopMargins(
        name=name,
        place=place,
        gain_up=min((c.gain for c in at_phase if c.gain > 1), default=math.inf),
        gain_down=max((c.gain for c in at_phase if c.gain < 1), default=0.0),
        phase_deg=min((min(c.phase_deg, 360 - c.phase_deg) for c in at_gain), default=math.inf),
        delay_s=min((c.delay_s for c in at_gain), default=math.inf),
        modulus=float(1 / np.abs(loop.closed[:, at[0], at[0]]).max()),
        disk=_disk(loop, at),
        gain_crossovers=at_gain,
        phase_crossovers=at_phase,
        loop=loop.response(values, [name], [name]),  # type: ignore[arg-type]
        unstable_poles=loop.unstable_poles,
    )


def measured_at_once(loop: MeasuredLoop, where: Where) -> MarginsAtOnce:
    """Return what the loop bears at several signals at once, as far as the lines tell."""
    place: Place | None = {"inputs": "input", "outputs": "output"}.get(where)  # type: ignore
    if place is None:
        at, common = [*loop.at("input"), *loop.at("output")], math.nan
    else:
        at, common = loop.at(place), _common_delay(loop.omega, loop.opened(place))
    labels = [*loop.names("input"), *loop.names("output")]
    opened = loop.side_by_side if place is None else loop.opened(place)
    large = np.flatnonzero(_scaled_sizes(opened) >= 1)
    last = int(large[-1]) + 1 if large.size else 0
    # Each line speaks for the stretch up to the next, where the same delay turns further.
    ends = np.append(loop.omega[1:], loop.omega[-1])[:last]
    delays = 2 * np.arctan2(1.0, _scaled_sizes(_balanced(loop, at)[:last])) / ends
    least = float(np.nanmin([*delays, common, math.inf]))
    return MarginsAtOnce(where, tuple(labels[i] for i in at), _disk(loop, at), common, least)


def measured_bandwidths(
    loop: MeasuredLoop, margins: tuple[LoopMargins, ...]
) -> tuple[LoopBandwidth, ...]:
    """Return bandwidths and peaks, those of all signals of a place too."""
    found = []
    for place in PLACES:
        own = [m for m in margins if m.place == place]
        groups = [(m.name, [i]) for i, m in enumerate(own)]
        if len(own) > 1:
            groups.append(("all", list(range(len(own)))))
        found += [_bandwidth(loop, place, name, signals) for name, signals in groups]
    return tuple(found)


def largest(values: AnyArray) -> Vector:
    """Return the largest singular value, line by line."""
    return np.linalg.svd(values, compute_uv=False)[:, 0]


def _balanced(loop: MeasuredLoop, at: list[int]) -> AnyArray:
    """Return S - T = 2 S - 1 at some signals."""
    return 2 * loop.closed[:, at][:, :, at] - np.eye(len(at))


def _scaled_sizes(values: AnyArray) -> Vector:
    return np.array([best_scales(value)[0] for value in values])


def _disk(loop: MeasuredLoop, at: list[int]) -> DiskMargin:
    sizes = _scaled_sizes(_balanced(loop, at))
    worst = int(np.argmax(sizes))
    alpha = 2 / float(sizes[worst]) if sizes[worst] else math.inf
    return DiskMargin(alpha, float(loop.omega[worst] / (2 * math.pi)), False)


def _gain_crossings(omega: Vector, L: Any) -> tuple[Crossing, ...]:
    found = []
    for share, i in _sign_changes(np.log(np.abs(L))):
        at = float(omega[i] * (omega[i + 1] / omega[i]) ** share)
        turn = float(np.angle(L[i + 1] / L[i]))
        lag = (float(np.angle(L[i])) + share * turn + math.pi) % (2 * math.pi)
        found.append(Crossing(at / (2 * math.pi), 1.0, math.degrees(lag), lag / at))
    return tuple(found)


def _phase_crossings(omega: Vector, L: Any) -> tuple[Crossing, ...]:
    """Return where the phase passes -180 degrees, followed by the shorter way."""
    found = []
    away = np.angle(-L)
    near = np.abs(np.diff(away)) < math.pi
    for share, i in _sign_changes(away):
        if near[i]:
            at = float(omega[i] * (omega[i + 1] / omega[i]) ** share)
            size = float(np.abs(L[i]) * np.abs(L[i + 1] / L[i]) ** share)
            found.append(Crossing(at / (2 * math.pi), 1 / size, 0.0, 0.0))
    for i in (0, -1):
        # At rest, or for ever above, L may be on the axis, where no line can lie.
        if abs(away[i]) < _NEAR_AXIS and 1 / _FAR < abs(L[i]) < _FAR:
            found.append(Crossing(float(omega[i] / (2 * math.pi)), float(1 / abs(L[i])), 0.0, 0.0))
    return tuple(sorted(found, key=lambda crossing: crossing.frequency_hz))


def _sign_changes(values: Vector) -> list[tuple[float, int]]:
    """Return where a value changes its sign: the share of the step, and the line before."""
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = values[:-1] / (values[:-1] - values[1:])
    changes = (values[:-1] > 0) != (values[1:] > 0)
    return [(float(shares[i]), int(i)) for i in np.flatnonzero(changes & np.isfinite(shares))]


def _common_delay(omega: Vector, L: AnyArray) -> float:
    """Return the smallest delay at all signals that turns an eigenvalue of L to -1."""
    values = np.linalg.eigvals(L)
    values = np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)
    delays = [c.delay_s for one in values.T for c in _gain_crossings(omega, one)]
    return min(delays, default=math.inf)


def _bandwidth(loop: MeasuredLoop, place: Place, name: str, signals: list[int]) -> LoopBandwidth:
    at = loop.at(place, signals)
    S = loop.closed[:, at][:, :, at]
    s, t = largest(S), largest(np.eye(len(at)) - S)
    crossings = _gain_crossings(loop.omega, largest(loop.opened(place, signals)))
    rising = [w for w, up in _half_power(loop.omega, s) if up]
    falling = [w for w, up in _half_power(loop.omega, t) if not up]
    above = bool(t[-1] > _HALF_POWER)
    hertz = loop.omega / (2 * math.pi)
    return LoopBandwidth(
        name,
        place,
        max((c.frequency_hz for c in crossings), default=math.nan),
        min(rising, default=math.nan),
        math.nan if above else max(falling, default=math.nan),
        float(s.max()),
        float(t.max()),
        float(hertz[np.argmax(s)]),
        float(hertz[np.argmax(t)]),
    )


def _half_power(omega: Vector, sizes: Vector) -> list[tuple[float, bool]]:
    """Return the frequencies in Hz at which a gain passes -3 dB, and whether upwards."""
    levels = np.log(sizes / _HALF_POWER)
    return [
        (float(omega[i] * (omega[i + 1] / omega[i]) ** share / (2 * math.pi)), levels[i] < 0)
        for share, i in _sign_changes(levels)
    ]
