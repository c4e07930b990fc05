"""A family of plants, as responses at common frequencies, and their errors from one of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import control
import numpy as np
import xarray as xr

from robustpolish.analysis.norms.frequency_grid import frequency_grid
from robustpolish.arrays import AnyArray, Vector
from robustpolish.exact.exponents import refuse_extreme
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.models.plant.measured import finite
from robustpolish.validation import described, invalid

Kind = Literal["output", "input", "additive"]

_EXPECTED = "models, or responses measured at the same frequencies"
# Points of an even background, on which models are looked at beside their resonances.
_BACKGROUND = 300
# Into how many parts the steps between frequencies are cut for the last look at a weight.
_FINER = 5
# Decades beyond the slowest and the fastest pole or zero.
_BEYOND = 2.0
# Relative difference of frequencies that are the same.
_SAME = 1e-9
# What is left of a difference that a relative error cannot make, relative to the plant.
_LEFT = 1e-9
# Relative distance from a pole at which a response stands for the one there.
_BESIDE = 1e-8
# Real part over size below which a pole counts as one on the axis, on neither side.
_AXIS = 1e-8


@dataclass(frozen=True, eq=False)
class Family:
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


def refined(family: Family) -> Family:
    """Return a family of models at more frequencies, those between its own."""
    steps = np.arange(_FINER) / _FINER
    ratio = (family.omega[1:] / family.omega[:-1])[:, None]
    between = (family.omega[:-1, None] * ratio**steps).ravel()
    omega = np.append(between, family.omega[-1])
    return replace(family, omega=omega, responses=np.array([response(m, omega) for m in
                                                            family.models]))  # fmt: skip


def read_family(plants: Any, nominal: Any) -> Family:
    """Return what a user gave as a family."""
    if isinstance(plants, Mapping):
        plants = list(plants.values())
    given = list(plants) if isinstance(plants, Iterable) and not isinstance(
        plants, str | xr.DataArray | control.LTI) else []  # fmt: skip
    if not given:
        raise invalid("plants", plants, _EXPECTED, "Pass a list of them.")
    centre = None if nominal is None else as_state_space("nominal", nominal)
    measured = [_measured(i, item) for i, item in enumerate(given)]
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
    values = _response(system, omega)
    at_pole = ~np.isfinite(values).all(axis=(1, 2))
    if at_pole.any():
        values[at_pole] = _response(system, omega[at_pole] * (1 + _BESIDE))
    return values


def _response(system: control.StateSpace, omega: Vector) -> AnyArray:
    points = 1j * omega
    if system.dt:
        points = np.exp(points * (1.0 if system.dt is True else system.dt))
    values = np.asarray(system(points, squeeze=False, warn_infinite=False))
    return np.moveaxis(values, -1, 0)


def errors(family: Family, nominal: AnyArray, kind: Kind, refuse: bool = True) -> AnyArray:
    """Return the largest gain of each plant's error over frequency, shape (plants, frequencies).

    Parameters
    ----------
    family : Family
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
    gains[np.linalg.norm(left, 2, axis=(-2, -1)) > _LEFT * size] = np.inf
    if refuse and not np.isfinite(gains).all():
        where = family.omega[np.argwhere(~np.isfinite(gains))[0][1]]
        other = "input" if kind == "output" else "output"
        shown = described(f"a relative error at the {kind} that is infinite at {where:.6g} rad/s")
        remedy = f'Take kind="additive" or "{other}", or another nominal plant.'
        raise invalid("kind", shown, "a form that can make every plant", remedy)
    return gains


def _measured(i: int, item: Any) -> control.FrequencyResponseData | None:
    """Return a measured response, None if it is a model."""
    if isinstance(item, control.FrequencyResponseData):
        return finite(f"plants[{i}]", item)
    if isinstance(item, xr.DataArray):
        if set(item.dims) != {"frequency", "output", "input"}:
            shown = described(f"an array over {', '.join(map(str, item.dims))}")
            remedy = "Read it with read_frequency_response, and pass one measurement each."
            raise invalid(("plants", i), shown, "frequency, output and input", remedy)
        ordered = item.transpose("output", "input", "frequency")
        omega = 2 * np.pi * item["frequency"].values
        return finite(f"plants[{i}]", control.FrequencyResponseData(ordered.values, omega))
    return None


def _of_responses(
    measured: Sequence[control.FrequencyResponseData], count: int, centre: Any
) -> Family:
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
        same = len(item.omega) == omega.size and np.allclose(
            np.sort(item.omega), omega, rtol=_SAME, atol=0
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
    return Family(omega[use], np.array(values)[:, use], (), centre, centre.dt or 0)


def _of_models(models: tuple[control.StateSpace, ...], centre: Any) -> Family:
    every = (*models, *(() if centre is None else (centre,)))
    times = {float(m.dt) if m.dt is not None else 0.0 for m in every if m.nstates}
    if len(times) > 1:
        shown = described(f"sampling times {', '.join(f'{t:g}' for t in sorted(times))}")
        raise invalid("plants", shown, "one sampling time", "Resample the others.")
    _same_shape([(m.noutputs, m.ninputs) for m in models], every[-1])
    poles = [np.asarray(m.poles()) for m in every]
    dt = next((m.dt for m in every if m.dt), 0)
    unstable = [_unstable(p, bool(dt)) for p in poles]
    if len(set(unstable)) > 1:
        shown = described(f"{min(unstable)} to {max(unstable)} unstable poles")
        remedy = "No stable error makes one of another: cover them apart."
        raise invalid("plants", shown, "plants with as many unstable poles", remedy)
    omega = _frequencies(np.concatenate([*poles, *(_zeros(m) for m in every)]), dt)
    return Family(omega, np.array([response(m, omega) for m in models]), models, centre, dt)


def _same_shape(shapes: Sequence[tuple[int, ...]], centre: control.StateSpace) -> None:
    own = (centre.noutputs, centre.ninputs)
    if 0 in own:
        shown = described(f"{own[0]} outputs and {own[1]} inputs")
        raise invalid("plants", shown, "at least one of each", "Select signals.")
    for i, shape in enumerate(shapes):
        if tuple(shape) != own:
            shown = described(f"{shape[0]} x {shape[1]}")
            raise invalid(("plants", i), shown, f"{own[0]} x {own[1]}", "Select the same signals.")


def _unstable(poles: AnyArray, discrete: bool) -> int:
    beyond = np.abs(poles) - 1 if discrete else np.real(poles)
    return int(np.count_nonzero(beyond > _AXIS * np.abs(poles)))


def _zeros(model: control.StateSpace) -> AnyArray:
    if model.ninputs != model.noutputs or not model.nstates:
        return np.zeros(0)
    return np.asarray(model.zeros())


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
    ends = low / 10**_BEYOND, min(high * 10**_BEYOND, 0.999 * highest)
    grid = [np.geomspace(*ends, _BACKGROUND)]
    for root in roots[np.isfinite(roots) & (np.imag(roots) > 0)]:
        near = frequency_grid(np.array([root]), highest)
        apart = np.abs(near / abs(root.imag) - 1)
        grid += [near[apart < 0.3][::4], [root.imag]]
    points = np.unique(np.concatenate(grid))
    return points[(points >= ends[0]) & (points <= ends[1])]
