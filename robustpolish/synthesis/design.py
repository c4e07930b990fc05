"""What every synthesis returns: a controller, its loop, and what is known about both."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal, get_args

import control
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.base import saved
from robustpolish.base.arrays import AGREE
from robustpolish.base.budget import Budget
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.errors import SolverError
from robustpolish.implementation.certify_sampled import checked_plant, longest_period
from robustpolish.implementation.realization import METHODS
from robustpolish.implementation.sampled.certificate import AntiAliasing, filter_system, with_filter
from robustpolish.implementation.sampled_design import SampledDesign, discretized
from robustpolish.linear.norms.hinf import singular_values
from robustpolish.linear.stability import stability
from robustpolish.plants.blocks import GivenController, controller_system
from robustpolish.plants.plant import (
    GeneralizedPlant,
    check_size,
    plant_content,
    plant_from,
    system_content,
    system_from,
)
from robustpolish.plots.frequency import plot_gains
from robustpolish.synthesis.certificate import Certificate, certify, norm_in_words
from robustpolish.synthesis.problem.pole_regions import (
    Disk,
    HalfPlane,
    PassiveElement,
    PoleRegion,
    Sector,
)
from robustpolish.synthesis.problem.preflight import Status
from robustpolish.synthesis.reduce import is_shaped, reduce_controller, reduced_shaping
from robustpolish.synthesis.structured.block_parts import TunedBlocks

# What the file of a design holds: plant and controller are read, the rest is proven again.
#
# It lies below the design, which writes and reads itself with it.

_REGIONS = {"HalfPlane": HalfPlane, "Disk": Disk, "Sector": Sector}


def design_content(design: Any) -> dict[str, Any]:
    """Return what is written of a :class:`robustpolish.results.Design`."""
    certificate = design.certificate
    plainly = ("norm", "status", "message", "method", "backend", "elapsed")
    return {name: getattr(design, name) for name in plainly} | {
        "achieved": certificate.achieved,
        "claimed": certificate.claimed,
        "lower_bound": design.lower_bound,
        "plant": plant_content(design.plant),
        "controller": system_content(design.controller),
        "details": _writable_details(design.details),
        "history": [_writable_details(entry) for entry in design.history],
    }


_REMEDY = "Plant or controller were changed after saving; design it anew."


def _writable_details(details: Mapping[str, Any]) -> dict[str, Any]:
    """Return what can be written; certificates and the like can be computed again."""
    written = {key: _encode(value) for key, value in details.items()}
    return {key: value for key, value in written.items() if value is not _LEFT_OUT}


_LEFT_OUT = object()


def _encode(value: Any) -> Any:
    kind = value.dtype.kind if isinstance(value, np.ndarray | np.generic) else ""
    if isinstance(value, complex) or kind == "c":
        return {"complex": saved.plain([value.real, value.imag])}
    if value is None or isinstance(value, str | bool | int | float | np.generic):
        return saved.plain(value)
    if isinstance(value, np.ndarray):
        return {"array": saved.plain(value)} if kind in "biuf" else _LEFT_OUT
    if isinstance(value, control.StateSpace):
        return {"system": saved.plain(system_content(value))}
    if isinstance(value, PassiveElement):
        return {"element": [value.kind, list(value.between), value.coefficient, value.unit]}
    if isinstance(value, TunedBlocks):
        return {"blocks": value.content()}
    if type(value).__name__ in _REGIONS:
        return {"region": [type(value).__name__, *map(float, vars(value).values())]}
    if isinstance(value, list | tuple):
        items = [_encode(item) for item in value]
        return _LEFT_OUT if any(item is _LEFT_OUT for item in items) else items
    return {"table": _writable_details(value)} if isinstance(value, Mapping) else _LEFT_OUT


def _decode_table(table: saved.Fields) -> Mapping[str, Any]:
    return MappingProxyType({key: _decode(table, key, table.raw(key)) for key in table})


def _decode(table: saved.Fields, key: str, value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_decode(table, key, item) for item in value)
    if value in ("inf", "-inf", "nan"):
        return float(value)
    if not isinstance(value, dict):
        return value
    own = saved.Fields(value, f"{table.where}: {key}")
    body: Any
    kind, body = next(iter(value.items()), ("nothing", None))
    if kind == "system":
        return system_from(own.table(kind))
    if kind == "table":
        return _decode_table(own.table(kind))
    if kind not in _READERS:
        raise invalid(own.where, kind, "a known kind of detail", "Update robustpolish.")
    try:
        return _READERS[kind](body)
    except (TypeError, ValueError, KeyError, IndexError):
        raise invalid(own.where, value, f"a description of {kind}", "Save it again.") from None


def _complex(body: Any) -> Any:
    real, imaginary = np.array(body, dtype=float)
    joined = real + 1j * imaginary
    return joined if np.ndim(joined) else complex(joined)


_READERS: Mapping[str, Callable[[Any], Any]] = {
    "array": lambda body: np.array(body, dtype=float),
    "complex": _complex,
    "element": lambda body: PassiveElement(
        body[0], (body[1][0], body[1][1]), float(body[2]), body[3]
    ),
    "blocks": TunedBlocks.of_content,
    "region": lambda body: _REGIONS[body[0]](*map(float, body[1:])),
}


@dataclass(frozen=True, eq=False, repr=False)
class Design(Displayed):
    """A certified controller.

    Attributes
    ----------
    plant : GeneralizedPlant
        The plant that the controller was designed for, in its own units.
    controller : control.StateSpace
        K in u = K y; for a state feedback K is static and y is the state.
    closed_loop : control.StateSpace
        The system from w to z.
    norm : {"hinf", "h2"}
        The norm that was minimised.
    status : str
        "optimal": within the tolerance of `lower_bound`; "suboptimal": certified, but no
        claim of optimality (a constrained, nonconvex or stopped search);
        "infimum_not_attained": the infimum is only approached, by ever larger gains or by a
        limit; "time_limit": the best certified controller when the safety net in seconds stopped
        the search, so that another machine may find another one.
    message : str
        What happened, and what to try next.
    certificate : Certificate
        Computed afresh from the closed loop.
    method : str
        "lmi", "riccati", ...
    backend : str
        The library that solved it: "cvxpy", "picos", "slycot", "scipy", ...
    elapsed : float
        Seconds.
    history : tuple of mapping
        One entry per step of the search (such as per axis, or per gamma).
    details : mapping
        What the method wants to tell besides: diagnosis, observer gain, ...
    lower_bound : float or None
        A norm below which no controller of this kind comes (how that is known is told
        in the message); None if none is known, or the infimum is no more than estimated.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.given_controller(plant, [[-3.0]])
    Design (given): suboptimal
      plant               1 states, 1 controls, 1 measurements
      controller          a static gain
      H-infinity norm     0.5, proven to be at most 0.500005
      largest entry of K  3
      certificate         valid
      seconds             ...
      This controller was given; it is certified, not optimised.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    closed_loop: control.StateSpace
    norm: Literal["hinf", "h2"]
    status: Status
    message: str
    certificate: Certificate
    method: str
    backend: str
    elapsed: float
    history: tuple[Mapping[str, Any], ...] = ()
    details: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    lower_bound: float | None = None

    @property
    def gain(self) -> NDArray[np.float64] | None:
        """The matrix K of a static controller, shape (nu, ny); None for a dynamic one."""
        return np.array(self.controller.D) if self.controller.nstates == 0 else None

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the design to one JSON file, whole or not at all.

        Parameters
        ----------
        path : path
            Ends in ``.json``; its folder has to exist.
        force : bool, optional
            Replace an existing file.

        Raises
        ------
        InvalidInputError
            If the file exists and `force` is not set, or it cannot be written there.

        Examples
        --------
        >>> import os, tempfile
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> design = rp.given_controller(plant, [[-3.0]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     design.save(os.path.join(folder, "design.json"))
        ...     again = rp.results.Design.load(os.path.join(folder, "design.json"))
        >>> again.certificate.valid, float(again.gain[0, 0])
        (True, -3.0)
        """
        saved.write_saved(path, "design", design_content(self), force)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, max_bytes: float | None = None) -> Design:
        """Read a design from a file, and certify it again: the file is not believed.

        Parameters
        ----------
        path : path
            A file that :meth:`save` wrote.
        max_bytes : float, optional
            Largest size of the file in bytes, 2e8 by default.

        Returns
        -------
        Design
            Plant, controller and what the method told are those of the file; closed loop, poles,
            norm and proof are computed anew.

        Raises
        ------
        InvalidInputError
            If it is no such file, or if its controller does not earn a certificate for the norm
            that the file claims.

        Examples
        --------
        See :meth:`save`.

        >>> import robustpolish as rp
        >>> rp.results.Design.load("missing.json")
        Traceback (most recent call last):
        ...
        robustpolish.errors.InvalidInputError: path: got missing.json (No such file or directory)...
        """
        return design_from(saved.read_saved(path, "design", max_bytes))

    def reduce(self, order: int | None = None, tolerance: float | None = None) -> Design:
        """Shorten the controller, and certify its loop anew.

        Candidates are the controller's balanced truncation and residualisation, those of its
        normalised coprime factors (which an unstable one has too), and those weighted by what its
        states do inside the loop. The loop's norm decides, not the Hankel singular values. Of a
        design of :func:`robustpolish.loop_shaping` the gamma of the shaped loop decides: the
        controller between its weights is shortened, and the weights stay as they are.

        Parameters
        ----------
        order : int, optional
            Number of states of the new controller, those of weights counted; it has fewer where
            the rest does nothing.
        tolerance : float, optional
            Instead: the fewest states with which the norm rises by at most this part; 0.05, five
            percent, if neither is given.

        Returns
        -------
        Design
            With status "suboptimal", unless nothing could be left out. `details` tell the Hankel
            singular values of every way, and orders and norms before and after.

        Raises
        ------
        InvalidInputError
            If there is no such order.
        InfeasibleError
            If no candidate of this order keeps the loop stable; it tells which order does. Of loop
            shaping also if there is no room for the states of the weights.
        SolverError
            If a shaped loop could not be certified with its weights in the controller.

        Examples
        --------
        A filter that is much faster than the loop costs almost nothing to leave out:

        >>> import control
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> K = control.ss([[-1000.0]], [[1000.0]], [[-3.0]], 0)
        >>> design = rp.given_controller(plant, K).reduce(tolerance=0.01)
        >>> design.controller.nstates, round(float(design.gain[0, 0]), 6)
        (0, -3.0)
        """
        if is_shaped(self.details):
            found = reduced_shaping(self.plant, self.details, order, tolerance)
        else:
            given = self.plant, self.controller, self.certificate
            found = reduce_controller(*given, order, tolerance)
        if found.details["reduction"] == "none":
            details = MappingProxyType({**self.details, **found.details})
            return replace(self, message=f"{self.message} {found.message}", details=details)
        return replace(
            self,
            controller=found.controller,
            closed_loop=self.plant.closed_loop(found.controller),
            status="suboptimal",
            message=found.message,
            certificate=found.certificate,
            details=found.details,
            history=(),
        )

    def discretize(
        self,
        period: float,
        delay: float = 0.0,
        method: str = "tustin",
        *,
        prewarp_hz: float | None = None,
        anti_aliasing: AntiAliasing = None,
    ) -> SampledDesign:
        """Imitate the controller at samples, and certify the sampled loop.

        The loop has a sampler, the controller as a computer runs it, the time that this takes,
        and a zero-order hold. Its norm counts w and z at all times, not only at the samples.

        Parameters
        ----------
        period : float
            Seconds between samples.
        delay : float, optional
            Seconds from a sample until its control acts: any part or multiple of the period.
        method : str, optional
            "tustin", "zoh", "foh", "matched", "impulse", "forward" or "backward".
        prewarp_hz : float, optional
            Where "tustin" is exact, in Hz.
        anti_aliasing : float, (int, float) or control system, optional
            Analogue filter before the samplers: the corner of a Butterworth filter in Hz (second
            order), (order, corner in Hz), or a system. It is a part of the loop.

        Returns
        -------
        SampledDesign

        Raises
        ------
        InvalidInputError
            If an argument is wrong, or the plant is discrete already.
        InfeasibleError
            If the sampled loop is unstable; it tells the longest period that keeps it stable.
        SolverError
            If no bound could be proven.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> design = rp.given_controller(plant, [[-3.0]])
        >>> sampled = design.discretize(period=0.1, delay=0.05)
        >>> sampled.certificate.valid, round(sampled.certificate.bound, 3)
        (True, 0.502)
        >>> design.discretize(1.0)
        Traceback (most recent call last):
        ...
        robustpolish.errors.InfeasibleError: period: sampled every 1 s, the loop is unstable...
        """
        return discretized(
            self.plant,
            self.controller,
            period,
            delay,
            self.norm,
            self.certificate.achieved,
            method=method,
            prewarp_hz=prewarp_hz,
            anti_aliasing=anti_aliasing,
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the largest singular value from w to z without and with control.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            With the certified norm at its peak. Prices of control and measurement noise act in
            a closed loop only: the two loops are drawn without them, and a third curve shows what
            the norm is of.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.given_controller(plant, [[-3.0]]).plot().get_xlabel()
        'frequency'
        """
        open_loop, closed_loop = self.plant.open_loop, self.closed_loop
        without = "without control" + ("" if stability(open_loop) else " (unstable)")
        z, w = self._physical()
        loops = {without: open_loop[z, w], "with control": closed_loop[z, w]}
        if len(z) * len(w) < open_loop.noutputs * open_loop.ninputs:
            more = {"price": open_loop.noutputs > len(z), "noise": open_loop.ninputs > len(w)}
            added = " and ".join(name for name, there in more.items() if there)
            loops[f"with control, {added}"] = closed_loop
        unit, (z_units, w_units) = self.gain_unit, self._units()
        mixed = z_units and w_units and not unit
        shown = f"{', '.join(z_units)} per {', '.join(w_units)}" if mixed else unit
        # From the plant's own frequencies on: below them nothing happens in either loop.
        lowest = float(singular_values(open_loop)["frequency"].values.min())
        grids = [singular_values(loop)["frequency"].values for loop in loops.values()]
        grid = np.unique(np.concatenate(grids))
        grid = grid[grid >= lowest]
        gains = {name: singular_values(loop, grid)[:, 0] for name, loop in loops.items()}
        gains = {name: gain.assign_attrs(units=shown) for name, gain in gains.items()}
        achieved, peak = self.certificate.achieved, self.certificate.peak_frequency
        norm = f"norm {achieved:.4g} {unit}".rstrip()
        mark = {} if peak is None else {norm: (peak / (2 * np.pi), achieved)}
        return plot_gains(gains, mark, ax, first_style=0)

    def plot_poles(
        self, ax: Axes | None = None, *, regions: PoleRegion | Sequence[PoleRegion] | None = None
    ) -> Axes:
        """Draw the closed-loop poles, and the regions that they were to lie in.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        regions : HalfPlane, Disk, Sector or a sequence of them, optional
            By default the regions that were demanded of the design.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.given_controller(plant, [[-3.0]]).plot_poles().get_ylabel()
        'frequency [mHz]'
        """
        demanded = self.details.get("pole_regions", ()) if regions is None else regions
        return self.certificate.plot(ax, regions=demanded)

    def _physical(self) -> tuple[list[int], list[int]]:
        """Return the outputs z and inputs w that the plant has without control."""
        system = self.plant.open_loop
        z = np.hstack([system.C, system.D]).any(axis=1)
        w = np.vstack([system.B, system.D]).any(axis=0)
        if not (z.any() and w.any()):  # nothing reaches anything without control
            z, w = z | True, w | True
        return np.flatnonzero(z).tolist(), np.flatnonzero(w).tolist()

    @property
    def gain_unit(self) -> str:
        """Unit of the gain from w to z, if all z and all w have one each; "" otherwise."""
        z, w = self._units()
        return f"{z[0]}/{w[0]}" if len(z) == len(w) == 1 else ""

    def _units(self) -> tuple[list[str], list[str]]:
        """Return the units that are known of z and of w, each once."""
        known, plant = self.plant.units, self.plant
        z, w = (
            list(dict.fromkeys(known[name] for name in names if name in known))
            for names in (plant.performance_names, plant.disturbance_names)
        )
        return z, w

    def _card(self) -> Card:
        c, plant, order = self.certificate, self.plant, self.controller.nstates
        name = norm_in_words(self.norm)
        below = () if self.lower_bound is None else (f"{self.lower_bound:.6g}",)
        rows = (
            ("plant", f"{plant.nx} states, {plant.nu} controls, {plant.ny} measurements"),
            ("controller", f"{order} states" if order else "a static gain"),
            (f"{name} norm", f"{c.achieved:.6g}, proven to be at most {c.bound:.6g}"),
            *((f"no {name} norm below", bound) for bound in below),
            ("largest entry of K", f"{c.largest_gain:.6g}"),
            ("certificate", "valid" if c.valid else "NOT valid"),
            ("seconds", f"{self.elapsed:.2g}"),
        )
        tables = [quantities(*rows)]
        if self.details.get("elements"):
            found = [
                (e.kind, " and ".join(e.between), e.coefficient, e.unit)
                for e in self.details["elements"]
            ]
            head = ("element", "between", "coefficient", "unit")
            tables.append(Table("Springs and dampers", head, tuple(found)))
        if isinstance(self.details.get("blocks"), TunedBlocks):
            tables.extend(self.details["blocks"].tables())
        solved = self.backend not in ("none", self.method)
        how = f"{self.method}, {self.backend}" if solved else self.method
        notes = [self.message]
        if c.exact_delays is not None:
            notes.append(f"The certificate is {c.exact_delays}.")
        return Card(f"Design ({how}): {self.status}", tuple(tables), tuple(notes))


def design_from(fields: saved.Fields) -> Design:
    """Return the design in a file that has been opened, with a new certificate.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, if the controller does not earn a certificate, or if its
        loop has another norm than the file says.
    """
    plant = plant_from(fields.table("plant"))
    controller = system_from(fields.table("controller"))
    check_size(fields, plant.system, controller)
    norm = fields.text("norm", ("hinf", "h2"))
    claimed = None if fields.raw("claimed") is None else fields.number("claimed")
    certificate = certify(plant, controller, "h2" if norm == "h2" else "hinf", claimed)
    told = saved.confirm_norm(fields, certificate, _REMEDY)
    known = "lower_bound" in fields and fields.raw("lower_bound") is not None
    bound = fields.number("lower_bound") if known else None
    if bound is not None and bound > told * (1 + AGREE):
        shown = described(f"{bound:.6g} for a loop that has {told:.6g}")
        raise invalid(f"{fields.where}: lower_bound", shown, "at most the norm", _REMEDY)
    details = _decode_table(fields.table("details"))
    for region in details.get("pole_regions", ()):
        if not region.contains(certificate.poles):
            shown = described(f"a closed-loop pole outside {region}")
            raise invalid(f"{fields.where}: details", shown, "poles in their region", _REMEDY)
    status: Any = fields.text("status", get_args(Status))
    return Design(
        plant=plant,
        controller=controller,
        closed_loop=plant.closed_loop(controller),
        norm=certificate.norm,
        status=status,
        message=fields.text("message"),
        certificate=certificate,
        method=fields.text("method"),
        backend=fields.text("backend"),
        elapsed=fields.number("elapsed"),
        history=tuple(_decode_table(entry) for entry in fields.tables("history")),
        details=details,
        lower_bound=bound,
    )


# The check of what has to be a design.


def checked_design(argument: str, value: Any) -> Design:
    """Return `value` if it is a design; refuse a bare controller with the way to make it one.

    Examples
    --------
    >>> checked_design("design", -3.0)
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: design: got float, expected a Design. Pass what a
    synthesis returned, or given_controller(plant, K) for a controller K of your own.
    """
    own = "given_controller(plant, K) for a controller K of your own"
    remedy = f"Pass what a synthesis returned, or {own}."
    return instance_of(argument, value, Design, "a Design", remedy)


# A controller that somebody else designed, and how slowly any design may be sampled.


def given_controller(
    plant: GeneralizedPlant, controller: GivenController, norm: Literal["hinf", "h2"] = "hinf"
) -> Design:
    """Certify a given controller and return it as a design, to be simulated and compared.

    Parameters
    ----------
    plant : GeneralizedPlant
        Its measurements y are what the controller reads; for a state feedback pass
        ``plant.with_full_state()``.
    controller : control.StateSpace, control.TransferFunction or array_like, shape (nu, ny)
        K in u = K y (positive sign): a system or a gain.
    norm : {"hinf", "h2"}, optional
        The norm that is certified.

    Returns
    -------
    Design
        With status "suboptimal", since nothing was optimised.

    Raises
    ------
    InvalidInputError
        If plant and controller do not fit.
    SolverError
        If the loop cannot be certified, for instance because it is unstable.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.given_controller(plant, [[-3.0]]).certificate.valid
    True
    """
    clock = Budget()
    controller = controller_system(plant, controller)
    certificate = certify(plant, controller, norm)
    if not certificate.valid:
        why = "; ".join(certificate.reasons)
        raise SolverError(
            f"controller: not certified, because {why}. Check its sign (u = K y) and its units."
        )
    return Design(
        plant=plant,
        controller=controller,
        closed_loop=plant.closed_loop(controller),
        norm=norm,
        status="suboptimal",
        message="This controller was given; it is certified, not optimised.",
        certificate=certificate,
        method="given",
        backend="none",
        elapsed=clock.elapsed,
    )


def largest_period(
    design: Design,
    delay: float = 0.0,
    *,
    delay_periods: float = 0.0,
    method: str = "tustin",
    prewarp_hz: float | None = None,
    anti_aliasing: AntiAliasing = None,
) -> float:
    """Return the longest period up to which a design may be sampled without losing stability.

    Parameters
    ----------
    design : Design
        Of a continuous plant.
    delay : float, optional
        Seconds from a sample until its control acts, whatever the period.
    delay_periods : float, optional
        Delay in periods, which is added: 1.0 for a computer that needs the whole of each.
    method : str, optional
        How the controller is imitated; see :meth:`Design.discretize`. Not "matched", whose
        polynomials lose their digits at short periods.
    prewarp_hz : float, optional
        Where "tustin" is exact, in Hz.
    anti_aliasing : float, (int, float) or control system, optional
        Analogue filter before the samplers; see :meth:`Design.discretize`.

    Returns
    -------
    float
        In s; infinite if no period makes the loop unstable, 0 if none was found that keeps it
        stable: the delay is too long, or fast and slow poles differ by more than 1e9 or so, which
        doubles cannot tell apart at samples. At this period the loop is about to become unstable:
        sample several times faster.

    Raises
    ------
    InvalidInputError
        If an argument is wrong.

    Notes
    -----
    Periods are tried upwards, each 8 % longer than the one before, and the limit is bisected.

    Examples
    --------
    x' = x + u with u = -3 x, held for h, is stable while exp(h) - 3 (exp(h) - 1) > -1.

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> design = rp.given_controller(plant, [[-3.0]])
    >>> round(rp.synthesis.largest_period(design), 4)
    0.6931
    >>> round(rp.synthesis.largest_period(design, delay_periods=1.0), 4)
    0.2877
    """
    checked_design("design", design)
    plant = checked_plant(design.plant)
    known = [*(m for m in METHODS if m != "matched"), "bilinear", "euler", "backward_diff"]
    one_of("method", method, known, "Short periods spoil the polynomials of 'matched'.")
    return longest_period(
        with_filter(plant, filter_system(anti_aliasing, plant.ny)),
        design.controller,
        positive("delay", delay, "s", zero=True),
        delay_periods=positive("delay_periods", delay_periods, zero=True),
        method=method,
        prewarp_hz=None if prewarp_hz is None else positive("prewarp_hz", prewarp_hz, "Hz"),
    )
