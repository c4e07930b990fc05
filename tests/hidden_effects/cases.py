"""Seeded cases: a machine, what its model does not know, and two records of it."""

from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from scipy.signal import lfilter

from robustpolish.machines.mechanical import parts as parts
from robustpolish.machines.mechanical.model import MechanicalModel

from .motion import motion, output_name, shown


@dataclass
class Machine:
    """Masses, stiffnesses and dampings of a chain or of two axes."""

    names: list
    mass: list
    springs: list  # (a, b, k)
    dampers: list  # (a, b, c)
    forced: list
    measured: list  # (name, quantity)
    spin: float | None = None
    f_max: float = 30.0
    dt: float = 2e-3
    turns: bool = False  # angles and moments


@dataclass
class Case:
    name: str
    machine: Machine
    effects: list = field(default_factory=list)  # (kind, at, parameters of the integrator)
    verdict: str = "missing_effect"
    noise_db: float = 30.0
    samples: int = 8000
    seed: int = 0
    colour: float = 0.0  # pole of the sensor noise
    wrong: dict = field(default_factory=dict)  # relative errors of the model's numbers
    input_noise: float = 0.0
    warm_up: int = 0
    drive: float = 1.0
    excitation: str = "noise"
    chaotic: bool = False
    start: float = 0.0  # initial displacement, for free decays
    held: bool = False  # inputs stay between samples, instead of linear


def one(zeta=0.02, **kw):
    m, k = 1.0, 3000.0
    return Machine(["x"], [m], [("x", "ground", k)], [("x", "ground", 2 * zeta * np.sqrt(k * m))],
                   ["x"], [("x", "displacement")], f_max=25.0, dt=2e-3, **kw)  # fmt: skip


def lever(**kw):
    """A lever on a weak torsion spring; nothing says that it hangs."""
    return Machine(["arm"], [0.5], [("arm", "ground", 8.0)], [("arm", "ground", 0.25)], ["arm"],
                   [("arm", "displacement")], f_max=3.0, dt=0.01, turns=True, **kw)  # fmt: skip


def two(measured=(("x_m", "displacement"), ("x", "displacement")), zeta=0.02, **kw):
    return Machine(["x_m", "x"], [1.2, 0.6], [("x_m", "ground", 9000.0), ("x_m", "x", 2500.0)],
                   [("x_m", "ground", 2 * zeta * 104), ("x_m", "x", 2 * zeta * 39)], ["x"],
                   list(measured), f_max=35.0, dt=2e-3, **kw)  # fmt: skip


def four(**kw):
    names = ["a", "b", "c", "d"]
    springs = [("a", "ground", 9000.0), ("b", "a", 7000.0), ("c", "b", 6000.0), ("d", "c", 5000.0)]
    dampers = [(a, b, 0.0006 * k) for a, b, k in springs]
    return Machine(names, [1.0, 0.8, 0.8, 0.6], springs, dampers, ["d"],
                   [(n, "displacement") for n in names], f_max=35.0, dt=2e-3, **kw)  # fmt: skip


def axes(**kw):
    return Machine(["x", "y"], [1.0, 1.0], [("x", "ground", 3000.0), ("y", "ground", 4000.0)],
                   [("x", "ground", 2.5), ("y", "ground", 3.0)], ["x", "y"],
                   [("x", "displacement"), ("y", "displacement")], spin=9.0, f_max=25.0, dt=2e-3,
                   **kw)  # fmt: skip


def bearing(**kw):
    """Two axes of the air bearing: a stiff bearing mass and a brush on each."""
    names = ["x_m", "x", "y_m", "y"]
    springs, dampers = [], []
    for m, b in (("x_m", "x"), ("y_m", "y")):
        springs += [(m, "ground", 1.0752e8), (b, m, 2.9821e5)]
        dampers += [(m, "ground", 13.16), (b, m, 1.0)]
    return Machine(names, [0.6376, 0.2, 0.6376, 0.2], springs, dampers, ["x", "y"],
                   [("x", "displacement"), ("y", "displacement")], spin=50.0, f_max=400.0, dt=2e-4,
                   **kw)  # fmt: skip


def model_of(case):
    """The model as its owner has it: linear, with slightly wrong numbers if so asked."""
    m, wrong = case.machine, case.wrong
    return MechanicalModel(
        [
            parts.Dof(n, v * (1 + wrong.get("mass", 0.0)), m.turns)
            for n, v in zip(m.names, m.mass, strict=False)
        ],
        [
            parts.Spring((a, b), k * (1 + wrong.get("stiffness", 0.0) * (-1) ** i))
            for i, (a, b, k) in enumerate(m.springs)
        ],
        [parts.Damper((a, b), c * (1 + wrong.get("damping", 0.0))) for a, b, c in m.dampers],
        []
        if case.excitation == "none"
        else [
            parts.Input(f"F_{n}", (n, "ground"), gain=1 + wrong.get("gain", 0.0)) for n in m.forced
        ],
        [parts.Output(output_name(n, q), (n, "ground"), q) for n, q in m.measured],
        spin_frequency=m.spin,
    )


def records(case):
    """Return two datasets with noise, and the noise rms per output."""
    return [_record(case, k) for k in (0, 1)]


def _record(case, which):
    m = case.machine
    rng = np.random.default_rng(1000 * case.seed + which)
    moved = motion(case, which, rng)
    data, noise = {}, {}
    for name, y in shown(case, moved, bare=True).items():
        e = rng.standard_normal(len(y) + 500)
        e = lfilter([1.0], [1.0, -case.colour], e)[500:]
        noise[name] = size = np.std(y) * 10 ** (-case.noise_db / 20)
        data[name] = ("time", size * e / np.std(e))
    for name, y in shown(case, moved).items():
        data[name] = ("time", y + data[name][1])
    for j, name in enumerate(m.forced if moved.inputs.shape[1] else []):
        u = moved.inputs[:, j]
        u = u + case.input_noise * np.std(u) * rng.standard_normal(len(u))
        data[f"F_{name}"] = ("time", u)
    time = np.arange(case.samples) * m.dt
    return xr.Dataset(data, coords={"time": ("time", time)}), noise
