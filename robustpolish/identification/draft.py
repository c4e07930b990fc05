"""A first mechanical model from a record alone, as a guess to begin with.

The spectra of a whole record obey the equations of motion line by line, but for what its two ends
differ by, which is a polynomial of low degree in the frequency (Pintelon, Schoukens and
Vandersteen, IEEE Trans. Automatic Control 42 (1997) 1717-1720). So any excitation will do.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.optimize import least_squares, nnls

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.identification.observer.kalman import ABOVE_FLOOR, white_noise
from robustpolish.machines.effects.kind import GROUND
from robustpolish.machines.mechanical import parts
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.signals.quality import sampling_time

_MEANING = {u: (of, turns) for turns, units in parts.UNITS.items() for of, u in units.items()}
_ORDER = {parts.VELOCITY: 1, parts.ACCELERATION: 2}
# Lines at most: more take time and say no more of a guess; at least; and the share of the mean that
# a tenth of the lines of noise lie below.
_MOST_LINES, _LEAST_LINES, _TENTH = 1000, 20, 0.105
# Rounds of weighted equation errors, steps of a fit, and logarithm by which it may change a number.
_ROUNDS, _STEPS, _FAR = 12, 1000, 14.0
# Coordinates that one force moves at most: with more no record of one force tells their springs.
_MOST = 3
# Log odds for a hold, and mean squares over that of white noise up to which they mean anything: a
# model that lacks more may take a hold for it.
_ODDS, _ADEQUATE = 20.0, 4.0


def meaning(channel: xr.DataArray) -> tuple[str, bool]:
    """Return the quantity of a channel by its unit, "" if it tells none, and whether it turns."""
    return _MEANING.get(str(channel.attrs.get("units", "")), ("", False))


class _Spectra(NamedTuple):
    """Lines of a record: displacements and the factors that make outputs of power one of them.

    Beside them stand the factors of a held force, which is late by half a step and a mean over a
    step, and the share of the outputs' power that may be white noise.
    """

    omega: Array
    motion: AnyArray
    unit: AnyArray
    inputs: AnyArray
    held: AnyArray
    noise: Array

    def of(self, rows: Sequence[int]) -> _Spectra:
        """Return the same of some outputs."""
        one = {name: getattr(self, name)[..., rows] for name in ("motion", "unit", "noise")}
        return self._replace(**one)


def _spectra(data: xr.Dataset, inputs: Sequence[str], outputs: Sequence[str]) -> _Spectra:
    """Return the lines in which outputs stand out of their noise."""
    dt, samples = sampling_time(data), data.sizes["time"]
    rows = np.array([data[name].values for name in (*outputs, *inputs)], dtype=float)
    lines = np.fft.rfft(rows.T - rows.mean(axis=1), axis=0)[1:]
    size = np.sum(np.abs(lines) ** 2, axis=0)[: len(outputs)]
    power = np.sum(np.abs(lines[:, : len(outputs)]) ** 2 / size, axis=1)
    above = np.count_nonzero(power > ABOVE_FLOOR * np.percentile(power, 10) / _TENTH)
    kept = np.sort(np.argsort(-power)[: min(max(above, _LEAST_LINES), _MOST_LINES)])
    omega = np.asarray(2 * np.pi * (kept + 1.0) / (samples * dt), dtype=np.float64)
    order = [_ORDER.get(meaning(data[name])[0], 0) for name in outputs]
    derived = (1j * omega[:, None]) ** order
    Y, U = np.split(lines[kept], [len(outputs)], axis=1)
    noise = np.array([white_noise(row, dt) ** 2 for row in rows[: len(outputs)]])
    held = np.exp(-0.5j * omega * dt) * np.sinc(omega * dt / (2 * np.pi))
    unit = derived / np.sqrt(np.sum(np.abs(Y) ** 2, axis=0))
    return _Spectra(omega, Y / derived, unit, U, held, samples * kept.size * noise / size)


def _without_ends(s: _Spectra, weight: AnyArray, errors: AnyArray) -> Array:
    """Return errors without what the ends of the record may add, real parts above imaginary ones.

    `weight` (lines, outputs, coordinates) is what the equations of motion are multiplied by,
    `errors` has the shape (lines * outputs, anything).
    """
    powers = np.stack([(1j * s.omega / s.omega[-1]) ** k for k in range(-2, 2)], axis=1)
    ends = np.einsum("loi,lk->loik", weight, powers).reshape(len(errors), -1)
    ends, left = (np.concatenate([x.real, x.imag]) for x in (ends, errors))
    basis = np.linalg.qr(ends / np.linalg.norm(ends, axis=0))[0]
    return left - basis @ (basis.T @ left)


def _oscillator(s: _Spectra, force: AnyArray | None) -> tuple[float, Array]:
    """Fit mass, damping and stiffness to one output; without a force the mass is 1.

    The equation error is weighted by the response of the round before (Sanathanan and Koerner,
    IEEE Trans. Automatic Control 8 (1963) 56-58); no number gets negative. What is left is a share
    of the output's power.
    """
    w, free = s.omega, int(force is None)
    columns = np.stack([-(w**2), 1j * w, 1.0 + 0 * w], axis=1)
    both = np.column_stack([columns * s.motion, 0 * w if force is None else -force])
    best, weight = (np.inf, np.ones(3)), s.unit / w[:, None] ** 2
    for _ in range(_ROUNDS):
        A = _without_ends(s, weight[:, :, None], both * weight)
        size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        found = nnls(A[:, free:3] / size[free:3], -A[:, 3] - free * A[:, 0])[0] / size[free:3]
        found = np.concatenate([[1.0] * free, found])
        Z = columns @ found
        if not np.all(np.abs(Z) > 0):
            break
        weight = s.unit / Z[:, None]
        left = _without_ends(s, weight[:, :, None], both * weight) @ [*found, 1.0]
        best = min(best, (float(left @ left), found), key=lambda fit: fit[0])
    return best


def _places(n: int) -> list[tuple[int, int]]:
    """Return the places of springs and dampers among coordinates 0 to n - 1; n is the ground."""
    return [*((i, n) for i in range(n)), *combinations(range(n), 2)]


def _errors(s: _Spectra, forces: AnyArray, numbers: Array, slopes: bool = False) -> Array:
    """Return what masses, dampers and springs leave of the outputs, each of power one.

    Or its slopes over the logarithms of the numbers (Kaufman, BIT 15 (1975) 49-57).
    """
    n, w = s.motion.shape[1], s.omega
    B = [np.eye(n + 1)[a, :n] - np.eye(n + 1)[b, :n] for a, b in _places(n)]
    V, each = np.vstack([np.eye(n), B, B]), [n, len(B), len(B)]
    g = np.repeat(np.stack([-(w**2), 1j * w, 1.0 + 0 * w], axis=1), each, axis=1) * numbers
    inverse = np.linalg.inv(np.einsum("lp,pi,pj->lij", g, V, V))
    weight, x = s.unit[:, :, None] * inverse, np.einsum("lij,lj->li", inverse, forces)
    left = _without_ends(s, weight, (s.unit * (x - s.motion)).ravel())
    if not slopes:
        return left
    # The ends of the record act as forces do.
    x = s.motion + np.reshape(left[: x.size] + 1j * left[x.size :], x.shape) / s.unit
    changes = -(weight @ V.T) * (x @ V.T * g)[:, None]
    return _without_ends(s, weight, changes.reshape(x.size, -1))


def _fitted(s: _Spectra, forces: AnyArray, start: Array) -> tuple[float, Array]:
    """Fit positive numbers by least squares from a start."""
    low, high = np.log(start) - _FAR, np.log(start) + _FAR

    def numbers(x: Array) -> Array:
        return np.exp(np.clip(x, low, high))

    def errors(x: Array) -> Array:
        return _errors(s, forces, numbers(x))

    slopes: Any = lambda x: _errors(s, forces, numbers(x), True)  # noqa: E731 (scipy's stub)
    found = least_squares(errors, np.log(start), slopes, method="lm", max_nfev=_STEPS)
    return 2 * float(found.cost), numbers(found.x)


def _group(s: _Spectra, alone: Array, force: AnyArray) -> tuple[float, Array, int, str]:
    """Fit the coordinates that one force moves, from the numbers that each would have alone.

    The start is no machine's: springs and dampers of a like size are everywhere. Those that the
    lines do not need, by Schwarz's criterion, are dropped.

    Returns
    -------
    error : float
    numbers : ndarray
        Masses, then dampings and stiffnesses at :func:`_places`.
    at : int
        The coordinate on which the force acts.
    hold : str
        What the force does between samples, "" where the lines do not tell.
    """
    n, count = s.motion.shape[1], 2 * s.motion.size
    m, c, k = alone.T
    m = np.maximum(m, 1e-3 * np.max(m) or 1.0)
    k = np.maximum(k, 1e-3 * m * s.omega[0] * s.omega[-1])
    c = np.maximum(c, 1e-2 * np.sqrt(k * m))
    between = [[np.sqrt(x[a] * x[b]) for a, b in _places(n)[n:]] for x in (c, k)]
    start = np.concatenate([m, c, between[0], k, between[1]])
    tried = [(*_fitted(s, np.outer(force, row), start), at) for at, row in enumerate(np.eye(n))]
    error, numbers, at = min(tried, key=lambda found: found[0])
    forces, hold = np.outer(force, np.eye(n)[at]), ""
    held = _fitted(s, forces * s.held[:, None], numbers)
    odds = s.motion.size * np.log(error / held[0])
    if abs(odds) > _ODDS and min(error, held[0]) < _ADEQUATE * np.sum(s.noise):
        hold = "held" if odds > 0 else "not held"
    if hold == "held":
        (error, numbers), forces = held, forces * s.held[:, None]
    for i in range(n, numbers.size):
        fewer = np.where(np.arange(numbers.size) == i, 0.0, numbers)
        changed = float(np.sum(_errors(s, forces, fewer) ** 2))
        if changed <= error * count ** (1 / count):
            error, numbers = changed, fewer
    return error, numbers, at, hold


class Draft(NamedTuple):
    """A model as a guess, the share of each output's size that it leaves, and holds of inputs."""

    model: MechanicalModel
    left: dict[str, float]
    holds: dict[str, str]
    notes: list[str]


def draft_model(data: xr.Dataset, inputs: Sequence[str], outputs: Sequence[str]) -> Draft:
    """Make a model of a record, with one coordinate for each output.

    One force moves all coordinates. Of several forces each moves the one that it explains best;
    without any, coordinates move by themselves.

    Parameters
    ----------
    data : xarray.Dataset
        Uniform over ``time``.
    inputs, outputs : sequence of str
        Columns; what is no force by its unit is taken for one, with a gain.

    Returns
    -------
    Draft
    """
    kind = {name: meaning(data[name]) for name in (*inputs, *outputs)}
    unit = {n: None if of else data[n].attrs.get("units") or None for n, (of, _) in kind.items()}
    s = _spectra(data, inputs, outputs)
    fits: dict[tuple[int, str, int], tuple[float, Array]] = {}
    for k, o in enumerate(outputs):
        for i, force in zip(inputs, s.inputs.T, strict=True):
            if kind[i][0] != parts.FORCE or kind[i][1] == kind[o][1] or not kind[o][0]:
                fits |= {(k, i, g): _oscillator(s.of([k]), g * force) for g in (1, -1)}
        if not inputs:
            fits[k, str(k), 1] = _oscillator(s.of([k]), None)
    order, groups = sorted(fits, key=lambda key: fits[key][0]), dict[str, list[tuple[int, int]]]()
    for k, i, g in order:
        taken = {k for members in groups.values() for k, _ in members}
        room = _MOST if len(inputs) == 1 else 1
        if k not in taken and len(groups.get(i, [])) < room:
            groups.setdefault(i, []).append((k, g))
    made: dict[str, Any] = {f"{n}s": [] for n in ("dof", "damper", "spring", "input", "output")}
    notes, left, holds = list[str](), dict[str, float](), dict[str, str]()
    for i, members in groups.items():
        rows, names = [k for k, _ in members], [outputs[k] for k, _ in members]
        alone = [next(fits[key] for key in order if key[:2] == (k, i)) for k in rows]
        (error, numbers), at, known = alone[0], 0, False
        if i in inputs:
            force, known = members[0][1] * s.inputs[:, inputs.index(i)], kind[i][0] == parts.FORCE
            error, numbers, at, holds[i] = _group(
                s.of(rows), np.array([a for _, a in alone]), force
            )
        # Where nothing has a unit of force, only ratios of the numbers are known.
        scale = 1.0 if known else float(numbers[at])
        if not known:
            notes.append(
                f"{names[at]}: no force in N or N m is known to move it, its mass is set to 1"
            )
        if i in inputs:
            gain = members[0][1] / scale
            made["inputs"].append(parts.Input(i, (names[at], GROUND), None, gain, unit[i]))
        m, c, k = np.split(numbers / scale, [len(rows), len(rows) + len(_places(len(rows)))])
        for name, mass in zip(names, m, strict=True):
            turns = kind[name][1] or (not kind[name][0] and i in inputs and kind[i][1])
            made["dofs"].append(parts.Dof(name, float(mass), turns))
            of = kind[name][0] or parts.DISPLACEMENT
            made["outputs"].append(parts.Output(name, (name, GROUND), of, unit=unit[name]))
            left[name] = float(np.sqrt(error / len(rows)))
        for (a, b), *numbers in zip(_places(len(rows)), c.tolist(), k.tolist(), strict=True):
            ends = ([*names, GROUND][a], [*names, GROUND][b])
            for what, part, number in zip(
                ("dampers", "springs"), (parts.Damper, parts.Spring), numbers, strict=True
            ):
                made[what] += [part(ends, number)] * (number > 0)
    if rest := [o for o in outputs if o not in left]:
        notes.append(f"{', '.join(rest)}: not in the draft, what moves it is not known")
    model = MechanicalModel(**made, name="draft: every number is a guess")
    for i in (i for i, hold in holds.items() if hold == "held"):
        model = model.with_effect("input_hold", (i,), {"order": 0.0})
    return Draft(model, left, holds, notes)
