"""Sampled controllers that a machine was measured with, or is simulated with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import control
import numpy as np
from scipy.linalg import block_diag
from scipy.signal import bilinear, tf2ss

from robustpolish.base.arrays import Array, Matrix
from robustpolish.base.checks import Key, described, invalid, matrix, one_of, positive
from robustpolish.base.saved import read_saved
from robustpolish.machines.mechanical.parts import number, text
from robustpolish.plants.plant import GeneralizedPlant, plant_from, system_from

_StateSpace = tuple[Matrix, Matrix, Matrix, Matrix]
_Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class FeedbackTerm:
    """What a controller makes of one error, ``reference - output``.

    ``(gain + integral / s + derivative s / (lag s + 1)) numerator(s) / denominator(s)``, imitated
    at samples by Tustin's rule; a derivative without `lag` is the difference of two samples.

    Parameters
    ----------
    of : str
        The output.
    gain, integral, derivative : float, optional
        In units of the command per unit of the output, per second, and times a second.
    lag : float, optional
        Time constant of the derivative's filter in s.
    reference : str, optional
        What the output shall be: a column of the record, or the command of another loop; 0 by
        default.
    quantum : float, optional
        Step of the sensor's converter as the controller sees it; none by default.
    numerator, denominator : sequence of float, optional
        A filter in s, highest power first.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.simulation.FeedbackTerm("x", 400.0, derivative=2.0, lag=1e-3, reference="x_ref").of
    'x'
    """

    of: str
    gain: float = 0.0
    integral: float = 0.0
    derivative: float = 0.0
    lag: float = 0.0
    reference: str = ""
    quantum: float = 0.0
    numerator: tuple[float, ...] = (1.0,)
    denominator: tuple[float, ...] = (1.0,)

    def discrete(self, period: float) -> _StateSpace:
        """Return what it does to its error at samples.

        Parameters
        ----------
        period : float
            Seconds between samples.

        Returns
        -------
        A, B, C, D : ndarray
        """
        late = [2 * self.lag + period, period - 2 * self.lag] if self.lag else [period, 0.0]
        slope = self.derivative * (2.0 if self.lag else 1.0)
        parts = [_state_space([self.gain], [1.0])]
        if self.integral:
            half = self.integral * period / 2
            parts.append(_state_space([half, half], [1.0, -1.0]))
        if self.derivative:
            parts.append(_state_space([slope, -slope], late))
        each = list(zip(*parts, strict=True))
        A: Any = block_diag(*each[0])
        B, C, D = np.vstack(each[1]), np.hstack(each[2]), np.sum(each[3], axis=0)
        if self.numerator == self.denominator == (1.0,):
            return A, B, C, D
        a, b, c, d = _state_space(*bilinear(self.numerator, self.denominator, 1 / period))
        return (
            np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]]),
            np.vstack([B, b @ D]), np.hstack([d @ C, c]), d @ D,
        )  # fmt: skip


def _state_space(numerator: Any, denominator: Any) -> _StateSpace:
    if len(np.atleast_1d(denominator)) == 1:
        gain = np.atleast_2d(np.asarray(numerator, dtype=float) / denominator)
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), gain
    A, B, C, D = tf2ss(numerator, denominator)
    return A, B, C, D


UNKNOWN = ("gain", "integral", "derivative", "lag")
"""Numbers of a term that a fit may be asked for, as ``"x.gain"``."""
_OWN = ("limit", "rate_limit", "delay")


@dataclass(frozen=True)
class Feedback:
    """A sampled controller in a loop with a machine.

    Each `period` it reads the outputs, and `delay` later its commands act, held until the next
    ones. A record of a machine in its loop then has references for inputs: comparisons, fits and
    diagnoses run the loop, whose commands need not have been recorded.

    Parameters
    ----------
    drives : str or sequence of str
        Force inputs of the machine that it commands, or a name that another loop has as reference.
    period : float
        Seconds between samples.
    terms : sequence of FeedbackTerm
        Their sum is the command; with `matrices` only which outputs these see, their references
        and quanta count.
    delay : float, optional
        Seconds from a sample until its command acts.
    limit : float or (float, float), optional
        Largest size of a command, or its lowest and highest value; of several a list of these
        pairs.
    rate_limit : float, optional
        Largest change of a command per second.
    quantum : float, optional
        Step of the converter that puts commands out.
    feedforward : sequence of str, optional
        Columns that are added to the command, before its limits.
    matrices : (A, B, C, D), optional
        A discrete controller in place of gains, ``u = K (output - reference)``: positive sign, as
        designs have it.
    anti_windup : bool or array_like, optional
        Whether integrals, or the states of `matrices`, move at a limit as if the errors had asked
        for what is put out (Hanus), where this is stable; or the gain L with which
        ``L (put out - wanted)`` is added to all states.
    unknown : sequence of str, optional
        Numbers of the loop that fits find, such as ``"limit"``, ``"rate_limit"``, ``"delay"`` or
        ``"x.gain"``; they all stay as they are by default.

    Raises
    ------
    InvalidInputError
        If a number or a name is wrong.

    Examples
    --------
    >>> import robustpolish as rp
    >>> position = rp.simulation.FeedbackTerm("x", 400.0, derivative=2.0, reference="x_ref")
    >>> loop = rp.simulation.Feedback("F", 1e-3, [position], limit=10.0)
    >>> loop.drives, loop.columns
    (('F',), ('x_ref',))
    """

    drives: tuple[str, ...] | str
    period: float
    terms: tuple[FeedbackTerm, ...] | Sequence[FeedbackTerm]
    delay: float = 0.0
    limit: float | Any = None
    rate_limit: float | None = None
    quantum: float = 0.0
    feedforward: tuple[str, ...] | Sequence[str] = ()
    matrices: tuple[_Rows, _Rows, _Rows, _Rows] | Any = None
    anti_windup: bool | Any = True
    unknown: tuple[str, ...] | Sequence[str] = ()

    def __post_init__(self) -> None:
        found: dict[str, Any] = {name: _names(name, getattr(self, name)) for name in _LISTS}
        found["terms"] = tuple(_term(i, term) for i, term in enumerate(self.terms))
        if not found["terms"]:
            raise invalid("term", described("none"), "one or more", "Add [[feedback.term]].")
        remedy = "Give the seconds between two samples of the controller."
        found["period"] = _positive("period", self.period, False, remedy)
        for name in ("delay", "quantum"):
            found[name] = _positive(name, getattr(self, name))
        if self.rate_limit is not None:
            found["rate_limit"] = _positive("rate_limit", self.rate_limit, False)
        found["limit"] = _limit(self.limit, len(found["drives"]))
        known = [name for name in _OWN if isinstance(found.get(name), float)]
        known += [f"{term.of}.{name}" for term in found["terms"] for name in UNKNOWN]
        for name in found["unknown"]:
            one_of("unknown", name, known, "Give it a start value.")
        found["matrices"] = _matrices(self.matrices, len(found["drives"]), len(found["terms"]))
        if not isinstance(self.anti_windup, bool):
            shape = (len(found["matrices"][0]) if self.matrices else None, len(found["drives"]))
            found["anti_windup"] = _rows(matrix("anti_windup", self.anti_windup, shape))
        if self.matrices is None and len(found["drives"]) > 1:
            remedy = "Write a loop for each input."
            raise invalid("drives", found["drives"], "one input, with gains", remedy)
        for name, value in found.items():
            object.__setattr__(self, name, value)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its references and of what is added to its commands."""
        return tuple(
            dict.fromkeys([t.reference for t in self.terms if t.reference] + [*self.feedforward])
        )

    @property
    def bounds(self) -> Array:
        """Lowest and highest commands, shape (2, commands)."""
        each = np.array((-math.inf, math.inf) if self.limit is None else self.limit)
        each = np.array([-each, each]) if each.ndim == 0 else each
        return np.broadcast_to(each, (len(self.drives), 2)).T

    @property
    def linear(self) -> Feedback:
        """The same without limits and steps."""
        terms = tuple(replace(term, quantum=0.0) for term in self.terms)
        kept = tuple(name for name in self.unknown if "limit" not in name)
        plain = replace(self, terms=terms, limit=None, rate_limit=None, quantum=0.0, unknown=kept)
        return self if plain == self else plain

    def numbers(self) -> dict[str, float]:
        """Return its numbers by name, as `unknown` names them; those of which there is none not."""
        found = {name: getattr(self, name) for name in _OWN}
        found |= {f"{t.of}.{name}": getattr(t, name) for t in self.terms for name in UNKNOWN}
        known = (*self.unknown, "delay")
        return {n: v for n, v in found.items() if isinstance(v, float) and (v or n in known)}

    def with_numbers(self, numbers: Mapping[str, float]) -> Feedback:
        """Return the loop with other numbers.

        Parameters
        ----------
        numbers : mapping of str to float
            By the names that :meth:`numbers` has.

        Returns
        -------
        Feedback
        """
        own = {name: value for name, value in numbers.items() if name in _OWN}
        terms = []
        for term in self.terms:
            named = {
                n.rpartition(".")[2]: v
                for n, v in numbers.items()
                if n.rpartition(".")[0] == term.of
            }
            terms.append(replace(term, **named) if named else term)
        return replace(self, terms=tuple(terms), **own)

    def discrete(self) -> tuple[_StateSpace, Matrix]:
        """Return A, B, C, D from errors (reference - output), then what is added, and the gain L.

        At a limit ``L (given - wanted)`` is added to the states.
        """
        return _discrete(self)


_LISTS = ("drives", "feedforward", "unknown")


@lru_cache(maxsize=64)
def _discrete(loop: Feedback) -> tuple[_StateSpace, Matrix]:
    A: Any  # types of scipy's blocks are none
    B: Any
    if loop.matrices is None:
        parts = [term.discrete(loop.period) for term in loop.terms]
        a, b, c, d = zip(*parts, strict=True)
        first = [(term.integral != 0, len(own)) for term, own in zip(loop.terms, a, strict=True)]
        sums = np.array([own and i == 0 for own, n in first for i in range(n)], dtype=bool)
        A, B, C, D = block_diag(*a), block_diag(*b), np.hstack(c), np.hstack(d)
    else:
        a, b, c, d = (np.array(rows, dtype=float) for rows in loop.matrices)
        n, nu, ny = len(a), len(loop.drives), len(loop.terms)
        A, B, C, D = a.reshape(n, n), -b.reshape(n, ny), c.reshape(nu, n), -d.reshape(nu, ny)
        sums = np.ones(n, dtype=bool)
    L = np.zeros((len(A), len(C)))
    if not isinstance(loop.anti_windup, bool):
        L += np.reshape(loop.anti_windup, L.shape)
    elif loop.anti_windup:
        hanus = B @ np.linalg.pinv(D) * sums[:, None]
        if np.max(np.abs(np.linalg.eigvals(A - hanus @ C)), initial=0.0) < 1:
            L = hanus
    more = len(loop.feedforward)
    B = np.hstack([B, np.zeros((len(B), more))])
    return (A, B, C, np.hstack([D, np.ones((len(D), more))])), L


def _names(where: str, value: Any) -> tuple[str, ...]:
    given = (value,) if isinstance(value, str) else value
    if not isinstance(given, Iterable):
        raise invalid(where, value, "a name, or a list of names", "Write them as text.")
    found = tuple(name if where == "unknown" else text(where, name) for name in given)
    if where == "drives" and not found:
        raise invalid(where, value, "an input of the machine", "Name the input.")
    return found


def _positive(where: str, value: Any, zero: bool = True, remedy: str = "") -> float:
    if value is None and remedy:
        raise invalid(where, described("no period"), "a time in s", remedy)
    return positive(where, number(where, value), zero=zero)


def _limit(value: Any, commands: int) -> Any:
    if value is None or isinstance(value, int | float):
        return None if value is None else _positive("limit", value, False)
    ends = np.asarray(value, dtype=float)
    fits = ends.shape in ((2,), (commands, 2)) and not np.isnan(ends).any()
    if not fits or not np.all(ends[..., 0] < ends[..., 1]):
        raise invalid("limit", value, "a size, or its ends, low < high", "Correct it.")
    return _rows(ends) if ends.ndim == 2 else tuple(ends.tolist())


def _rows(entries: Any) -> _Rows:
    return tuple(map(tuple, entries.tolist()))


def _term(i: int, term: Any) -> FeedbackTerm:
    where: Key = ("term", i)
    if not isinstance(term, FeedbackTerm):
        raise invalid(where, term, "a FeedbackTerm", "Use rp.simulation.FeedbackTerm(...).")
    if term.reference:
        text((*where, "reference"), term.reference)
    found: dict[str, Any] = {"of": text((*where, "of"), term.of)}
    for name in UNKNOWN:
        found[name] = number((*where, name), getattr(term, name))
    for name in ("lag", "quantum"):
        found[name] = positive(
            (*where, name), number((*where, name), getattr(term, name)), zero=True
        )
    for name in ("numerator", "denominator"):
        given = getattr(term, name)
        if not isinstance(given, Sequence) or not given:
            raise invalid((*where, name), given, "coefficients", "Write [1.0, 50.0].")
        found[name] = tuple(number((*where, name), c) for c in given)
    if found["denominator"][0] == 0 or len(found["numerator"]) > len(found["denominator"]):
        want, remedy = "at least as many poles as zeros", "Add a pole."
        raise invalid((*where, "denominator"), found["denominator"], want, remedy)
    return replace(term, **found)


def _matrices(value: Any, commands: int, outputs: int) -> Any:
    if value is None:
        return None
    if not isinstance(value, Sequence) or len(value) != 4:
        raise invalid("matrices", described(type(value).__name__), "A, B, C and D", "Give four.")
    n = len(np.atleast_1d(value[0]))
    shapes = {"A": (n, n), "B": (n, outputs), "C": (commands, n), "D": (commands, outputs)}
    found = []
    for (name, shape), entries in zip(shapes.items(), value, strict=True):
        given = np.asarray(entries, dtype=float)
        given = given.reshape(shape) if given.size == 0 and 0 in shape else given
        found.append(_rows(matrix(name, given, shape)))
    return tuple(found)


def feedback_from_file(path: Any, references: Mapping[str, str], **more: Any) -> Feedback:
    """Return the loop of a sampled design that was saved.

    Parameters
    ----------
    path : path
        What ``save`` of a sampled design wrote.
    references : mapping of str to str
        Columns with what outputs shall be, by output.
    **more
        Further parameters of :class:`Feedback`; its signals go by the names of the design.
    """
    fields = read_saved(path, "sampled design")
    K, plant = system_from(fields.table("controller")), plant_from(fields.table("plant"))
    own = {"delay": fields.number("delay"), "limit": limits_of(plant, K.output_labels)}
    return feedback_of(K, references, **{**own, **more})


def feedback_of(K: control.StateSpace, references: Mapping[str, str], **more: Any) -> Feedback:
    """Return the loop of a discrete controller, ``u = K y``, whose signals have their names."""
    seen = [name.removeprefix("measured_") for name in K.input_labels]
    terms = [FeedbackTerm(name, reference=references.get(name, "")) for name in seen]
    given = {"drives": tuple(K.output_labels), "period": float(K.dt), **more}
    return Feedback(terms=terms, matrices=(K.A, K.B, K.C, K.D), **given)


def limits_of(plant: GeneralizedPlant, commands: Sequence[str]) -> Any:
    """Return the limits of controls that a plant knows, None if it knows none."""
    sizes = [plant.limits.get(name, math.inf) for name in commands]
    return [(-size, size) for size in sizes] if np.isfinite(sizes).any() else None


def check_feedback(
    loops: Sequence[Any], inputs: Mapping[str, bool], outputs: Sequence[str]
) -> tuple[Feedback, ...]:
    """Return the loops of a model, each behind those whose commands are its references.

    Parameters
    ----------
    loops : sequence of Feedback
    inputs : mapping of str to bool
        The model's inputs, and whether each is a force.
    outputs : sequence of str

    Raises
    ------
    InvalidInputError
        If an input or an output is unknown, two loops drive one input, or loops go in circles.
    """
    commands: dict[str, int] = {}
    needed = {name for loop in loops if isinstance(loop, Feedback) for name in loop.columns}
    for i, loop in enumerate(loops):
        where: Key = ("feedback", i)
        if not isinstance(loop, Feedback):
            raise invalid(where, loop, "a Feedback", "Use rp.simulation.Feedback(...).")
        for name in loop.drives:
            if name in commands:
                shown = described(f"{name!r}, which loop {commands[name]} drives already")
                raise invalid((*where, "drives"), shown, "an input of its own", "Join the loops.")
            commands[name] = i
            forces = [known for known, force in inputs.items() if force]
            if name not in needed:
                one_of((*where, "drives"), name, forces, "Name a force input of the machine.")
        for k, term in enumerate(loop.terms):
            at = (*where, "term", k, "of")
            one_of(at, term.of, outputs, "Name an output: controllers see nothing else.")
        for name in loop.columns:
            if name in outputs:
                shown = described(f"{name!r}, an output of the machine")
                want = "what is known before: a column, or the command of another loop"
                raise invalid((*where, "reference"), shown, want, "Write a term of this output.")
    left, order = dict(enumerate(loops)), []
    while left:
        waiting = {name for loop in left.values() for name in loop.drives}
        ready = [i for i, loop in left.items() if not waiting & {*loop.columns}]
        if not ready:
            shown = described(f"references that go in a circle: {', '.join(sorted(waiting))}")
            want, remedy = "no algebraic loop", "Let one of them have another reference."
            raise invalid(("feedback", min(left)), shown, want, remedy)
        order += [left.pop(i) for i in ready]
    return tuple(order)
