"""The thresholds of designs for polytopes, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PolytopePolicy:
    """When a search for a polytope steps and stops.

    All numbers are relative or in scaled units, in which entries of the plant are about one.

    Attributes
    ----------
    most_numbers : int
        Each number doubles the vertices, and programs grow with them: 6 give 64.
    tilts : tuple of float
        Weights of the slack on the derivative of the state that are tried. Small ones come back to
        a common Lyapunov matrix, large ones leave the matrices freer; which is best depends on how
        fast the loop is in the plant's unit of time.
    rounds : int
        Programs solved again in the coordinates of the last answer.
    turns : int
        How often gain and slack are minimised in turn; each lowers the bound or leaves it.
    turn_rooms : tuple of float
        How far inside the inequalities the slack is taken between two turns. One far inside lets
        the gain move far, one near the edge moves it where that did not help.
    gain_of_turn : float
        A turn that lowers the bound by less is the last with its room.
    back_offs : tuple of float
        How far the gain may move from the smallest bound to get smaller, one after the other until
        a proof succeeds: it often grows without limit towards the optimum.
    broken : float
        A bound exceeded by more is broken: the smallest gains lie at the edge of inequalities whose
        numbers span twenty decades, and on some processors rounding carries them over it by 1e-3.
    room : float
        The same where an answer only serves for coordinates.
    slacks : tuple of float
        How far above the smallest bound proofs are tried: near it no strict inequality is left.
    shrinkings : int
        Halvings of the polytope's size when it is told for which part of it there is a gain.
    tolerance : float
        Of the solver.
    work : float
        Steps that one design may take.
    """

    most_numbers: int = 6
    tilts: tuple[float, ...] = (0.03, 0.1, 0.3, 1.0, 3.0)
    rounds: int = 2
    turns: int = 25
    turn_rooms: tuple[float, ...] = (0.1, 0.01, 0.001)
    gain_of_turn: float = 1e-3
    back_offs: tuple[float, ...] = (0.01, 0.03, 0.1)
    broken: float = 1e-6
    room: float = 0.3
    slacks: tuple[float, ...] = (3e-4, 3e-3, 3e-2)
    shrinkings: int = 5
    tolerance: float = 1e-9
    work: float = 100_000.0


POLICY = PolytopePolicy()
