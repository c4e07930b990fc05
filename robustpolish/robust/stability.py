"""How much uncertainty a loop bears before it gets unstable: proven below, witnessed above."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from robustpolish.analysis.poles.stability import stability
from robustpolish.display import Card, Displayed, quantities
from robustpolish.long_calls import same_bits
from robustpolish.models.uncertain.elements import ComplexElement, RealElement
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.all_pass import all_pass
from robustpolish.robust.coverage import Coverage
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.one_number import proven_size
from robustpolish.robust.search import bounds
from robustpolish.robust.witness import Witness
from robustpolish.validation import instance_of

Status = Literal["bracketed", "no witness", "incomplete", "unstable", "marginal", "unaffected"]

_SAYS = {
    "bracketed": "proven below, and reached by the witness",
    "no witness": "proven below; no search found a machine that is unstable",
    "incomplete": "not proven: the intervals do not cover the axis",
    "unstable": "the nominal loop is unstable",
    "marginal": "the nominal loop has a pole on the boundary of stability",
    "unaffected": "nothing that is uncertain acts back on itself: stable whatever it is",
}


@dataclass(frozen=True, eq=False, repr=False)
class RobustStability(Displayed):
    """How far the uncertainty of a loop may grow before it gets unstable.

    Attributes
    ----------
    lower, upper : float
        The margin lies between. The loop is stable for all uncertainty of size below `lower`,
        where 1 is what was said to be possible; and `witness` of size `upper` makes it unstable.
    critical_frequency : float
        In rad/s, where the witness puts a pole on the boundary of stability; infinite if the loop
        through it stops being well posed; nan without a witness.
    witness : mapping of str to float, complex or control.StateSpace
        The values of all that is uncertain, in their own units, for which that is so; of dynamics
        the part before their bound. Empty if none was found.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which the lower bound was proven; they cover the axis.
    status : {"bracketed", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        Whether both bounds are there, and why not.
    proven : bool
        Whether the lower bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain_real("c", 1, range=(0, 2))
    >>> mass = rp.uncertain_system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> margin = rp.robust_stability(mass)
    >>> round(margin.upper, 6), margin.status, margin.intervals
    (1.0, 'bracketed', ((0.0, inf),))
    """

    lower: float
    upper: float
    critical_frequency: float
    witness: Mapping[str, Any] = field(default_factory=dict)
    intervals: tuple[tuple[float, float], ...] = ()
    status: Status = "bracketed"
    proven: bool = False

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        return says(self.status)

    @property
    def robust(self) -> bool | None:
        """Whether every machine within the bounds is stable; None if neither is certain."""
        if self.proven and self.lower >= 1:
            return True
        return False if self.upper <= 1 else None

    def _card(self) -> Card:
        verdict = {True: "robustly stable", False: "not robustly stable", None: "undecided"}
        rows = (
            ("margin at least", self.lower),
            ("margin at most", self.upper),
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )
        title = f"Robust stability: {verdict[self.robust]}"
        return Card(title, (quantities(*rows),), (self.reason,))


@same_bits
def robust_stability(system: UncertainSystem) -> RobustStability:
    """Bound the margin of stability of an uncertain system over all frequencies.

    Parameters
    ----------
    system : UncertainSystem
        A closed loop, for example ``(plant * controller).feedback()``; continuous or discrete.

    Returns
    -------
    RobustStability
        A margin of 1.5 says that the loop is stable even if everything is off by 1.5 times as much
        as was said to be possible.

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system.

    Notes
    -----
    Below the lower bound, scalings D and G prove stability over intervals of frequency, whose ends
    are eigenvalues of a Hamiltonian matrix [1]_, all in ball arithmetic. The upper bound is a
    machine: real numbers, and for dynamics all-passes. Dynamics are any stable linear systems; of
    numbers it is assumed that they do not change with time. With many real numbers the two may be
    far apart.

    References
    ----------
    .. [1] C. Roos, J.-M. Biannic, "A detailed comparison of mu lower and upper bounds for large
       families of uncertain systems", IFAC-PapersOnLine 48 (2015); G. Ferreres, "A practical
       approach to robustness analysis with aeronautical applications", Kluwer (1999).

    Examples
    --------
    A spring that is known to 40 %, a gain that is off by 50 % at any frequency, and a PID:

    >>> import control
    >>> import robustpolish as rp
    >>> k = rp.uncertain_real("k", 10, percent=40)
    >>> plant = rp.uncertain_system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]])
    >>> plant = plant * (1 + 0.5 * rp.uncertain_dynamics("delta"))
    >>> s = control.tf("s")
    >>> loop = (plant * (2.3 + 3 / s + 0.38 * s / (0.001 * s + 1))).feedback()
    >>> margin = rp.robust_stability(loop)
    >>> round(margin.lower, 2), round(margin.upper, 2), margin.proven
    (1.6, 1.6, True)
    """
    checked(system)
    verdict = nominal_verdict(system)
    if verdict != "stable":
        status: Status = "marginal" if verdict == "marginal" else "unstable"
        return RobustStability(0.0, 0.0, math.nan, status=status)
    everywhere = ((0.0, math.inf),)
    if not system.blocks:
        return RobustStability(math.inf, math.inf, math.nan, {}, everywhere, "unaffected", True)
    loop = LoopModel.of(system)
    if not loop.acts_back:
        return RobustStability(math.inf, math.inf, math.nan, {}, everywhere, "unaffected", True)
    found = bounds(loop)
    coverage, witness = found.coverage, found.witness
    lower = proven_margin(coverage, loop.gain)
    intervals, proven = loop.in_rad_per_s(coverage.intervals), coverage.complete
    exact = proven_size(loop, witness.size) if witness else None
    if exact is not None:
        lower, intervals, proven = down(exact / loop.gain), everywhere, True
    upper, values, frequency = math.inf, {}, math.nan
    if witness is not None:
        upper, frequency = witness.size / loop.gain, loop.frequency(witness.at)
        values = named_values(system, loop, witness)
        frequency = loop.omega(frequency)
    status = "bracketed" if witness else "no witness"
    return RobustStability(
        lower,
        upper,
        frequency,
        values,
        intervals,
        status if proven else "incomplete",
        proven,
    )


def checked(system: Any) -> UncertainSystem:
    """Refuse what is not an uncertain system."""
    remedy = "Make it with uncertain_real and the like, or use stability."
    return instance_of("system", system, UncertainSystem, "an UncertainSystem", remedy)


def says(status: Status) -> str:
    """Return a status in a sentence."""
    return _SAYS[status]


def named_values(system: UncertainSystem, loop: LoopModel, witness: Witness) -> dict[str, Any]:
    """Return the values of the elements of a system that a witness stands for."""
    omega = loop.omega(loop.frequency(witness.at))
    values: dict[str, Any] = {}
    for block, delta in zip(system.blocks, witness.deltas, strict=False):
        own = loop.at_positive(delta, witness.at) / loop.gain
        element = block.element
        if isinstance(element, RealElement):
            values[element.name] = element.value(float(own[0, 0].real))
        elif isinstance(element, ComplexElement):
            values[element.name] = element.value(complex(own[0, 0]))
        else:
            values[element.name] = all_pass(own, omega, loop.step)
    return values


def nominal_verdict(system: UncertainSystem) -> str:
    """Say whether the nominal system is stable; without states it is."""
    if not system.nstates:
        return "stable"
    whole = system.interconnection
    return stability(whole).verdict


def proven_margin(coverage: Coverage, gain: float) -> float:
    """Return the size below which a level proves something: 0 if it is not proven."""
    if not coverage.complete:
        return 0.0
    return down(1 / (coverage.level * gain)) if coverage.level else math.inf


def down(value: float) -> float:
    """Return the next smaller double but one: what was divided is rounded."""
    return math.nextafter(math.nextafter(value, 0.0), 0.0)
