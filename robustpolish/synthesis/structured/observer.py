"""State feedback of an observer's estimate: where to start, and the way back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, ClassVar, NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget, step_cost
from robustpolish.base.checks import matrix
from robustpolish.errors import InfeasibleError
from robustpolish.plants.blocks import named_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.nonsmooth.parametrisations import ObserverGain
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, regularise
from robustpolish.synthesis.problem.scaling import PlantPart
from robustpolish.synthesis.riccati.gamma import central_controller, normalise, search_gamma
from robustpolish.synthesis.structured.search import (
    POLICY,
    ControllerStructure,
    Norm,
    PartDesign,
    PartProblem,
    bound_in_words,
    norm_measure,
    scaled_part,
)
from robustpolish.synthesis.structured.starts import DrawnStarts, regulator

# Write a full-order controller as an observer with a state feedback.
#
# Any strictly proper controller of the plant's order is, in suitable coordinates, a Luenberger
# observer with u = F xhat (Bender and Fowell 1985; Alazard and Apkarian 1999). So the
# H-infinity problem over F and L, which is bilinear in (10.74) of the thesis, has the same infimum
# as the convex one over strictly proper controllers.

# Up to this many real poles and pairs every choice is tried; beyond, some drawn at random.
_ALL_CHOICES = 10
_DRAWN_CHOICES = 30


class ObserverForm(NamedTuple):
    """u = F xhat, xhat' = A xhat + B u + L (y - C xhat - D u), and how well it is conditioned."""

    F: Matrix
    L: Matrix
    condition: float


def observer_form(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, Ak: Matrix, Bk: Matrix, Ck: Matrix
) -> ObserverForm | None:
    """Find F and L whose observer-based controller equals a given one.

    The controller's state is T xhat with T of the invariant subspace [I; T] of the loop matrix;
    the loop's poles are then those of A + B F, chosen for the subspace, and of A - L C. Among the
    choices the one with the best conditioned T is taken.

    Parameters
    ----------
    A, B, C, D : ndarray
        The plant from u to y, with n states.
    Ak, Bk, Ck : ndarray
        A strictly proper controller with n states.

    Returns
    -------
    ObserverForm or None
        None if no choice gives an invertible T to working accuracy.
    """
    n = len(A)
    loop = np.block([[A, B @ Ck], [Bk @ C, Ak + Bk @ D @ Ck]])
    found = np.linalg.eig(loop)
    poles, vectors = np.asarray(found[0], complex), np.asarray(found[1], complex)
    best: ObserverForm | None = None
    for choice in _choices(poles, n):
        top, bottom = vectors[:n, choice], vectors[n:, choice]
        if np.linalg.cond(top) > 1e12:
            continue
        T = np.linalg.solve(top.T, bottom.T).T
        if np.abs(T.imag).max() > 1e-6 * np.abs(T).max():
            continue
        T = T.real
        condition = float(np.linalg.cond(T))
        if condition < 1e10 and (best is None or condition < best.condition):
            best = ObserverForm(Ck @ T, np.linalg.solve(T, Bk), condition)
    return best


def _choices(poles: NDArray[np.complex128], n: int) -> list[list[int]]:
    """Return sets of n poles closed under conjugation; all of them for small plants."""
    groups = _conjugate_groups(poles)
    if len(groups) <= _ALL_CHOICES:
        return [
            [i for group in members for i in group]
            for count in range(len(groups) + 1)
            for members in combinations(groups, count)
            if sum(map(len, members)) == n
        ]
    rng = np.random.default_rng(0)
    orders = [groups, groups[::-1]]
    orders += [[groups[i] for i in rng.permutation(len(groups))] for _ in range(_DRAWN_CHOICES)]
    filled = [_filled(order, n) for order in orders]
    return [choice for choice in filled if len(choice) == n]


def _filled(groups: list[list[int]], n: int) -> list[int]:
    """Take groups in their order as long as they fit."""
    choice: list[int] = []
    for group in groups:
        if len(choice) + len(group) <= n:
            choice.extend(group)
    return choice


def _conjugate_groups(poles: NDArray[np.complex128]) -> list[list[int]]:
    """Return the indices of real poles and of complex pairs, slow ones first."""
    order = sorted(range(len(poles)), key=lambda i: (-poles[i].real, abs(poles[i].imag)))
    groups: list[list[int]] = []
    used: set[int] = set()
    for i in order:
        if i in used:
            continue
        group = [i]
        rest = [j for j in order if j not in used and j != i]
        if poles[i].imag != 0 and rest:
            group.append(min(rest, key=lambda j: abs(poles[j] - np.conj(poles[i]))))
        used.update(group)
        groups.append(group)
    return groups


@dataclass(frozen=True, eq=False)
class ObserverStructure(ControllerStructure):
    """u = F xhat with a Luenberger observer, over F and L.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    gain_bound : float or None
    """

    norm: Norm
    gain_bound: float | None = None
    method: ClassVar[str] = "observer"

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over F and L of one part; see :meth:`Structure.problem`."""
        plant, what, hinf = part.plant, "observer-based controller", self.norm == "hinf"
        if 0 in (plant.nx, plant.nu, plant.ny):
            return None
        if not hinf and not plant.is_discrete and plant.D11.any():
            raise InfeasibleError(
                "The H2 norm is infinite for every observer-based controller: D11 passes the "
                "disturbance straight to z. Filter the disturbance or the output, or use 'hinf'."
            )
        scaled, inner = scaled_part(plant, what)
        form = ObserverGain(inner.A, inner.B2, inner.C2, inner.D22)
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=plant.nx,
            parametrisation=form,
            starts=(RiccatiStarts(inner, self.norm, form), DrawnStarts(-2, 0)),
            what=what,
            gain_bound=self.gain_bound,
            demands=bound_in_words(self.gain_bound),
            effort=POLICY.observer if hinf else POLICY.observer_h2,
        )

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the observer of the whole plant from F and L of its parts."""
        F, L = np.zeros((plant.nu, plant.nx)), np.zeros((plant.nx, plant.ny))
        for part, found in zip(parts, designs, strict=True):
            if found is None:
                continue
            scaled, P = found.scaled, found.scaled.plant
            own_F, own_L = ObserverGain(P.A, P.B2, P.C2, P.D22).split(found.point)
            own_L = scaled.state[:, None] * own_L / scaled.measurement / scaled.time
            F[np.ix_(part.controls, part.states)] = scaled.state_gain(own_F)
            L[np.ix_(part.states, part.measurements)] = own_L
        return observer_controller(plant, F, L), {
            "state_feedback": F,
            "observer_gain": L,
            "feedback_poles": np.linalg.eigvals(plant.A + plant.B2 @ F),
            "observer_poles": np.linalg.eigvals(plant.A - L @ plant.C2),
        }


def observer_controller(plant: GeneralizedPlant, F: ArrayLike, L: ArrayLike) -> control.StateSpace:
    """Return the observer (10.63) with u = F xhat as a controller u = K y.

    Parameters
    ----------
    plant : GeneralizedPlant
    F : array_like, shape (nu, nx)
        State feedback, the thesis's D_c.
    L : array_like, shape (nx, ny)
        Observer gain, the thesis's C_c.

    Returns
    -------
    control.StateSpace
        Its states are the estimates, named after the plant's states with ``_hat``.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> K = rp.synthesis.observer_controller(plant, [[-3.0]], [[4.0]])
    >>> sorted(plant.closed_loop(K).poles().real.round(9).tolist())
    [-3.0, -2.0]
    """
    F = matrix("F", F, (plant.nu, plant.nx))
    L = matrix("L", L, (plant.nx, plant.ny))
    A = plant.A + plant.B2 @ F - L @ (plant.C2 + plant.D22 @ F)
    states = [f"{name}_hat" for name in plant.states]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((A, L, F, np.zeros((plant.nu, plant.ny))), plant.dt, *names)


@dataclass(frozen=True, eq=False)
class RiccatiStarts:
    """The best few of central H-infinity controllers and LQG designs, as observers.

    Attributes
    ----------
    plant : PlantMatrices
        Scaled.
    norm : {"hinf", "h2"}
    form : ObserverGain
    coordinates : callable or None
        From K to the free numbers, if these are not F and L.
    """

    plant: PlantMatrices
    norm: Norm
    form: ObserverGain
    coordinates: Callable[[Matrix], Vector] | None = None

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the designs, the best first; F = 0 and L = 0 if there is none."""
        own = budget.share(POLICY.start_share)
        found: list[Vector] = []
        if self.norm == "hinf" and not self.plant.discrete:
            found.extend(_central(self.plant, self.form, own))
        plain = self.plant.without_d22()
        for epsilon in POLICY.epsilons:
            if found and own.over:
                break
            own.spend(2 * step_cost(2 * self.plant.nx))
            gains = _quadratic(plain, epsilon)
            if gains is not None:
                found.append(self.form.join(*gains))
        objective = norm_measure(augmented(self.plant, self.plant.nx), self.norm)

        def achieved(point: Vector) -> float:
            K = self.form.gain(point)
            if np.abs(K).max(initial=0.0) > POLICY.modest_entry or budget.over:
                return np.inf
            budget.spend(objective.work)
            pieces = objective.pieces(K, 0.0, ())
            return pieces[0].value if pieces else np.inf

        best = sorted(found, key=achieved)[: POLICY.proposals]
        for point in best or [np.zeros(self.form.size)]:
            yield point if self.coordinates is None else self.coordinates(self.form.gain(point))


def _quadratic(plant: PlantMatrices, epsilon: float) -> tuple[Matrix, Matrix] | None:
    """Return F and L of the H2 (LQG) design for the plant regularised by `epsilon`."""
    P = regularise(plant, epsilon)
    F = _h2_gain(P.A, P.B2, P.C1, P.D12, plant.discrete)
    L = _h2_gain(P.A.T, P.C2.T, P.B1.T, P.D21.T, plant.discrete)
    return None if F is None or L is None else (F, -L.T)


def _h2_gain(A: Matrix, B: Matrix, C: Matrix, D: Matrix, discrete: bool) -> Matrix | None:
    """Return the F that minimises the H2 norm of C + D F over A + B F."""
    return regulator(A, B, C.T @ C, D.T @ D, C.T @ D, discrete)


def _central(plant: PlantMatrices, form: ObserverGain, budget: Budget) -> Iterator[Vector]:
    """Propose central H-infinity controllers of regularised plants in observer form."""
    gamma, riccati = 1.0, 2 * step_cost(2 * plant.nx)
    for epsilon in POLICY.epsilons:
        if budget.over:
            return
        normal = normalise(regularise(plant.without_d22(), epsilon))
        bracket = search_gamma(normal.halves, gamma, 1e-3, budget)
        if bracket is None:
            continue
        gamma = bracket.upper
        # Regularisations of the scaled plant, and back-offs from the smallest gamma, of the
        # Riccati designs to start from: nobody knows which one is near the best observer.
        for back_off in (1.001, 1.005, 1.02, 1.2):
            # The observer form tries many invariant subspaces.
            budget.spend(riccati + 30 * step_cost(plant.nx))
            found = normal.halves.attempt(gamma * back_off)
            if not found.feasible or found.X is None or found.Y is None:
                continue
            K = central_controller(normal, gamma * back_off, found.X, found.Y)
            # Dk vanishes with D11; D22 is left out of the formulas and put back by the observer.
            observer = observer_form(plant.A, plant.B2, plant.C2, 0 * plant.D22, K.A, K.B, K.C)
            if observer is not None:
                yield form.join(observer.F, observer.L)
