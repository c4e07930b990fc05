"""Plants from papers and other suites, with the optimal norms that are published for them."""

from pathlib import Path

import control
import numpy as np

from robustpolish.plants.plant import GeneralizedPlant


def compleib(shared: Path, name: str) -> GeneralizedPlant:
    """Return a plant of COMPleib from the folder of shared data."""
    keys = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
    for file in ("compleib24", "compleib_larger"):
        data = np.load(shared / f"data/compleib/{file}.npz")
        if f"{name}/A" in data.files:
            return GeneralizedPlant.from_matrices(*(data[f"{name}/{key}"] for key in keys))
    raise KeyError(name)


def scherer_1997() -> GeneralizedPlant:
    """Scherer, Gahinet, Chilali (1997), example 7: H-infinity optimum 9.51."""
    return GeneralizedPlant.from_matrices(
        [[0, 10, 2], [-1, 1, 0], [0, 2, -5]],
        [[1], [0], [1]],
        [[0], [1], [0]],
        [[1, 0, 0], [0, 0, 0]],
        [[0, 1, 0]],
        D12=[[0], [1]],
        D21=[[2]],
    )


def zhou_h2() -> GeneralizedPlant:
    """Zhou, Doyle, Glover (1996), example 19.1: H2 optimum 8.9582."""
    B1 = np.array([[0, 0], [1, 0], [0, 0]])
    ones = np.ones((3, 1))
    return GeneralizedPlant.from_matrices(
        [[-1, 0, 4], [0, 2, 0], [0, 0, -3]], B1, ones, B1.T, ones.T, D12=[[0], [1]], D21=[[0, 1]]
    )


def benner_weak() -> GeneralizedPlant:
    """From "A robust numerical method for the gamma-iteration in H-infinity control": 0.806."""
    return GeneralizedPlant.from_matrices(
        -np.eye(2),
        [[0, 0], [0, 1]],
        np.ones((2, 1)),
        np.eye(2),
        np.ones((1, 2)),
        D11=np.diag([0.5, 0.5]),
        D12=[[0], [1]],
        D21=[[0, 1]],
    )


def slow_weights() -> GeneralizedPlant:
    """An integrator almost cancelled by slow weights: SB10AD claims 4.4825150."""
    return GeneralizedPlant.from_matrices(
        [[0, 1, 0], [-1.2e-6, -0.12001, 0], [-11.2, 0, -2e-7]],
        [[0], [0], [1]],
        [[0], [1], [0]],
        [[-7.466666666666666, 0, 19.999999866666666], [0, 0, 0]],
        [[-11.2, 0, 0]],
        D11=[[0.6666666666666666], [0]],
        D12=[[0], [1]],
        D21=[[1]],
    )


def integral_weight(dt: float = 0) -> GeneralizedPlant:
    """A lag under an integrating weight, in RobustAndOptimalControl.jl's suite.

    H2 optimum 3.0568; with every block sampled at 0.01 s, 0.3083.
    """
    blocks = [control.tf2ss([1], [10, 1]), control.tf2ss([1], [1, 1e-6]), _weight(1e-2, 0.1, 100)]
    if dt:
        blocks = [control.sample_system(block, dt) for block in blocks]
    return mixed_sensitivity(*blocks)


def mixed_sensitivity(
    G: control.StateSpace,
    WS: control.StateSpace,
    WU: control.StateSpace,
    WT: control.StateSpace | None = None,
) -> GeneralizedPlant:
    """Weigh S, K S and T of a loop with y = w - G u."""
    ny, nu = G.noutputs, G.ninputs
    blocks = [G, WS, WU] + ([WT] if WT is not None else [])
    nx = [b.nstates for b in blocks]
    total, at = sum(nx), np.concatenate([[0], np.cumsum(nx)])
    A, B1, B2 = np.zeros((total, total)), np.zeros((total, ny)), np.zeros((total, nu))
    rows = []

    def part(i: int) -> slice:
        return slice(at[i], at[i + 1])

    A[part(0), part(0)], B2[part(0)] = G.A, G.B
    Cg = np.zeros((ny, total))
    Cg[:, part(0)] = G.C

    def filtered(
        i: int, W: control.StateSpace, of_x: np.ndarray, of_w: np.ndarray, of_u: np.ndarray
    ):
        A[part(i), part(i)] += W.A
        A[part(i)] += W.B @ of_x
        B1[part(i)] += W.B @ of_w
        B2[part(i)] += W.B @ of_u
        C = W.D @ of_x
        C[:, part(i)] += W.C
        rows.append((C, W.D @ of_w, W.D @ of_u))

    filtered(1, WS, -Cg, np.eye(ny), -G.D)
    filtered(2, WU, np.zeros((nu, total)), np.zeros((nu, ny)), np.eye(nu))
    if WT is not None:
        filtered(3, WT, Cg, np.zeros((ny, ny)), np.asarray(G.D))
    return GeneralizedPlant.from_matrices(
        A,
        B1,
        B2,
        np.vstack([r[0] for r in rows]),
        -Cg,
        np.vstack([r[1] for r in rows]),
        np.vstack([r[2] for r in rows]),
        np.eye(ny),
        -np.asarray(G.D),
        dt=G.dt,
    )


def _first_order(high: float, zero: float, pole: float, count: int) -> control.StateSpace:
    """Return (high s + zero)/(s + pole) on every channel."""
    one = np.eye(count)
    return control.StateSpace(-pole * one, one, (zero - high * pole) * one, high * one)


def mit_lecture() -> GeneralizedPlant:
    """Lecture 15 of MIT 16.323 (2008), in RobustAndOptimalControl.jl: 0.923430124918."""
    G = control.tf2ss([200], [0.025, 1.0025, 10.1, 1])
    return mixed_sensitivity(
        G, _first_order(1 / 1.5, 10, 10e-4, 1), control.StateSpace([], [], [], [[0.1]])
    )


def quadruple_tank() -> GeneralizedPlant:
    """The quadruple tank of Johansson in RobustAndOptimalControl.jl: 0.9534467."""
    k1, k2, kc, g = 3.33, 3.35, 0.5, 981
    area, outlet = np.array([28, 32, 28, 32.0]), np.array([0.071, 0.057, 0.071, 0.057])
    level = np.array([12.4, 12.7, 1.8, 1.4])
    # The suite pairs the levels with the tanks in this order.
    T = area[[0, 1, 2, 3]] / outlet[[0, 1, 2, 3]] * np.sqrt(2 * level / g)
    g1, g2 = 0.7, 0.6
    A = np.diag(-1 / T)
    A[0, 2], A[1, 3] = area[2] / (area[0] * T[2]), area[3] / (area[1] * T[3])
    B = np.array(
        [
            [g1 * k1 / area[0], 0],
            [0, g2 * k2 / area[1]],
            [0, (1 - g2) * k2 / area[2]],
            [(1 - g1) * k1 / area[3], 0],
        ]
    )
    G = control.StateSpace(A, B, kc * np.eye(4)[:2], np.zeros((2, 2)))
    return mixed_sensitivity(
        G,
        _first_order(0.1, 0.1, 0.001, 2),
        control.StateSpace([], [], [], 0.01 * np.eye(2)),
        _first_order(10, 0.1, 1, 2),
    )


def lightly_damped() -> GeneralizedPlant:
    """A resonance with weights on error and control, in RobustAndOptimalControl.jl: 0.3148."""
    G = control.tf2ss([1], [1, 0.1, 1])
    return mixed_sensitivity(G, _weight(10, 1, 0.1), _scaled(_weight(1e-3, 10, 10), 0.01))


def _weight(low: float, crossover: float, high: float) -> control.StateSpace:
    """Return a first-order weight with the given gains and unit gain at the crossover."""
    pole = (
        crossover * np.sqrt((1 - high**2) / (low**2 - 1))
        if low > 1
        else (crossover * np.sqrt((high**2 - 1) / (1 - low**2)))
    )
    return _first_order(high, low * pole, pole, 1)


def _scaled(W: control.StateSpace, factor: float) -> control.StateSpace:
    return control.StateSpace(W.A, W.B, factor * W.C, factor * W.D)
