"""Units in which a plant is solved, all of order one, and the way from there back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.arrays import Matrix
from robustpolish.exact import exponents
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
from robustpolish.synthesis.problem.bilinear import to_continuous, to_discrete
from robustpolish.synthesis.problem.decoupling import named_controller
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, balanced, shift

_SWEEPS = 20
_NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")


@dataclass(frozen=True, eq=False)
class ScaledPlant:
    """A plant in its own units, the same plant in units that suit a solver, and the way back.

    A quantity in the plant's units is its unit times the scaled quantity. All factors are
    powers of two, so that scaling adds no rounding error.

    Attributes
    ----------
    original, plant : GeneralizedPlant
        Before and after scaling; the signals keep their names.
    time : float
        Unit of time in the plant's unit of time, usually s; 1 in discrete time.
    state, control, measurement : ndarray
        Unit of every x, u and y.
    disturbance, performance : float
        One unit for all w and one for all z, because single ones would change the norm.
    """

    original: GeneralizedPlant
    plant: GeneralizedPlant
    time: float
    state: Matrix
    control: Matrix
    measurement: Matrix
    disturbance: float
    performance: float

    def norm(self, scaled: float, kind: str = "hinf") -> float:
        """Return a norm from w to z, "hinf" or "h2", in the plant's units."""
        value = scaled * self.performance / self.disturbance
        return value / math.sqrt(self.time) if kind == "h2" else value

    def scaled_norm(self, value: float, kind: str = "hinf") -> float:
        """Return a norm given in the plant's units for the scaled plant."""
        return value / self.norm(1.0, kind)

    def state_gain(self, scaled: ArrayLike) -> Matrix:
        """Return F of u = F x in the plant's units, equation (10.60)."""
        return self.control[:, None] * np.asarray(scaled, dtype=float) / self.state

    def output_gain(self, scaled: ArrayLike) -> Matrix:
        """Return F of u = F y in the plant's units."""
        return self.control[:, None] * np.asarray(scaled, dtype=float) / self.measurement

    def in_units(self, p: PlantMatrices) -> PlantMatrices:
        """Return another plant of these signals in the same units, which round nothing.

        Its first states are those of this plant; more of them keep their own units.
        """
        x = np.concatenate([self.state, np.ones(p.nx - len(self.state))])
        u, y, w, z = self.control, self.measurement, self.disturbance, self.performance
        return p.replace(
            A=self.time * p.A * x / x[:, None],
            B1=self.time * p.B1 * w / x[:, None],
            B2=self.time * p.B2 * u / x[:, None],
            C1=p.C1 * x / z,
            D11=p.D11 * w / z,
            D12=p.D12 * u / z,
            C2=p.C2 * x / y[:, None],
            D21=p.D21 * w / y[:, None],
            D22=p.D22 * u / y[:, None],
        )

    def controller(self, scaled: control.StateSpace) -> control.StateSpace:
        """Return a dynamic controller u = K y in the plant's units."""
        rate = self.time
        return control.StateSpace(
            np.asarray(scaled.A) / rate,
            np.asarray(scaled.B) / rate / self.measurement,
            self.control[:, None] * np.asarray(scaled.C),
            self.output_gain(scaled.D),
            self.original.dt,
        )


def scale_plant(plant: GeneralizedPlant) -> ScaledPlant:
    """Choose units in which the entries of a plant's matrices are of order one.

    The unit of time is the geometric mean of the time constants; states are balanced as
    for eigenvalues, but with inputs and outputs taken into account; each control and
    measurement gets the unit that makes its column or row of order one; the
    disturbances share one unit and so do the performance outputs.

    Parameters
    ----------
    plant : GeneralizedPlant
        In any units, continuous or discrete.

    Returns
    -------
    ScaledPlant

    Examples
    --------
    A stiff spring with a small mass, pushed by a force of some N, seen in micrometres:

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [-1e8, -1.0]], [[0.0], [2.0]], [[0.0], [2.0]], [[1.0, 0.0]], [[1.0, 0.0]]
    ... )
    >>> from robustpolish.synthesis.problem.scaling import scale_plant
    >>> bool(abs(scale_plant(plant).plant.A).max() < 10)
    True
    """
    with exponents.within_doubles("plant", {name: getattr(plant, name) for name in _NAMES}):
        return _scaled_plant(plant)


def _scaled_plant(plant: GeneralizedPlant) -> ScaledPlant:
    nx, nw, nu, nz, ny = plant.nx, plant.nw, plant.nu, plant.nz, plant.ny
    time = 1.0 if plant.is_discrete else _unit_of_time(plant.A)
    S = np.block(
        [
            [exponents.scaled(M, time) for M in (plant.A, plant.B1, plant.B2)],
            [plant.C1, plant.D11, plant.D12],
            [plant.C2, plant.D21, plant.D22],
        ]
    )
    left, right = _balance(S, nx, nw, nz)
    S = exponents.scaled(S, left[:, None], right)
    exponents.refuse_beyond(S)
    matrices = (S[:nx, :nx], S[:nx, nx:], S[nx:, :nx], S[nx:, nx:])
    whole = plant.system
    names = (whole.input_labels, whole.output_labels, whole.state_labels)
    system = named_system(matrices, plant.dt, *names)
    return ScaledPlant(
        original=plant,
        plant=GeneralizedPlant(system, ny, nu),
        time=time,
        state=right[:nx],
        control=right[nx + nw :],
        measurement=1 / left[nx + nz :],
        disturbance=float(right[nx]) if nw else 1.0,
        performance=float(1 / left[nx]) if nz else 1.0,
    )


@dataclass(frozen=True, eq=False)
class SolverPlant:
    """A plant prepared for an engine.

    Attributes
    ----------
    original : GeneralizedPlant
        In its own units, continuous or discrete.
    scaled : ScaledPlant
        The same, or its continuous-time image, before and after scaling.
    matrices : PlantMatrices
        The scaled matrices without D22.
    feedback : ndarray, shape (nu, ny)
        A static controller that was closed around a discrete-time plant before it was mapped.
    """

    original: GeneralizedPlant
    scaled: ScaledPlant
    matrices: PlantMatrices
    feedback: Matrix

    @classmethod
    def of(cls, plant: GeneralizedPlant, mapped: bool) -> SolverPlant:
        """Prepare a plant.

        Parameters
        ----------
        plant : GeneralizedPlant
        mapped : bool
            Whether to map a discrete-time plant to continuous time, which keeps the H-infinity
            norm but not the H2 norm.
        """
        feedback = np.zeros((plant.nu, plant.ny))
        scaled = scale_plant(plant)
        if plant.is_discrete and mapped:
            gain = scaled.output_gain(np.ones_like(feedback))
            image, feedback = to_continuous(plant, scaled.state, gain)
            scaled = scale_plant(image)
        return cls(plant, scaled, PlantMatrices.of(scaled.plant).without_d22(), feedback)

    def norm(self, value: float, kind: str = "hinf") -> float:
        """Return a norm of the scaled loop in the plant's units."""
        return self.scaled.norm(value, kind)

    def controller(self, K: Controller) -> control.StateSpace | None:
        """Return a controller in the plant's units; None if its loop is not well posed."""
        shifted = shift(K, self.scaled.plant.D22)
        if shifted is None:
            return None
        found = self.scaled.controller(control.StateSpace(*shifted, remove_useless_states=False))
        final: Controller | None = Controller(
            *map(np.asarray, (found.A, found.B, found.C, found.D))
        )
        if self.original.is_discrete and not self.scaled.original.is_discrete:
            final = to_discrete(final, self.feedback, self.original.D22)
        if final is None or not all(np.isfinite(M).all() for M in final):
            return None
        return named_controller(self.original, *balanced(final))


def _balance(S: Matrix, nx: int, nw: int, nz: int) -> tuple[Matrix, Matrix]:
    """Return factors of the rows and columns of [[A, B1, B2], [C1, D11, D12], [C2, D21, D22]]."""
    left, right = np.ones(S.shape[0]), np.ones(S.shape[1])
    for _ in range(_SWEEPS):
        before = right.copy()
        size = np.abs(S) * left[:, None] * right
        column = _reach(size[:nx, nx:], size[nx:, nx:])
        row = _reach(size[nx:, :nx].T, size[nx:, nx:].T)
        right[nx + nw :] /= _power_of_two(column[nw:])
        right[nx : nx + nw] /= _power_of_two(column[:nw].max(initial=0.0))
        left[nx + nz :] /= _power_of_two(row[nz:])
        left[nx : nx + nz] /= _power_of_two(row[:nz].max(initial=0.0))
        for i in range(nx):
            into = np.linalg.norm(np.delete(np.abs(S[i]) * left[i] * right, i))
            out = np.linalg.norm(np.delete(np.abs(S[:, i]) * left * right[i], i))
            if into > 0 and out > 0:
                factor = float(_power_of_two(math.sqrt(into / out)))
                left[i] /= factor
                right[i] *= factor
        if (right == before).all():
            break
    return left, right


def _reach(on_states: Matrix, direct: Matrix) -> Matrix:
    """Return the size of inputs by what they do to states; directly, where they reach none."""
    reach = np.linalg.norm(on_states, axis=0)
    return np.where(reach > 0, reach, np.linalg.norm(direct, axis=0))


def _unit_of_time(A: Matrix) -> float:
    """Return the power of two next to the geometric mean of the time constants."""
    size = np.abs(np.linalg.eigvals(A)) if A.size else np.zeros(0)
    # Modes at zero, up to rounding, say nothing about the time scale.
    size = size[size > size.max(initial=0.0) * math.sqrt(np.finfo(float).eps)]
    if not size.size:
        largest = float(np.abs(A).max(initial=0.0))
        return 1 / float(_power_of_two(largest)) if largest > 0 else 1.0
    return float(np.exp2(np.clip(np.round(-np.log2(size).mean()), -1000, 1000)))


def _power_of_two(size: ArrayLike) -> Matrix:
    """Return the next power of two of every number; 1 for zeros."""
    array = np.asarray(size, dtype=float)
    safe = np.where(array > 0, array, 1.0)
    return np.exp2(np.clip(np.round(np.log2(safe)), -1000, 1000))
