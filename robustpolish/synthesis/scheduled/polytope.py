"""Polytopes of plants: matrix inequalities with slack that bound norms, and proofs in balls.

The vertices are a list of plants, or the corners of a box of real numbers.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import flint
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.arrays import ROUNDING
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.checks import described, instance_of, invalid, is_whole, misfit
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import Ball, BallSystem, is_definite
from robustpolish.plants.blocks import SignalChoice, chosen_names
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.lft import Lft, RealElement, block_slices
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    symmetric_block,
)
from robustpolish.synthesis.problem.matrices import NAMES, Controller, PlantMatrices
from robustpolish.synthesis.problem.preflight import ScaledPlant, scale_plant, with_control_penalty
from robustpolish.synthesis.proofs.bounded_real import BITS

ACCURACY = 1e-9
"""Of the solver, in scaled units, in which entries of the plant are about one."""

# Each number doubles the vertices, and programs grow with them: 6 give 64.
_MOST_NUMBERS = 6
# Corners of rates that programs hold themselves: those of two slow numbers.
_CORNERS = 4

# Parameter-dependent Lyapunov matrices: one for all vertices, one for each, or affine in numbers.


class LyapunovFamily(NamedTuple):
    """P at vertex i is the sum of ``shares[i, k] P_k``; its derivatives are sums over ``drifts``.

    Attributes
    ----------
    shares : ndarray, shape (vertices, K)
        Affine functions of the point of the polytope, at its vertices.
    drifts : ndarray, shape (m, K)
        Extreme rates of change of the shares; of convex combinations of these the derivative is
        made. A single row of zeros where nothing changes with time.
    """

    shares: Matrix
    drifts: Matrix

    @classmethod
    def common(cls, vertices: int) -> LyapunovFamily:
        """Return one matrix for all: it holds however fast the plant moves in the polytope."""
        return cls(np.ones((vertices, 1)), np.zeros((1, 1)))

    @classmethod
    def per_vertex(cls, vertices: int) -> LyapunovFamily:
        """Return a matrix for each vertex: for plants that do not change with time."""
        return cls(np.eye(vertices), np.zeros((1, vertices)))

    @classmethod
    def affine(cls, positions: Matrix, rates: Sequence[float]) -> LyapunovFamily:
        """Return matrices that are affine in numbers whose rates of change are bounded.

        Parameters
        ----------
        positions : ndarray, shape (vertices, m)
            The numbers at the vertices, as -1 and 1.
        rates : sequence of float
            Largest change per unit of time, in the same units; infinite for a number on which the
            matrices must not depend.
        """
        slow = [i for i, rate in enumerate(rates) if math.isfinite(rate)]
        shares = np.hstack([np.ones((len(positions), 1)), positions[:, slow]])
        corners = itertools.product(*[sorted({-rates[i], rates[i]}) for i in slow])
        return cls(shares, np.array([[0.0, *corner] for corner in corners]))


@dataclass(frozen=True, eq=False)
class PolytopeSpecification:
    """What is asked of all loops of a polytope.

    Attributes
    ----------
    family : LyapunovFamily
    norm : {"hinf", "h2"}
    discrete : bool
    """

    family: LyapunovFamily
    norm: str
    discrete: bool

    @property
    def tied(self) -> bool:
        """Whether the slack is made of the one Lyapunov matrix that there is."""
        return self.family.shares.shape[1] == 1

    @property
    def tied_weights(self) -> tuple[float, float]:
        """The a and b with which X = (a P, b P, 0) is the inequality without slack."""
        return (1.0, 0.0) if self.discrete else (0.0, 1.0)

    def seen(self, C: Any) -> Any:
        """Return the part of C that the first inequality needs: for the H2 norm none."""
        return C if self.norm == "hinf" else np.zeros((0, C.shape[1]))

    def at(self, vertex: int, matrices: Sequence[Any]) -> Any:
        """Return the Lyapunov matrix at a vertex."""
        return weighted_sum(self.family.shares[vertex], matrices)

    def rates(self, matrices: Sequence[Any]) -> list[Any]:
        """Return the extreme derivatives of the Lyapunov matrix; None for one that is zero."""
        drifts = self.family.drifts
        return [weighted_sum(drift, matrices) if drift.any() else None for drift in drifts]

    def mean(self, matrices: Sequence[Matrix]) -> Matrix:
        """Return the mean of the Lyapunov matrices at the vertices."""
        count = len(self.family.shares)
        total: Any = sum(self.at(i, matrices) for i in range(count))
        return total / count


def weighted_sum(weights: Matrix, matrices: Sequence[Any]) -> Any:
    """Return the sum of ``weights[k] * matrices[k]``, of any kind that adds and multiplies."""
    terms = [matrix * float(w) for w, matrix in zip(weights, matrices, strict=True) if w]
    return functools.reduce(lambda a, b: a + b, terms) if terms else matrices[0] * 0.0


# Matrix inequalities of a polytope of loops, with a slack in place of products of unknowns.
#
# Along the dual loop x' = A' x + C' w, z = B' x + D' w the rate of x' P x has to stay below
# ``gamma^2 |w|^2 - |z|^2``. With the equation of motion written as
# ``[-I, A', C'] (x', x, w) = 0`` any slack X of three rows of blocks may multiply it (Finsler):
#
#     Q(P) + X [-I, A', C'] + [-I, A', C']' X'  - gamma^2 on w + (0, B, D) (0, B, D)'  <  0,
#
# which no longer holds any product of P with A or C. So P may differ from vertex to vertex if X
# does not, and the inequality at the vertices is that of all points between (de Oliveira,
# Bernussou and Geromel, Systems & Control Letters 37, 1999; in continuous time Shaked, IEEE TAC
# 46, 2001). With X = (a V', b V', 0) and L = F V it is linear in V and L: a gain F for all
# vertices.

Blocks = list[list[Any]]


Slack = tuple[Any, ...]
"""The three blocks of X: on the derivative of the state (or its next value), on it, on w."""


def with_slack(X: Slack, A: Any, C: Any) -> Blocks:
    """Return X [-I, A', C'], where either X or A and C hold unknowns."""
    return [[-Affine.of(row), Affine.of(row @ A.T), Affine.of(row @ C.T)] for row in X]


def with_gain(V: Affine, AV: Affine, CV: Affine, a: float, b: float) -> Blocks:
    """Return X [-I, A', C'] for X = (a V', b V', 0), from the loop's A V and C V."""
    rows = [[-V.T * f, AV.T * f, CV.T * f] for f in (a, b)]
    nz, n = CV.shape
    return [*rows, [Affine.of(np.zeros((nz, k))) for k in (n, n, nz)]]


class PolytopeProgram(SemidefiniteProgram):
    """A program with the Lyapunov matrices of a polytope of loops among its unknowns.

    Of up to two slow numbers the derivatives of the Lyapunov matrix are those at the corners of the
    rates. Corners of more make a program of 4-fold size for each: there one unknown N_j above
    r_j P_j and -r_j P_j for each number stands for them, -sum N_j. That asks for a little more;
    what is proven afterwards is proven at the corners themselves.

    Parameters
    ----------
    specification : PolytopeSpecification
    n : int
        States of the loops.
    """

    def __init__(self, specification: PolytopeSpecification, n: int) -> None:
        super().__init__()
        self.specification, family = specification, specification.family
        self.matrices = [self.symmetric(n) for _ in range(family.shares.shape[1])]
        self.rates: list[Affine | None] = specification.rates(self.matrices)
        if len(family.drifts) > _CORNERS:
            total = self.matrices[0] * 0.0
            largest = np.abs(family.drifts).max(axis=0)
            for rate, matrix in zip(largest, self.matrices, strict=True):
                if rate > 0:
                    N = self.symmetric(n)
                    self.positive(N - matrix * float(rate))
                    self.positive(N + matrix * float(rate))
                    total = total - N
            self.rates = [total]

    def impose(
        self,
        vertex: int,
        S: Blocks,
        CV: Any,
        V: Any,
        inputs: tuple[Matrix, Matrix],
        square: Affine,
        margin: Affine | None = None,
    ) -> Affine | None:
        """Require a bound on the norm at a vertex; return the unknown Z of the H2 norm.

        Parameters
        ----------
        vertex : int
        S : list of lists of Affine
            X [-I, A', C'] of the loop there.
        CV, V : Affine or ndarray
            C times a slack of the H2 norm, and that slack; without one P is in its place.
        inputs : tuple of ndarray
            B and D of the loop.
        square : Affine
            Of the bound.
        margin : Affine, optional
            By how much every inequality is to be strict, a scalar.
        """
        hinf = self.specification.norm == "hinf"
        margin = Affine.of(0.0) if margin is None else margin

        def strictly(M: Affine) -> None:
            self.positive(M - margin.times(np.eye(M.shape[0])))

        P = self.specification.at(vertex, self.matrices)
        strictly(P)
        for rate in self.rates:
            strictly(-self._dissipation(P, rate, S, inputs, square if hinf else None))
        if hinf:
            return None
        # The energy: Z >= C P C' + D D'.
        D = inputs[1]
        Z = self.symmetric(CV.shape[0])
        between = P if V is None else V + V.T - P
        none = np.zeros((P.shape[0], D.shape[1]))
        strictly(symmetric_block([[Z, CV, D], [between, none], [np.eye(D.shape[1])]]))
        self.nonnegative(square - Z.trace)
        return Z

    def _dissipation(
        self,
        P: Affine,
        rate: Affine | None,
        S: Blocks,
        inputs: tuple[Matrix, Matrix],
        square: Affine | None,
    ) -> Affine:
        """Return the matrix that has to be negative definite; for the H2 norm w is left out."""
        (B, D), discrete, none = inputs, self.specification.discrete, P * 0.0
        Q = ((P, none), (-P,)) if discrete else ((none, P), (none if rate is None else -rate,))
        first: list[Any] = [Q[0][0] + S[0][0] + S[0][0].T, Q[0][1] + S[0][1] + S[1][0].T]
        second: list[Any] = [Q[1][0] + S[1][1] + S[1][1].T]
        rows = [[*first, None], [*second, B]]
        if square is not None:
            level = S[2][2] + S[2][2].T - square.times(np.eye(len(D)))
            rows = [
                [*first, S[0][2] + S[2][0].T, None],
                [*second, S[1][2] + S[2][1].T, B],
                [level, D],
            ]
        rows.append([-np.eye(B.shape[1])])
        # Where X is made of P its first row is nought in continuous time, and left out.
        return symmetric_block(rows[1:] if self.specification.tied and not discrete else rows)


def vertex_names(points: Sequence[Mapping[str, float]]) -> list[str]:
    """Return the numbers at the vertices as text; empty where plants were given."""
    return [", ".join(f"{k} = {v:.6g}" for k, v in point.items()) for point in points]


@dataclass(frozen=True, eq=False)
class Polytope:
    """Plants at the vertices of a polytope, all with the same signals.

    Attributes
    ----------
    plants : tuple of GeneralizedPlant
    points : tuple of mapping of str to float
        Values of the numbers at each vertex; empty mappings for a list of plants.
    system : UncertainSystem or None
        The box from which the vertices are, disturbances before controls and outputs z before y.
    bends : tuple of float or None
        See :func:`affine_warps`; None if some plants of the box are no mixtures of its corners.
    """

    plants: tuple[GeneralizedPlant, ...]
    points: tuple[Mapping[str, float], ...]
    system: UncertainSystem | None = None
    bends: tuple[float, ...] | None = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What messages call the vertices."""
        return tuple(n or f"plants[{i}]" for i, n in enumerate(vertex_names(self.points)))

    @property
    def is_convex_hull(self) -> bool:
        """Whether all plants that are meant are mixtures of the vertices."""
        return self.bends is not None

    def weights(self, values: Mapping[str, float]) -> Matrix:
        """Return the shares of the vertices in the plant at a point of the box.

        Parameters
        ----------
        values : mapping of str to float
            The numbers, in their own units.
        """
        ends = [np.array([1 - s, 1 + s]) / 2 for s in self.place(values)]
        return functools.reduce(np.kron, ends, np.ones(1))

    def place(self, values: Mapping[str, float]) -> list[float]:
        """Return numbers as positions from -1 to 1, between which plants are mixed evenly."""
        found = []
        for element, bend in zip(self.numbers, self.bends or (), strict=True):
            delta = element.delta(values[element.name])
            # delta / (1 - bend delta) on the line between its values at the ends.
            found.append(float((delta - bend) / (1 - bend * delta)))
        return found

    def speed(self, name: str) -> float:
        """Return by how much the position of a number changes at most per unit of it."""
        index = [element.name for element in self.numbers].index(name)
        element, bend = self.numbers[index], (self.bends or ())[index]
        # Position over value is a fraction without a pole in between: steepest at an end.
        steep = []
        for delta, value in ((-1.0, element.low), (1.0, element.high)):
            below = element.slope + element.skew * (value - element.nominal)
            slope = element.slope / below**2
            steep.append(slope * (1 - bend**2) / (1 - bend * delta) ** 2)
        return max(steep) * (1 + 1e-12)

    @property
    def numbers(self) -> tuple[RealElement, ...]:
        """The real numbers of the system."""
        return () if self.system is None else real_numbers(self.system)

    @property
    def positions(self) -> Matrix:
        """The numbers at the vertices as -1 and 1, shape (vertices, numbers)."""
        columns = np.array([list(point.values()) for point in self.points])
        middle = (columns.max(axis=0) + columns.min(axis=0)) / 2
        return np.sign(columns - middle)

    def with_full_state(self) -> Polytope:
        """Return the polytope with y = x at all vertices."""
        return replace(self, plants=tuple(plant.with_full_state() for plant in self.plants))


def scaled_vertices(whole: Polytope) -> tuple[ScaledPlant, tuple[PlantMatrices, ...]]:
    """Return the units of the plant in the middle, and all vertices in these units."""
    vertices = tuple(PlantMatrices.of(plant) for plant in whole.plants)
    middle = shrunk_matrices(vertices, 0.0)[0]
    scaled = scale_plant(whole.plants[0].replace(**middle.matrices))
    return scaled, tuple(scaled.in_units(p) for p in vertices)


def shrunk_matrices(vertices: Sequence[PlantMatrices], factor: float) -> tuple[PlantMatrices, ...]:
    """Return vertices moved towards their middle."""
    middle = {name: sum(getattr(p, name) for p in vertices) / len(vertices) for name in NAMES}
    return tuple(
        p.replace(**{n: m + factor * (getattr(p, n) - m) for n, m in middle.items()})
        for p in vertices
    )


def polytope(
    given: Any,
    controls: SignalChoice | None,
    measurements: SignalChoice | None,
    control_weight: ArrayLike | None = None,
) -> Polytope:
    """Return the polytope that a user gave, as plants or as an uncertain system.

    Parameters
    ----------
    given : sequence of GeneralizedPlant, or UncertainSystem
    controls, measurements : int, str or sequence of str, or None
        Which signals of an uncertain system are u and y; None where plants say it. Without
        measurements all outputs are z.
    control_weight : float or array_like, optional
        Prices on u that join z.

    Returns
    -------
    Polytope

    Raises
    ------
    InvalidInputError
        If plants differ in more than their numbers, or something else than real numbers is
        uncertain.
    """
    if isinstance(given, UncertainSystem):
        if controls is None:
            expected = "names or number of the inputs that are controls"
            raise invalid("controls", controls, expected, 'Write controls=["F"].')
        return _of_system(given, controls, measurements, control_weight)
    for argument, value in (("controls", controls), ("measurements", measurements)):
        if value is not None:
            remedy = "Leave it out: the plants say what their signals are."
            raise invalid(argument, value, "no choice of signals beside plants", remedy)
    return _of_plants(given, control_weight)


def _of_plants(given: Any, weight: ArrayLike | None) -> Polytope:
    kind, remedy = "a list of GeneralizedPlant, or an UncertainSystem", "Pass [plant, plant]."
    if isinstance(given, GeneralizedPlant) or not isinstance(given, Sequence) or not given:
        raise invalid("plant", described(type(given).__name__), kind, remedy)
    plants = tuple(instance_of(("plant", i), p, GeneralizedPlant, kind, remedy)
                   for i, p in enumerate(given))  # fmt: skip
    first = plants[0]
    for i, p in enumerate(plants):
        if p.delays:
            shown = described("a plant with delays")
            raise invalid(("plant", i), shown, "plants without", "Take plant.without_delays().")
        for what in ("nx", "nw", "nu", "nz", "ny", "dt"):
            mine, theirs = getattr(first, what), getattr(p, what)
            if mine != theirs:
                shown, want = described(f"{what} = {theirs}"), f"{mine} as of the first plant"
                raise invalid(("plant", i), shown, want, "Vertices differ in numbers only.")
    paid = tuple(with_control_penalty(p, weight) for p in plants)
    return Polytope(paid, tuple(MappingProxyType({}) for _ in plants))


def _of_system(
    system: UncertainSystem,
    controls: SignalChoice,
    measurements: SignalChoice | None,
    weight: ArrayLike | None,
) -> Polytope:
    for element in system.elements.values():
        if not isinstance(element, RealElement):
            remedy = "Use robust_output_feedback for dynamics and complex numbers."
            raise misfit("plant", f"{element.name}, {element}", "real numbers only", remedy)
    count = len(system.elements)
    if not 1 <= count <= _MOST_NUMBERS:
        want = f"1 to {_MOST_NUMBERS}, which have {2**_MOST_NUMBERS} vertices at most"
        raise invalid("plant", described(f"{count} uncertain numbers"), want, "Fix some with .at.")
    inputs = _last("controls", controls, system.input_labels, "inputs")
    outputs = _last("measurements", measurements or 0, system.output_labels, "outputs")
    nu, ny = len(inputs[1]), len(outputs[1])
    if not system.nstates:
        shown = described("a matrix without states")
        raise invalid("plant", shown, "a system with states", "Make it with uncertain_system.")
    ordered = system[[*outputs[0], *outputs[1]], [*inputs[0], *inputs[1]]]
    ends = [[(one.name, one.low), (one.name, one.high)] for one in real_numbers(system)]
    points = tuple(MappingProxyType(dict(corner)) for corner in itertools.product(*ends))
    plants = tuple(
        GeneralizedPlant(ordered.at(point), measurements=ny, controls=nu) for point in points
    )
    paid = tuple(with_control_penalty(plant, weight) for plant in plants)
    whole = _with_prices(ordered, paid[0], len(outputs[0]))
    return Polytope(paid, points, whole, affine_warps(ordered.matrices))


def _with_prices(system: UncertainSystem, priced_plant: GeneralizedPlant, nz: int) -> Any:
    """Return the system with the prices of a plant among its outputs, behind its first z."""
    one, D = system.matrices, priced_plant.D12[nz:]
    if not len(D):
        return system
    J = np.hstack([np.zeros((len(D), one.J.shape[1] - D.shape[1])), D])
    outputs = system.output_labels
    return UncertainSystem(
        replace(
            one,
            H=np.vstack([one.H[:nz], np.zeros((len(D), one.H.shape[1])), one.H[nz:]]),
            J=np.vstack([one.J[:nz], J, one.J[nz:]]),
            outputs=(*outputs[:nz], *priced_plant.performance_names[nz:], *outputs[nz:]),
        )
    )


def real_numbers(system: UncertainSystem) -> tuple[RealElement, ...]:
    """Return the real numbers of a system, in the order of its blocks."""
    return tuple(e for e in system.elements.values() if isinstance(e, RealElement))


def _last(
    argument: str, given: SignalChoice, labels: Sequence[str], what: str
) -> tuple[list[str], list[str]]:
    """Return the other signals and the chosen ones, each by name."""
    if is_whole(given):
        if not 0 <= given <= len(labels):
            raise invalid(argument, given, f"0 to {len(labels)}", f"Count the last {what}.")
        chosen = list(labels[len(labels) - int(given) :])
    else:
        chosen = chosen_names(argument, given, labels, what)
    return [name for name in labels if name not in chosen], chosen


def require_equal(whole: Polytope, names: Sequence[str]) -> Polytope:
    """Refuse vertices whose matrices of these names differ, but for rounding, which is taken out.

    Raises
    ------
    InvalidInputError
        It tells how to put a filter between.
    """
    first = whole.plants[0]
    equal = {name: getattr(first, name) for name in names}
    for name, matrix in equal.items():
        size = max(float(np.abs(getattr(p, name)).max(initial=0.0)) for p in whole.plants)
        for p in whole.plants:
            # Entries below this beside the others are what rounding leaves of a zero.
            if np.abs(getattr(p, name) - matrix).max(initial=0.0) > ROUNDING * size:
                remedy = (
                    "Put a fast lag before the controls: plant * "
                    "rp.uncertain.append(np.eye(nw), lag)."
                    if name in ("B2", "D12")
                    else "Put a fast lag behind the measurements: "
                    "rp.uncertain.append(np.eye(nz), lag) * plant."
                )
                shown = described(f"numbers that {name} depends on")
                raise invalid("plant", shown, f"the same {name} at all corners", remedy)
    return replace(whole, plants=tuple(p.replace(**equal) for p in whole.plants))


def affine_warps(system: Lft) -> tuple[float, ...] | None:
    """Return how each number has to be bent for every entry to be affine in it, the others held.

    With one number at a time on a line, every plant of the box is a mixture of its corners. It is
    so if no number acts back on others through which it is reached, and on itself by a factor at
    most: then v = delta / (1 - bend delta) stands for the number, as for k / m it is 1 / m.

    Parameters
    ----------
    system : Lft

    Returns
    -------
    tuple of float or None
        One for each block, between -1 and 1; None if there is no such way.
    """
    n = len(system.states)
    slices = block_slices(system)
    size = max(1.0, float(np.abs(system.F[n:, n:]).max(initial=0.0)))
    reaches = np.zeros((len(slices), len(slices)), bool)
    bends = []
    for i, (z, _) in enumerate(slices):
        for j, (_, w) in enumerate(slices):
            part = system.F[z][:, w]
            if i == j:
                bends.append(float(np.trace(part)) / len(z))
                part = part - bends[-1] * np.eye(len(z))
            reaches[i, j] = np.abs(part).max(initial=0.0) > ROUNDING * size
    # No path leads from a number back to it if powers of the pattern vanish.
    power = np.linalg.matrix_power(reaches.astype(float), len(slices))
    if power.any() or max(map(abs, bends), default=0.0) >= 1:
        return None
    return tuple(0.0 if abs(bend) <= ROUNDING else bend for bend in bends)


# How far above the smallest bound proofs are tried: near it no strict inequality is left.
_SLACKS = (3e-4, 3e-3, 3e-2)


def _turned(loop: BallSystem, T: Matrix, unit: float) -> BallSystem:
    """Return the loop in states x = T x_new, with its gain over a power of four."""
    into, root = balls.ball(T), flint.arb(math.sqrt(unit))
    A, B, C, D = loop.transformed(into.inv(), into)
    return BallSystem(A, B * (1 / root), C * (1 / root), D * (1 / flint.arb(unit)))


class ProgramResult(NamedTuple):
    """What a program gave, in doubles that are not verified.

    Attributes
    ----------
    square : float
        Of the bound.
    P : list of ndarray
        The Lyapunov matrices of the family.
    X : Slack or None
        None where it is made of P.
    V : ndarray or None
        The slack of the H2 norm.
    Z : list of ndarray
    """

    square: float
    P: list[Matrix]
    X: Slack | None
    V: Matrix | None
    Z: list[Matrix]


def prove(
    loops: Sequence[BallSystem],
    specification: PolytopeSpecification,
    solver: ProgramSolver,
    guess: float,
) -> float | None:
    """Prove that all mixtures of loops are stable, and return the smallest bound that is proven.

    Parameters
    ----------
    loops : sequence of BallSystem
        At the vertices, in scaled units.
    specification : PolytopeSpecification
        Of what changes with time the H-infinity norm is the largest ratio of energies of z and w.
    solver : ProgramSolver
    guess : float
        About how large the norm is.

    Returns
    -------
    float or None
        None if there is none, or none was found.
    """
    # A power of four has a root that is a power of two, and rounds nothing.
    unit = float(4.0 ** round(math.log(guess, 4))) if 0 < guess < math.inf else 1.0
    T = np.eye(loops[0].A.nrows())
    least, same = math.inf, all(loop.C == loops[0].C for loop in loops)
    with balls.precision(BITS):
        for _ in range(2):
            inside = [_turned(loop, T, unit) for loop in loops]
            first = lyapunov_analysis([x.doubles for x in inside], specification, solver, same)
            if first is None:
                return None
            least = first.square
            better = _square_root(specification.mean(first.P))
            if better is None:
                break
            T = T @ better
        inside = [_turned(loop, T, unit) for loop in loops]
        doubles = [x.doubles for x in inside]
        for slack in _SLACKS:
            if solver.budget.over:
                return None
            limit = least * (1 + slack) ** 2
            found = lyapunov_analysis(doubles, specification, solver, same, limit)
            bound = found and _checked(inside, specification, found, math.sqrt(limit))
            if bound is not None:
                return math.nextafter(bound * unit, math.inf)
    return None


def lyapunov_analysis(
    loops: Sequence[tuple[Matrix, Matrix, Matrix, Matrix]],
    specification: PolytopeSpecification,
    solver: ProgramSolver,
    same: bool,
    limit: float | None = None,
) -> ProgramResult | None:
    """Return matrices for the smallest norm; with a limit on its square, the most strict ones.

    `same` says whether all loops have the same C, beside which no slack is needed.
    """
    n, nz = len(loops[0][0]), len(loops[0][3])
    program = PolytopeProgram(specification, n)
    hinf, tied = specification.norm == "hinf", specification.tied
    rows = (n, n, nz if hinf else 0)
    X = None if tied else tuple(program.matrix(count, n) for count in rows)
    V = None if same or tied or hinf else program.matrix(n, n)
    square = program.scalar() if limit is None else Affine.of(limit)
    margin = None if limit is None else program.scalar()
    energies = []
    a, b = specification.tied_weights
    for i, (A, B, C, D) in enumerate(loops):
        P = specification.at(i, program.matrices)
        seen = specification.seen(C)
        S = with_slack(X or (P * a, P * b, Affine.of(np.zeros((len(seen), n)))), A, seen)
        CV = C @ (P if V is None else V)
        energies.append(program.impose(i, S, CV, V, (B, D), square, margin))
    program.minimise(square if margin is None else -margin)
    solution = solver.solve(program)
    if solution.x is None:
        return None

    def symmetric(unknowns: Iterable[Affine | None]) -> list[Matrix]:
        values = [solution.value(M) for M in unknowns if M is not None]
        return [(M + M.T) / 2 for M in values]

    return ProgramResult(
        solution.value(square).item(),
        symmetric(program.matrices),
        None if X is None else tuple(solution.value(M) for M in X),
        None if V is None else solution.value(V),
        symmetric(energies),
    )


def _checked(
    loops: Sequence[BallSystem],
    specification: PolytopeSpecification,
    found: ProgramResult,
    gamma: float,
) -> float | None:
    """Return the bound that the matrices prove in ball arithmetic; None if they prove none."""
    hinf = specification.norm == "hinf"
    matrices = [balls.ball(M) for M in found.P]
    largest = flint.arb(0)
    for i, loop in enumerate(loops):
        P = specification.at(i, matrices)
        if not is_definite(P):
            return None
        for rate in specification.rates(matrices):
            level = gamma if hinf else None
            rate = P * 0 if rate is None else rate
            M = _dissipation(P, rate, found.X, loop, level, specification)
            if not is_definite(-M):
                return None
        if not hinf:
            Z = balls.ball(found.Z[i])
            if not is_definite(_energy(Z, loop, found.V, P)):
                return None
            trace = sum((Z[k, k] for k in range(Z.nrows())), flint.arb(0))
            largest = max(largest, flint.arb(trace.upper()), key=lambda x: float(x.upper()))
    if hinf:
        return gamma
    return math.nextafter(math.sqrt(math.nextafter(float(largest.upper()), math.inf)), math.inf)


def _dissipation(
    P: Ball,
    rate: Ball,
    slack: Slack | None,
    loop: BallSystem,
    gamma: float | None,
    specification: PolytopeSpecification,
) -> Ball:
    """Return the matrix that has to be negative definite."""
    n, nw = P.nrows(), loop.B.ncols()
    # For the H2 norm nothing is seen, which leaves w and its rows out.
    C = loop.C if gamma is not None else balls.zeros(0, n)
    D = loop.D if gamma is not None else balls.zeros(0, nw)
    nz = C.nrows()
    if slack is None:
        a, b = specification.tied_weights
        X = balls.block([[P * a], [P * b], [balls.zeros(nz, n)]])
    else:
        X = balls.block([[balls.ball(M)] for M in slack])
    none, side, low = balls.zeros(n, n), balls.zeros(n, nz), balls.zeros(nz, n)
    Q = [[P, none], [none, -P]] if specification.discrete else [[none, P], [P, -rate]]
    level = balls.identity(nz) * (flint.arb(gamma or 0.0) ** 2)
    whole = balls.block([[*Q[0], side], [*Q[1], side], [low, low, -level]])
    S = X * balls.block([[-balls.identity(n), loop.A.transpose(), C.transpose()]])
    whole = whole + S + S.transpose()
    source = balls.block([[balls.zeros(n, nw)], [loop.B], [D]])
    M = balls.block([[whole, source], [source.transpose(), -balls.identity(nw)]])
    if specification.tied and not specification.discrete:
        return balls.part(M, slice(n, None), slice(n, None))
    return M


def _energy(Z: Ball, loop: BallSystem, V: Matrix | None, P: Ball) -> Ball:
    """Return the matrix that has to be positive for Z >= C P C' + D D'."""
    slack = P if V is None else balls.ball(V)
    CV = loop.C * slack
    between = P if V is None else slack + slack.transpose() - P
    none = balls.zeros(P.nrows(), loop.D.ncols())
    return balls.block(
        [
            [Z, CV, loop.D],
            [CV.transpose(), between, none],
            [loop.D.transpose(), none.transpose(), balls.identity(loop.D.ncols())],
        ]
    )


def _square_root(P: Matrix) -> Matrix | None:
    values, vectors = np.linalg.eigh((P + P.T) / 2)
    if not (np.isfinite(values).all() and values[-1] > 0):
        return None
    return vectors * np.sqrt(np.maximum(values, 1e-10 * values[-1]))


# Loops at the vertices, connected without rounding, and the loop of an uncertain system.


def state_loop(p: PlantMatrices, F: Matrix) -> BallSystem:
    """Return the loop of u = F x in balls."""
    n = p.nx
    seen = replace(p, C2=np.eye(n), D21=np.zeros((n, p.nw)), D22=np.zeros((n, p.nu)))
    none = np.zeros((0, 0)), np.zeros((0, n)), np.zeros((p.nu, 0))
    return output_loop(seen, Controller(*none, F))


def output_loop(p: PlantMatrices, K: Controller) -> BallSystem:
    """Return the loop of a dynamic controller in balls, for a plant without D22."""
    with balls.precision(BITS):
        return BallSystem.closed_loop(p, K)


def uncertain_loop(system: UncertainSystem, nz: int, F: Matrix) -> UncertainSystem:
    """Return an uncertain system, its last inputs closed by u = F x, with its first outputs."""
    one = system.matrices
    n, inside = len(one.states), one.F.shape[1]
    seen = replace(
        one,
        H=np.vstack([one.H[:nz], np.eye(n, inside)]),
        J=np.vstack([one.J[:nz], np.zeros((n, one.J.shape[1]))]),
        outputs=(*system.output_labels[:nz], *(f"measured_{name}" for name in one.states)),
    )
    return UncertainSystem(seen).lft(F)
