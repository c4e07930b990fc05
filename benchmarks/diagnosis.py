"""Diagnoses by samples, masses and size of the catalogue, and one against pysindy.

The machine is a chain of masses on springs whose first spring stiffens with the third power; the
model does not know. pysindy is given the true mass, damper and spring, differentiates the measured
displacement and fits a polynomial to the force that is left; it runs in an interpreter of its own.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from benchmarks.row import Row, once
from robustpolish.machines.effects.effect import unregister

RATE, STIFFNESS, DAMPING, CUBIC = 500.0, 400.0, 1.0, 4e5
SCRIPT = Path(__file__).with_name("pysindy_residual.py")

_PYSINDY = (
    "ours knows neither place nor kind: it tries a catalogue of effects at every place, refits all "
    "numbers of the machine with the best, and judges them on data held out; the peer is one "
    "regression on a force that it is handed"
)
_MISSING = "pysindy is not installed in an interpreter of its own (see `make bench`)"

# Further kinds for the catalogue with the units of their k, none of which is the right one.
_OWN = {
    "f = -k*q**5": "N/m^5", "f = -k*q**7": "N/m^7", "f = -k*q*abs(q)": "N/m^2",
    "f = -k*v**3": "N*s^3/m^3", "f = -k*v*q**4": "N*s/m^5", "f = -k*q*v**2": "N*s^2/m^3",
    "f = -k*v*abs(q)": "N*s/m^2", "f = -k*v**5": "N*s^5/m^5",
}  # fmt: skip


def chain(masses: int) -> rp.MechanicalModel:
    """Return the model, without what stiffens."""
    names = [f"x{i + 1}" for i in range(masses)]
    places = list(zip(names, ["ground", *names], strict=False))
    return rp.MechanicalModel(
        [rp.Dof(name, 1.0) for name in names],
        [rp.Spring(place, STIFFNESS) for place in places],
        [rp.Damper(place, DAMPING) for place in places],
        inputs=[rp.Input("F", (names[0], "ground"))],
        outputs=[rp.Output(name, (name, "ground")) for name in names],
    )


@lru_cache
def record(masses: int, samples: int) -> xr.Dataset:
    """Return what would be measured, with noise of a thousandth."""
    random = np.random.default_rng(0)
    time = np.arange(samples) / RATE
    phases, lines = random.uniform(0, 2 * np.pi, 40), np.arange(1, 41) * 0.2
    K = STIFFNESS * (2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
    K[-1, -1] = STIFFNESS
    C = DAMPING / STIFFNESS * K
    first = np.eye(masses)[0]

    def force(t):
        return 10.0 * np.cos(2 * np.pi * np.multiply.outer(t, lines) + phases).mean(axis=-1)

    def rate(t, s):
        x, v = s[:masses], s[masses:]
        return np.concatenate([v, (force(t) - CUBIC * x[0] ** 3) * first - K @ x - C @ v])

    start = np.zeros(2 * masses)
    y = solve_ivp(rate, (0, time[-1]), start, t_eval=time, rtol=1e-8, atol=1e-11).y[:masses]
    y = y + 1e-3 * y.std(axis=1, keepdims=True) * random.standard_normal(y.shape)
    columns = {f"x{i + 1}": ("time", y[i], {"units": "m"}) for i in range(masses)}
    columns["F"] = ("time", force(time), {"units": "N"})
    return xr.Dataset(columns, {"time": ("time", time, {"units": "s"})})


def diagnosed(masses: int, samples: int) -> tuple[float, str]:
    """Return the time in ms, and what was found."""
    spent, diagnosis = once(rp.diagnose, chain(masses), record(masses, samples))
    kinds = [effect.kind for effect in diagnosis.effects]
    value = next(
        (e.parameters["stiffness"].value for e in diagnosis.effects if e.kind == "cubic_stiffness"),
        0.0,
    )
    named = ", ".join(kinds) or diagnosis.verdict
    return spent, f"found {named}, {value / CUBIC:.3f} of true"


def sparse_regression(python: Path | None, samples: int) -> dict | None:
    """Return what pysindy found, None if it is not there."""
    if python is None or not python.exists():
        return None
    data = record(1, samples)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.npz"
        known = {"m": 1.0, "c": DAMPING, "k": STIFFNESS}
        arrays = {"time": data["time"], "x": data["x1"], "F": data["F"]}
        np.savez(path, **{name: v.to_numpy() for name, v in arrays.items()}, **known)
        done = subprocess.run([python, SCRIPT, path], capture_output=True, text=True, timeout=120)
    return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else None


def rows(quick: bool, python: Path | None = None) -> Iterator[Row]:
    """Time diagnoses, one thing larger at a time."""
    diagnosed(1, 500)  # compiles
    sizes = [(1, 500)] if quick else [(1, 1000), (1, 2000), (1, 4000), (2, 2000), (4, 2000)]
    for masses, samples in sizes:
        spent, said = diagnosed(masses, samples)
        task = f"{masses} {'mass' if masses == 1 else 'masses'}, {samples} samples"
        yield Row("diagnosis", task, "rp.diagnose", spent, answers=said)
    masses, samples = sizes[min(1, len(sizes) - 1)]
    for count in (4,) if quick else (4, 8):
        own = [rp.effect(formula, {"k": unit}) for formula, unit in list(_OWN.items())[:count]]
        spent, said = diagnosed(masses, samples)
        for kind in own:
            unregister(kind.kind)
        task = f"{masses} mass, {samples} samples, {count} more kinds in the catalogue"
        yield Row("diagnosis", task, "rp.diagnose", spent, answers=said)
    spent, said = diagnosed(masses, samples)
    task = f"residual force of {masses} mass, {samples} samples"
    found = sparse_regression(python, samples)
    if found is None:
        yield Row("diagnosis", task, "rp.diagnose", spent, "pysindy", None, said, reason=_MISSING)
        return
    terms = ", ".join(found["terms"]) or "nothing"
    said = f"ours {said}; peer found {terms}, {found['cubic'] / CUBIC:.3f} of true"
    peer = f"pysindy {found['version']}"
    yield Row("diagnosis", task, "rp.diagnose", spent, peer, found["ms"], said, reason=_PYSINDY)
