"""Plants, loops and records that the subjects share, made through public names only."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import control
import numpy as np
import xarray as xr

import robustpolish as rp

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
PLACE = ("x", "ground")
KEYS = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
s = control.tf("s")


def plants(file: str) -> Iterator[tuple[str, rp.GeneralizedPlant]]:
    """Yield the benchmark plants of a file in the order of the file."""
    with np.load(DATA / "compleib" / file) as data:
        for name in dict.fromkeys(key.split("/")[0] for key in data):
            yield name, rp.GeneralizedPlant.from_matrices(*(data[f"{name}/{key}"] for key in KEYS))


def servo_plant() -> rp.GeneralizedPlant:
    """Two masses and a spring, force on one, position of the other measured with noise."""
    A = np.array([[0, 1, 0, 0], [-4, -0.04, 4, 0.04], [0, 0, 0, 1], [4, 0.04, -4, -0.04]])
    return rp.GeneralizedPlant.from_matrices(
        A, [[0, 0], [1, 0], [0, 0], [0, 0]], [[0], [1], [0], [0]],
        [[0, 0, 1, 0], [0, 0, 0, 0]], [[0, 0, 1, 0]], D12=[[0], [0.5]], D21=[[0, 0.2]],
        controls=["F"], measurements=["x"], units={"F": "N", "x": "m"},
    )  # fmt: skip


@cache
def servo_design() -> rp.results.Design:
    """Return its controller."""
    return rp.output_feedback(servo_plant())


@cache
def two_by_two() -> rp.results.Design:
    """Two measurements, two controls, an integrator in the controller."""
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0.2], [0.1, -0.5]], np.eye(2), np.eye(2), np.eye(2), np.eye(2)
    )
    K = control.ss(np.diag([0.0, -3.0]), np.eye(2), -np.eye(2), [[-1.0, 0.1], [0.0, -0.5]])
    return rp.given_controller(plant, K)


def servo() -> Any:
    """A spring known to 40 %, a gain known to 50 % at any frequency, and a PID."""
    k = rp.uncertain.real("k", 10, percent=40)
    plant = rp.uncertain.system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]])
    plant = plant * (1 + 0.5 * rp.uncertain.dynamics("delta"))
    return (plant * (2.3 + 3 / s + 0.38 * s / (0.001 * s + 1))).feedback()


def damper() -> Any:
    """A mass on a spring, with a damper from none to twice the nominal one."""
    c = rp.uncertain.real("c", 1, range=(0, 2))
    return rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])


def carts() -> Any:
    """Two carts joined by a spring, all known to 20 %, and a controller with three leads."""
    k, m1, m2 = (rp.uncertain.real(name, 1, percent=20) for name in ("k", "m1", "m2"))
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k / m1, k / m1, 0, 0], [k / m2, -k / m2, 0, 0]]
    plant = rp.uncertain.system(A, [[0], [0], [1 / m1], [0]], [[0, 1, 0, 0]])
    return (plant * (100 * ((s + 1) / (0.001 * s + 1)) ** 3)).feedback()


def column() -> Any:
    """Skogestad, Morari and Doyle (1988): the distillation column, inverse-based control."""
    gains = np.array([[87.8, -86.4], [108.2, -109.6]])
    lag, lead = control.ss(control.tf(1, [75, 1])), control.ss(control.tf([75, 1], [1, 0]))
    K = control.append(lead, lead) * (0.7 * np.linalg.inv(gains))
    error = control.ss(control.tf([1, 0.2], [0.5, 1]))
    errors = rp.uncertain.append(
        *(error * rp.uncertain.dynamics(name) for name in ("first", "second"))
    )
    plant = control.ss(gains * control.append(lag, lag)) * (np.eye(2) + errors)
    weight = control.ss(control.tf([0.5, 0.05], [1, 1e-6]))
    return control.append(weight, weight) * rp.feedback(np.eye(2), plant * K)


def coprime_loop() -> control.StateSpace:
    """The loop around errors of the coprime factors of an oscillator, 16/(s^2 + 0.16 s + 16)."""
    plant = control.ss([[0, 1], [-16, -0.16]], [[0], [16]], [[1, 0]], 0)
    K = rp.loop_shaping(plant, factor=1.001).controller
    loop = rp.uncertain.append(np.eye(1), K) * rp.feedback(
        rp.uncertain.append(plant, K) * 0 + np.eye(2),
        np.array([[0, -1], [-1, 0]]) * rp.uncertain.append(plant, K),
    )
    return loop.nominal


def robot() -> rp.MechanicalModel:
    """The polishing robot of notebook 09."""
    return rp.MechanicalModel(
        dofs=[rp.Dof("arm", 6.0), rp.Dof("tool", 1.2)],
        springs=[
            rp.Spring(("arm", "ground"), 4e4), rp.Spring(("tool", "arm"), 6e4),
            rp.Spring(("tool", "ground"), 1.5e4),
        ],
        dampers=[rp.Damper(("arm", "ground"), 80.0), rp.Damper(("tool", "arm"), 25.0)],
        inputs=[rp.Input("F", ("tool", "ground")), rp.Input("u", ("arm", "ground"))],
        outputs=[rp.Output("tool", ("tool", "ground"))],
    )  # fmt: skip


def hard_system(seed: int, wide: bool = False) -> control.StateSpace:
    """A system of the families on which the norms are judged: barely damped, defective, ...

    The frozen answers know six families; the `wide` range has all, sparse ones and fast sampling.
    """
    rng = np.random.default_rng(seed)
    A = FAMILIES[seed % (len(FAMILIES) if wide else 6)](rng)
    n, m, p = len(A), rng.integers(1, 4), rng.integers(1, 4)
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    style = rng.integers(5)
    if style == 0:
        B[rng.integers(n)] = 0
    elif style == 1:
        C[:, rng.integers(n)] *= 1e-12
    elif style == 2 and wide:
        B, C = B * (rng.random(B.shape) < 0.4), C * (rng.random(C.shape) < 0.4)
    D = rng.standard_normal((p, m)) * rng.choice([0, 0, 1e-3, 1, 10])
    dt = 0
    if rng.random() < 0.3:
        dt = rng.choice([1e-6, 1.0]) if wide else 1.0
        step = 0.5 / max(abs(np.linalg.eigvals(A)).max(), 1e-300)
        A = np.linalg.solve(np.eye(n) - A * step, np.eye(n) + A * step)
    else:
        time = 10.0 ** rng.uniform(-9, 9)
        A, B = A * time, B * time
    units = 10.0 ** rng.uniform(-4, 4, n)
    A, B, C = A * units / units[:, None], B / units[:, None], C * units
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False)


def dense(rng: np.random.Generator) -> np.ndarray:
    n = rng.integers(1, 8)
    A = rng.standard_normal((n, n))
    return A - (np.linalg.eigvals(A).real.max() + 10.0 ** rng.uniform(-6, 0)) * np.eye(n)


def oscillators(rng: np.random.Generator) -> np.ndarray:
    count = rng.integers(1, 4)
    A = np.zeros((2 * count, 2 * count))
    for k in range(count):
        w, zeta = 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-12, -0.1)
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0, 1], [-w * w, -2 * zeta * w]]
    return A


def mixed(rng: np.random.Generator) -> np.ndarray:  # rounding may even make these unstable
    A = oscillators(rng)
    Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
    return Q @ A @ Q.T


def defective(rng: np.random.Generator) -> np.ndarray:
    n = rng.integers(2, 6)
    return -(10.0 ** rng.uniform(-6, 0)) * np.eye(n) + np.diag(np.ones(n - 1), 1)


def chain(rng: np.random.Generator) -> np.ndarray:
    n = rng.integers(2, 5)
    K = 2 * np.eye(n) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    zeta = 10.0 ** rng.uniform(-10, -1)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-K, -zeta * (K + 0.1 * np.eye(n))]])


def stiff(rng: np.random.Generator) -> np.ndarray:
    n = rng.integers(2, 6)
    return np.triu(rng.standard_normal((n, n)), 1) - np.diag(10.0 ** rng.uniform(-6, 6, n))


FAMILIES = (dense, oscillators, mixed, defective, chain, stiff)


def slide(stiffness: float = 3000.0, damping: float = 10.0) -> rp.MechanicalModel:
    """One mass on a spring, as it was drawn."""
    return rp.MechanicalModel(
        dofs=[rp.Dof("x", 2.0)],
        springs=[rp.Spring(PLACE, stiffness)],
        dampers=[rp.Damper(PLACE, damping)],
        inputs=[rp.Input("F", PLACE)],
        outputs=[rp.Output("x", PLACE)],
    )


def record(law: Callable[[float, float], float], samples: int = 500, seed: int = 5) -> xr.Dataset:
    """A noisy record of 2 kg on 3000 N/m and 10 N s/m with one more force, 2 ms between samples.

    Made by an integrator of its own (Runge-Kutta, 8 steps a sample), the force linear between.
    """
    rng = np.random.default_rng(seed)
    force = np.convolve(rng.normal(size=samples), np.ones(6) / 6, "same")
    force = 20 * force / force.std()
    h, q, v, moved = 2e-3 / 8, 0.0, 0.0, [0.0]

    def rate(q: float, v: float, F: float) -> tuple[float, float]:
        return v, (F - 3000.0 * q - 10.0 * v - law(q, v)) / 2.0

    for first, last in zip(force[:-1].tolist(), force[1:].tolist(), strict=True):
        for i in range(8):
            F0, F1, F2 = (first + (last - first) * (i + part) / 8 for part in (0.0, 0.5, 1.0))
            a = rate(q, v, F0)
            b = rate(q + h / 2 * a[0], v + h / 2 * a[1], F1)
            c = rate(q + h / 2 * b[0], v + h / 2 * b[1], F1)
            d = rate(q + h * c[0], v + h * c[1], F2)
            q += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            v += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        moved.append(q)
    x = np.array(moved)
    x = x + rng.normal(0, 0.02 * x.std(), samples)
    time = 2e-3 * np.arange(samples)
    return xr.Dataset(
        {"F": ("time", force, {"units": "N"}), "x": ("time", x, {"units": "m"})},
        {"time": ("time", time, {"units": "s"})},
    )


def hardening(q: float, v: float) -> float:
    """Return the force of a cubic spring."""
    return 2e7 * q**3


def drag(q: float, v: float) -> float:
    """Return the force of a damper that is quadratic in speed."""
    return 400.0 * v * abs(v)


def blocks_and_matrix(seed: int) -> tuple[list[str], list[int], np.ndarray]:
    """Draw kinds of two to five blocks, their sizes, and a complex matrix around them."""
    random = np.random.default_rng(seed)
    kinds = ["real", "complex", "full"]
    blocks = [kinds[int(random.integers(3))] for _ in range(int(random.integers(2, 6)))]
    sizes = [int(random.integers(2, 4)) if kind == "full" else 1 for kind in blocks]
    n = sum(sizes)
    return blocks, sizes, random.standard_normal((n, n)) + 1j * random.standard_normal((n, n))
