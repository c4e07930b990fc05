"""Robust stability, robust performance, worst-case gain and the circle criterion, from mu."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.optimize import minimize

from robustpolish.base.arrays import SAME, AnyMatrix, Vector
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import described, instance_of, invalid, positive
from robustpolish.base.results import Card, Displayed, quantities, tables
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.stability import stability
from robustpolish.plants.uncertain.lft import ComplexElement, RealElement, constant, product
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.plots.frequency import plot_gains
from robustpolish.robust.bounds import EVERYWHERE, GAP, Bounds, bounds
from robustpolish.robust.loop_model import DeltaBlock, LoopModel
from robustpolish.robust.scalings import Inequality, Space, best_scalings, response
from robustpolish.robust.witness import Witness, all_pass, worst_delta

# Mu bounds over frequency, and the sensitivity to each block.

# Frequencies of a picture besides those of the poles, and decades beyond these.
_POINTS = 40
_BEYOND = 1.0
_DIRECTIONS = 2
# Relative change of a block's size from which its cost is taken.
_CHANGE = 0.05


Nominal = Literal["stable", "unstable", "marginal"]
Outcome = Literal["bracketed", "wide", "no witness", "incomplete"]
Status = Literal[Outcome, "unstable", "marginal", "unaffected"]


@dataclass(frozen=True, eq=False)
class AnalysedLoop:
    """The loop that a result is about.

    Attributes
    ----------
    loop : LoopModel
    unit : float
        Levels of the loop's model times this are what is drawn.
    fixed : tuple of bool
        Blocks that have size 1 whatever the level is; empty for none.
    at : float
        The critical frequency of the model; nan if none is known.
    system : UncertainSystem or None
        What the witness is to be put into.
    """

    loop: LoopModel
    unit: float
    fixed: tuple[bool, ...]
    at: float
    system: UncertainSystem | None = None

    @property
    def space(self) -> Space:
        """The scalings."""
        return Space(self.loop.structure, self.fixed)

    def bounds_at(self, x: float) -> tuple[float, float]:
        """Return both bounds at a frequency of the model; nan those that were not found."""
        try:
            M = response(self.loop.model, x)
        except np.linalg.LinAlgError:
            return math.nan, math.nan
        inequality = Inequality(self.space, M[None])
        level = best_scalings(inequality)
        if not math.isfinite(level.square):
            return math.nan, math.nan
        witness = worst_delta(inequality, level, _DIRECTIONS)
        lower = 1 / witness.size if witness else math.nan
        return lower * self.unit, level.level * self.unit

    def curves(self) -> xr.Dataset:
        """Return both bounds over frequency in Hz."""
        seeds = np.array([x for x in (*self.loop.seeds(), self.at) if 0 < x < math.inf] or [1.0])
        ends = np.log10(seeds.min()) - _BEYOND, np.log10(seeds.max()) + _BEYOND
        grid = np.unique(np.concatenate([np.logspace(*ends, _POINTS), seeds]))
        values = np.array([self.bounds_at(float(x)) for x in grid])
        hertz = [self.loop.omega(float(x)) / (2 * math.pi) for x in grid]
        return xr.Dataset(
            {"at least": ("frequency", values[:, 0]), "at most": ("frequency", values[:, 1])},
            coords={"frequency": ("frequency", hertz, {"units": "Hz"})},
        )

    def costs(self) -> dict[str, float]:
        """Return the relative change of the upper bound per relative change of a block's size."""
        M = response(self.loop.model, self.at)
        structure, found = self.loop.structure, {}

        def square(rows: slice, factor: float) -> float:
            scaled: AnyMatrix = M.copy()
            scaled[rows] *= factor
            return best_scalings(Inequality(self.space, scaled[None])).square

        width = math.log((1 + _CHANGE) / (1 - _CHANGE))
        sides = zip(structure.blocks, structure.inputs, self.space.fixed, strict=True)
        for block, rows, held in sides:
            if any(self.fixed) and not held:
                continue  # the gain itself, which is in proportion
            low, high = square(rows, 1 - _CHANGE), square(rows, 1 + _CHANGE)
            known = 0 < low < math.inf and 0 < high < math.inf
            found[block.name] = math.log(high / low) / 2 / width if known else math.nan
        return found


@dataclass(frozen=True, eq=False, repr=False)
class MuOverFrequency(Displayed):
    """A result about a loop, which can be looked at over frequency."""

    _asked: AnalysedLoop | None = field(default=None, kw_only=True)

    _drawn: ClassVar[str] = "structured singular value"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw both bounds over frequency, with the proven level and the critical frequency.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            Over frequency in Hz. What is drawn is computed at single frequencies: the proof is the
            level line, which holds between them too. The lower bound has gaps where no search found
            a witness, as real numbers reach the boundary at few frequencies.

        Raises
        ------
        InvalidInputError
            If there is no loop to draw: of a matrix, or where the nominal loop is not stable.
        """
        asked, (name, value, omega) = self._source(), self._shown()
        curves = asked.curves()
        marks: dict[str, tuple[float, float]] = {"proven": (math.nan, value[1])}
        if omega > 0:
            marks["critical frequency"] = (omega / (2 * math.pi), value[0])
        gains: dict[str, Any] = {str(k): curve for k, curve in curves.data_vars.items()}
        return plot_gains(gains, marks, ax, name=name)

    @cached_property
    def sensitivity(self) -> Mapping[str, float]:
        """How many percent the bound gets worse per percent that the range of each block grows.

        By name, at the critical frequency, from the bound by scalings: shares of the blame, whose
        sum is 1 for margins, where the performance block counts as one; of a worst-case gain they
        are what the gain rises by. A block of 0 can be forgotten, one of 0.9 is worth measuring.
        """
        asked = self._source()
        if math.isnan(asked.at):
            return {block.name: math.nan for block in asked.loop.structure.blocks}
        return asked.costs()

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        """Return what is drawn, its bounds, and the critical frequency in rad/s."""
        raise NotImplementedError

    def _source(self) -> AnalysedLoop:
        if self._asked is None:
            want = "the result of a stable loop in which something uncertain acts back"
            remedy = "Look at .status, which says what it is."
            raise invalid("result", described("no loop behind it"), want, remedy)
        return self._asked


@dataclass(frozen=True, eq=False, repr=False)
class Witnessed(MuOverFrequency):
    """A result about an uncertain system, with the machine that reaches its bound."""

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
        return status_sentence(self.status)

    def worst_plant(self) -> control.StateSpace:
        """Return the system at the witness.

        Returns
        -------
        control.StateSpace
            A complex number is replaced by a stable system that has its value at the critical
            frequency, and its size at all of them.

        Raises
        ------
        InvalidInputError
            If no witness was found.
        """
        asked = self._source()
        if not self.witness or asked.system is None:
            remedy = "Look at .status, which says why."
            raise invalid("result", described("no witness"), "one that was found", remedy)
        return system_at_witness(asked.system, self.witness, self._shown()[2], asked.loop.step)

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        mu = reciprocal(self.upper), reciprocal(self.lower)
        return self._drawn, mu, self.critical_frequency

    def _bounds_card(self, title: str, what: str, *more: tuple[str, float]) -> Card:
        """Return the card of a result with both bounds."""
        rows = (
            (f"{what} at least", self.lower),
            (f"{what} at most", self.upper),
            *more,
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )
        return Card(title, (quantities(*rows),), (self.reason,))


def system_at_witness(
    system: UncertainSystem, values: Mapping[str, Any], omega: float, step: float
) -> Any:
    """Return a system at a witness, with real systems for complex numbers."""
    found = {}
    for name, value in values.items():
        if isinstance(value, complex):
            nominal = getattr(system.elements[name], "nominal", 0.0)
            value = nominal + all_pass(np.array([[value - nominal]]), omega, step)
        found[name] = value
    return system.at(found)


# Bounds and witness in the units of the system, and their status.


_SAYS = tables(__file__)["status"]


def _physical_bounds(
    system: UncertainSystem,
    loop: LoopModel,
    gap: float,
    fixed: tuple[bool, ...] | None = None,
    unit: float | None = None,
) -> tuple[float, float, dict[str, Any]]:
    """Bound the peak of a loop of a system; pictures are drawn in a unit of the model's.

    Returns
    -------
    level : float
        Proven: below one over it nothing happens. Infinite if nothing is proven.
    size : float
        Of the witness; infinite without one.
    told : mapping of str to object
        What all results tell alike. Of the witness the values of all that is uncertain, empty
        without one, and the frequency in rad/s, nan without one.
    """
    found = bounds(loop, fixed, gap)
    coverage, witness = found.coverage, found.witness
    at = critical_frequency_of(loop, found)
    told = {
        "critical_frequency": loop.omega(loop.frequency(witness.at)) if witness else math.nan,
        "witness": _named_values(system, loop, witness) if witness else {},
        "intervals": loop.in_rad_per_s(coverage.intervals),
        "status": bound_status(found, gap),
        "proven": coverage.complete,
        "_asked": AnalysedLoop(loop, unit or loop.gain, fixed or (), at, system),
    }
    size = witness.size / loop.gain if witness else math.inf
    return (coverage.level * loop.gain if coverage.complete else math.inf), size, told


def _named_values(system: UncertainSystem, loop: LoopModel, witness: Witness) -> dict[str, Any]:
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


def nominal_status(system: control.StateSpace) -> Nominal:
    """Say whether a certain system is stable; without states it is."""
    return stability(system).verdict if system.nstates else "stable"


def bound_status(found: Bounds, gap: float) -> Outcome:
    """Say which bounds there are, and whether they are as near to each other as asked."""
    if not found.coverage.complete:
        return "incomplete"
    if found.witness is None:
        return "no witness"
    # Of the gap, which is a difference of nearly equal numbers.
    return "bracketed" if found.gap <= gap * (1 + SAME) else "wide"


def critical_frequency_of(loop: LoopModel, found: Bounds) -> float:
    """Return the frequency of a loop's model where its bounds are reached; nan if none is known."""
    if found.witness is not None:
        return loop.frequency(found.witness.at)
    return found.coverage.peaks[0][0] if found.coverage.peaks else math.nan


def reciprocal(value: float) -> float:
    """Return one over a number of at least 0."""
    return math.inf if value == 0 else 1 / value


def status_sentence(status: Status, side: Literal["below", "above"] = "below") -> str:
    """Return a status in a sentence; on the given side of the value is what is proven."""
    return _SAYS[status].format(side=side)


def reciprocal_below(value: float) -> float:
    """Return a reciprocal that is rounded towards 0: what is proven stays proven."""
    if value == 0:
        return math.inf
    return math.nextafter(math.nextafter(1 / value, 0.0), 0.0)


def round_up(value: float) -> float:
    """Return the next larger double but one: what was multiplied is rounded."""
    return math.nextafter(math.nextafter(value, math.inf), math.inf)


# Robust stability margin: proven below, witnessed above.


@dataclass(frozen=True, eq=False, repr=False)
class RobustStability(Witnessed):
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
    status : {"bracketed", "wide", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        Whether both bounds are there, and why not.
    proven : bool
        Whether the lower bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 1, range=(0, 2))
    >>> mass = rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> margin = rp.robust_stability(mass)
    >>> round(margin.upper, 6), margin.status, margin.intervals
    (1.0, 'bracketed', ((0.0, inf),))

    The machine at the witness, and what each number has to do with it:

    >>> margin.worst_plant().poles().real.round(6).tolist()
    [0.0, 0.0]
    >>> {name: round(share, 3) for name, share in margin.sensitivity.items()}
    {'c': 1.0}
    """

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        said = status_sentence(self.status)
        if math.isinf(self.critical_frequency):
            said += ", with which the loop is not well posed"
        return said

    @property
    def robust(self) -> bool | None:
        """Whether every machine within the bounds is stable; None if neither is certain."""
        if self.proven and self.lower >= 1:
            return True
        return False if self.upper <= 1 else None

    def _card(self) -> Card:
        verdict = {True: "robustly stable", False: "not robustly stable", None: "undecided"}
        return self._bounds_card(f"Robust stability: {verdict[self.robust]}", "margin")


@single_threaded_blas
def robust_stability(system: UncertainSystem, *, gap: float = GAP) -> RobustStability:
    """Bound the margin of stability of an uncertain system over all frequencies.

    Parameters
    ----------
    system : UncertainSystem
        A closed loop, for example ``(plant * controller).feedback()``; continuous or discrete.
    gap : float, optional
        Relative distance of both bounds that is small enough, 0.2 % by default. Where real numbers
        leave a larger one, it is closed by branch and bound if they are few, as far as a few
        seconds of work go.

    Returns
    -------
    RobustStability
        A margin of 1.5 says that the loop is stable even if everything is off by 1.5 times as much
        as was said to be possible.

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system, or the gap not positive.

    Notes
    -----
    Below the lower bound, scalings D and G prove stability over intervals of frequency, whose ends
    are eigenvalues of a Hamiltonian matrix [1]_, all in ball arithmetic. The upper bound is a
    machine: real numbers, and for dynamics all-passes. Dynamics are any stable linear systems; of
    numbers it is assumed that they do not change with time.

    With real numbers the two may be far apart. If there are few of them, and at most one other
    block, their box is halved again and again, together with the axis of frequencies, until the
    Bernstein coefficients of the characteristic polynomial prove each part [2]_. Beside several
    other blocks their box is halved too, and scalings prove each of up to two dozen parts.

    All of it is done in units of states, signals and time that follow from the loop itself: other
    units of the same loop give the same numbers but for rounding.

    References
    ----------
    .. [1] C. Roos, J.-M. Biannic, "A detailed comparison of mu lower and upper bounds for large
       families of uncertain systems", IFAC-PapersOnLine 48 (2015); G. Ferreres, "A practical
       approach to robustness analysis with aeronautical applications", Kluwer (1999).
    .. [2] M. Zettler, J. Garloff, "Robustness analysis of polynomials with polynomial parameter
       dependency using Bernstein expansion", IEEE Trans. Automatic Control 43 (1998) 425-431.

    Examples
    --------
    A spring that is known to 40 %, a gain that is off by 50 % at any frequency, and a PID:

    >>> import control
    >>> import robustpolish as rp
    >>> k = rp.uncertain.real("k", 10, percent=40)
    >>> plant = rp.uncertain.system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]])
    >>> plant = plant * (1 + 0.5 * rp.uncertain.dynamics("delta"))
    >>> s = control.tf("s")
    >>> loop = (plant * (2.3 + 3 / s + 0.38 * s / (0.001 * s + 1))).feedback()
    >>> margin = rp.robust_stability(loop)
    >>> round(margin.lower, 2), round(margin.upper, 2), margin.proven
    (1.6, 1.6, True)
    """
    require_uncertain_system(system)
    gap = positive("gap", gap)
    status = nominal_status(system.interconnection)
    if status != "stable":
        return RobustStability(0.0, 0.0, math.nan, status=status)
    loop = LoopModel.of(system)
    if not system.blocks or not loop.acts_back:
        return RobustStability(math.inf, math.inf, math.nan, {}, EVERYWHERE, "unaffected", True)
    level, size, told = _physical_bounds(system, loop, gap)
    return RobustStability(reciprocal_below(level), size, **told)


def require_uncertain_system(system: Any) -> UncertainSystem:
    """Refuse what is not an uncertain system."""
    remedy = "Make it with uncertain_real and the like, or use stability."
    return instance_of("system", system, UncertainSystem, "an UncertainSystem", remedy)


@dataclass(frozen=True, eq=False, repr=False)
class RobustPerformance(Witnessed):
    """How far the uncertainty may grow while the gain stays in proportion below a bound.

    Attributes
    ----------
    lower, upper : float
        The margin lies between. For all uncertainty of size below m = `lower` the gain stays below
        ``gamma / m``; and for the witness, of size `upper`, it is ``gamma / upper``.
    gamma : float
        The bound on the gain that a margin of 1 stands for.
    critical_frequency : float
        In rad/s, where the witness has this gain; nan without a witness.
    witness : mapping of str to float, complex or control.StateSpace
        Values of all that is uncertain, as of :class:`RobustStability`.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which the lower bound was proven; they cover the axis.
    status : {"bracketed", "wide", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        Whether both bounds are there, and why not.
    proven : bool
        Whether the lower bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.
    mu : (float, float)
        Bounds of the structured singular value with the performance block: one over the margin.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 1, range=(0, 2))
    >>> mass = rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> margin = rp.robust_performance(mass, gamma=5.0)
    >>> margin.proven, margin.upper / margin.lower < 1.002
    (True, True)
    """

    gamma: float = field(default=1.0, kw_only=True)

    @property
    def mu(self) -> tuple[float, float]:
        """Bounds of the structured singular value with the performance block."""
        return reciprocal(self.upper), reciprocal(self.lower)

    def _card(self) -> Card:
        verdict = "met" if self.proven and self.lower >= 1 else "not proven"
        title = f"Robust performance: {'not met' if self.upper < 1 else verdict}"
        return self._bounds_card(title, "margin", ("gain that 1 stands for", self.gamma))


@dataclass(frozen=True, eq=False, repr=False)
class WorstCaseGain(Witnessed):
    """The largest gain of all machines within the bounds.

    Attributes
    ----------
    lower, upper : float
        It lies between: the witness has the gain `lower`, and no machine has one above `upper`.
        Infinite if some machine within the bounds is unstable.
    nominal : float
        The gain of the nominal machine.
    critical_frequency : float
        In rad/s, where the witness has its gain.
    witness : mapping of str to float, complex or control.StateSpace
        Values of all that is uncertain, within the bounds, as of :class:`RobustStability`.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which the upper bound was proven; they cover the axis.
    status : {"bracketed", "wide", "no witness", "incomplete", "unstable", "marginal", "unaffected"}
        As of :class:`RobustStability`; "unstable" also if a machine within the bounds is.
    proven : bool
        Whether the upper bound is proven, in ball arithmetic, for all frequencies.
    reason : str
        The status in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 1, range=(0.5, 2))
    >>> mass = rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> rp.worst_case_gain(mass).proven
    True
    """

    nominal: float = field(kw_only=True)

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        if self.status == "unstable" and math.isfinite(self.nominal):
            return "a machine within the bounds is unstable: the witness"
        return status_sentence(self.status, "above")

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        return "worst-case gain", (self.lower, self.upper), self.critical_frequency

    def _card(self) -> Card:
        return self._bounds_card("Worst-case gain", "gain", ("nominal gain", self.nominal))


@single_threaded_blas
def robust_performance(
    system: UncertainSystem, gamma: float = 1.0, *, gap: float = GAP
) -> RobustPerformance:
    """Bound the margin of performance of an uncertain system over all frequencies.

    Parameters
    ----------
    system : UncertainSystem
        A closed loop with weights, whose largest gain is to stay below `gamma`.
    gamma : float, optional
        The bound; 1 by default.
    gap : float, optional
        Relative distance of both bounds that is small enough, as of :func:`robust_stability`.

    Returns
    -------
    RobustPerformance
        A margin m: the gain stays below ``gamma / m`` for all uncertainty of size up to m.

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system, or gamma or the gap not positive.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> error = rp.uncertain.dynamics("error", bound=0.2)
    >>> loop = rp.feedback(control.ss([[-1.0]], [[2.0]], [[1.0]], 0) * (1 + error))
    >>> margin = rp.robust_performance(loop, gamma=1.0)
    >>> round(margin.lower, 3), round(margin.upper, 3)
    (1.39, 1.391)
    """
    require_uncertain_system(system)
    gamma, gap = positive("gamma", gamma), positive("gap", gap)
    status = nominal_status(system.interconnection)
    if status != "stable":
        return RobustPerformance(0.0, 0.0, math.nan, status=status, gamma=gamma)
    scaled = UncertainSystem(product(constant(np.eye(system.noutputs) / gamma), system.matrices))
    loop = LoopModel.of(scaled, _performance(system))
    level, size, told = _physical_bounds(system, loop, gap)
    return RobustPerformance(reciprocal_below(level), size, gamma=gamma, **told)


@single_threaded_blas
def worst_case_gain(system: UncertainSystem, *, gap: float = GAP) -> WorstCaseGain:
    """Bound the largest gain of all machines within the bounds of an uncertain system.

    Parameters
    ----------
    system : UncertainSystem
        Continuous or discrete; the gain is the H-infinity norm from its inputs to its outputs.
    gap : float, optional
        Relative distance of both bounds that is small enough, as of :func:`robust_stability`.

    Returns
    -------
    WorstCaseGain

    Raises
    ------
    InvalidInputError
        If it is not an uncertain system, or the gap not positive.

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 0.4, percent=50)
    >>> mass = rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]])
    >>> worst = rp.worst_case_gain(mass)
    >>> round(worst.nominal, 2), round(worst.lower, 2), round(worst.witness["c"], 6)
    (2.55, 5.03, 0.2)
    """
    margin = robust_stability(system, gap=gap)
    status = "marginal" if margin.status == "marginal" else "unstable"
    if margin.upper <= 1:
        gain = math.inf if margin.upper == 0 else _nominal_gain(system)
        where = margin.critical_frequency, margin.witness
        return WorstCaseGain(math.inf, math.inf, *where, (), status, nominal=gain)
    nominal = _nominal_gain(system)
    loop = LoopModel.of(system, _performance(system))
    unit = nominal or 1.0
    fixed = (True,) * len(system.blocks) + (False,)
    level, size, told = _physical_bounds(system, loop.in_unit_of_gain(unit), gap, fixed, unit)
    lower = nominal
    if math.isfinite(size):
        told["witness"] = _within(system, told["witness"])
        omega = told["critical_frequency"]
        machine = system_at_witness(system, told["witness"], omega, loop.step)
        lower = max(lower, _gain_at(machine, omega))
    upper = max(math.nextafter(level * unit, math.inf), lower)
    return WorstCaseGain(lower, upper, nominal=nominal, **told)


def _performance(system: UncertainSystem) -> DeltaBlock:
    """Return the block from the outputs back to the inputs that stands for a bound on the gain."""
    ny, nu = system.shape
    if not (ny and nu):
        shown = described(f"{ny} outputs and {nu} inputs")
        raise invalid("system", shown, "at least one of each", "Choose the signals to be judged.")
    return DeltaBlock("complex" if ny == nu == 1 else "full", 1, nu, ny, "performance")


def _within(system: UncertainSystem, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with numbers that rounding has put just outside their range at its end."""
    real = {n: e for n, e in system.elements.items() if isinstance(e, RealElement)}
    inside = {n: float(np.clip(values[n], e.low, e.high)) for n, e in real.items()}
    for group in {element.group for element in real.values() if element.group}:
        names = [name for name, element in real.items() if element.group == group]
        size = math.hypot(*(inside[name] for name in names))
        inside.update({name: inside[name] / max(size, 1.0) for name in names})
    return {**values, **inside}


def _gain_at(machine: Any, omega: float) -> float:
    """Return the largest singular value at a frequency."""
    value = machine
    if hasattr(machine, "dt") and math.isinf(omega):
        value = machine.D
    elif hasattr(machine, "dt"):
        step = 1 if machine.dt is True else machine.dt
        value = machine(np.exp(1j * omega * step) if step else 1j * omega)
    return float(np.linalg.norm(np.atleast_2d(value), 2))


def _nominal_gain(system: UncertainSystem) -> float:
    machine: Any = system.nominal
    static = isinstance(machine, float | np.ndarray)
    return _gain_at(machine, 0.0) if static else hinf_norm(machine).value


# The circle criterion for uncertain loops with sector-bounded nonlinearities.

# Evaluations of the nominal norm in the search for scalings of several sectors.
_EVALUATIONS = 60


@dataclass(frozen=True, eq=False, repr=False)
class SectorStability(Displayed):
    """Whether a loop is stable with every nonlinear force in its sector, and on every machine.

    Attributes
    ----------
    lower, upper : float
        The criterion bears sectors that are wider about their middle by at least `lower` times, on
        every machine within the bounds; on the machine of `witness` no more than `upper` times.
        That says nothing of instability: the criterion is sufficient.
    proven : bool
        Whether `lower` is proven, in ball arithmetic and for all frequencies.
    critical_frequency : float
        In rad/s, where the criterion is hardest.
    witness : mapping of str to float, complex or control.StateSpace
        The machine on which it is hardest, by what is uncertain.
    sectors : mapping of str to (float, float)

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 0.4, percent=25)
    >>> mass = rp.uncertain.system(
    ...     [[0, 1], [-1, -c]], [[0], [1]], [[1, 0]], inputs=["spring"], outputs=["spring"])
    >>> found = rp.robust_sector(mass, {"spring": (0.0, 0.5)})
    >>> found.stable, found.proven, round(found.upper, 2)
    (True, True, 1.33)
    """

    lower: float
    upper: float
    proven: bool
    critical_frequency: float
    witness: Mapping[str, Any] = field(default_factory=dict)
    sectors: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def stable(self) -> bool | None:
        """True if the loop is stable with all such forces; None if the criterion does not say."""
        return True if self.proven and self.lower >= 1 else None

    def _card(self) -> Card:
        rows = (
            *((f"sector of {name}", f"{low:.4g} to {high:.4g}")
              for name, (low, high) in self.sectors.items()),
            ("width that it bears, at least", self.lower),
            ("at most", self.upper),
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )  # fmt: skip
        verdict = "stable" if self.stable else "undecided"
        note = "Stable with any such forces, also if they change with time, while they stay in it."
        return Card(f"Forces in sectors: {verdict}", (quantities(*rows),),
                    (note,) if self.stable else ())  # fmt: skip


@single_threaded_blas
def robust_sector(
    loop: UncertainSystem, sectors: Mapping[str, tuple[float, float]]
) -> SectorStability:
    """Prove a loop stable with nonlinear forces, on every machine within its bounds.

    Parameters
    ----------
    loop : UncertainSystem
        The closed loop without these forces. Each has an input, by which it acts, and an output of
        the same name, of which it is a function: ``u = -f(y, t)``.
    sectors : mapping of str to (float, float)
        By that name, the smallest and largest slope of lines through the origin between which the
        force lies: ``low y^2 <= f(y, t) y <= high y^2``.

    Returns
    -------
    SectorStability
        If it is stable: signals that are square integrable leave all others so.

    Raises
    ------
    InvalidInputError
        If a name is not both an input and an output, or a sector is empty.

    Notes
    -----
    The circle criterion [1]_: with the middle of the sectors put into the loop, what is left of the
    forces has at most their half widths as gain, and the small-gain theorem holds if the largest
    gain of the rest, in units of these, is below 1. That gain is bounded for every machine by
    :func:`worst_case_gain`. Several forces are weighed against each other by constants: scalings
    that change with frequency would prove nothing of nonlinear forces. A sector that holds up to an
    amplitude proves stability while the motion stays below it.

    References
    ----------
    .. [1] G. Zames, "On the input-output stability of time-varying nonlinear feedback systems",
       part II, IEEE Transactions on Automatic Control 11 (1966) 465-476.

    Examples
    --------
    A machine of uncertain damping with a hardening spring of 1 N/m^3 that is stretched by at most
    0.5 m:

    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 0.4, percent=25)
    >>> mass = rp.uncertain.system(
    ...     [[0, 1], [-1, -c]], [[0], [1]], [[1, 0]], inputs=["spring"], outputs=["spring"])
    >>> rp.robust_sector(mass, {"spring": (0.0, 1.0 * 0.5**2)}).stable
    True
    """
    require_uncertain_system(loop)
    if not isinstance(sectors, Mapping) or not sectors:
        raise invalid("sectors", sectors, "a mapping of names to (low, high)", "Name one at least.")
    known = sorted({*loop.input_labels} & {*loop.output_labels})
    ends = []
    for name, sector in sectors.items():
        if name not in known:
            listed = ", ".join(known) or "there is none"
            expected = f"names of both an input and an output: {listed}"
            raise invalid("sectors", name, expected, "Give the force an input and an output.")
        ends.append(_ends(name, sector))
    low, high = np.array(ends).T
    names = [*sectors]
    centred = loop[names, names].feedback(np.diag((low + high) / 2))
    half = (high - low) / 2
    scaled = _scaled(centred, half, _weights(centred, half))
    worst = worst_case_gain(scaled)
    lower, upper = reciprocal_below(worst.upper), reciprocal_below(worst.lower)
    where, told = worst.critical_frequency, dict(zip(names, ends, strict=True))
    return SectorStability(lower, upper, worst.proven, where, worst.witness, told)


def _ends(name: str, sector: Any) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in sector)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        remedy = "Write (0.0, 400.0)."
        raise invalid(("sectors", name), sector, "two numbers, the smaller first", remedy)
    return low, high


def _scaled(centred: UncertainSystem, half: Vector, weights: Vector) -> UncertainSystem:
    """Return the loop from forces to forces in units of half widths, weighed by constants."""
    return np.diag(half * weights) * centred * np.diag(1 / weights)


def _weights(centred: UncertainSystem, half: Vector) -> Vector:
    """Return constants that make the nominal gain small; any prove as much."""
    count = half.size
    if count == 1:
        return np.ones(1)

    def gain(logs: Vector) -> float:
        nominal: Any = _scaled(centred, half, np.exp2([0.0, *logs])).nominal
        system = hasattr(nominal, "poles")
        value = float(hinf_norm(nominal).value if system else np.linalg.norm(nominal, 2))
        return math.log(value) if 0 < value < math.inf else 0.0

    found = minimize(gain, np.zeros(count - 1), method="Nelder-Mead",
                     options={"maxfev": _EVALUATIONS, "xatol": 0.05})  # fmt: skip
    logs = found.x if np.isfinite(found.x).all() else np.zeros(count - 1)
    return np.exp2([0.0, *np.round(logs, 1)])
