"""Normalised coprime factors of a plant, and what loop shaping makes of their equations."""

from __future__ import annotations

from typing import Any, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.errors import SolverError
from robustpolish.exact.exponents import refuse_extreme
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.synthesis.problem.matrices import SystemMatrices, balancing_scale
from robustpolish.synthesis.problem.preflight import diagnose, refuse
from robustpolish.synthesis.riccati.equations import solve_riccati
from robustpolish.validation import described, invalid


class Coprime(NamedTuple):
    """A plant in continuous time with the solutions of its two normalised Riccati equations.

    Attributes
    ----------
    plant : SystemMatrices
        A, B, C, D; of a discrete-time plant the image under z = (1 + s) / (1 - s).
    X, Z : ndarray, shape (n, n)
        Of the control and of the filter equation.
    S, R : ndarray
        I + D'D and I + DD'.
    """

    plant: SystemMatrices
    X: Matrix
    Z: Matrix
    S: Matrix
    R: Matrix

    @property
    def optimal_gamma(self) -> float:
        """The smallest norm of [I; K] (I - G K)^-1 [I, G] over all controllers."""
        product = np.linalg.eigvals(self.X @ self.Z).real if len(self.X) else np.zeros(0)
        return float(np.sqrt(1 + max(product.max(initial=0.0), 0.0)))

    @property
    def state_gain(self) -> Matrix:
        """F, which makes A + BF the state matrix of the right factors."""
        _, B, C, D = self.plant
        return -np.linalg.solve(self.S, D.T @ C + B.T @ self.X)

    def right(self) -> SystemMatrices:
        """Return [N; M] with G = N M^-1 and N~N + M~M = I."""
        A, B, C, D = self.plant
        F, root = self.state_gain, _inverse_root(self.S)
        return SystemMatrices(
            A + B @ F, B @ root, np.vstack([C + D @ F, F]), np.vstack([D @ root, root])
        )

    def left(self) -> SystemMatrices:
        """Return [-M, N] with G = M^-1 N and N N~ + M M~ = I."""
        A, B, C, D = self.plant
        H = -np.linalg.solve(self.R, (B @ D.T + self.Z @ C.T).T).T
        root = _inverse_root(self.R)
        return SystemMatrices(
            A + H @ C, np.hstack([-H, B + H @ D]), root @ C, np.hstack([-root, root @ D])
        )

    def controller(self, gamma: float) -> SystemMatrices:
        """Return the central controller of u = K y for a gamma above the optimal one.

        Skogestad, Postlethwaite, "Multivariable Feedback Control", equations (9.65) to (9.71).
        """
        A, B, C, D = self.plant
        F, n = self.state_gain, len(self.X)
        L = (1 - gamma**2) * np.eye(n) + self.X @ self.Z
        into = gamma**2 * np.linalg.solve(L.T, self.Z @ C.T)
        return SystemMatrices(A + B @ F + into @ (C + D @ F), into, B.T @ self.X, -D.T)


def coprime(plant: GeneralizedPlant) -> Coprime:
    """Solve the normalised Riccati equations of the part of a plant from u to y.

    Parameters
    ----------
    plant : GeneralizedPlant

    Returns
    -------
    Coprime

    Raises
    ------
    InfeasibleError
        If a mode that is not stable is not controllable or not observable; it is named.
    SolverError
        If the equations could not be solved.
    InvalidInputError
        If a discrete-time plant has a pole at z = -1.
    """
    exact = [mode for mode in diagnose(plant).fixed_modes if mode.exact]
    if exact:
        raise refuse(exact)
    A, B, C, D = plant.A, plant.B2, plant.C2, plant.D22
    if plant.is_discrete:
        A, B, C, D = cayley(A, B, C, D)
    size = np.zeros((len(A) + 1, len(A) + 1))
    size[:-1, :-1] = np.abs(A)
    size[:-1, -1], size[-1, :-1] = (
        np.abs(B).max(axis=1, initial=0),
        np.abs(C).max(axis=0, initial=0),
    )
    scale = balancing_scale(size)
    t = scale[:-1] / scale[-1]
    A, B, C = A * t / t[:, None], B / t[:, None], C * t
    S, R = np.eye(B.shape[1]) + D.T @ D, np.eye(len(C)) + D @ D.T
    if max(np.linalg.cond(S), np.linalg.cond(R)) > 1 / np.finfo(float).eps:
        raise SolverError(
            "The normalised coprime factors are lost in rounding: the plant passes its inputs on "
            f"directly with gains up to {np.abs(D).max():.3g}. Choose other units for the signals."
        )
    own = A - B @ np.linalg.solve(S, D.T @ C)
    into, out = B @ np.linalg.solve(S, B.T), C.T @ np.linalg.solve(R, C)
    X, Z = solve_riccati(own, -into, out), solve_riccati(own.T, -out, into)
    if X is None or Z is None:
        raise SolverError(
            "The Riccati equations of the normalised coprime factors could not be solved: a mode "
            "is almost uncontrollable or unobservable. Reduce the plant to the modes that matter."
        )
    return Coprime(SystemMatrices(A, B, C, D), X.X, Z.X, S, R)


def cayley(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Map discrete time to continuous time by z = (1 + s) / (1 - s), which keeps all norms."""
    one = np.eye(len(A))
    if len(A) and np.linalg.cond(one + A) > 1e12:
        shown = described("a discrete-time plant with a pole at z = -1")
        raise invalid("plant", shown, "one without", "Shift it, or take the continuous plant.")
    inverse, root = np.linalg.inv(one + A), np.sqrt(2)
    return inverse @ (A - one), root * inverse @ B, root * C @ inverse, D - C @ inverse @ B


def cayley_back(K: SystemMatrices) -> SystemMatrices:
    """Map a continuous controller to discrete time, the inverse of :func:`cayley`."""
    one, root = np.eye(len(K.A)), np.sqrt(2)
    inverse = np.linalg.inv(one - K.A)
    return SystemMatrices(
        inverse @ (one + K.A), root * inverse @ K.B, root * K.C @ inverse, K.D + K.C @ inverse @ K.B
    )


def loop_plant(argument: str, plant: Any) -> GeneralizedPlant:
    """Return a plant whose part from u to y is meant, whatever was given."""
    if not isinstance(plant, GeneralizedPlant):
        G = as_state_space(argument, plant)
        plant = GeneralizedPlant(G, measurements=G.noutputs or 0, controls=G.ninputs or 0)
    if not (plant.nu and plant.ny):
        shown = described(f"{plant.nu} controls and {plant.ny} measurements")
        raise invalid(argument, shown, "at least one of each", "Check controls=, measurements=.")
    refuse_extreme(argument, {name: getattr(plant, name) for name in ("A", "B2", "C2", "D22")})
    return plant


def in_series(first: SystemMatrices, second: SystemMatrices) -> SystemMatrices:
    """Return second after first."""
    a, b = first, second
    return SystemMatrices(
        np.block([[a.A, np.zeros((len(a.A), len(b.A)))], [b.B @ a.C, b.A]]),
        np.vstack([a.B, b.B @ a.D]),
        np.hstack([b.D @ a.C, b.C]),
        b.D @ a.D,
    )


def arrays_of(system: control.StateSpace) -> SystemMatrices:
    """Return the matrices of a system with consistent shapes."""
    return SystemMatrices(*matrices_of(system))


def _inverse_root(S: Matrix) -> Matrix:
    values, vectors = linalg.eigh(S)
    return vectors / np.sqrt(values) @ vectors.T
