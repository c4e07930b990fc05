"""Seeded cases: a machine, what its model does not know, and two records of it."""

from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from scipy.signal import butter, lfilter, sosfilt

import robustpolish.models.mechanical.parts as parts
from robustpolish.models import MechanicalModel

from .integrator import CODES, integrate


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
    return Machine(
        ["x"],
        [m],
        [("x", "ground", k)],
        [("x", "ground", 2 * zeta * np.sqrt(k * m))],
        ["x"],
        [("x", "displacement")],
        f_max=25.0,
        dt=2e-3,
        **kw,
    )


def lever(**kw):
    """A lever on a weak torsion spring; nothing says that it hangs."""
    return Machine(
        ["arm"],
        [0.5],
        [("arm", "ground", 8.0)],
        [("arm", "ground", 0.25)],
        ["arm"],
        [("arm", "displacement")],
        f_max=3.0,
        dt=0.01,
        turns=True,
        **kw,
    )


def two(measured=(("x_m", "displacement"), ("x", "displacement")), zeta=0.02, **kw):
    return Machine(
        ["x_m", "x"],
        [1.2, 0.6],
        [("x_m", "ground", 9000.0), ("x_m", "x", 2500.0)],
        [("x_m", "ground", 2 * zeta * 104), ("x_m", "x", 2 * zeta * 39)],
        ["x"],
        list(measured),
        f_max=35.0,
        dt=2e-3,
        **kw,
    )


def four(**kw):
    names = ["a", "b", "c", "d"]
    springs = [("a", "ground", 9000.0), ("b", "a", 7000.0), ("c", "b", 6000.0), ("d", "c", 5000.0)]
    dampers = [(a, b, 0.0006 * k) for a, b, k in springs]
    return Machine(
        names,
        [1.0, 0.8, 0.8, 0.6],
        springs,
        dampers,
        ["d"],
        [(n, "displacement") for n in names],
        f_max=35.0,
        dt=2e-3,
        **kw,
    )


def axes(**kw):
    return Machine(
        ["x", "y"],
        [1.0, 1.0],
        [("x", "ground", 3000.0), ("y", "ground", 4000.0)],
        [("x", "ground", 2.5), ("y", "ground", 3.0)],
        ["x", "y"],
        [("x", "displacement"), ("y", "displacement")],
        spin=9.0,
        f_max=25.0,
        dt=2e-3,
        **kw,
    )


def bearing(**kw):
    """Two axes of the air bearing: a stiff bearing mass and a brush on each."""
    names = ["x_m", "x", "y_m", "y"]
    springs, dampers = [], []
    for m, b in (("x_m", "x"), ("y_m", "y")):
        springs += [(m, "ground", 1.0752e8), (b, m, 2.9821e5)]
        dampers += [(m, "ground", 13.16), (b, m, 1.0)]
    return Machine(
        names,
        [0.6376, 0.2, 0.6376, 0.2],
        springs,
        dampers,
        ["x", "y"],
        [("x", "displacement"), ("y", "displacement")],
        spin=50.0,
        f_max=400.0,
        dt=2e-4,
        **kw,
    )


def matrices(machine):
    n = len(machine.names)
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for target, items in ((K, machine.springs), (C, machine.dampers)):
        for a, b, value in items:
            i = machine.names.index(a)
            target[i, i] += value
            if b != "ground":
                j = machine.names.index(b)
                target[j, j] += value
                target[i, j] -= value
                target[j, i] -= value
    B = np.zeros((n, len(machine.forced)))
    for j, name in enumerate(machine.forced):
        B[machine.names.index(name), j] = 1.0
    return np.array(machine.mass), C, K, B


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
        [parts.Output(_output_name(n, q), (n, "ground"), q) for n, q in m.measured],
        spin_frequency=m.spin,
    )


def _output_name(name, quantity):
    return name if quantity == "displacement" else f"{name}_{quantity[0]}"


def excitation(case, rng, samples):
    """A forcing whose band covers the modes: noise, multisine or sweep."""
    m = case.machine
    t = np.arange(samples) * m.dt
    columns = []
    for _ in m.forced:
        if case.excitation == "multisine":
            f = np.arange(1, int(m.f_max * 8)) / 8
            u = sum(np.cos(2 * np.pi * g * t + rng.uniform(0, 6.28)) for g in f)
        elif case.excitation == "sweep":
            u = np.sin(2 * np.pi * (0.5 * t + 0.5 * (m.f_max - 0.5) / t[-1] * t**2))
        else:
            sos = butter(4, m.f_max * 2 * m.dt, output="sos")
            u = sosfilt(sos, rng.standard_normal(samples))
        columns.append(u / np.std(u))
    if case.excitation == "none":
        return np.zeros((samples, 0))
    return case.drive * np.column_stack(columns)


def records(case):
    """Return two datasets with noise, and the noise rms per output."""
    return [_record(case, k) for k in (0, 1)]


def _record(case, which):
    m = case.machine
    rng = np.random.default_rng(1000 * case.seed + which)
    M, C, K, B = matrices(m)
    samples = case.samples + case.warm_up
    U = excitation(case, rng, samples)
    if U.shape[1] == 0:
        B = np.zeros((len(M), 0))
    effects = [e for e in case.effects if e[0] in CODES]
    codes = np.array([CODES[e[0]] for e in effects], dtype=np.int64)
    places = np.full((len(effects), 2), -1, dtype=np.int64)
    params = np.zeros((len(effects), 6))
    for i, (_, at, p) in enumerate(effects):
        for j, name in enumerate(at):
            places[i, j] = m.names.index(name) if name != "ground" else -1
        params[i, : len(p)] = p
    Ue = U.copy()
    others = {e[0]: e for e in case.effects if e[0] not in CODES}
    names = [f"F_{n}" for n in m.forced]
    if "input_gain" in others:
        _, at, p = others["input_gain"]
        Ue[:, names.index(at[0])] *= p[0]
    if "input_delay" in others:
        _, at, p = others["input_delay"]
        j = names.index(at[0])
        t = np.arange(samples) * m.dt
        Ue[:, j] = np.interp(t - p[0], t, Ue[:, j])
    q0 = np.zeros(len(M))
    q0[-1] = case.start * (1.0 if which == 0 else 0.8)
    stiffest = np.sqrt(np.max(np.diag(K) / M))
    over = max(12, int(np.ceil(m.dt * stiffest * 4)))
    v0 = np.zeros(len(M))
    Q, V, A = integrate(M, C, K, B, Ue, m.dt, over, codes, places, params, q0, v0, case.held)
    data, noise = {}, {}
    keep = slice(case.warm_up, None)
    for n, quantity in m.measured:
        signal = {"displacement": Q, "velocity": V, "acceleration": A}[quantity]
        y = signal[keep, m.names.index(n)].copy()
        e = rng.standard_normal(len(y) + 500)
        e = lfilter([1.0], [1.0, -case.colour], e)[500:]
        size = np.std(y) * 10 ** (-case.noise_db / 20)
        name = _output_name(n, quantity)
        if "sensor_gain" in others and others["sensor_gain"][1][0] == name:
            y *= others["sensor_gain"][2][0]
        if "sensor_offset" in others and others["sensor_offset"][1][0] == name:
            y += others["sensor_offset"][2][0]
        data[name] = ("time", y + size * e / np.std(e))
        noise[name] = size
    for j, name in enumerate(names if U.shape[1] else []):
        u = U[keep, j]
        data[name] = ("time", u + case.input_noise * np.std(u) * rng.standard_normal(len(u)))
    time = np.arange(case.samples) * m.dt
    return xr.Dataset(data, coords={"time": ("time", time)}), noise
