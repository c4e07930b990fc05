"""Plants of many kinds and any size on which the synthesis methods are tried."""

import numpy as np

from robustpolish.plants.plant import GeneralizedPlant


def flexible_structure(modes: int, damping: float = 5e-3, seed: int = 0) -> GeneralizedPlant:
    """Lightly damped modes over two decades, force actuators, displacement sensors elsewhere."""
    rng = np.random.default_rng(seed)
    omega = np.logspace(0, 2, modes)
    A = np.block(
        [
            [np.zeros((modes, modes)), np.eye(modes)],
            [-np.diag(omega**2), -2 * damping * np.diag(omega)],
        ]
    )
    force, sensor = rng.standard_normal((modes, 4)), rng.standard_normal((3, modes))
    B = np.vstack([np.zeros((modes, 4)), force])
    C = np.hstack([sensor, np.zeros((3, modes))])
    nu = 2
    return GeneralizedPlant.from_matrices(
        A,
        np.hstack([B[:, :2], np.zeros((2 * modes, 2))]),
        B[:, 2:],
        np.vstack([C[:1], np.zeros((nu, 2 * modes))]),
        C[1:],
        D12=np.vstack([np.zeros((1, nu)), 0.1 * np.eye(nu)]),
        D21=np.hstack([np.zeros((2, 2)), 0.01 * np.eye(2)]),
    )


def mass_chain(masses: int, priced: bool = False) -> GeneralizedPlant:
    """A free chain of masses and springs: rigid-body mode, no price on u, no noise on y."""
    K = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    K[0, 0] = K[-1, -1] = 1
    A = np.block([[np.zeros((masses, masses)), np.eye(masses)], [-K, -0.01 * K]])
    first, last = np.zeros((2 * masses, 1)), np.zeros((2 * masses, 1))
    first[masses], last[-1] = 1, 1
    position = np.zeros((1, 2 * masses))
    position[0, masses - 1] = 1
    D12 = np.array([[0.0], [1.0 if priced else 0.0]])
    return GeneralizedPlant.from_matrices(
        A, last, first, np.vstack([position, 0 * position]), position, D12=D12
    )


def heat_rod(points: int) -> GeneralizedPlant:
    """A heat equation with a source that makes it unstable; stiff: rates over four decades."""
    h = 1 / (points + 1)
    A = (np.eye(points, k=1) + np.eye(points, k=-1) - 2 * np.eye(points)) / h**2 + 15 * np.eye(
        points
    )
    x = np.arange(1, points + 1) * h
    actuator, sensor = (np.abs(x - 0.3) < 0.1).astype(float), (np.abs(x - 0.7) < 0.1) * h / 0.2
    return GeneralizedPlant.from_matrices(
        A, np.ones((points, 1)), actuator[:, None], np.sqrt(h) * np.eye(points), sensor[None, :]
    )


def random_plant(
    n: int, seed: int, unstable: int = 2, singular: bool = True, feedthrough: bool = True
) -> GeneralizedPlant:
    """Random modes, a few of them unstable, D12 and D21 without full rank if `singular`."""
    rng = np.random.default_rng(seed)
    draw = rng.standard_normal
    rates = -np.exp(rng.uniform(-2, 2, n))
    rates[: min(unstable, n)] *= -0.3
    A = np.diag(rates)
    for i in range(min(unstable, n), n - 1, 2):
        A[i + 1, i + 1] = A[i, i]
        A[i, i + 1], A[i + 1, i] = -3 * A[i, i], 3 * A[i, i]
    T = draw((n, n)) + 2 * np.eye(n)
    A = T @ A @ np.linalg.inv(T)
    nw, nu, nz, ny = 3, 2, 3, 2
    D12, D21 = np.vstack([np.eye(nu), np.zeros((1, nu))]), draw((ny, nw))
    if singular:
        D12[:, 0] = 0
        D21[0] = 0
    return GeneralizedPlant.from_matrices(
        A,
        draw((n, nw)),
        draw((n, nu)),
        draw((nz, n)),
        draw((ny, n)),
        D11=draw((nz, nw)) * feedthrough,
        D12=D12,
        D21=D21,
        D22=draw((ny, nu)) * feedthrough,
    )


def rescaled(
    plant: GeneralizedPlant, seed: int, decades: float = 3
) -> tuple[GeneralizedPlant, float]:
    """Express a plant in random other units.

    Returns
    -------
    plant : GeneralizedPlant
    unit : float
        H-infinity norms of loops with the new plant are `unit` times those with the old one.
    """
    rng = np.random.default_rng(seed)

    def units(count: int) -> np.ndarray:
        return 10.0 ** rng.uniform(-decades, decades, count)

    x, u, y = units(plant.nx), units(plant.nu), units(plant.ny)
    w, z, t = units(3)
    t = 1.0 if plant.is_discrete else t
    return (
        GeneralizedPlant.from_matrices(
            t * plant.A * x / x[:, None],
            t * plant.B1 * w / x[:, None],
            t * plant.B2 * u / x[:, None],
            plant.C1 * x / z,
            plant.C2 * x / y[:, None],
            D11=plant.D11 * w / z,
            D12=plant.D12 * u / z,
            D21=plant.D21 * w / y[:, None],
            D22=plant.D22 * u / y[:, None],
            dt=plant.dt,
        ),
        w / z,
    )


def wild_plant(rng: np.random.Generator) -> GeneralizedPlant:
    """Draw a plant of 1 to 12 states with the troubles that plants have.

    Wild units, modes that u does not move or y does not see (stable or not), modes and zeros on the
    stability boundary, rank-deficient D12 and D21, D11 and D22, continuous or discrete time.
    """
    n, nw, nu, nz, ny = (int(rng.integers(1, top)) for top in (13, 4, 4, 4, 4))
    draw = rng.standard_normal
    discrete = rng.random() < 0.25
    A = draw((n, n)) * 10.0 ** rng.uniform(-1, 1)
    B1, B2, C1, C2 = draw((n, nw)), draw((n, nu)), draw((nz, n)), draw((ny, n))
    if rng.random() < 0.4:
        keep = int(rng.integers(0, n))
        A[keep:, :keep] = 0
        B2[keep:] = 0
        if rng.random() < 0.7:
            A[keep:, keep:] -= (np.abs(A[keep:, keep:]).sum() + 0.1) * np.eye(n - keep)
    elif rng.random() < 0.4:
        keep = int(rng.integers(0, n))
        A[:keep, keep:] = 0
        C2[:, keep:] = 0
        if rng.random() < 0.7:
            A[keep:, keep:] -= (np.abs(A[keep:, keep:]).sum() + 0.1) * np.eye(n - keep)
    if rng.random() < 0.3:
        A[0] = 0
    if discrete:
        A /= max(1.0, np.abs(A).sum(axis=1).max() / rng.uniform(0.5, 3))
    D12, D21 = draw((nz, nu)), draw((ny, nw))
    if rng.random() < 0.5:
        D12[:, : int(rng.integers(0, nu + 1))] = 0
    if rng.random() < 0.5:
        D21[: int(rng.integers(0, ny + 1))] = 0
    if rng.random() < 0.2:
        C1[0] = C2[0]
        D12[0] = 0
    plant = GeneralizedPlant.from_matrices(
        A,
        B1,
        B2,
        C1,
        C2,
        D11=draw((nz, nw)) * (rng.random() < 0.5),
        D12=D12,
        D21=D21,
        D22=draw((ny, nu)) * (rng.random() < 0.5),
        dt=0.1 if discrete else 0,
    )
    return rescaled(plant, int(rng.integers(2**31)), rng.uniform(0, 4))[0]
