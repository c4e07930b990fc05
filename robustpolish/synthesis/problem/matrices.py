"""Plant and controller as bare arrays, for the inner loops of the searches."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.base.arrays import EPS
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.checks import invalid
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.scaling import border_scale
from robustpolish.plants.plant import GeneralizedPlant

# Parts of a plant's disturbances and performance outputs, by name.

Channel = tuple[Sequence[str] | str, Sequence[str] | str]


def channel(
    plant: GeneralizedPlant, disturbances: Sequence[str] | str, performance: Sequence[str] | str
) -> GeneralizedPlant:
    """Return the plant with only the named w and z; x, u and y stay.

    Parameters
    ----------
    plant : GeneralizedPlant
    disturbances, performance : sequence of str, or str
        Names of the disturbances and performance outputs to keep, in this order.

    Returns
    -------
    GeneralizedPlant

    Raises
    ------
    InvalidInputError
        If a name is unknown or repeated.

    Examples
    --------
    >>> import robustpolish as rp
    >>> channel(rp.air_bearing(), "F_x", ["x", "y"]).performance_names
    ('x', 'y')
    """
    w = _places("disturbances", disturbances, plant.disturbance_names)
    z = _places("performance", performance, plant.performance_names)
    return plant.part(disturbances=w, performance=z)


def _places(argument: str, names: Sequence[str] | str, known: Sequence[str]) -> list[int]:
    wanted = [names] if isinstance(names, str) else list(names)
    if any(name not in known for name in wanted) or len(set(wanted)) != len(wanted) or not wanted:
        listed = ", ".join(known)
        raise invalid(argument, names, f"different names out of {listed}", "Check their spelling.")
    return [list(known).index(name) for name in wanted]


@dataclass(frozen=True, eq=False)
class PlantMatrices:
    """The nine matrices of a plant as bare arrays: the one type that all searches work on.

    Attributes
    ----------
    A, B1, B2, C1, C2, D11, D12, D21, D22 : ndarray
        As in :class:`robustpolish.GeneralizedPlant`.
    discrete : bool
        Whether the plant is a discrete-time system.
    """

    A: Matrix
    B1: Matrix
    B2: Matrix
    C1: Matrix
    C2: Matrix
    D11: Matrix
    D12: Matrix
    D21: Matrix
    D22: Matrix
    discrete: bool = False

    @classmethod
    def of(cls, plant: GeneralizedPlant) -> PlantMatrices:
        """Copy the matrices out of a plant."""
        named = {name: getattr(plant, name) for name in NAMES}
        return cls(**named, discrete=plant.is_discrete)

    @classmethod
    def of_system(cls, system: SystemMatrices, nw: int, nz: int) -> PlantMatrices:
        """Split a continuous system into the first `nw` inputs and `nz` outputs, and u and y."""
        A, B, C, D = system
        w, u, z, y = slice(nw), slice(nw, None), slice(nz), slice(nz, None)
        return cls(A, B[:, w], B[:, u], C[z], C[y], D[z, w], D[z, u], D[y, w], D[y, u])

    @property
    def matrices(self) -> dict[str, Any]:
        """All nine by name."""
        return {name: getattr(self, name) for name in NAMES}

    @property
    def system(self) -> SystemMatrices:
        """A, B, C and D from (w, u) to (z, y)."""
        return SystemMatrices(
            self.A,
            np.hstack([self.B1, self.B2]),
            np.vstack([self.C1, self.C2]),
            np.block([[self.D11, self.D12], [self.D21, self.D22]]),
        )

    @property
    def nx(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def nw(self) -> int:
        """Number of disturbances."""
        return self.B1.shape[1]

    @property
    def nu(self) -> int:
        """Number of controls."""
        return self.B2.shape[1]

    @property
    def nz(self) -> int:
        """Number of performance outputs."""
        return self.C1.shape[0]

    @property
    def ny(self) -> int:
        """Number of measurements."""
        return self.C2.shape[0]

    @cached_property
    def has_d22(self) -> bool:
        """Whether u reaches y directly."""
        return bool(np.any(self.D22))

    @property
    def dual(self) -> PlantMatrices:
        """The transposed plant, whose controls are the measurements, and whose w is z."""
        pairs = zip(NAMES, _DUAL, strict=True)
        return self.replace(**{name: getattr(self, other).T for name, other in pairs})

    def replace(self, **matrices: Any) -> PlantMatrices:
        """Return the plant with some matrices exchanged."""
        return replace(self, **matrices)

    def in_states(self, into: Matrix, back: Matrix) -> PlantMatrices:
        """Return the plant in the states x_new = into x, with `back` the inverse of `into`."""
        return self.replace(
            A=into @ self.A @ back,
            B1=into @ self.B1,
            B2=into @ self.B2,
            C1=self.C1 @ back,
            C2=self.C2 @ back,
        )

    def with_inner_loop(self, F: Matrix) -> PlantMatrices:
        """Return the plant without D22 around which u = F y is closed."""
        into, shown = self.B2 @ F, self.D12 @ F
        return self.replace(
            A=self.A + into @ self.C2,
            B1=self.B1 + into @ self.D21,
            C1=self.C1 + shown @ self.C2,
            D11=self.D11 + shown @ self.D21,
        )

    def without_d22(self) -> PlantMatrices:
        """Return the plant whose y lacks D22 u, which :func:`absorb_d22` accounts for."""
        return self.replace(D22=np.zeros_like(self.D22)) if self.has_d22 else self

    @cached_property
    def fingerprint(self) -> tuple[bytes, ...]:
        """What is the same for parts with the same matrices."""
        matrices = map(np.ascontiguousarray, self.matrices.values())
        return (*(str(M.shape).encode() + M.tobytes() for M in matrices), bytes([self.discrete]))


NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
_DUAL = ("A", "C1", "C2", "B1", "B2", "D11", "D21", "D12", "D22")


def with_penalty_and_noise(
    plant: PlantMatrices, epsilon: float, on_states: bool = False
) -> PlantMatrices:
    """Append epsilon times u to z and epsilon times noise on y to w; zero returns the plant.

    If it is to be `on_states`, x is appended to z and w disturbs x before them.
    """
    if epsilon == 0:
        return plant
    P, n = plant, plant.nx if on_states else 0
    nu, ny, e, zero = P.nu, P.ny, epsilon, np.zeros
    return P.replace(
        B1=np.hstack([P.B1, e * np.eye(P.nx, n), zero((P.nx, ny))]),
        C1=np.vstack([P.C1, e * np.eye(n, P.nx), zero((nu, P.nx))]),
        D11=linalg.block_diag(P.D11, zero((n + nu, n + ny))),
        D12=np.vstack([P.D12, zero((n, nu)), e * np.eye(nu)]),
        D21=np.hstack([P.D21, zero((ny, n)), e * np.eye(ny)]),
    )


def regularise(plant: PlantMatrices, epsilon: float) -> PlantMatrices:
    """Price u and x, and disturb y and x, a little.

    Appends epsilon times u and x to z, and epsilon times noise on y and x to w. Then D12
    and D21 have full rank and no zeros lie on the imaginary axis, whatever the plant. The norm
    of a loop with the regularised plant bounds the norm with the true one from above.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, so that epsilon is small compared with the entries.
    epsilon : float
        Zero returns the plant itself.
    """
    return with_penalty_and_noise(plant, epsilon, on_states=True)


def shifted(plant: PlantMatrices, by: float) -> PlantMatrices:
    """Return a continuous plant whose imaginary axis lies at -by: A + by I in place of A.

    Zeros on the axis then lie beside it. A controller that stabilises the shifted plant, its own
    A shifted back, has a loop whose poles lie to the left of -by and whose norm over the
    half plane right of -by, and so over the axis (maximum principle), is that of the shifted
    loop. Hence the infimum rises with the shift: negative shifts bound the true one from below,
    positive ones from above.

    Parameters
    ----------
    plant : PlantMatrices
        Continuous.
    by : float
        In the plant's unit of frequency, of either sign.
    """
    return plant.replace(A=plant.A + by * np.eye(plant.nx)) if by else plant


class SystemMatrices(NamedTuple):
    """x' = A x + B u, y = C x + D u, without names: a closed loop from w to z, or a controller."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


class Controller(SystemMatrices):
    """A controller x' = A x + B y, u = C x + D y."""

    @property
    def gain(self) -> float:
        """Largest absolute entry: how hard the controller is to verify and to build."""
        return max(float(np.abs(M).max(initial=0.0)) for M in self)

    def shifted_back(self, by: float) -> Controller:
        """Return the controller for a plant from that for the one :func:`shifted` by `by`."""
        return self._replace(A=self.A - by * np.eye(len(self.A))) if by else self


def controller_matrix(K: Controller) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]]."""
    return np.block([[K.A, K.B], [K.C, K.D]])


def controller_from_matrix(K: Matrix, order: int) -> Controller:
    """Return the controller of [[Ak, Bk], [Ck, Dk]]."""
    k = order
    return Controller(K[:k, :k], K[:k, k:], K[k:, :k], K[k:, k:])


def in_series(first: SystemMatrices, second: SystemMatrices) -> SystemMatrices:
    """Return second after first."""
    a, b = first, second
    return SystemMatrices(
        np.block([[a.A, np.zeros((len(a.A), len(b.A)))], [b.B @ a.C, b.A]]),
        np.vstack([a.B, b.B @ a.D]),
        np.hstack([b.D @ a.C, b.C]),
        b.D @ a.D,
    )


def close(plant: PlantMatrices, K: Controller) -> SystemMatrices:
    """Connect u = K y to a plant without D22."""
    P = plant
    return SystemMatrices(
        np.block([[P.A + P.B2 @ K.D @ P.C2, P.B2 @ K.C], [K.B @ P.C2, K.A]]),
        np.vstack([P.B1 + P.B2 @ K.D @ P.D21, K.B @ P.D21]),
        np.hstack([P.C1 + P.D12 @ K.D @ P.C2, P.D12 @ K.C]),
        P.D11 + P.D12 @ K.D @ P.D21,
    )


def absorb_d22(K: Controller, D22: Matrix) -> Controller | None:
    """Return the controller for the plant with D22 that acts as K does on the one without.

    K sees y - D22 u. None if I + Dk D22 is singular to working accuracy.
    """
    if not D22.any() or not (K.C.any() or K.D.any()):
        return K
    loop = np.eye(K.D.shape[0]) + K.D @ D22
    unit = balancing_scale(loop)
    if np.linalg.cond(loop * unit / unit[:, None]) > 1e10:
        return None
    C, D = np.linalg.solve(loop, K.C), np.linalg.solve(loop, K.D)
    A, B = K.A - K.B @ D22 @ C, K.B - K.B @ D22 @ D
    return Controller(A, B, C, D)


def balanced(K: Controller) -> Controller:
    """Balance the controller's states by powers of two, which rounds nothing."""
    if not len(K.A):
        return K
    into, out = np.abs(K.B).max(axis=1, initial=0.0), np.abs(K.C).max(axis=0, initial=0.0)
    t = border_scale(K.A, into, out)
    return Controller(K.A * t / t[:, None], K.B / t[:, None], K.C * t, K.D)


def balancing_scale(size: Matrix) -> Matrix:
    """Return s such that the rows and columns of size * s / s[:, None] are alike in size.

    Parameters
    ----------
    size : ndarray, shape (n, n)
        Absolute values count only. Where an entry is not finite nothing is scaled.

    Returns
    -------
    ndarray, shape (n,)
        Powers of two.
    """
    if not (size.size and np.isfinite(size).all()):
        return np.ones(len(size))
    # SciPy casts permutation indices that were never set, and may complain about their values.
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(size, permute=False, separate=True)
    return np.asarray(scale)


# Discrete time to continuous time and back by z = (1 + s)/(1 - s), which keeps the norm.

_WORST_CONDITION = 1e7
_TRIALS = 6


def to_continuous(
    plant: GeneralizedPlant, state: Matrix, gain: Matrix
) -> tuple[GeneralizedPlant, Matrix]:
    """Map a discrete-time plant to a continuous one with the same H-infinity problem.

    An eigenvalue at z = -1 has no image. A small random static controller moves it
    first; :func:`to_discrete` adds it to the controller that is found.

    Parameters
    ----------
    plant : GeneralizedPlant
        Discrete.
    state, gain : ndarray, shapes (nx,) and (nu, ny)
        Units of the states and of a static controller's entries.

    Returns
    -------
    plant : GeneralizedPlant
        Continuous; the static controller, if any, is closed around it, and its D22 is that
        of the loop.
    feedback : ndarray, shape (nu, ny)
        That static controller, zero as a rule; it acts on y - D22 u.
    """
    rng = np.random.default_rng(0)
    # The plant without D22 is mapped: the controller's way back accounts for it.
    P = PlantMatrices.of(plant).without_d22()
    feedback, best, moved = np.zeros((plant.nu, plant.ny)), np.inf, P
    for trial in range(_TRIALS):
        F = 0.3 * gain * rng.standard_normal(gain.shape) if trial else feedback
        closed = P.with_inner_loop(F)
        shown = (np.eye(P.nx) + closed.A) * state / state[:, None]
        condition = np.linalg.cond(shown) if P.nx else 1.0
        if condition < best:
            best, feedback, moved = condition, F, closed
        if best < _WORST_CONDITION:
            break
    image = PlantMatrices.of_system(cayley(*moved.system), plant.nw, plant.nz)
    return GeneralizedPlant.from_matrices(**image.matrices), feedback


def to_discrete(K: Controller, feedback: Matrix, D22: Matrix) -> Controller | None:
    """Map a controller back, add the static one and account for the discrete plant's D22."""
    if len(K.A) and np.linalg.cond(np.eye(len(K.A)) - K.A) > 1e12:
        return None
    mapped = cayley_back(K)
    return absorb_d22(Controller(*mapped[:3], mapped.D + feedback), D22)


def cayley(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> SystemMatrices:
    """Map discrete time to continuous time; no pole may lie at z = -1."""
    one, root = np.eye(len(A)), np.sqrt(2)
    inverse = np.linalg.inv(A + one)
    A, into, out = inverse @ (A - one), root * inverse @ B, root * C @ inverse
    D = D - C @ inverse @ B
    return SystemMatrices(A, into, out, D)


def cayley_back(K: SystemMatrices) -> SystemMatrices:
    """Map a continuous system to discrete time, the inverse of :func:`cayley`."""
    one, root = np.eye(len(K.A)), np.sqrt(2)
    inverse = np.linalg.inv(one - K.A)
    A, B, C = (one + K.A) @ inverse, root * inverse @ K.B, root * K.C @ inverse
    D = K.D + K.C @ inverse @ K.B
    return SystemMatrices(A, B, C, D)


# Plants whose whole state is measured, y = x: the loops of u = F x, and related plants.
#
# Every function takes and returns :class:`PlantMatrices`; in discrete time x' is x(k + 1).


def with_measured_states(plant: PlantMatrices) -> PlantMatrices:
    """Return the plant with y = x."""
    nx = plant.nx
    return plant.replace(C2=np.eye(nx), D21=np.zeros((nx, plant.nw)), D22=np.zeros((nx, plant.nu)))


def stabilises(plant: PlantMatrices, F: Matrix) -> bool:
    """Return whether all poles of the loop with u = F x are stable."""
    poles = np.linalg.eigvals(plant.A + plant.B2 @ F)
    return bool((np.abs(poles) < 1).all() if plant.discrete else (poles.real < 0).all())


def state_gain_norm(plant: PlantMatrices, F: Matrix | None, norm: str) -> float:
    """Return the norm from w to z that F achieves; infinite where the loop is unstable."""
    p = plant
    if F is None or not np.isfinite(F).all() or not stabilises(p, F):
        return math.inf
    if not p.B1.size or not p.C1.size:
        return 0.0
    loop = control.StateSpace(p.A + p.B2 @ F, p.B1, p.C1 + p.D12 @ F, p.D11, p.discrete)
    return float(hinf_norm(loop) if norm == "hinf" else h2_norm(loop))


def is_regular(plant: PlantMatrices) -> bool:
    """Return whether every control has a price: D12 of full column rank, to rounding."""
    p = plant
    if p.nu == 0 or p.nz < p.nu:
        return p.nu == 0
    singular = np.linalg.svd(p.D12, compute_uv=False)
    size = max(float(np.linalg.norm(p.C1, 2)), float(singular[0]))
    return bool(singular[-1] > 1e-11 * size)


def with_small_penalty(plant: PlantMatrices, price: float) -> PlantMatrices:
    """Append `price` times u to z, and a thousandth of it times x: no rank is missing then."""
    nx, nu, nw = plant.nx, plant.nu, plant.nw
    return plant.replace(
        C1=np.vstack([plant.C1, np.zeros((nu, nx)), 1e-3 * price * np.eye(nx)]),
        D11=np.vstack([plant.D11, np.zeros((nu + nx, nw))]),
        D12=np.vstack([plant.D12, price * np.eye(nu), np.zeros((nx, nu))]),
    )


def minimum_effort_problem(plant: PlantMatrices, state_weight: float) -> PlantMatrices:
    """Return the problem of stabilising with little effort, whatever w and z are."""
    nx, nu = plant.nx, plant.nu
    return with_measured_states(
        plant.replace(
            B1=np.eye(nx),
            C1=np.vstack([state_weight * np.eye(nx), np.zeros((nu, nx))]),
            D11=np.zeros((nx + nu, nx)),
            D12=np.vstack([np.zeros((nx, nu)), np.eye(nu)]),
        )
    )


def with_noise(plant: PlantMatrices, share: float) -> PlantMatrices:
    """Append a disturbance on every state, `share` times as large as those that are there."""
    nx = plant.nx
    size = share * (float(np.linalg.norm(plant.B1, 2)) if plant.B1.size else 1.0)
    return with_measured_states(
        plant.replace(
            B1=np.hstack([plant.B1, size * np.eye(nx)]),
            D11=np.hstack([plant.D11, np.zeros((plant.nz, nx))]),
        )
    )


def compressed_outputs(plant: PlantMatrices) -> PlantMatrices:
    """Return the plant with as few performance outputs as give the same norms."""
    columns = np.hstack([plant.C1, plant.D11, plant.D12])
    if columns.shape[0] <= columns.shape[1]:
        return plant
    R: Any = np.linalg.qr(columns, mode="r")
    nx, nw = plant.nx, plant.nw
    return plant.replace(C1=R[:, :nx], D11=R[:, nx : nx + nw], D12=R[:, nx + nw :])


def in_states(plant: PlantMatrices, T: Matrix) -> PlantMatrices:
    """Return the plant for states x = T x_new, which are measured; F = F_new inv(T)."""
    return with_measured_states(plant.in_states(np.linalg.inv(T), T))


# A plant closed with a constant matrix K, and how gradients travel back to K.


@dataclass(frozen=True, eq=False)
class StaticLoop:
    """The loop from w to z for one K."""

    plant: PlantMatrices
    K: Matrix
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    left: Matrix | None
    right: Matrix | None

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of the closed loop."""
        return self.modes[0]

    @cached_property
    def modes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Eigenvalues and eigenvectors of the closed loop."""
        values, vectors = np.linalg.eig(self.A)
        return np.asarray(values, complex), np.asarray(vectors, complex)

    @property
    def stable(self) -> bool:
        """Whether all poles are inside, by more than rounding errors of the eigenvalues."""
        if self.A.size == 0 or not np.isfinite(self.A).all():
            return self.A.size == 0
        blur = 10 * EPS * float(np.linalg.norm(self.A, 2))
        size = np.abs(self.poles) - 1 if self.plant.discrete else self.poles.real
        return bool(np.max(size) < -blur)

    def back(self, gradient: Matrix) -> Matrix:
        """Turn a gradient over T = K (I - D22 K)^-1 into one over K."""
        if self.left is None or self.right is None:
            return gradient
        return self.left.T @ gradient @ self.right.T


def close_static_loop(plant: PlantMatrices, K: Matrix) -> StaticLoop | None:
    """Connect u = K y with a constant K; None if the loop is not well posed."""
    T, ends = K, (None, None)
    if plant.has_d22:
        left, right = np.eye(len(K)) - K @ plant.D22, np.eye(K.shape[1]) - plant.D22 @ K
        # Both are singular for the same K, but rounding may show it in one of them only.
        for end in (left, right):
            if not np.isfinite(end).all() or np.linalg.cond(end) > 1 / EPS:
                return None
        T, ends = np.linalg.solve(left, K), (np.linalg.inv(left), np.linalg.inv(right))
    loop = plant.with_inner_loop(T)
    return StaticLoop(plant, K, loop.A, loop.B1, loop.C1, loop.D11, *ends)


def augmented(loop: PlantMatrices, order: int) -> PlantMatrices:
    """Add `order` integrators (delays), so that a static K holds a dynamic controller.

    The static gain of the augmented plant is [[Ak, Bk], [Ck, Dk]]: its inputs are
    (xk, y), its outputs (xk', u). El Ghaoui, Oustry, AitRami (1997), section II.
    """
    if order == 0:
        return loop
    eye, none = np.eye(order), np.zeros((order, order))
    more_x = np.zeros((loop.nx, order))
    return loop.replace(
        A=linalg.block_diag(loop.A, none),
        B1=np.pad(loop.B1, ((0, order), (0, 0))),
        B2=np.block([[more_x, loop.B2], [eye, np.zeros((order, loop.nu))]]),
        C1=np.pad(loop.C1, ((0, 0), (0, order))),
        C2=np.block([[more_x.T, eye], [loop.C2, np.zeros((loop.ny, order))]]),
        D12=np.pad(loop.D12, ((0, 0), (order, 0))),
        D21=np.pad(loop.D21, ((order, 0), (0, 0))),
        D22=linalg.block_diag(none, loop.D22) if loop.D22.size else np.zeros((0, 0)),
    )


def controller_loop(order: int, left: Matrix, right: Matrix, discrete: bool) -> PlantMatrices:
    """Return the loop whose closed form is left K(s) right, for measuring a controller itself.

    K = [[Ak, Bk], [Ck, Dk]] is closed around `order` integrators (delays) alone.
    """
    (rows, nu), (ny, columns), zero = left.shape, right.shape, np.zeros
    still = zero((0, 0)), zero((0, columns)), zero((0, nu)), zero((rows, 0)), zero((ny, 0))
    gain = PlantMatrices(*still, zero((rows, columns)), left, right, zero((ny, nu)), discrete)
    return augmented(gain, order)


def solve_riccati(A: Matrix, R: Matrix, Q: Matrix) -> Matrix | None:
    r"""Return the stabilising solution of A'X + XA + XRX + Q = 0.

    Parameters
    ----------
    A, R, Q : ndarray, shape (n, n)
        R and Q symmetric, of any sign.

    Returns
    -------
    ndarray or None
        X symmetric with A + R X stable; None if the Hamiltonian has eigenvalues on the
        axis, to working accuracy, or if no such X exists.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros((0, 0))
    if not (np.isfinite(A).all() and np.isfinite(R).all() and np.isfinite(Q).all()):
        return None
    H, scale, weight = balanced_hamiltonian(A, R, Q)
    if not np.isfinite(H).all():
        return None
    try:
        _, U, stable = linalg.schur(H, sort="lhp")  # type: ignore[misc]
    except linalg.LinAlgError:
        return None
    if stable != n:
        return None
    upper, lower = U[:n, :n], U[n:, :n]
    # A subspace that holds eigenvalues of the axis, pushed to the left by rounding, is
    # not Lagrangian: its X would not be symmetric.
    product = upper.T @ lower
    if np.abs(product - product.T).max() > 1e-6:
        return None
    # LAPACK itself: SciPy would warn of a singular matrix, which is an answer here.
    getrf: Any = linalg.get_lapack_funcs("getrf", (upper,))
    lu, pivots, info = getrf(upper)
    singular = np.linalg.svd(upper, compute_uv=False)
    if info > 0 or singular[-1] <= np.finfo(float).tiny:
        return None
    X = linalg.lu_solve((lu, pivots), lower.T, trans=1).T
    X = (X + X.T) / 2 * weight / scale / scale[:, None]
    return X if np.isfinite(X).all() else None


def balanced_hamiltonian(A: Matrix, R: Matrix, Q: Matrix) -> tuple[Matrix, Matrix, float]:
    """Return a Hamiltonian that powers of two even out without breaking its structure, and these.

    Returns
    -------
    H : ndarray, shape (2n, 2n)
    scale : ndarray, shape (n,)
        State scaling x = diag(scale) x_new.
    weight : float
        Factor between the two halves: R is multiplied and Q divided by it.
    """
    n = A.shape[0]
    size = np.abs(np.block([[A, R], [Q, A.T]]))
    np.fill_diagonal(size, 0)
    logs = np.log2(balancing_scale(size))
    scale = np.exp2(np.round((logs[:n] - logs[n:]) / 2))
    r = np.abs(R / scale[:, None] / scale[None, :]).max()
    q = np.abs(Q * scale[:, None] * scale[None, :]).max()
    weight = float(np.exp2(np.round(np.log2(q / r) / 2))) if r > 0 and q > 0 else 1.0
    A, R, Q = A * scale / scale[:, None], R / scale / scale[:, None], Q * scale * scale[:, None]
    return np.block([[A, R * weight], [-Q / weight, -A.T]]), scale, weight


def solve_lyapunov(A: Matrix, Q: Matrix) -> Matrix | None:
    """Return X of A'X + XA + Q = 0 for a stable A; None where numbers are not finite.

    Where eigenvalues lie on the axis, to working accuracy, LAPACK moves them: X is then no more
    than a start.
    """
    if A.shape[0] == 0:
        return np.zeros((0, 0))
    if not (np.isfinite(A).all() and np.isfinite(Q).all()):
        return None
    T, U = linalg.schur(A.T, output="real")  # type: ignore[misc]
    # dtrsyl scales the right-hand side down where it would overflow.
    trsyl: Any = linalg.get_lapack_funcs("trsyl", (T, Q))
    Y, scale, info = trsyl(T, T, -U.T @ Q @ U, tranb="T")
    if info < 0 or scale == 0 or not np.isfinite(Y).all():
        return None
    X = U @ (Y / scale) @ U.T
    return (X + X.T) / 2 if np.isfinite(X).all() else None


def without_many_modes(K: Controller, hold: bool) -> Iterator[Controller]:
    """Propose controllers without the fastest half, quarter or eighth of their modes."""
    speeds = np.sort(np.abs(np.linalg.eigvals(K.A)))
    n = len(speeds)
    for count in (n // 2, n // 4, n // 8):
        # Between two speeds, so that no pair is torn apart.
        bound = float(np.sqrt(speeds[n - count] * speeds[n - count - 1])) if count < n else 0.0
        yield from _truncate_modes(K, lambda v, b=bound: np.abs(v) > b, hold)


def without_one_mode(K: Controller, hold: bool) -> Iterator[Controller]:
    """Propose controllers with one mode less: without the fastest, without the weakest."""
    values, vectors = np.linalg.eig(K.A)
    fastest = np.abs(values).max()
    yield from _truncate_modes(K, lambda v: np.abs(v) > 0.9 * fastest, hold)
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return
    # What a mode adds to the response.
    damping = np.maximum(np.abs(np.real(values)), 1e-12 * fastest)
    size = np.linalg.norm(K.C @ vectors, axis=0) * np.linalg.norm(left @ K.B, axis=1) / damping
    weakest = values[np.argmin(size)]
    if size.min() <= 1e-2 * size.max():
        pair = np.array([weakest, weakest.conjugate()])
        yield from _truncate_modes(K, lambda v: np.abs(v - pair).min() <= 1e-9 * fastest, False)


def _truncate_modes(
    K: Controller, removed: Callable[[Any], Any], hold: bool
) -> Iterator[Controller]:
    """Split off the modes that `removed` selects and drop them, or hold them at rest."""
    try:
        T, Z, kept = linalg.schur(  # type: ignore[misc]
            K.A, output="real", sort=lambda re, im: not removed(np.array(complex(re, im)))
        )
        n = len(T)
        if kept == n:
            return
        slow, fast = slice(0, kept), slice(kept, n)
        X = linalg.solve_sylvester(T[slow, slow], -T[fast, fast], -T[slow, fast])
        B, C = Z.T @ K.B, K.C @ Z
        B_slow, C_fast = B[slow] - X @ B[fast], C[:, fast] + C[:, slow] @ X
        D = K.D
        if hold:
            D = D - C_fast @ np.linalg.solve(T[fast, fast], B[fast])
    except (linalg.LinAlgError, ValueError):
        return
    yield Controller(T[slow, slow], B_slow, C[:, slow], D)
